//! Random draws of aircraft from a distribution (a file such as `params/any/aircraft.toml`). Mass and dimensions are drawn from
//! ranges. Coefficients are textbook estimates times random factors.

use rand_distr::{Distribution, StandardNormal, Uniform};

use super::character::Cruise;
use super::{Population, Range};
use crate::GreyBox;
use crate::textbook::{Drives, Estimate, Measures, Section, Tail};
use greylag_num::stream::{Stream, stream};
use greylag_physics::atmosphere::{SEA_LEVEL_DENSITY, STANDARD_GRAVITY};

/// Number that separates the random stream of these draws from others with the same seed.
const AIRCRAFT: u64 = 49;
/// Largest number of attempts at one aircraft, after which the draw fails.
const TRIES: u64 = 200;
/// The logarithms of log-normal factors are limited to this many standard deviations.
const CUT: f64 = 2.5;
/// Lift coefficient at the cruise airspeed, which the textbook estimates take as 1.6 times the stall airspeed: the largest lift
/// coefficient, 1.2, divided by 1.6².
const CRUISE_LIFT: f64 = 0.47;
/// Ratio of the rolling moment due to the rudder command of a V-tail to that of a rudder on a fin.
const V_TAIL_ROLL: f64 = 4.0;
const SOURCE: &str = "drawn";

/// Layout of a drawn aircraft's tail and surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// A tailplane and a fin with a rudder.
    Conventional,
    /// A V-tail, whose two surfaces act as elevator and rudder.
    VTail,
    /// A tailplane and a fin without a rudder.
    WithoutRudder,
    /// A tailless wing with elevons.
    Elevons,
}

impl Layout {
    /// Name of the layout in tables.
    pub fn name(self) -> &'static str {
        match self {
            Layout::Conventional => "conventional",
            Layout::VTail => "V-tail",
            Layout::WithoutRudder => "no rudder",
            Layout::Elevons => "elevons",
        }
    }
}

/// A drawn aircraft.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Index among the draws of its seed.
    pub number: u64,
    /// Layout of the surfaces.
    pub layout: Layout,
    /// Static margin as a fraction of the chord.
    pub static_margin: f64,
    /// Time delay of the surfaces in addition to the servos' lag, s.
    pub delay_s: f64,
    /// Mass, dimensions and propulsion of the aircraft, as a user could state them.
    pub measures: Measures,
    /// The model of the aircraft as drawn.
    pub exact: GreyBox,
    /// The model that textbook methods estimate from `measures`.
    pub textbook: GreyBox,
    /// Texts of the airframe file and the model file of `exact`, in this order.
    pub files: [String; 2],
}

/// Reason why no aircraft could be drawn.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// The drawn values do not form a valid model.
    #[error("a drawn aircraft is no model: {0}; correct the distribution")]
    Model(String),
    /// No drawn aircraft meets the conditions in the section `[flyable]` of the distribution's file.
    #[error(
        "of {} aircraft drawn none meets [flyable]; widen the distribution or its conditions",
        TRIES
    )]
    NoneFlies,
}

fn uniform(rng: &mut Stream, [least, most]: Range) -> f64 {
    // no error is possible here: the reader of the file has checked that the ends are finite and in order
    Uniform::new_inclusive(least, most).map_or(least, |between| between.sample(rng))
}

fn log_uniform(rng: &mut Stream, range: Range) -> f64 {
    uniform(rng, range.map(f64::ln)).exp()
}

fn log_normal(rng: &mut Stream, width: f64) -> f64 {
    let normal: f64 = StandardNormal.sample(rng);
    (width * normal.clamp(-CUT, CUT)).exp()
}

impl Population {
    /// Draws the aircraft with index `number` of `seed`. The result does not depend on other draws.
    ///
    /// # Errors
    /// If no drawn aircraft is a valid model that meets the conditions of `[flyable]`.
    pub fn draw(&self, seed: u64, number: u64) -> Result<Drawn, DrawError> {
        let mut why = DrawError::NoneFlies;
        for attempt in 0..TRIES {
            let mut rng = stream(seed, &[AIRCRAFT, number, attempt]);
            match self.one(&mut rng, seed, number) {
                Ok(drawn) if self.flies(&drawn.exact) => return Ok(drawn),
                Ok(_) => {}
                // for example, a coefficient lies outside the physical bounds of its effect
                Err(error) => why = error,
            }
        }
        Err(why)
    }

    /// Whether `model` meets the conditions of `[flyable]`.
    fn flies(&self, model: &GreyBox) -> bool {
        let limits = &self.flyable;
        let Ok(cruise) = Cruise::of(model) else { return false };
        let ([growth, frequency], controls) = (cruise.short_period(), &cruise.trim.controls);
        let elevator = model.airframe.actuators.elevator.travel.part(controls.elevator);
        (0.0..=limits.throttle_most).contains(&controls.throttle)
            && cruise.excess >= limits.climb_least * STANDARD_GRAVITY
            && elevator.abs() <= limits.elevator_most
            && growth <= std::f64::consts::LN_2 / limits.doubling_s
            && frequency.max(cruise.roll_damping()) <= limits.fastest_radps
    }

    fn layout(&self, rng: &mut Stream) -> Layout {
        let mut left = uniform(rng, [0.0, self.whole()]);
        for (layout, share) in self.shares() {
            left -= share;
            if left <= 0.0 {
                return layout;
            }
        }
        Layout::Conventional
    }

    fn measures(&self, rng: &mut Stream, layout: Layout, name: String) -> Measures {
        let tailless = layout == Layout::Elevons;
        let aspects =
            if tailless { self.size.aspect_ratio_tailless } else { self.size.aspect_ratio };
        let mass = log_uniform(rng, self.size.mass_kg);
        let weight = mass * STANDARD_GRAVITY;
        let loading = 47.0 * weight.cbrt() * log_uniform(rng, self.size.loading_ratio);
        let area = weight / loading;
        let cruise = (2.0 * loading / (SEA_LEVEL_DENSITY * CRUISE_LIFT)).sqrt();
        let travel = uniform(rng, self.controls.travel_deg).to_radians();
        Measures {
            name,
            mass,
            span: (log_uniform(rng, aspects) * area).sqrt(),
            area,
            tail: if tailless { Tail::FlyingWing } else { Tail::Conventional },
            rudder: matches!(layout, Layout::Conventional | Layout::VTail).then_some(travel),
            travel,
            static_thrust: weight * log_uniform(rng, self.propulsion.thrust_weight),
            pitch_speed: cruise * uniform(rng, self.propulsion.pitch_speed_ratio),
        }
    }

    fn one(&self, rng: &mut Stream, seed: u64, number: u64) -> Result<Drawn, DrawError> {
        let layout = self.layout(rng);
        let measures = self.measures(rng, layout, format!("drawn {seed}-{number}"));
        let tailless = layout == Layout::Elevons;
        let margins =
            if tailless { self.balance.static_margin_tailless } else { self.balance.static_margin };
        let static_margin = uniform(rng, margins);
        let delay_s = uniform(rng, self.controls.delay_s).max(0.0);
        let mut sections = self.sections(rng, &measures);
        self.balanced(rng, &measures, &mut sections, static_margin);
        if layout == Layout::VTail {
            change(&mut sections, "rudder_linear", "Cldr", |value| V_TAIL_ROLL * value);
        }
        sections.push(("time_delay", vec![("delay_s", delay_s, 0.0, SOURCE)]));
        let drives = Drives {
            frequency: log_uniform(rng, self.controls.servo_radps),
            damping: uniform(rng, self.controls.servo_damping),
            lag: log_uniform(rng, self.propulsion.lag_s),
            source: SOURCE,
        };
        let inertia = self.inertia(rng, &measures);
        let description = "An aircraft that was drawn: textbook estimates times random factors.";
        let model = measures.model_with(&inertia, &sections, description);
        let airframe = deeper(&measures.airframe_with_drives(&drives));
        let read = |model: &str, airframe: &str| {
            GreyBox::from_texts(model, airframe).map_err(DrawError::Model)
        };
        let exact = read(&model, &airframe)?;
        let textbook = read(&measures.model(), &deeper(&measures.airframe()))?;
        let files = [airframe, model];
        Ok(Drawn { number, layout, static_margin, delay_s, measures, exact, textbook, files })
    }

    /// The textbook estimates of the coefficients, each multiplied by a positive random factor.
    fn sections(&self, rng: &mut Stream, measures: &Measures) -> Vec<Section> {
        let mut sections = measures.sections();
        for (_, value, width, source) in sections.iter_mut().flat_map(|(_, all)| all.iter_mut()) {
            *value *= log_normal(rng, width.min(self.shape.width_most));
            (*width, *source) = (0.0, SOURCE);
        }
        sections
    }

    /// Sets the coefficients that determine the trim: Cmα for the static margin `margin`, Cm0 for a random elevator deflection in
    /// cruise, and random Cl0 and Cn0 for the asymmetry in roll and yaw.
    fn balanced(
        &self,
        rng: &mut Stream,
        measures: &Measures,
        sections: &mut [Section],
        margin: f64,
    ) {
        let [_, incidence] = measures.cruise();
        let offset = uniform(rng, self.balance.elevator_offset_rad);
        let crooked = [0, 1].map(|_| uniform(rng, self.shape.crooked));
        let slope = value(sections, "lift_linear", "CLalpha");
        let elevator = value(sections, "pitch_linear", "Cmde");
        change(sections, "pitch_linear", "Cmalpha", |_| -margin * slope);
        change(sections, "pitch_linear", "Cm0", |_| margin * slope * incidence - elevator * offset);
        change(sections, "roll_linear", "Cl0", |_| crooked[0]);
        change(sections, "yaw_linear", "Cn0", |_| crooked[1]);
    }

    /// Random moments of inertia and product of inertia, kg m². Jz is less than Jx + Jy, as for every rigid body.
    fn inertia(&self, rng: &mut Stream, measures: &Measures) -> [Estimate; 4] {
        let [(_, jx, ..), (_, jy, ..), (_, jz, ..), _] = measures.inertia();
        let width = self.shape.inertia_width;
        let (x, y) = (jx * log_normal(rng, width), jy * log_normal(rng, width));
        let flat = (jz / (jx + jy) * log_normal(rng, 0.05)).min(0.999);
        let product = 0.1 * uniform(rng, [-1.0, 1.0]) * (x * y).sqrt();
        [
            ("jx_kgm2", x, 0.0, SOURCE),
            ("jy_kgm2", y, 0.0, SOURCE),
            ("jz_kgm2", flat * (x + y), 0.0, SOURCE),
            ("jxz_kgm2", product, 0.0, SOURCE),
        ]
    }
}

/// Changes the smallest pitch angle in the text of an airframe file from −10° to −20°. The limit of −10° is meant for a first
/// flight. Drawn aircraft fly in simulations only.
fn deeper(airframe: &str) -> String {
    airframe.replace("pitch_min_deg = -10.0", "pitch_min_deg = -20.0")
}

fn value(sections: &[Section], effect: &str, name: &str) -> f64 {
    let all = sections.iter().filter(|(id, _)| *id == effect).flat_map(|(_, all)| all);
    all.filter(|e| e.0 == name).map(|e| e.1).sum()
}

fn change(sections: &mut [Section], effect: &str, name: &str, new: impl Fn(f64) -> f64) {
    let all = sections.iter_mut().filter(|(id, _)| *id == effect).flat_map(|(_, all)| all);
    for estimate in all.filter(|e| e.0 == name) {
        (estimate.1, estimate.3) = (new(estimate.1), SOURCE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn shipped() -> Population {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/any/aircraft.toml");
        Population::load(&path).unwrap()
    }

    #[test]
    fn a_draw_is_the_same_whatever_else_is_drawn_and_its_files_are_its_model() {
        let population = shipped();
        let (one, again) = (population.draw(3, 5).unwrap(), population.draw(3, 5).unwrap());
        assert_eq!(one.files, again.files);
        assert_ne!(one.files, population.draw(3, 6).unwrap().files);
        assert_ne!(one.files, population.draw(4, 5).unwrap().files);
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in ["airframe.toml", "model.toml"].iter().zip(&one.files) {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let read = GreyBox::load(&folder.path().join("model.toml")).unwrap();
        assert_eq!(read.coefficients(), one.exact.coefficients());
        assert_eq!(read.body, one.exact.body);
    }

    #[test]
    fn draws_keep_to_the_file_and_are_bodies_that_fly() {
        let population = shipped();
        let drawn: Vec<Drawn> = (0..60).map(|k| population.draw(1, k).unwrap()).collect();
        for d in &drawn {
            let body = &d.exact.body;
            // the tolerance covers the rounding to five decimals in the file
            assert!(body.jz <= body.jx + body.jy + 2e-5 && body.is_physical(), "{body:?}");
            assert!((-0.05..=0.3).contains(&d.static_margin));
            assert!(population.flies(&d.exact));
            assert_eq!(d.exact.has_rudder(), d.measures.rudder.is_some());
            // Cmα gives the static margin, up to the rounding to five decimals in the file
            let of =
                |name: &str| d.exact.coefficients().iter().find(|c| c.name == name).unwrap().value;
            let margin = -of("pitch_linear.Cmalpha") / of("lift_linear.CLalpha");
            assert!((margin - d.static_margin).abs() < 1e-4);
        }
        for layout in [Layout::Conventional, Layout::VTail, Layout::WithoutRudder, Layout::Elevons]
        {
            assert!(drawn.iter().any(|d| d.layout == layout), "{layout:?}");
        }
        assert!(drawn.iter().any(|d| d.static_margin < 0.0));
    }

    #[test]
    fn a_range_the_wrong_way_round_is_named() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/any/aircraft.toml");
        let text = std::fs::read_to_string(path).unwrap();
        let wrong = text.replace("mass_kg = [0.1, 1200.0]", "mass_kg = [9.0, 1.0]");
        assert!(Population::parse(&wrong).unwrap_err().contains("size.mass_kg"));
    }
}
