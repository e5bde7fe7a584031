//! Control authority: steady roll rate, initial pitch acceleration and initial yaw acceleration at full deflection of a surface.

use serde::Serialize;

use greylag_model::modes::rates;
use greylag_model::{GreyBox, Trim};

/// Control authority of the model linearised about a trim. Full deflection is the smaller magnitude of the surface's two
/// travel limits. Rates and accelerations are about the body axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Authority {
    /// Steady roll rate at full positive aileron, rad/s; right wing down is positive.
    pub roll_rate: f64,
    /// Initial pitch acceleration at full positive elevator, rad/s²; nose up is positive.
    pub pitch_acceleration: f64,
    /// Initial yaw acceleration at full positive rudder, rad/s²; nose right is positive. `None` without a rudder.
    pub yaw_acceleration: Option<f64>,
}

impl Authority {
    /// The control authority about `trim` at `altitude` (m).
    pub(crate) fn at(model: &GreyBox, trim: &Trim, altitude: f64) -> Authority {
        let linear = rates(model, trim, altitude);
        let figures = &model.airframe.actuators;
        let full = |place: usize, column: usize, travel: f64| linear.b[(place, column)] * travel;
        let rudder = figures.rudder.filter(|_| model.has_rudder());
        Authority {
            // at the steady roll rate, roll damping balances the aileron's moment; sideslip and yaw rate are neglected
            roll_rate: full(3, 0, figures.aileron.travel.smallest()) / -linear.a[(3, 3)],
            pitch_acceleration: full(4, 1, figures.elevator.travel.smallest()),
            yaw_acceleration: rudder.map(|rudder| full(5, 3, rudder.travel.smallest())),
        }
    }

    /// Steady roll rate at full aileron in level flight at the cruise airspeed, rad/s. `None` if the model has no level trim at
    /// this airspeed, or if positive aileron does not roll to the right.
    pub(crate) fn roll_rate(model: &GreyBox) -> Option<f64> {
        let altitude = model.airframe.reference.altitude;
        let trim =
            Trim::level(model, model.airframe.envelope.airspeed_cruise_mps, altitude).ok()?;
        let rate = Authority::at(model, &trim, altitude).roll_rate;
        (rate.is_finite() && rate > 0.0).then_some(rate)
    }
}
