//! The model monitor of the pilot: channels that depart from the model are reported to the ground stations.

use super::Pilot;
use crate::monitor::Monitor;
use greylag_link::autopilot::Severity;
use greylag_link::vehicle::Telemetry;

impl Pilot {
    /// Compares what is measured with what `monitor` predicts from now on, whenever the aircraft is flown.
    pub fn monitor_with(&mut self, monitor: Monitor) {
        self.monitor = Some(monitor);
    }

    /// Takes a state whose surfaces are known, once its command is out: no command depends on it.
    pub fn monitor(&mut self, frame: &Telemetry) {
        let Some(monitor) = &mut self.monitor else { return };
        if !self.armed {
            return monitor.forget();
        }
        if let Some(warning) = monitor.see(frame) {
            self.texts.say(Severity::Warning, warning.to_string());
        }
    }

    /// The surfaces are not known to do what is commanded: earlier residuals say nothing of what comes.
    pub fn forget_residuals(&mut self) {
        if let Some(monitor) = &mut self.monitor {
            monitor.forget();
        }
    }

    /// Residuals by their bands, in the order of the monitor's channels; NaN when not known.
    pub fn residual_shares(&self) -> [f64; 6] {
        self.monitor.as_ref().map_or([f64::NAN; 6], Monitor::shares)
    }
}
