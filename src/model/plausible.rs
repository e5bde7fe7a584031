//! Plausibility checks of an aircraft's mass, dimensions and propulsion. They detect wrong units.
//!
//! From insects to airliners, the wing loading (N/m²) is near 47 times the cube root of the weight (N), within a factor of a
//! few: H. Tennekes, "The Simple Science of Flight", 2nd ed., 2009.

use greylag_physics::atmosphere::{SEA_LEVEL_DENSITY, STANDARD_GRAVITY};

/// Factor of Tennekes' line, N^(2/3)/m².
const LINE: f64 = 47.0;
/// Plausible wing loadings relative to Tennekes' line. A human-powered aircraft has 0.07, a supersonic fighter 2.4.
const LOADING: [f64; 2] = [0.04, 6.0];
/// Plausible aspect ratios of straight wings.
const ASPECT: [f64; 2] = [2.0, 40.0];
/// Plausible Reynolds numbers of the mean chord, for which textbook formulas of subsonic wings are valid.
const REYNOLDS: [f64; 2] = [1.5e4, 2e8];
/// Kinematic viscosity of air at sea level, m²/s.
const VISCOSITY: f64 = 1.46e-5;
/// Plausible ratios of static thrust to weight.
const THRUST: [f64; 2] = [0.03, 4.0];
/// Plausible ratios of the propeller's pitch speed to the airspeed of level flight at a lift coefficient of 0.6.
const PITCH_SPEED: [f64; 2] = [1.0, 12.0];
/// Plausible products of static thrust and pitch speed per mass, W/kg.
const POWER: [f64; 2] = [5.0, 5000.0];

/// Units that are often confused with kg, m and m²: the unit, the index of mass, span or area, and the factor to the right
/// unit.
const SLIPS: [(&str, usize, f64); 8] = [
    ("g", 0, 1e-3),
    ("t", 0, 1e3),
    ("cm", 1, 1e-2),
    ("mm", 1, 1e-3),
    ("dm²", 2, 1e-2),
    ("cm²", 2, 1e-4),
    ("mm²", 2, 1e-6),
    ("ft²", 2, 0.0929),
];
/// Command-line options for mass, span and area, with their units.
const OPTIONS: [(&str, &str); 3] = [("--mass-kg", "kg"), ("--span-m", "m"), ("--area-m2", "m²")];

/// Mass, span and wing area of an aircraft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Total mass, kg.
    pub mass: f64,
    /// Wing span, m.
    pub span: f64,
    /// Area of the wing, m².
    pub area: f64,
}

impl Size {
    /// Weight at standard gravity, N.
    fn weight(self) -> f64 {
        self.mass * STANDARD_GRAVITY
    }

    /// Airspeed of level flight at a lift coefficient of 0.6 at sea level, m/s.
    pub fn level_mps(self) -> f64 {
        (2.0 * self.weight() / (SEA_LEVEL_DENSITY * self.area * 0.6)).sqrt()
    }

    /// Reason why mass, span and area are implausible, with the value that was probably meant. `None` if they are plausible.
    pub fn doubt(self) -> Option<String> {
        let what = self.odd()?;
        let value = |place: usize, size: Size| [size.mass, size.span, size.area][place];
        let slip = |(unit, place, factor): (&str, usize, f64)| {
            let mut meant = self;
            *[&mut meant.mass, &mut meant.span, &mut meant.area][place] *= factor;
            meant.odd().is_none().then(|| {
                let (option, is) = OPTIONS[place];
                format!(
                    "did you mean {option} {} ({} {unit} are {} {is})?",
                    short(value(place, meant)),
                    short(value(place, self)),
                    short(value(place, meant))
                )
            })
        };
        let meant = SLIPS.into_iter().find_map(slip);
        let check = || "check --mass-kg, --span-m and --area-m2".into();
        Some(format!("{what}: {}", meant.unwrap_or_else(check)))
    }

    /// The property that is implausible for this mass, span and area, in words. `None` if all are plausible.
    fn odd(self) -> Option<String> {
        let aspect = self.span * self.span / self.area;
        let loading = self.weight() / self.area / (LINE * self.weight().cbrt());
        let reynolds = self.level_mps() * self.area / self.span / VISCOSITY;
        if outside(aspect, ASPECT) {
            return Some(format!(
                "the aspect ratio span²/area is {}, that of aircraft with a straight wing 2 to 40",
                short(aspect)
            ));
        }
        if outside(loading, LOADING) {
            return Some(format!(
                "the wing loading is {} kg/m², {} times what aircraft of that mass have",
                short(self.mass / self.area),
                short(loading)
            ));
        }
        outside(reynolds, REYNOLDS).then(|| {
            format!(
                "the wing's Reynolds number is {reynolds:.0e}, out of reach of textbook formulas"
            )
        })
    }

    /// Reason why a propulsion with this static thrust (N) and pitch speed (m/s) is implausible for the aircraft. `None` if it
    /// is plausible.
    pub fn doubt_of_thrust(self, thrust: f64, pitch_speed: f64) -> Option<String> {
        let share = thrust / self.weight();
        let speed = pitch_speed / self.level_mps();
        let power = thrust * pitch_speed / self.mass;
        if outside(share, THRUST) {
            return Some(format!(
                "--static-thrust-n {} is {} of the weight, that of aircraft 0.03 to 4: newtons are wanted (1 kg of thrust is 9.81 N)",
                short(thrust),
                short(share)
            ));
        }
        if outside(speed, PITCH_SPEED) {
            return Some(format!(
                "--pitch-speed-mps {} is {} of the airspeed of level flight ({} m/s), that of propellers 1 to 12: check its unit",
                short(pitch_speed),
                short(speed),
                short(self.level_mps())
            ));
        }
        outside(power, POWER).then(|| {
            format!(
                "the power loading is {} W/kg, that of aircraft 5 to 5000: check --static-thrust-n and --pitch-speed-mps",
                short(power)
            )
        })
    }
}

fn outside(x: f64, [least, most]: [f64; 2]) -> bool {
    !(least..=most).contains(&x)
}

/// The number as text with three significant figures, without trailing zeros.
fn short(x: f64) -> String {
    let places = (2 - x.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{x:.places$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aircraft_from_foam_glider_to_airliner_are_plausible() {
        // mass, span and area of a foam glider, the X8, a Cessna 172, Daedalus, a sailplane, a B747 and an F-104
        for [mass, span, area] in [
            [0.25, 1.0, 0.15],
            [3.364, 2.1, 0.75],
            [1043.0, 11.0, 16.2],
            [104.0, 34.0, 30.8],
            [500.0, 18.0, 10.5],
            [333_400.0, 64.4, 541.0],
            [9365.0, 6.36, 18.2],
        ] {
            assert_eq!(Size { mass, span, area }.doubt(), None, "{mass} kg");
        }
    }

    #[test]
    fn a_unit_that_slipped_is_named_with_what_was_meant() {
        let said = |mass, span, area| Size { mass, span, area }.doubt().unwrap();
        assert!(said(2100.0, 1.6, 0.3).contains("7000 kg/m²"));
        assert!(
            said(2100.0, 1.6, 0.3).ends_with("did you mean --mass-kg 2.1 (2100 g are 2.1 kg)?")
        );
        assert!(said(2.1, 1.6, 32.0).contains("--area-m2 0.32 "));
        assert!(said(2.1, 160.0, 0.32).contains("--span-m 1.6 "));
        assert!(said(2.1, 1600.0, 0.32).contains("--span-m 1.6 "));
        assert!(said(0.0021, 1.6, 0.32).contains("--mass-kg 2.1 "));
    }

    #[test]
    fn a_thrust_in_kilograms_is_named() {
        let size = Size { mass: 2.1, span: 1.6, area: 0.32 };
        assert_eq!(size.doubt_of_thrust(10.0, 25.0), None);
        assert!(size.doubt_of_thrust(0.5, 25.0).unwrap().contains("9.81 N"));
        // a pitch speed in km/h is not detected, because some propellers reach the same number in m/s; ten times this number is
        // detected
        assert!(size.doubt_of_thrust(10.0, 900.0).unwrap().contains("--pitch-speed-mps"));
    }
}
