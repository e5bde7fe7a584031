//! Textbook model of an aircraft, estimated from its mass, dimensions and thrust. Each estimate has a standard deviation.
//!
//! Sources are B. Etkin, L. D. Reid, "Dynamics of Flight", 3rd ed., 1996; J. Roskam, "Airplane Design" part V, 1985 (radii
//! of gyration); \[BM12\], R. W. Beard, T. W. McLain, "Small Unmanned Aircraft", 2012. The factors for roll are taken from
//! published models of the Skywalker X8 and the Aerosonde, the factors for the elevons of a flying wing from the X8.

mod derivatives;

use std::fmt::Write;

use crate::derivatives::widths::{self, Tool};
use derivatives::{induced, rudder};
use greylag_physics::atmosphere::{SEA_LEVEL_DENSITY, STANDARD_GRAVITY};

/// Arrangement of an aircraft's tail and control surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tail {
    /// Conventional tail: a tailplane and a fin.
    Conventional,
    /// Flying wing with elevons.
    FlyingWing,
}

/// Mass, dimensions and thrust of an aircraft, from which a model is estimated.
#[derive(Clone, Debug, PartialEq)]
pub struct Measures {
    /// Name of the aircraft.
    pub name: String,
    /// Total mass of the aircraft, kg.
    pub mass: f64,
    /// Span of the wing, m.
    pub span: f64,
    /// Area of the wing, m².
    pub area: f64,
    /// Arrangement of the tail and control surfaces.
    pub tail: Tail,
    /// Rudder travel to each side, rad. `None` if the aircraft has no rudder.
    pub rudder: Option<f64>,
    /// Travel of aileron and elevator to each side, rad.
    pub travel: f64,
    /// Static thrust at full throttle, N.
    pub static_thrust: f64,
    /// Airspeed at which full throttle gives no thrust (pitch speed), m/s.
    pub pitch_speed: f64,
}

/// Dynamics of the servos and the motor of an aircraft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drives {
    /// Natural frequency of the servos, rad/s.
    pub frequency: f64,
    /// Damping ratio of the servos.
    pub damping: f64,
    /// Time constant of the thrust's lag, s.
    pub lag: f64,
    /// Source of these values.
    pub source: &'static str,
}

impl Drives {
    /// Values for hobby servos and an electric motor.
    pub const HOBBY: Drives = Drives {
        frequency: 40.0,
        damping: 0.7,
        lag: 0.2,
        source: "estimate: hobby servo, electric motor",
    };
}

/// An estimated number: name, value (in the unit of its name), relative standard deviation, source.
pub type Estimate = (&'static str, f64, f64, &'static str);

/// The id of an effect in a model file, with the estimates of the effect's coefficients.
pub(crate) type Section = (&'static str, Vec<Estimate>);

/// Largest lift coefficient of a small wing.
const LIFT_MAX: f64 = 1.2;

/// Quantities derived from the measures, in SI units: aspect ratio, mean chord, stall and cruise airspeed, and lift.
struct Figures {
    aspect: f64,
    chord: f64,
    stall: f64,
    cruise: f64,
    /// Lift slope of the wing alone, 1/rad.
    wing: f64,
    /// Lift coefficient at the cruise airspeed.
    lift: f64,
}

/// Text of the section `[incidence]` of an airframe file, from the angles of attack (rad) at cruise and at the stall.
pub fn incidence_limits(cruise: f64, stall: f64) -> String {
    let up_to = |share: f64| (cruise + share * (stall - cruise)).max(0.01);
    format!(
        "# Cruise is flown at {cruise:.3} rad; the wing stalls at {stall:.3} rad.\n[incidence]\ncomfortable_rad = \
         {:.3}\ntolerable_rad = {:.3}\npush_from_rad = {:.3}\npush_gain = 3.0\n\
         stall_rad = {stall:.3}\n\n",
        up_to(0.2),
        up_to(0.5),
        up_to(0.8)
    )
}

/// Lift slope (1/rad) of a straight wing with aspect ratio `aspect`, by Helmbold's formula.
fn helmbold(aspect: f64) -> f64 {
    std::f64::consts::TAU * aspect / (2.0 + (4.0 + aspect * aspect).sqrt())
}

impl Measures {
    fn figures(&self) -> Figures {
        let aspect = self.span * self.span / self.area;
        let weight = self.mass * STANDARD_GRAVITY;
        let loading = 2.0 * weight / (SEA_LEVEL_DENSITY * self.area);
        let stall = (loading / LIFT_MAX).sqrt();
        let cruise = 1.6 * stall;
        let (chord, wing) = (self.area / self.span, helmbold(aspect));
        Figures { aspect, chord, stall, cruise, wing, lift: loading / (cruise * cruise) }
    }

    /// Text of the airframe file for these measures.
    pub fn airframe(&self) -> String {
        let f = self.figures();
        self.airframe_with_chord(f.chord, [self.slope(&f), self.zero_lift()])
    }

    /// Text of the airframe file with the servos and motor of `drives`.
    pub(crate) fn airframe_with_drives(&self, drives: &Drives) -> String {
        let f = self.figures();
        self.airframe_of(f.chord, [self.slope(&f), self.zero_lift()], drives)
    }

    /// Cruise airspeed (m/s) and angle of attack at cruise (rad).
    pub(crate) fn cruise(&self) -> [f64; 2] {
        let f = self.figures();
        [f.cruise, (f.lift - self.zero_lift()) / self.slope(&f)]
    }

    /// Text of the airframe file with values from another source: the mean chord (m), and in `lift` the lift slope (1/rad) and
    /// the lift coefficient at α = 0.
    pub(crate) fn airframe_with_chord(&self, chord: f64, lift: [f64; 2]) -> String {
        self.airframe_of(chord, lift, &Drives::HOBBY)
    }

    fn airframe_of(&self, chord: f64, [slope, zero_lift]: [f64; 2], drives: &Drives) -> String {
        let f = self.figures();
        let Drives { frequency, damping, lag, source } = *drives;
        let mut out = format!(
            "# Written by `greylag aircraft`: measure what is marked as an estimate.\nschema = 2\nname = {}\n\n\
             [geometry]\nwing_area_m2 = {{ value = {:?}, source = \"given\" }}\nspan_m = {{ value = {:?}, source = \
             \"given\" }}\nmean_chord_m = {{ value = {:.5}, source = \"area over span\" }}\n\n[reference]\n\
             airspeed_mps = {{ value = {:.2}, source = \"cruise\" }}\naltitude_m = {{ value = 100.0, source = \
             \"estimate\" }}\n\n",
            quoted(&self.name),
            self.area,
            self.span,
            chord,
            f.cruise
        );
        let surfaces = [
            ("aileron", Some(self.travel)),
            ("elevator", Some(self.travel)),
            ("rudder", self.rudder),
        ];
        for (name, travel) in surfaces {
            if let Some(travel) = travel {
                let _ = write!(
                    out,
                    "[controls.{name}]\nfrequency_radps = {{ value = {frequency:?}, source = \"{source}\" }}\n\
                     damping = {{ value = {damping:?}, source = \"{source}\" }}\ntravel_rad = {{ value = {travel:.5}, \
                     source = \"given\" }}\n\n"
                );
            }
        }
        let incidence = |lift: f64| (lift - zero_lift) / slope;
        let limits = incidence_limits(incidence(f.lift), incidence(LIFT_MAX));
        let _ = write!(
            out,
            "[controls.throttle]\nlag_s = {{ value = {lag:?}, source = \"{source}\" }}\n\n{limits}\
             # The stall at a lift coefficient of {LIFT_MAX} is at {:.1} m/s.\n[envelope]\nbank_max_deg = 45.0\n\
             pitch_max_deg = 20.0\npitch_min_deg = -10.0\nload_factor_max = 2.0\nairspeed_min_mps = {:.1}\n\
             airspeed_max_mps = {:.1}\nairspeed_cruise_mps = {:.1}\nsurface_slew_per_s = 20.0\n",
            f.stall,
            1.25 * f.stall,
            2.2 * f.stall,
            f.cruise
        );
        out
    }

    /// Text of the model file, which belongs in the folder of the airframe file `airframe.toml`.
    pub fn model(&self) -> String {
        self.model_of(&self.sections(), "Textbook estimates from mass, span, area and tail.")
    }

    /// Text of a model file with the effects `sections`, and with mass and inertia from these measures.
    pub(crate) fn model_of(&self, sections: &[Section], description: &str) -> String {
        self.model_with(&self.inertia(), sections, description)
    }

    /// The same as `model_of`, with the moments of inertia `inertia`.
    pub(crate) fn model_with(
        &self,
        inertia: &[Estimate; 4],
        sections: &[Section],
        description: &str,
    ) -> String {
        let mut out = format!(
            "# Written by `greylag aircraft`: fly, then `greylag amend --tune-only`.\nschema = 1\nname = {}\n\
             description = {description:?}\nairframe = \"airframe.toml\"\n\
             integrator = \"rk4\"\nforce_axes = \"wind\"\n\n[rigid_body]\n",
            quoted(&format!("{}-prior", self.name))
        );
        let given: [Estimate; 1] = [("mass_kg", self.mass, 0.01, "given")];
        numbers(&mut out, &given);
        numbers(&mut out, inertia);
        let _ = write!(
            out,
            "\n[air]\ngravity_mps2 = {{ value = 9.806, source = \"middle latitudes\" }}\ndensity = \"standard\"\n"
        );
        for (effect, estimates) in sections {
            let _ = write!(out, "\n[effects.{effect}]\n");
            numbers(&mut out, estimates);
        }
        out
    }

    /// Coefficients of α and α² in the induced drag, for a wing with the lift slope `slope` (1/rad) and the lift coefficient
    /// `zero_lift` at α = 0.
    pub(crate) fn induced_by(&self, slope: f64, zero_lift: f64) -> [f64; 2] {
        let k = 1.0 / induced(&self.figures());
        [2.0 * k * zero_lift * slope, k * slope * slope]
    }

    /// The effects of the model with their estimates.
    pub(crate) fn sections(&self) -> Vec<Section> {
        let f = self.figures();
        let mut effects = vec![
            ("lift_linear", self.lift(&f)),
            ("drag_linear", self.drag(&f)),
            ("drag_alpha2", vec![self.induced_drag(&f)]),
            ("side_force_linear", self.side(&f)),
            ("roll_linear", self.roll(&f)),
            ("pitch_linear", self.pitch(&f)),
            ("yaw_linear", self.yaw(&f)),
            ("propeller", self.thrust()),
        ];
        if self.rudder.is_some() {
            effects.push(("rudder_linear", rudder()));
        }
        // a standard deviation that was measured on known aircraft replaces the stated one
        for (name, _, width, _) in effects.iter_mut().flat_map(|(_, all)| all.iter_mut()) {
            *width = widths::of(Tool::Textbook, name).unwrap_or(*width);
        }
        effects
    }

    /// Moments of inertia, kg m². The radius of gyration about x is a fraction of half the span, about y of half the length,
    /// and about z of half the mean of span and length.
    pub(crate) fn inertia(&self) -> [Estimate; 4] {
        let length =
            if self.tail == Tail::Conventional { 0.7 * self.span } else { 0.35 * self.span };
        let about = |share: f64, reach: f64| self.mass * (share * reach / 2.0).powi(2);
        let source = "radius of gyration of light aircraft, Roskam part V";
        [
            ("jx_kgm2", about(0.22, self.span), 0.4, source),
            ("jy_kgm2", about(0.34, length), 0.4, source),
            ("jz_kgm2", about(0.38, 0.5 * (self.span + length)), 0.4, source),
            ("jxz_kgm2", 0.0, 0.0, "estimate: axes are principal ones"),
        ]
    }
}

/// The text as a TOML string. TOML lacks some of Rust's escape sequences.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// Names of the moments of inertia in a model file.
const MOMENTS: [&str; 3] = ["jx_kgm2", "jy_kgm2", "jz_kgm2"];

/// Appends the estimates to `out` as lines of a model file. A standard deviation of zero is omitted.
pub fn numbers(out: &mut String, estimates: &[Estimate]) {
    for (name, value, width, source) in estimates {
        // five decimals are too few for the moments of inertia of an aircraft of a few grams
        let tiny = MOMENTS.contains(name) && 0.0 < *value && *value < 1e-5;
        let number = if tiny { format!("{value:.4e}") } else { format!("{value:.5}") };
        let _ = write!(out, "{name} = {{ value = {number}, source = \"{source}\"");
        let sd = width * value.abs();
        // a value that rounds to zero gets no standard deviation, so that a fit keeps it fixed
        if sd > 0.0 && (tiny || value.abs() >= 5e-6) {
            let _ = write!(out, ", sd = {sd:.3e}");
        }
        out.push_str(" }\n");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GreyBox;

    fn measures(tail: Tail, rudder: Option<f64>) -> Measures {
        Measures {
            name: "Own".into(),
            mass: 11.0,
            span: 2.9,
            area: 0.55,
            tail,
            rudder,
            travel: 0.4363,
            static_thrust: 60.0,
            pitch_speed: 50.0,
        }
    }

    fn made(tail: Tail, rudder: Option<f64>) -> GreyBox {
        let measures = measures(tail, rudder);
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("airframe.toml"), measures.airframe()).unwrap();
        std::fs::write(folder.path().join("model.toml"), measures.model()).unwrap();
        GreyBox::load(&folder.path().join("model.toml")).unwrap()
    }

    #[test]
    fn an_aerosondes_measures_give_its_published_coefficients_within_their_widths() {
        let model = made(Tail::Conventional, Some(0.4363));
        let published = [
            ("lift_linear.CLalpha", 5.61),
            ("pitch_linear.Cmde", -0.99),
            ("roll_linear.Clp", -0.51),
            ("roll_linear.Clda", 0.17),
            ("yaw_linear.Cnbeta", 0.073),
            ("yaw_linear.Cnr", -0.095),
            ("rudder_linear.CYdr", 0.19),
            ("rudder_linear.Cndr", -0.069),
        ];
        for (name, value) in published {
            let ours = model.coefficients().iter().find(|c| c.name == name).unwrap();
            // a realistic standard deviation implies an error below two standard deviations
            assert!((ours.value - value).abs() < 2.0 * ours.width(), "{ours:?} for {value}");
        }
    }

    #[test]
    fn level_flight_takes_a_throttle_within_its_stops() {
        // the propeller brakes at low throttle, and the throttle of level flight has a second, negative solution
        let model = made(Tail::Conventional, Some(0.4363));
        let speed = model.airframe.reference.airspeed;
        let trim = crate::Trim::level(&model, speed, 0.0).unwrap();
        assert!((0.1..1.0).contains(&trim.controls.throttle), "{trim:?}");
    }

    #[test]
    fn both_kinds_of_tail_make_files_that_load() {
        assert!(made(Tail::Conventional, Some(0.4)).has_rudder());
        assert!(!made(Tail::FlyingWing, None).has_rudder());
    }

    /// A combining accent and a quotation mark, as a folder's name may have them.
    #[test]
    fn any_name_stands_in_the_files() {
        let name = "Pe\u{301}lican \"2\"";
        let own = Measures { name: name.into(), ..measures(Tail::FlyingWing, None) };
        let model = GreyBox::from_texts(&own.model(), &own.airframe()).unwrap();
        assert_eq!(model.airframe.name, name);
        assert_eq!(model.name, format!("{name}-prior"));
    }

    #[test]
    fn the_files_of_an_aircraft_of_ten_grams_load() {
        let tiny = Measures {
            mass: 0.01,
            span: 0.15,
            area: 0.0045,
            static_thrust: 0.05,
            pitch_speed: 15.0,
            ..measures(Tail::Conventional, Some(0.4))
        };
        let model = GreyBox::from_texts(&tiny.model(), &tiny.airframe()).unwrap();
        let [(_, jx, ..), ..] = tiny.inertia();
        assert!(jx < 1e-5 && (model.body.jx / jx - 1.0).abs() < 1e-3, "{:?} {jx}", model.body);
    }

    #[test]
    fn the_coefficients_of_a_flying_wing_do_not_come_from_a_tail() {
        let of_tail = ["tailplane", "tail volume", "fin volume", "Etkin and Reid 5.4"];
        let sources = |tail: Tail| -> Vec<&'static str> {
            let sections = measures(tail, None).sections();
            sections.iter().flat_map(|(_, all)| all.iter().map(|estimate| estimate.3)).collect()
        };
        let named = |source: &&'static str| of_tail.iter().any(|words| source.contains(words));
        let wing: Vec<_> = sources(Tail::FlyingWing).into_iter().filter(named).collect();
        assert_eq!(wing, [""; 0]);
        // These are CLalpha, CLq, CLde, CYbeta, Cmq, Cmde, Cnbeta and Cnr.
        let tail = sources(Tail::Conventional).into_iter().filter(named).count();
        assert_eq!(tail, 8);
    }
}
