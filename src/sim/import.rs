//! An aircraft of JSBSim as airframe and model: central differences of its loads.

use std::f64::consts::FRAC_PI_2;

use greylag_sitl::plant::{Inputs, Loads, MassProperties, Plant, PlantError, Start, Stops, Travel};
use nalgebra::{DMatrix, DVector};

use crate::model::textbook::{Estimate, numbers};
use crate::physics::atmosphere::{SEA_LEVEL_DENSITY, STANDARD_GRAVITY};
use crate::physics::servos::{self, Surface};

/// Metres per foot, square metres per square foot.
const FT: f64 = 0.3048;
/// Incidence at which derivatives are taken, rad: 3°.
const ALPHA: f64 = 0.052;
/// Half the interval of angles, rad: 2°.
const ANGLE: f64 = 0.035;
/// Half the interval of dimensionless rates.
const RATE: f64 = 0.005;
/// Half the interval of commands.
const COMMAND: f64 = 0.2;
/// Incidences of the tables, degrees.
const TABLE_DEG: [f64; 24] = [
    -24.0, -20.0, -17.0, -14.0, -12.0, -10.0, -8.0, -6.0, -4.0, -2.0, 0.0, 2.0, 4.0, 6.0, 8.0,
    10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 25.0, 30.0,
];
/// Incidences over which the pitching moment is taken as a line, degrees.
const LINE_DEG: [f64; 2] = [-4.0, 10.0];
/// Share of a channel's variation that is worth a word when it is left.
const WORTH_SAYING: f64 = 0.02;

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
    let mut subject = Subject { plant, start, area, span, chord };
    let mut left_out = Vec::new();
    let (polar, lift_max) = subject.polar()?;
    if lift_max <= 0.0 {
        return Err(ImportError::Lift { airspeed: cruise });
    }
    let effects = subject.effects(&polar, &travel, &mut left_out)?;
    let (thrust, level) = subject.thrust(&mass, &mut left_out)?;
    let lags = subject.lags(&travel)?;
    Ok(Imported {
        airframe: subject.airframe(name, &travel, &lags, lift_max, &mass, level),
        model: model_file(name, &mass, &polar, &effects, &thrust, travel.rudder.is_some()),
        left_out,
    })
}

/// Lift and drag over incidence.
struct Polar {
    alpha: Vec<f64>,
    lift: Vec<f64>,
    drag: Vec<f64>,
    pitch: Vec<f64>,
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

    fn effects(
        &mut self,
        polar: &Polar,
        travel: &Travel,
        left_out: &mut Vec<String>,
    ) -> Result<Vec<Effect>, PlantError> {
        let base = self.at(&Start { alpha_rad: ALPHA, ..self.start }, &Inputs::default())?;
        let v = self.start.airspeed_mps;
        let (per_span, per_chord) = (2.0 * v / self.span, 2.0 * v / self.chord);
        let (beta, even_beta) = self.slope(ANGLE, |k, s, _| s.beta_rad = k * ANGLE)?;
        let (p, _) = self.slope(RATE, |k, s, _| s.p_radps = k * RATE * per_span)?;
        let (q, _) = self.slope(RATE, |k, s, _| s.q_radps = k * RATE * per_chord)?;
        let (r, _) = self.slope(RATE, |k, s, _| s.r_radps = k * RATE * per_span)?;
        let mean = |s: Stops| COMMAND * 0.5 * (s.most_rad - s.least_rad);
        let (a, _) = self.slope(mean(travel.aileron), |k, _, i| i.aileron = k * COMMAND)?;
        let (e, even_e) = self.slope(mean(travel.elevator), |k, _, i| i.elevator = k * COMMAND)?;
        let exact = |name, value| -> Estimate { (name, value, 0.02, SOURCE) };
        let [zero, slope, bent] = line(polar);
        if bent > WORTH_SAYING {
            left_out.push(format!(
                "the pitching moment over incidence is a line in the model; {:.0} % of its variation from {} \
                 to {} deg is left out",
                100.0 * bent,
                LINE_DEG[0],
                LINE_DEG[1]
            ));
        }
        let drag_beta = ((even_beta[0] - base[0]) / (ANGLE * ANGLE)).max(0.0);
        let drag_elevator = ((even_e[0] - base[0]) / mean(travel.elevator)).max(0.0);
        let mut all = vec![
            (
                "lift_linear",
                vec![
                    ("CL0", 0.0, 0.0, "lift_table stands in its place"),
                    ("CLalpha", 0.0, 0.0, "lift_table stands in its place"),
                    exact("CLq", q[2]),
                    exact("CLde", e[2]),
                ],
            ),
            (
                "drag_beta2",
                vec![("CDbeta", 0.0, 0.0, "none"), exact("CDbeta2", drag_beta.min(10.0))],
            ),
            ("drag_elevator_abs", vec![exact("CDde", drag_elevator.min(0.5))]),
            (
                "side_force_linear",
                vec![
                    exact("CY0", base[1]),
                    exact("CYbeta", beta[1]),
                    exact("CYp", p[1]),
                    exact("CYr", r[1]),
                    exact("CYda", a[1]),
                ],
            ),
            (
                "roll_linear",
                vec![
                    exact("Cl0", base[3]),
                    exact("Clbeta", beta[3]),
                    exact("Clp", p[3]),
                    exact("Clr", r[3]),
                    exact("Clda", a[3]),
                ],
            ),
            (
                "pitch_linear",
                vec![
                    exact("Cm0", zero),
                    exact("Cmalpha", slope),
                    exact("Cmq", q[4]),
                    exact("Cmde", e[4]),
                ],
            ),
            (
                "yaw_linear",
                vec![
                    exact("Cn0", base[5]),
                    exact("Cnbeta", beta[5]),
                    exact("Cnp", p[5]),
                    exact("Cnr", r[5]),
                    exact("Cnda", a[5]),
                ],
            ),
        ];
        if let Some(rudder) = travel.rudder {
            let (d, _) = self.slope(mean(rudder), |k, _, i| i.rudder = k * COMMAND)?;
            let numbers = vec![exact("CYdr", d[1]), exact("Cldr", d[3]), exact("Cndr", d[5])];
            all.push(("rudder_linear", numbers));
        }
        Ok(all)
    }

    /// The thrust's polynomial over throttle and airspeed, and the throttle of level flight.
    fn thrust(
        &mut self,
        mass: &MassProperties,
        left_out: &mut Vec<String>,
    ) -> Result<(Vec<Estimate>, f64), PlantError> {
        let (mut rows, mut thrusts, mut drags) = (Vec::new(), Vec::new(), Vec::new());
        for speed in [0.8, 1.0, 1.25] {
            for throttle in [0.0, 0.25, 0.5, 0.75, 1.0] {
                let airspeed_mps = speed * self.start.airspeed_mps;
                self.plant.reset(&Start { airspeed_mps, alpha_rad: ALPHA, ..self.start })?;
                for step in 0..300 {
                    let truth = self.plant.step(Inputs { throttle, ..Inputs::default() })?;
                    // an engine takes its time
                    if step < 200 || step % 10 != 0 {
                        continue;
                    }
                    let ahead = self.plant.property("forces/fbx-aero-lbs")? * 4.448_221_615_260_5;
                    let (d, v) = (truth.throttle, truth.airspeed_mps);
                    let share = truth.air_density_kgpm3 / SEA_LEVEL_DENSITY;
                    rows.push([1.0, d, d * d, v, d * v, v * v].map(|x| x * share));
                    thrusts.push(mass.mass_kg * truth.specific_force_mps2[0] - ahead);
                    if speed == 1.0 {
                        drags.push(-ahead);
                    }
                }
            }
        }
        let matrix = DMatrix::from_fn(rows.len(), 6, |i, j| rows[i][j]);
        let target = DVector::from_column_slice(&thrusts);
        let fit = matrix
            .clone()
            .svd(true, true)
            .solve(&target, 1e-9)
            .unwrap_or_else(|_| DVector::zeros(6));
        let left = (&matrix * &fit - &target).norm() / (target.len() as f64).sqrt();
        let most = target.amax().max(1e-9);
        if left > WORTH_SAYING * most {
            left_out.push(format!(
                "the thrust is a polynomial in the model; {left:.1} N (rms) of up to {most:.0} N are left out"
            ));
        }
        let names = ["T0_n", "Tt_n", "Ttt_n", "TV_nspm", "TtV_nspm", "TVV_ns2pm2"];
        let source = "least squares over JSBSim's thrust, 0.8 to 1.25 of the cruise airspeed";
        let thrust = |d: f64| {
            let v = self.start.airspeed_mps;
            [1.0, d, d * d, v, d * v, v * v].iter().zip(fit.iter()).map(|(a, b)| a * b).sum::<f64>()
        };
        let drag = drags.iter().sum::<f64>() / drags.len().max(1) as f64;
        let level =
            (0..=100).map(|k| f64::from(k) / 100.0).find(|d| thrust(*d) >= drag).unwrap_or(1.0);
        let estimates =
            names.into_iter().zip(fit.iter()).map(|(n, x)| (n, *x, 0.02, source)).collect();
        Ok((estimates, level.max(0.01)))
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

    fn airframe(
        &self,
        name: &str,
        travel: &Travel,
        (surfaces, lag): &([[f64; 2]; 3], f64),
        lift_max: f64,
        mass: &MassProperties,
        throttle: f64,
    ) -> String {
        let cruise = self.start.airspeed_mps;
        let density = crate::physics::atmosphere::standard_density(self.start.altitude_m);
        let stall =
            (2.0 * mass.mass_kg * STANDARD_GRAVITY / (density * self.area * lift_max)).sqrt();
        let slowest = (1.25 * stall).min(0.9 * cruise);
        let mut out = format!(
            "# Written by `greylag aircraft import jsbsim`.\nschema = 2\nname = {name:?}\n\n[geometry]\n\
             wing_area_m2 = {{ value = {:.6}, source = \"JSBSim\" }}\nspan_m = {{ value = {:.6}, source = \"JSBSim\" \
             }}\nmean_chord_m = {{ value = {:.6}, source = \"JSBSim\" }}\n\n[reference]\nairspeed_mps = {{ value = \
             {cruise:?}, source = \"given\" }}\naltitude_m = {{ value = {:?}, source = \"given\" }}\nthrottle = {{ \
             value = {throttle:.3}, source = \"drag at the reference airspeed\" }}\n\n",
            self.area, self.span, self.chord, self.start.altitude_m
        );
        let stops = [Some(travel.aileron), Some(travel.elevator), travel.rudder];
        for ((surface, stops), [frequency, damping]) in
            ["aileron", "elevator", "rudder"].into_iter().zip(stops).zip(surfaces)
        {
            if let Some(Stops { least_rad, most_rad }) = stops {
                out += &format!(
                    "[controls.{surface}]\nfrequency_radps = {{ value = {frequency:.2}, source = \"step of the \
                     command\" }}\ndamping = {{ value = {damping:.3}, source = \"step of the command\" }}\n\
                     travel_min_rad = {{ value = {least_rad:.6}, source = \"JSBSim\" }}\ntravel_max_rad = {{ value \
                     = {most_rad:.6}, source = \"JSBSim\" }}\n\n"
                );
            }
        }
        out += &format!(
            "[controls.throttle]\nlag_s = {{ value = {lag:.4}, source = \"step of the command\" }}\n\n\
             # The lift table's largest coefficient stalls at {stall:.1} m/s. Correct the rest to your mission.\n\
             [envelope]\nbank_max_deg = 45.0\npitch_max_deg = 15.0\npitch_min_deg = -15.0\nload_factor_max = 2.0\n\
             airspeed_min_mps = {slowest:.2}\nairspeed_max_mps = {:.2}\nairspeed_cruise_mps = {cruise:?}\n\
             surface_slew_per_s = 20.0\n",
            1.4 * cruise
        );
        out
    }
}

/// Intercept and slope of the pitching moment over incidence, and the share of its variation beside.
fn line(polar: &Polar) -> [f64; 3] {
    let [low, high] = LINE_DEG.map(|a| a.to_radians() + 1e-9);
    let inside: Vec<(f64, f64)> = polar
        .alpha
        .iter()
        .copied()
        .zip(polar.pitch.iter().copied())
        .filter(|(a, _)| *a >= low - 2e-9 && *a <= high)
        .collect();
    let count = inside.len() as f64;
    let (ma, mm) = inside.iter().fold((0.0, 0.0), |(x, y), (a, m)| (x + a / count, y + m / count));
    let moment =
        |f: &dyn Fn(f64, f64) -> f64| inside.iter().map(|(a, m)| f(a - ma, m - mm)).sum::<f64>();
    let slope = moment(&|a, m| a * m) / moment(&|a, _| a * a);
    let left = moment(&|a, m| (m - slope * a).powi(2)) / moment(&|_, m| m * m).max(1e-30);
    [mm - slope * ma, slope, left.sqrt()]
}

/// Frequency and damping of the filter whose step response is closest to `observed`.
fn second_order(observed: &[f64], end: f64) -> [f64; 2] {
    let miss = |frequency: f64, damping: f64| {
        let Surface { filter: [b, a1, a2], .. } =
            Surface::tustin(frequency, damping, servos::Travel::symmetric(FRAC_PI_2), 0.01);
        let (mut y, mut u) = ([0.0; 2], [0.0; 2]);
        let errors = observed.iter().map(|x| {
            let next = b * (end + 2.0 * u[0] + u[1]) - a1 * y[0] - a2 * y[1];
            (y, u) = ([next, y[0]], [end, u[0]]);
            (x - next).powi(2)
        });
        errors.sum::<f64>()
    };
    let frequencies = (0..60).map(|k| 5.0 * 1.09_f64.powi(k));
    let all = frequencies.flat_map(|w| [0.5, 0.6, 0.707, 0.8, 1.0, 1.4].map(|z| [w, z]));
    all.min_by(|a, b| miss(a[0], a[1]).total_cmp(&miss(b[0], b[1]))).unwrap_or([50.0, 0.7])
}

/// Time constant (s) by which `observed` follows a step, by the time to 63 % of its end.
fn first_order(observed: &[f64]) -> f64 {
    let end = 0.5;
    match observed.iter().position(|x| *x >= 0.632 * end) {
        Some(k) => (0.01 * k as f64).max(0.01),
        // slower than was waited for: by what it has done
        None => {
            let last = observed.last().copied().unwrap_or(0.0) / end;
            0.01 * observed.len() as f64 / -(1.0 - last.clamp(1e-3, 0.99)).ln()
        }
    }
}

fn model_file(
    name: &str,
    mass: &MassProperties,
    polar: &Polar,
    effects: &[Effect],
    thrust: &[Estimate],
    has_rudder: bool,
) -> String {
    let mut out = format!(
        "# Written by `greylag aircraft import jsbsim`{}.\nschema = 1\nname = {:?}\ndescription = \"Central \
         differences of JSBSim's loads.\"\nairframe = \"airframe.toml\"\nintegrator = \"jsbsim\"\nforce_axes = \
         \"wind\"\n\n[rigid_body]\n",
        if has_rudder { "" } else { "; the aircraft has no rudder" },
        format!("{name}-import")
    );
    let [jx, jy, jz, jxz] = mass.inertia_kgm2;
    let of = |name, value| -> Estimate { (name, value, 0.01, "JSBSim") };
    numbers(
        &mut out,
        &[
            of("mass_kg", mass.mass_kg),
            of("jx_kgm2", jx),
            of("jy_kgm2", jy),
            of("jz_kgm2", jz),
            of("jxz_kgm2", jxz),
        ],
    );
    out += "\n[air]\ngravity_mps2 = { value = 9.806, source = \"effective gravity in middle latitudes\" }\ndensity \
            = \"standard\"\n";
    for (effect, estimates) in effects {
        out += &format!("\n[effects.{effect}]\n");
        numbers(&mut out, estimates);
    }
    out += "\n[effects.propeller]\n";
    numbers(&mut out, thrust);
    for (effect, ordinate, values) in
        [("lift_table", "CL", &polar.lift), ("drag_table", "CD", &polar.drag)]
    {
        let list = |values: &[f64]| {
            values.iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(", ")
        };
        out += &format!(
            "\n[effects.{effect}]\nk = {{ value = 1.0, source = \"the table as it is\" }}\n\n[effects.{effect}.{ordinate}]\n\
             alpha_rad = [{}]\nvalue = [{}]\nsource = \"JSBSim's loads\"\n",
            list(&polar.alpha),
            list(values)
        );
    }
    out
}
