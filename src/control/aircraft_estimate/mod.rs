//! Control powers, dampings and the pitch stiffness of the aircraft, estimated in flight from body rates and deflections.
//!
//! Each axis is a recursive least squares ([`axis`]) on the measured deflections. The estimates need no model. They show what
//! a flight has revealed of an unknown aircraft, for instance while a policy without a model flies it.
//!
//! No command depends on [`AircraftEstimator`]. [`adaptive`](crate::adaptive) runs the same regression on its commands.

pub(crate) mod axis;

use axis::{Estimate, Input, Prior, Seen};
use greylag_physics::atmosphere::STANDARD_GRAVITY;
use greylag_physics::{ActuatorState, Airframe, State, Time};

/// Names of the estimates, in the order of [`AircraftEstimator::derivatives`]: the dimensional derivatives L_δa, L_p, M_δe, M_q
/// and M_α at the cruise airspeed.
pub const DERIVATIVES: [&str; 5] = ["L_da", "L_p", "M_de", "M_q", "M_a"];

/// Priors of the roll and the pitch axis: medians and spreads of a distribution of aircraft (`greylag aircraft draw`).
const PRIORS: [Prior; 2] = [
    Prior { mean: [200.0, 15.0, 0.0], sd: [250.0, 10.0, 1e-6], least: 1.0 },
    Prior { mean: [150.0, 10.0, 40.0], sd: [200.0, 7.0, 50.0], least: 1.0 },
];
/// Accepted sample intervals, s.
const STEPS_S: std::ops::RangeInclusive<f64> = 0.002..=0.05;
/// Ratio of an estimate's standard deviation to that of its prior below which the estimate counts as known.
const KNOWN: f64 = 0.3;
/// The range of airspeed over cruise airspeed in which the regression's scaling with dynamic pressure holds.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// Estimator of the derivatives of one aircraft. [`AircraftEstimator::see`] is called with each state of a flight, in the order
/// of time.
#[derive(Clone, Debug)]
pub struct AircraftEstimator {
    /// Cruise airspeed, m/s.
    cruise: f64,
    /// Full travel of aileron and elevator, rad.
    travel: [f64; 2],
    axes: [Estimate; 2],
    last: Option<Time>,
}

impl AircraftEstimator {
    /// An estimator for the aircraft with `airframe`, from which only the cruise airspeed and the travels are used.
    pub fn new(airframe: &Airframe) -> AircraftEstimator {
        let surfaces = &airframe.actuators;
        AircraftEstimator {
            cruise: airframe.envelope.airspeed_cruise_mps,
            travel: [&surfaces.aileron, &surfaces.elevator].map(|s| s.travel.smallest()),
            axes: PRIORS.map(|prior| Estimate::new(prior, Input::Deflection)),
            last: None,
        }
    }

    /// Updates the estimates with a state and the deflections at `time`. After a gap in time, or a state that is not finite, the
    /// filters restart; the estimates remain.
    pub fn see(&mut self, time: Time, state: &State, actuators: &ActuatorState) {
        let before = self.last.replace(time);
        let step = before.map_or(f64::NAN, |before| time.since(before).as_secs_f64());
        let speed = state.airspeed / self.cruise;
        if !STEPS_S.contains(&step) || !SPEEDS.contains(&speed) {
            return self.interrupt();
        }
        let [aileron, elevator] = self.travel;
        let common = |rate, command, incidence| Seen {
            rate,
            command,
            incidence,
            speed,
            time: self.cruise / STANDARD_GRAVITY,
            step,
        };
        let seen = [
            common(state.p, actuators.aileron / aileron, 0.0),
            common(state.q, -actuators.elevator / elevator, state.alpha),
        ];
        self.axes.iter_mut().zip(&seen).for_each(|(axis, seen)| axis.see(seen));
    }

    /// Restarts the filters, for instance when the deflections are unknown for a while. The estimates remain.
    pub fn interrupt(&mut self) {
        self.axes.iter_mut().for_each(Estimate::interrupt);
    }

    /// The dimensional derivatives at the cruise airspeed, in the order of [`DERIVATIVES`]: L_δa and M_δe in rad/s² at full
    /// deflection (L_δa is positive, M_δe negative), L_p and M_q in 1/s, M_α in 1/s². NaN if the flight has not revealed the value: its standard
    /// deviation is above 0.3 of the prior's.
    pub fn derivatives(&self) -> [f64; 5] {
        let time = self.cruise / STANDARD_GRAVITY;
        let [roll, pitch] = [0, 1].map(|axis| -> [f64; 3] {
            std::array::from_fn(|k| match self.axes[axis].narrowed(k) < KNOWN {
                true => self.axes[axis].theta[k],
                false => f64::NAN,
            })
        });
        let square = time * time;
        [
            roll[0] / square,
            -roll[1] / time,
            -pitch[0] / square,
            -pitch[1] / time,
            -pitch[2] / square,
        ]
    }
}
