//! The pilot's model monitor: deviations are reported to the ground stations.

use super::Pilot;
use crate::monitor::Monitor;
use greylag_link::autopilot::Severity;
use greylag_link::vehicle::Telemetry;

impl Pilot {
    /// Compares measurements with the predictions of `monitor` from now on, while armed.
    pub fn monitor_with(&mut self, monitor: Monitor) {
        self.monitor = Some(monitor);
    }

    /// Takes a state with known surfaces, after its command is out: no command depends on it.
    pub fn monitor(&mut self, frame: &Telemetry) {
        let Some(monitor) = &mut self.monitor else { return };
        if !self.armed {
            return monitor.forget();
        }
        if let Some(warning) = monitor.see(frame) {
            self.texts.say(Severity::Warning, warning.to_string());
        }
    }

    /// Clears the monitor, as when the surfaces do not follow the commands.
    pub fn forget_residuals(&mut self) {
        if let Some(monitor) = &mut self.monitor {
            monitor.forget();
        }
    }

    /// Residuals divided by their bands, in the order of the monitor's channels; NaN when unknown.
    pub fn residual_shares(&self) -> [f64; 6] {
        self.monitor.as_ref().map_or([f64::NAN; 6], Monitor::shares)
    }
}
