//! The pilot's model monitor and its estimator of the aircraft's derivatives.
//!
//! The monitor compares measured accelerations with the model's predictions. It reports deviations to the ground stations.

use super::Pilot;
use crate::monitor::Monitor;
use greylag_control::aircraft_estimate::{AircraftEstimator, DERIVATIVES};
use greylag_link::autopilot::Severity;
use greylag_link::vehicle::{Faults, Telemetry};

impl Pilot {
    /// Sets the model monitor. From now on it compares measurements with its predictions while the pilot is armed.
    pub fn monitor_with(&mut self, monitor: Monitor) {
        self.monitor = Some(monitor);
    }

    /// Sets the estimator of the aircraft's derivatives. From now on it is updated while the pilot is armed.
    pub fn estimate_with(&mut self, estimator: AircraftEstimator) {
        self.estimator = Some(estimator);
    }

    /// Passes a state with known surface positions to the model monitor and the estimator. The caller first sends the command
    /// for this state, because no command depends on the results.
    pub fn monitor(&mut self, frame: &Telemetry) {
        if !self.armed {
            return self.forget_residuals();
        }
        if let Some(estimator) = &mut self.estimator {
            match frame.faults {
                Faults::NONE => estimator.see(frame.time, &frame.state, &frame.actuators),
                _ => estimator.interrupt(),
            }
        }
        let warning = self.monitor.as_mut().and_then(|monitor| monitor.see(frame));
        if let Some(warning) = warning {
            self.texts.say(Severity::Warning, warning.to_string());
        }
    }

    /// Clears the monitor's residuals and interrupts the estimator, for instance while the companion does not command the
    /// surfaces.
    pub fn forget_residuals(&mut self) {
        if let Some(monitor) = &mut self.monitor {
            monitor.forget();
        }
        if let Some(estimator) = &mut self.estimator {
            estimator.interrupt();
        }
    }

    /// Residuals (measured minus predicted accelerations) in the order of the monitor's channels. Each is divided by two
    /// standard deviations of its prediction; NaN if unknown.
    pub fn residual_shares(&self) -> [f64; 6] {
        self.monitor.as_ref().map_or([f64::NAN; 6], Monitor::shares)
    }

    /// The derivatives of the aircraft estimated since the start, in the order and the units of
    /// [`AircraftEstimator::derivatives`]; NaN if unknown.
    pub fn derivatives(&self) -> [f64; DERIVATIVES.len()] {
        let known = self.estimator.as_ref().map(AircraftEstimator::derivatives);
        known.unwrap_or([f64::NAN; DERIVATIVES.len()])
    }
}

#[cfg(test)]
mod tests {
    use super::DERIVATIVES;
    use greylag_link::autopilot::ESTIMATES;

    #[test]
    fn each_estimate_is_sent_under_its_name() {
        assert_eq!(ESTIMATES.map(str::to_owned), DERIVATIVES.map(|name| format!("est_{name}")));
    }
}
