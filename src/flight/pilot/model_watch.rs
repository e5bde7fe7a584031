//! The pilot's use of the model monitor: deviations are reported to the ground stations.

use super::Pilot;
use crate::monitor::Monitor;
use greylag_link::autopilot::Severity;
use greylag_link::vehicle::Telemetry;

impl Pilot {
    /// Sets the model monitor. From now on it compares measurements with its predictions while the pilot is armed.
    pub fn monitor_with(&mut self, monitor: Monitor) {
        self.monitor = Some(monitor);
    }

    /// Compares a state with known surface positions. To be called after its command is sent: no command depends on the
    /// result.
    pub fn monitor(&mut self, frame: &Telemetry) {
        let Some(monitor) = &mut self.monitor else { return };
        if !self.armed {
            return monitor.forget();
        }
        if let Some(warning) = monitor.see(frame) {
            self.texts.say(Severity::Warning, warning.to_string());
        }
    }

    /// Clears the monitor, for instance when the surfaces do not follow the commands.
    pub fn forget_residuals(&mut self) {
        if let Some(monitor) = &mut self.monitor {
            monitor.forget();
        }
    }

    /// Residuals divided by the half widths of their bands, dimensionless, in the order of the monitor's channels; NaN
    /// if unknown.
    pub fn residual_shares(&self) -> [f64; 6] {
        self.monitor.as_ref().map_or([f64::NAN; 6], Monitor::shares)
    }
}
