//! Imports a JSBSim aircraft: writes an airframe file and a model file, with derivatives from central differences of the forces
//! and moments.

mod effects;
mod files;
mod fits;
mod lateral;
mod propeller;
mod propulsion;
mod wing;

use greylag_sitl::plant::{Inputs, Loads, MassProperties, Plant, PlantError, Start, Stops, Travel};

use effects::effects;
use files::{airframe, model_file};
use fits::{first_order, second_order};
use greylag_physics::airframe::Geometry;
use greylag_physics::rigid_body::RigidBody;
use greylag_physics::size::Size;
use lateral::{AileronOverIncidence, WithLift};
use propeller::Propeller;
use wing::measure;

/// Metres in a foot.
const FT: f64 = 0.3048;
/// Angle of attack at which derivatives are taken, rad: 3°.
const ALPHA: f64 = 0.052;
/// Half interval of angles, rad: 2°.
const ANGLE: f64 = 0.035;
/// Larger sideslip, at which the drag is evaluated a second time, rad: 8°.
const FAR: f64 = 4.0 * ANGLE;
/// Half interval of the dimensionless rates pb/2V, qc/2V and rb/2V.
const RATE: f64 = 0.005;
/// Pitch angle of the second attitude for the derivatives with respect to α̇, rad: 60°. At this pitch angle, gravity curves the
/// flight path less than in level flight.
const ATTITUDE: f64 = 1.05;
/// Half interval of surface commands (−1..1).
const COMMAND: f64 = 0.2;
/// Angles of attack of the tables, degrees.
const TABLE_DEG: [f64; 24] = [
    -24.0, -20.0, -17.0, -14.0, -12.0, -10.0, -8.0, -6.0, -4.0, -2.0, 0.0, 2.0, 4.0, 6.0, 8.0,
    10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 25.0, 30.0,
];

/// Files of an imported aircraft.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Text of the airframe file.
    pub airframe: String,
    /// Text of the model file, which refers to `airframe.toml` in the same folder.
    pub model: String,
    /// Effects that airframe and model do not represent, one sentence each.
    pub left_out: Vec<String>,
}

impl Imported {
    /// Adds JSBSim properties that are held constant to the airframe file. `held` has their names and values.
    pub fn hold(&mut self, held: &[(String, f64)]) {
        if !held.is_empty() {
            self.airframe.push_str("\n# Held in the simulator: the model is of the aircraft in this condition.\n[conditions]\n");
        }
        for (name, value) in held {
            self.airframe.push_str(&format!("{name:?} = {value:?}\n"));
        }
    }
}

/// Reason why an aircraft cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The simulator cannot load or evaluate the aircraft.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A surface moves to one side only, or against its command.
    #[error(
        "the {surface} of the aircraft goes from {least:.4} to {most:.4} rad for commands from -1 to 1: an \
         airframe needs one that goes from below zero to above; name a position property of that sense with \
         --property"
    )]
    Surface {
        /// Name of the surface.
        surface: &'static str,
        /// Deflection at the command −1, rad.
        least: f64,
        /// Deflection at the command 1, rad.
        most: f64,
    },
    /// A reference dimension of the wing is missing or not positive. The coefficients cannot be made dimensionless without it.
    #[error(
        "the {what} of the aircraft ({property}) is {value}: coefficients need one above zero; state it in the section metrics of the \
         aircraft's file"
    )]
    Wing {
        /// Name of the dimension, such as `wing span`.
        what: &'static str,
        /// Name of the property in JSBSim.
        property: &'static str,
        /// Value of the property, in feet or square feet.
        value: f64,
    },
    /// The aircraft has no positive lift at any angle of attack of the tables.
    #[error(
        "the aircraft has no lift at {airspeed:.1} m/s: give the airspeed at which it flies with --cruise-mps"
    )]
    Lift {
        /// Airspeed of the evaluation, m/s.
        airspeed: f64,
    },
}

/// The aircraft that is imported, with its reference dimensions.
struct Subject<'a> {
    plant: &'a mut Plant,
    start: Start,
    area: f64,
    span: f64,
    chord: f64,
    mass: MassProperties,
    /// Derivatives of the coefficients with respect to α̇c/2V, the dimensionless rate of the angle of attack. Their
    /// contribution is removed from every evaluation.
    alpha_rate: Coefficients,
}

/// Coefficients of drag, side force and lift (wind axes), and of rolling, pitching and yawing moment (body axes).
type Coefficients = [f64; 6];

/// Imports the aircraft of `plant` under the name `name`. Its forces and moments are evaluated at the airspeed `cruise` (m/s)
/// and the altitude `altitude` (m).
///
/// # Errors
///
/// If the aircraft cannot be evaluated in JSBSim, has no wing area, span or chord, has no lift, or has a surface that an
/// airframe file cannot represent.
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
    let area = measure(plant, "wing area", "metrics/Sw-sqft")? * FT * FT;
    let span = measure(plant, "wing span", "metrics/bw-ft")? * FT;
    let chord = measure(plant, "mean chord", "metrics/cbarw-ft")? * FT;
    let mut subject = Subject { plant, start, area, span, chord, mass, alpha_rate: [0.0; 6] };
    subject.alpha_rate = subject.alpha_rate()?;
    let mut left_out = Vec::new();
    let (polar, lift_max) = subject.polar()?;
    if lift_max <= 0.0 {
        return Err(ImportError::Lift { airspeed: cruise });
    }
    let beside = Beside {
        alpha_rate: subject.alpha_rate,
        propeller: subject.propeller(&travel)?,
        with_lift: subject.lateral_with_lift()?,
        aileron: subject.aileron_over_incidence(at_command(travel.aileron))?,
    };
    let size = subject.size();
    let effects = effects(&polar, &subject.slopes(&travel)?, &beside, &size, &mut left_out);
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

/// Coefficients of lift, drag and pitching moment over the angle of attack (rad).
struct Polar {
    alpha: Vec<f64>,
    lift: Vec<f64>,
    drag: Vec<f64>,
    pitch: Vec<f64>,
}

impl Polar {
    /// The smallest angle of attack (rad) at which the interpolated lift coefficient reaches `lift`; 0 if there is none.
    fn incidence(&self, lift: f64) -> f64 {
        let reaches = self.lift.windows(2).position(|w| w[0] < lift && lift <= w[1]);
        reaches.map_or(0.0, |k| {
            let share = (lift - self.lift[k]) / (self.lift[k + 1] - self.lift[k]);
            self.alpha[k] + share * (self.alpha[k + 1] - self.alpha[k])
        })
    }
}

/// Effects in addition to the linear coefficients.
struct Beside {
    alpha_rate: Coefficients,
    propeller: Propeller,
    with_lift: Option<WithLift>,
    aileron: Option<AileronOverIncidence>,
}

/// Derivatives of the coefficients at the angle of attack [`ALPHA`].
struct Slopes {
    base: Coefficients,
    beta: Coefficients,
    p: Coefficients,
    q: Coefficients,
    r: Coefficients,
    aileron: Coefficients,
    elevator: Coefficients,
    rudder: Option<Coefficients>,
    /// Derivatives of the drag coefficient with respect to |β| and β².
    drag_beta: [f64; 2],
    /// Derivative of the drag coefficient with respect to |elevator deflection|.
    drag_elevator: f64,
}

impl Subject<'_> {
    /// Coefficients in the state `state` with the commands `inputs`.
    fn at(&mut self, state: &Start, inputs: &Inputs) -> Result<Coefficients, PlantError> {
        let loads = self.plant.loads(state, inputs)?;
        let pressure = self.pressure(&loads);
        self.steady(&loads, pressure)
    }

    fn size(&self) -> Size {
        let MassProperties { mass_kg: mass, inertia_kgm2: [jx, jy, jz, jxz] } = self.mass;
        let geometry = Geometry { area: self.area, span: self.span, chord: self.chord };
        Size::new(&RigidBody { mass, jx, jy, jz, jxz }, &geometry)
    }

    /// Dynamic pressure times wing area, N.
    fn pressure(&self, loads: &Loads) -> f64 {
        0.5 * loads.truth.air_density_kgpm3 * loads.truth.airspeed_mps.powi(2) * self.area
    }

    /// Coefficients of `loads` without the contribution of α̇.
    fn steady(&mut self, loads: &Loads, pressure: f64) -> Result<Coefficients, PlantError> {
        let rate = self.incidence_rate(loads.truth.airspeed_mps)?;
        let all = self.coefficients(loads, pressure);
        Ok(std::array::from_fn(|k| all[k] - rate * self.alpha_rate[k]))
    }

    /// Dimensionless rate α̇c/2V of the angle of attack, with JSBSim's α̇.
    fn incidence_rate(&mut self, airspeed: f64) -> Result<f64, PlantError> {
        let rate = self.plant.property("aero/alphadot-rad_sec")?;
        Ok(rate * self.chord / (2.0 * airspeed))
    }

    /// Derivatives of the coefficients with respect to α̇c/2V, from two attitudes with the same airflow. Gravity curves the
    /// flight path at a different rate in each attitude.
    fn alpha_rate(&mut self) -> Result<Coefficients, PlantError> {
        let mut sides = [([0.0; 6], 0.0); 2];
        for (side, pitch_rad) in sides.iter_mut().zip([0.0, ATTITUDE]) {
            let state = Start { alpha_rad: ALPHA, pitch_rad, ..self.start };
            let loads = self.plant.loads(&state, &Inputs::default())?;
            let pressure = self.pressure(&loads);
            *side = (self.coefficients(&loads, pressure), self.incidence_rate(state.airspeed_mps)?);
        }
        let [(level, slow), (steep, fast)] = sides;
        let by = fast - slow;
        Ok(std::array::from_fn(|k| if by.abs() > 1e-9 { (steep[k] - level[k]) / by } else { 0.0 }))
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

    /// Coefficients of lift, drag and pitching moment over the angle of attack, and the largest lift coefficient.
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

    /// Evaluates the coefficients at two points on both sides of the reference state; `of` sets the state and inputs of each
    /// from its sign. Returns the difference of the coefficients divided by 2 `unit`, and their mean.
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

    /// Derivatives of the coefficients about the reference state, which is straight flight at the angle of attack [`ALPHA`].
    fn slopes(&mut self, travel: &Travel) -> Result<Slopes, PlantError> {
        let base = self.at(&Start { alpha_rad: ALPHA, ..self.start }, &Inputs::default())?;
        let v = self.start.airspeed_mps;
        let (per_span, per_chord) = (2.0 * v / self.span, 2.0 * v / self.chord);
        let (beta, even_beta) = self.slope(ANGLE, |k, s, _| s.beta_rad = k * ANGLE)?;
        let (_, far_beta) = self.slope(FAR, |k, s, _| s.beta_rad = k * FAR)?;
        let (elevator, even_elevator) =
            self.slope(at_command(travel.elevator), |k, _, i| i.elevator = k * COMMAND)?;
        let rudder = match travel.rudder {
            Some(stops) => Some(self.slope(at_command(stops), |k, _, i| i.rudder = k * COMMAND)?.0),
            None => None,
        };
        Ok(Slopes {
            base,
            beta,
            p: self.slope(RATE, |k, s, _| s.p_radps = k * RATE * per_span)?.0,
            q: self.slope(RATE, |k, s, _| s.q_radps = k * RATE * per_chord)?.0,
            r: self.slope(RATE, |k, s, _| s.r_radps = k * RATE * per_span)?.0,
            aileron: self.slope(at_command(travel.aileron), |k, _, i| i.aileron = k * COMMAND)?.0,
            elevator,
            rudder,
            drag_beta: size_and_square([even_beta[0] - base[0], far_beta[0] - base[0]]),
            drag_elevator: ((even_elevator[0] - base[0]) / at_command(travel.elevator))
                .clamp(0.0, 0.5),
        })
    }

    /// Natural frequency (rad/s) and damping ratio of aileron, elevator and rudder, then the time constant of the throttle (s).
    /// They are fitted to a step response.
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

/// Deflection at the command [`COMMAND`], rad: the mean of both sides.
fn at_command(stops: Stops) -> f64 {
    COMMAND * 0.5 * (stops.most_rad - stops.least_rad)
}

/// The coefficients a and b of the function a |β| + b β² from its values at [`ANGLE`] and [`FAR`].
fn size_and_square([near, far]: [f64; 2]) -> [f64; 2] {
    let square = (far / FAR - near / ANGLE) / (FAR - ANGLE);
    [near / ANGLE - square * ANGLE, square]
}
