//! Channels (time series) of a log with their kinds of interpolation, and the check of the required channels.

use super::{Periods, Present};
use crate::flight_path::ReconstructError;
use crate::flight_path::channel::{Channel, Interpolation};
use greylag_logs::{Flight, FlowAngles, Sample};

/// All channels of a log.
pub(super) struct Channels {
    pub(super) rates: [Channel; 3],
    pub(super) force: [Channel; 3],
    pub(super) attitude: [Channel; 3],
    pub(super) airspeed: Channel,
    pub(super) vanes: [Channel; 2],
    pub(super) velocity: [Channel; 3],
    pub(super) altitude: Channel,
    pub(super) density: Channel,
    pub(super) positions: [Channel; 4],
    pub(super) commands: [Channel; 4],
}

impl Channels {
    pub(super) fn of(flight: &Flight) -> Channels {
        let all = |kind, get: &dyn Fn(&Sample) -> f64| {
            Channel::new(flight.samples.iter().map(|s| (s.time_s, get(s))), kind)
        };
        let first = all(Interpolation::Linear, &|s| s.rates_radps[0]);
        let channel = |kind, get: &dyn Fn(&Sample) -> f64| all(kind, get).sharing(&first);
        let three = |kind, get: &dyn Fn(&Sample, usize) -> f64| {
            std::array::from_fn(|i| channel(kind, &|s| get(s, i)))
        };
        let four = |get: &dyn Fn(&Sample) -> [f64; 4]| {
            std::array::from_fn(|i| channel(Interpolation::Kept, &|s| get(s)[i]))
        };
        let vane = |get: &dyn Fn(&Sample) -> f64| match flight.flow_angles {
            FlowAngles::Measured => channel(Interpolation::Linear, get),
            FlowAngles::Estimated => channel(Interpolation::Linear, &|_| f64::NAN),
        };
        Channels {
            rates: three(Interpolation::Linear, &|s, i| s.rates_radps[i]),
            force: three(Interpolation::Linear, &|s, i| s.specific_force_mps2[i]),
            attitude: three(Interpolation::Angle, &|s, i| s.attitude_rad[i]),
            airspeed: channel(Interpolation::Linear, &|s| s.airspeed_mps),
            vanes: [vane(&|s| s.alpha_rad), vane(&|s| s.beta_rad)],
            velocity: three(Interpolation::Linear, &|s, i| s.velocity_ned_mps[i]),
            altitude: channel(Interpolation::Kept, &|s| s.altitude_m),
            density: channel(Interpolation::Kept, &|s| s.air_density_kgpm3),
            positions: four(&|s| [s.aileron_rad, s.elevator_rad, s.throttle, s.rudder_rad]),
            commands: four(&|s| [s.aileron_cmd, s.elevator_cmd, s.throttle_cmd, s.rudder_cmd]),
        }
    }

    pub(super) fn sensors(&self) -> Present {
        let all = |channels: &[Channel]| channels.iter().all(|c| !c.is_empty() && !c.stuck);
        Present {
            yaw: all(&self.attitude[2..]),
            force: all(&self.force),
            alpha: all(&self.vanes[..1]),
            beta: all(&self.vanes[1..]),
            velocity: all(&self.velocity[..2]),
            altitude: all(std::slice::from_ref(&self.altitude)),
        }
    }

    pub(super) fn periods(&self) -> Periods {
        Periods {
            attitude: self.attitude[0].period(),
            airspeed: self.airspeed.period(),
            vanes: self.vanes[0].period().max(self.vanes[1].period()),
            velocity: self.velocity[0].period(),
        }
    }

    /// Checks that the required channels have samples, and that the sensors among them are not constant. The error names the
    /// first channel that fails.
    pub(super) fn check(&self, flight: &str) -> Result<(), ReconstructError> {
        let missing =
            |channel, column| ReconstructError::Missing { flight: flight.into(), channel, column };
        let sensors: [(&[Channel], _, _); 3] = [
            (&self.attitude[..2], "attitude that changes", "roll_rad, pitch_rad"),
            (&self.rates, "body rates that change", "p_radps, q_radps, r_radps"),
            (std::slice::from_ref(&self.airspeed), "airspeed that changes", "airspeed_mps"),
        ];
        for (channels, what, column) in sensors {
            if channels.iter().any(|c| c.is_empty() || c.stuck) {
                return Err(missing(what, column));
            }
        }
        let actuators = [
            ("aileron command or position", "aileron_cmd or aileron_rad"),
            ("elevator command or position", "elevator_cmd or elevator_rad"),
            ("throttle command or position", "throttle_cmd or throttle"),
        ];
        for (i, (what, column)) in actuators.into_iter().enumerate() {
            if self.commands[i].is_empty() && self.positions[i].is_empty() {
                return Err(missing(what, column));
            }
        }
        Ok(())
    }
}
