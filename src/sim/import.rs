//! An aircraft of JSBSim as airframe and model: central differences of its loads.

mod files;
mod fits;

use greylag_sitl::plant::{Inputs, Loads, MassProperties, Plant, PlantError, Start, Stops, Travel};

use crate::model::textbook::Estimate;
use crate::num::least_squares;
use crate::physics::atmosphere::{SEA_LEVEL_DENSITY, STANDARD_GRAVITY};
use crate::physics::catalogue::describe;
use files::{airframe, model_file};
use fits::{ThrustLag, first_order, line, second_order, thrust_lag};

/// Metres per foot.
const FT: f64 = 0.3048;
/// Incidence at which derivatives are taken, rad: 3°.
const ALPHA: f64 = 0.052;
/// Half the interval of angles, rad: 2°.
const ANGLE: f64 = 0.035;
/// A larger sideslip, at which the drag is taken once more, rad: 8°.
const FAR: f64 = 4.0 * ANGLE;
/// Half the interval of dimensionless rates.
const RATE: f64 = 0.005;
/// Half the interval of commands.
const COMMAND: f64 = 0.2;
/// Incidences of the tables, degrees.
const TABLE_DEG: [f64; 24] = [
    -24.0, -20.0, -17.0, -14.0, -12.0, -10.0, -8.0, -6.0, -4.0, -2.0, 0.0, 2.0, 4.0, 6.0, 8.0,
    10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 25.0, 30.0,
];
/// Share of a channel's variation that is worth a word when it is left.
const WORTH_SAYING: f64 = 0.02;
/// Throttle before and after the step that shows the engine's lag.
const THRUST_STEP: [f64; 2] = [0.4, 0.7];
/// Part of that step beyond which it is said that the engine's answer is no first-order lag.
const LAG_WORTH_SAYING: f64 = 0.1;
/// How long the answer to the step is watched, s.
const STEP_S: f64 = 20.0;
/// Mean, amplitude and frequency (rad/s) of the throttle's wave that judges the lag, and how long it lasts, s.
const WAVE: [f64; 3] = [0.5, 0.1, 3.0];
const WAVE_S: f64 = 10.0;
/// Propeller torque that is none, in parts of weight times span.
const NO_MOMENT: f64 = 1e-5;
/// Distance of the thrust from the centre of gravity that is none, in chords.
const NO_ARM: f64 = 1e-3;
/// Newton metres per pound foot.
const LBF_FT: f64 = 1.355_817_948_331_4;

/// What was made of an aircraft.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The airframe file.
    pub airframe: String,
    /// The model file, beside `airframe.toml`.
    pub model: String,
    /// What airframe and model do not hold, one sentence each.
    pub left_out: Vec<String>,
}

impl Imported {
    /// Writes the properties that were held into the airframe file.
    pub fn hold(&mut self, held: &[(String, f64)]) {
        if !held.is_empty() {
            self.airframe.push_str("\n# Held in the simulator: the model is of the aircraft in this condition.\n[conditions]\n");
        }
        for (name, value) in held {
            self.airframe.push_str(&format!("{name:?} = {value:?}\n"));
        }
    }
}

/// Why an aircraft could not be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// It cannot be flown or read.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A surface moves to one side, or against its command.
    #[error(
        "the {surface} of the aircraft goes from {least:.4} to {most:.4} rad for commands from -1 to 1: an \
         airframe needs one that goes from below zero to above; name a position property of that sense with \
         --property"
    )]
    Surface {
        /// Which.
        surface: &'static str,
        /// At the command −1, rad.
        least: f64,
        /// At the command 1, rad.
        most: f64,
    },
    /// The wing makes no lift.
    #[error(
        "the aircraft has no lift at {airspeed:.1} m/s: give the airspeed at which it flies with --cruise-mps"
    )]
    Lift {
        /// Where it was asked, m/s.
        airspeed: f64,
    },
}

/// The aircraft as it is asked.
struct Subject<'a> {
    plant: &'a mut Plant,
    start: Start,
    area: f64,
    span: f64,
    chord: f64,
    mass: MassProperties,
}

/// D, Y, L and l, m, n as coefficients.
type Coefficients = [f64; 6];

/// Imports the aircraft that `plant` flies about `cruise` (m/s) at `altitude` (m), under `name`.
///
/// # Errors
/// [`ImportError`], if it cannot be held in a state, or has a surface that an airframe cannot hold.
pub fn import(
    plant: &mut Plant,
    name: &str,
    cruise: f64,
    altitude: f64,
) -> Result<Imported, ImportError> {
    let travel = plant.travel()?;
    let surfaces = [
        ("aileron", Some(travel.aileron)),
        ("elevator", Some(travel.elevator)),
        ("rudder", travel.rudder),
    ];
    for (surface, stops) in surfaces {
        if let Some(Stops { least_rad, most_rad }) =
            stops.filter(|s| s.least_rad >= 0.0 || s.most_rad <= 0.0)
        {
            return Err(ImportError::Surface { surface, least: least_rad, most: most_rad });
        }
    }
    let mass = plant.mass_properties()?;
    let start = Start { airspeed_mps: cruise, altitude_m: altitude, ..Start::NEUTRAL };
    let area = plant.property("metrics/Sw-sqft")? * FT * FT;
    let span = plant.property("metrics/bw-ft")? * FT;
    let chord = plant.property("metrics/cbarw-ft")? * FT;
    let mut subject = Subject { plant, start, area, span, chord, mass };
    let mut left_out = Vec::new();
    let (polar, lift_max) = subject.polar()?;
    if lift_max <= 0.0 {
        return Err(ImportError::Lift { airspeed: cruise });
    }
    let effects = effects(&polar, &subject.slopes(&travel)?, &mut left_out);
    let propulsion = subject.propulsion(&mut left_out)?;
    let lags = subject.lags(&travel)?;
    Ok(Imported {
        airframe: airframe(&subject, name, &travel, &lags, lift_max, &polar, &propulsion.thrust),
        model: model_file(
            name,
            &subject.mass,
            &polar,
            &effects,
            &propulsion,
            travel.rudder.is_some(),
        ),
        left_out,
    })
}

/// Lift, drag and pitching moment over incidence.
struct Polar {
    alpha: Vec<f64>,
    lift: Vec<f64>,
    drag: Vec<f64>,
    pitch: Vec<f64>,
}

impl Polar {
    /// The first incidence (rad) at which the lift coefficient reaches `lift`, between the table's points.
    fn incidence(&self, lift: f64) -> f64 {
        let reaches = self.lift.windows(2).position(|w| w[0] < lift && lift <= w[1]);
        reaches.map_or(0.0, |k| {
            let share = (lift - self.lift[k]) / (self.lift[k + 1] - self.lift[k]);
            self.alpha[k] + share * (self.alpha[k + 1] - self.alpha[k])
        })
    }
}

/// Slopes of the coefficients by what they depend on, at the incidence [`ALPHA`].
struct Slopes {
    base: Coefficients,
    beta: Coefficients,
    p: Coefficients,
    q: Coefficients,
    r: Coefficients,
    aileron: Coefficients,
    elevator: Coefficients,
    rudder: Option<Coefficients>,
    /// Drag by the size of sideslip and its square, and by the size of the elevator.
    drag_beta: [f64; 2],
    drag_elevator: f64,
}

/// What the engines do.
struct Propulsion {
    /// The polynomial of the settled thrust over throttle and airspeed.
    thrust: Vec<Estimate>,
    /// Time constant of the thrust behind the throttle's position, s.
    lag: Option<f64>,
    /// Rolling moment at full throttle, to the left, N m.
    torque: Option<f64>,
    /// How far below the centre of gravity the thrust acts, m.
    arm: Option<f64>,
}

/// An effect of the model file with its numbers.
type Effect = (&'static str, Vec<Estimate>);

const SOURCE: &str = "central difference of JSBSim's loads";

impl Subject<'_> {
    /// Coefficients in `state`, the surfaces at `inputs`.
    fn at(&mut self, state: &Start, inputs: &Inputs) -> Result<Coefficients, PlantError> {
        let loads = self.plant.loads(state, inputs)?;
        let pressure = 0.5 * loads.truth.air_density_kgpm3 * state.airspeed_mps.powi(2) * self.area;
        Ok(self.coefficients(&loads, pressure))
    }

    fn coefficients(&self, loads: &Loads, pressure: f64) -> Coefficients {
        let Loads { force_n: [x, y, z], moment_nm: [l, m, n], truth } = *loads;
        let ((sa, ca), (sb, cb)) = (truth.alpha_rad.sin_cos(), truth.beta_rad.sin_cos());
        let ahead = x * ca + z * sa;
        let drag = -(ahead * cb + y * sb);
        let side = y * cb - ahead * sb;
        let lift = x * sa - z * ca;
        let moments = [l / self.span, m / self.chord, n / self.span];
        [drag, side, lift, moments[0], moments[1], moments[2]].map(|c| c / pressure)
    }

    /// Lift, drag and pitching moment over incidence, with the largest lift coefficient.
    fn polar(&mut self) -> Result<(Polar, f64), PlantError> {
        let alpha: Vec<f64> = TABLE_DEG.iter().map(|a| a.to_radians()).collect();
        let mut polar = Polar { alpha, lift: vec![], drag: vec![], pitch: vec![] };
        for alpha_rad in polar.alpha.clone() {
            let [drag, _, lift, _, pitch, _] =
                self.at(&Start { alpha_rad, ..self.start }, &Inputs::default())?;
            polar.lift.push(lift);
            polar.drag.push(drag);
            polar.pitch.push(pitch);
        }
        let most = polar.lift.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Ok((polar, most))
    }

    /// Half the difference of the coefficients between two states, by `unit`.
    fn slope(
        &mut self,
        unit: f64,
        mut of: impl FnMut(f64, &mut Start, &mut Inputs),
    ) -> Result<(Coefficients, Coefficients), PlantError> {
        let base = Start { alpha_rad: ALPHA, ..self.start };
        let mut sides = [[0.0; 6]; 2];
        for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
            let (mut state, mut inputs) = (base, Inputs::default());
            of(sign, &mut state, &mut inputs);
            *side = self.at(&state, &inputs)?;
        }
        let [up, down] = sides;
        let odd = std::array::from_fn(|i| (up[i] - down[i]) / (2.0 * unit));
        let even = std::array::from_fn(|i| (up[i] + down[i]) / 2.0);
        Ok((odd, even))
    }

    /// The coefficients' slopes about the reference state.
    fn slopes(&mut self, travel: &Travel) -> Result<Slopes, PlantError> {
        let base = self.at(&Start { alpha_rad: ALPHA, ..self.start }, &Inputs::default())?;
        let v = self.start.airspeed_mps;
        let (per_span, per_chord) = (2.0 * v / self.span, 2.0 * v / self.chord);
        let mean = |s: Stops| COMMAND * 0.5 * (s.most_rad - s.least_rad);
        let (beta, even_beta) = self.slope(ANGLE, |k, s, _| s.beta_rad = k * ANGLE)?;
        let (_, far_beta) = self.slope(FAR, |k, s, _| s.beta_rad = k * FAR)?;
        let (elevator, even_elevator) =
            self.slope(mean(travel.elevator), |k, _, i| i.elevator = k * COMMAND)?;
        let rudder = match travel.rudder {
            Some(stops) => Some(self.slope(mean(stops), |k, _, i| i.rudder = k * COMMAND)?.0),
            None => None,
        };
        Ok(Slopes {
            base,
            beta,
            p: self.slope(RATE, |k, s, _| s.p_radps = k * RATE * per_span)?.0,
            q: self.slope(RATE, |k, s, _| s.q_radps = k * RATE * per_chord)?.0,
            r: self.slope(RATE, |k, s, _| s.r_radps = k * RATE * per_span)?.0,
            aileron: self.slope(mean(travel.aileron), |k, _, i| i.aileron = k * COMMAND)?.0,
            elevator,
            rudder,
            drag_beta: size_and_square([even_beta[0] - base[0], far_beta[0] - base[0]]),
            drag_elevator: ((even_elevator[0] - base[0]) / mean(travel.elevator)).clamp(0.0, 0.5),
        })
    }

    /// What the engines do, settled and after a step of the throttle.
    fn propulsion(&mut self, left_out: &mut Vec<String>) -> Result<Propulsion, PlantError> {
        let (mut rows, mut thrusts) = (Vec::new(), Vec::new());
        // Σ l δ, Σ δ², Σ m T, Σ T²
        let mut moments = [0.0; 4];
        for speed in [0.8, 1.0, 1.25] {
            for throttle in [0.0, 0.25, 0.5, 0.75, 1.0] {
                let airspeed_mps = speed * self.start.airspeed_mps;
                let start = Start { airspeed_mps, alpha_rad: ALPHA, ..self.start };
                let (thrust, truth) = self.plant.settled_thrust(&start, throttle)?;
                let (d, v) = (truth.throttle, truth.airspeed_mps);
                let share = truth.air_density_kgpm3 / SEA_LEVEL_DENSITY;
                rows.push([1.0, d, d * d, v, d * v, v * v].map(|x| x * share));
                thrusts.push(thrust);
                // an aircraft without engines has no such property
                let mut moment = |name: &str| LBF_FT * self.plant.property(name).unwrap_or(0.0);
                let (roll, pitch) =
                    (moment("moments/l-prop-lbsft"), moment("moments/m-prop-lbsft"));
                for (sum, x) in
                    moments.iter_mut().zip([roll * d, d * d, pitch * thrust, thrust * thrust])
                {
                    *sum += x;
                }
            }
        }
        let fit = least_squares(&rows, &thrusts).unwrap_or_default();
        let along = |row: &[f64; 6]| row.iter().zip(&fit).map(|(a, b)| a * b).sum::<f64>();
        let missed = rows.iter().zip(&thrusts).map(|(row, t)| (along(row) - t).powi(2));
        let left = (missed.sum::<f64>() / thrusts.len() as f64).sqrt();
        let most = thrusts.iter().fold(1e-9_f64, |most, t| most.max(t.abs()));
        if left > WORTH_SAYING * most {
            left_out.push(format!(
                "the thrust is a polynomial in the model; {left:.1} N (rms) of up to {most:.0} N are left out"
            ));
        }
        let names = ["T0_n", "Tt_n", "Ttt_n", "TV_nspm", "TtV_nspm", "TVV_ns2pm2"];
        let source = "least squares over JSBSim's thrust, 0.8 to 1.25 of the cruise airspeed";
        let thrust: Vec<Estimate> =
            names.into_iter().zip(fit.iter()).map(|(n, x)| (n, *x, 0.02, source)).collect();
        let lag = self.thrust_lag(&thrust, left_out)?;
        let [roll, throttle, pitch, squared] = moments;
        let (torque, arm) = (-roll / throttle.max(1e-9), pitch / squared.max(1e-9));
        let weight = self.mass.mass_kg * STANDARD_GRAVITY;
        Ok(Propulsion {
            thrust,
            lag,
            torque: (torque.abs() > NO_MOMENT * weight * self.span).then_some(torque),
            arm: (arm.abs() > NO_ARM * self.chord).then_some(arm),
        })
    }

    /// Time constant (s) of the thrust behind the throttle's position, if it has one; `thrust` is the settled thrust.
    fn thrust_lag(
        &mut self,
        thrust: &[Estimate],
        left_out: &mut Vec<String>,
    ) -> Result<Option<f64>, PlantError> {
        let start = Start { alpha_rad: ALPHA, ..self.start };
        let step = self.plant.step_s();
        let steps = |seconds: f64| (seconds / step) as usize;
        let [from, to] = THRUST_STEP;
        let raised: Vec<f64> =
            std::iter::once(from).chain(std::iter::repeat_n(to, steps(STEP_S))).collect();
        let wave = |k: usize| WAVE[0] + WAVE[1] * (WAVE[2] * step * k as f64).sin();
        let waved: Vec<f64> = (0..steps(WAVE_S)).map(wave).collect();
        let raised = self.plant.thrust_response(&start, &raised)?;
        let waved = self.plant.thrust_response(&start, &waved)?;
        let of = |name: &str| thrust.iter().find(|e| e.0 == name).map_or(0.0, |e| e.1);
        let slope = of("Tt_n") + of("TtV_nspm") * self.start.airspeed_mps;
        let Some(found) = thrust_lag([&raised, &waved], step, [slope, of("Ttt_n")]) else {
            return Ok(None);
        };
        let ThrustLag { lag, left, better } = found;
        if !better {
            left_out.push(format!(
                "how late the thrust follows the throttle: a lag of {lag:.2} s describes a step best, and small movements no \
                 better than none"
            ));
            return Ok(None);
        }
        if left > LAG_WORTH_SAYING {
            left_out.push(format!(
                "the thrust lags by {lag:.2} s in the model; its answer to a step of the throttle is off by {:.0} % of the \
                 step (rms)",
                100.0 * left
            ));
        }
        Ok(Some(lag))
    }

    /// Frequency (rad/s) and damping of aileron, elevator and rudder, then the throttle's lag (s).
    fn lags(&mut self, travel: &Travel) -> Result<([[f64; 2]; 3], f64), PlantError> {
        let mut traces = [[0.0; 4]; 40];
        self.plant.reset(&self.start.clone())?;
        let step = Inputs { aileron: COMMAND, elevator: COMMAND, throttle: 0.5, rudder: COMMAND };
        for trace in &mut traces {
            let truth = self.plant.step(step)?;
            *trace = [truth.aileron_rad, truth.elevator_rad, truth.rudder_rad, truth.throttle];
        }
        let of = |surface: usize, stops: Stops| {
            let observed: Vec<f64> = traces.iter().map(|t| t[surface]).collect();
            second_order(&observed, COMMAND * stops.most_rad)
        };
        let rudder = travel.rudder.map_or([50.0, 0.7], |stops| of(2, stops));
        let throttle: Vec<f64> = traces.iter().map(|t| t[3]).collect();
        Ok(([of(0, travel.aileron), of(1, travel.elevator), rudder], first_order(&throttle)))
    }
}

/// a and b of a |β| + b β² from its values at [`ANGLE`] and [`FAR`].
fn size_and_square([near, far]: [f64; 2]) -> [f64; 2] {
    let square = (far / FAR - near / ANGLE) / (FAR - ANGLE);
    [near / ANGLE - square * ANGLE, square]
}

/// Keeps coefficients within what their effects take; what is cut off is said.
fn bounded(effect: &str, estimates: &mut [Estimate], left_out: &mut Vec<String>) {
    let coefficients = describe(effect).map_or(&[][..], |about| about.coefficients);
    for estimate in estimates {
        let Some(own) = coefficients.iter().find(|c| c.name == estimate.0) else { continue };
        let (least, most) = own.bounds;
        let within = estimate.1.clamp(least, most);
        if within != estimate.1 {
            left_out.push(format!(
                "{effect}.{} = {:.4} lies outside of the model's {least} to {most}: {within} is written",
                estimate.0, estimate.1
            ));
            estimate.1 = within;
        }
    }
}

/// The effects of the model with their coefficients.
fn effects(polar: &Polar, slopes: &Slopes, left_out: &mut Vec<String>) -> Vec<Effect> {
    let [zero, slope, _] = line(polar);
    let Slopes { base, beta, p, q, r, aileron: a, elevator: e, .. } = slopes;
    let exact = |name, value| -> Estimate { (name, value, 0.02, SOURCE) };
    let lateral = |names: [&'static str; 5], k: usize| -> Vec<Estimate> {
        let values = [base[k], beta[k], p[k], r[k], a[k]];
        names.into_iter().zip(values).map(|(name, value)| exact(name, value)).collect()
    };
    let none = "lift_table stands in its place";
    let mut all = vec![
        (
            "lift_linear",
            vec![
                ("CL0", 0.0, 0.0, none),
                ("CLalpha", 0.0, 0.0, none),
                exact("CLq", q[2]),
                exact("CLde", e[2]),
            ],
        ),
        (
            "drag_beta2",
            vec![exact("CDbeta", slopes.drag_beta[0]), exact("CDbeta2", slopes.drag_beta[1])],
        ),
        ("drag_elevator_abs", vec![exact("CDde", slopes.drag_elevator)]),
        ("side_force_linear", lateral(["CY0", "CYbeta", "CYp", "CYr", "CYda"], 1)),
        ("roll_linear", lateral(["Cl0", "Clbeta", "Clp", "Clr", "Clda"], 3)),
        (
            "pitch_linear",
            vec![
                exact("Cm0", zero),
                exact("Cmalpha", slope),
                exact("Cmq", q[4]),
                exact("Cmde", e[4]),
            ],
        ),
        ("yaw_linear", lateral(["Cn0", "Cnbeta", "Cnp", "Cnr", "Cnda"], 5)),
    ];
    if let Some(d) = &slopes.rudder {
        let numbers = vec![exact("CYdr", d[1]), exact("Cldr", d[3]), exact("Cndr", d[5])];
        all.push(("rudder_linear", numbers));
    }
    all.iter_mut().for_each(|(effect, estimates)| bounded(effect, estimates, left_out));
    all
}
