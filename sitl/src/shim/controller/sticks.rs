//! Converts sticks to actuator commands in MANUAL, as each stack does.

use super::Personality;
use super::parameters::Table;
use crate::plant::Inputs;
use crate::shim::codec::{ManualControl, RcChannelsOverride};

/// Stick positions received last, with their times in µs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sticks {
    manual: Option<(u64, [i16; 3])>,
    channels: Option<(u64, [u16; 3])>,
    /// Time of the last override, µs; it is kept after the channels are released.
    overridden: Option<u64>,
    /// Start of the present uninterrupted stream of MANUAL_CONTROL, µs; `None` before the first message.
    since: Option<u64>,
}

/// Gap that ends a stream of MANUAL_CONTROL, µs: PX4's default of COM_RC_LOSS_T.
const GAP_US: u64 = 500_000;
/// Pulse width in RC_CHANNELS_OVERRIDE that leaves a channel unchanged.
const UNCHANGED: u16 = u16::MAX;

impl Sticks {
    pub(super) fn manual(&mut self, now_us: u64, m: &ManualControl) {
        let goes_on = self.manual.is_some_and(|(at, _)| now_us.saturating_sub(at) <= GAP_US);
        self.since = self.since.filter(|_| goes_on).or(Some(now_us));
        self.manual = Some((now_us, [m.x, m.y, m.z]));
    }

    /// Time since the stream of MANUAL_CONTROL began, s; `None` before the first message.
    pub(super) fn steady_s(&self, now_us: u64) -> Option<f64> {
        self.since.map(|at| now_us.saturating_sub(at) as f64 * 1e-6)
    }

    /// Stores an override. The value 0 in one of the first three channels releases all three to the RC transmitter. The
    /// value 65535 leaves a channel unchanged.
    pub(super) fn override_channels(&mut self, now_us: u64, m: &RcChannelsOverride) {
        let [one, two, three, ..] = m.channel;
        let sent = [one, two, three];
        if sent == [UNCHANGED; 3] {
            return;
        }
        let before = self.channels.map_or(super::RADIO_US, |(_, pulses)| pulses);
        let pulses =
            std::array::from_fn(|i| if sent[i] == UNCHANGED { before[i] } else { sent[i] });
        self.channels = (!sent.contains(&0)).then_some((now_us, pulses));
        self.overridden = self.channels.map(|(at, _)| at).or(self.overridden);
    }

    /// Time since the last override, s; `None` before the first.
    pub(super) fn overridden_s(&self, now_us: u64) -> Option<f64> {
        self.overridden.map(|at| now_us.saturating_sub(at) as f64 * 1e-6)
    }

    /// Time since the last stick message, s; `None` before the first or after the channels were released.
    pub(super) fn age_s(&self, now_us: u64) -> Option<f64> {
        let manual = self.manual.map(|(at, _)| at);
        let channels = self.channels.map(|(at, _)| at);
        manual.or(channels).map(|at| now_us.saturating_sub(at) as f64 * 1e-6)
    }

    /// Actuator command from the sticks; `standing` if no stick message is in force.
    pub(super) fn inputs(
        &self,
        personality: Personality,
        parameters: &Table,
        standing: Inputs,
    ) -> Inputs {
        match personality {
            Personality::Px4 => self.manual.map_or(standing, |(_, s)| px4(s, parameters)),
            Personality::Ardupilot => {
                self.channels.map_or(standing, |(_, s)| ardupilot(s, parameters))
            }
        }
    }
}

/// PX4's torque setpoints in MANUAL: stick times scale plus trim. A nose-up torque moves the elevator up (negative).
fn px4([x, y, z]: [i16; 3], parameters: &Table) -> Inputs {
    let stick = |thousandths: i16| f64::from(thousandths) / 1000.0;
    let roll = stick(y) * parameters.get("FW_MAN_R_SC") + parameters.get("TRIM_ROLL");
    let pitch = -stick(x) * parameters.get("FW_MAN_P_SC") + parameters.get("TRIM_PITCH");
    // PWM_MAIN_REV has one bit per output. It reverses the sticks but not the attitude loops, which simulates a wrong sign
    // between stick and surface.
    let reversed = parameters.get("PWM_MAIN_REV") as u32;
    let sign = |output: u32| if reversed >> output & 1 == 1 { -1.0 } else { 1.0 };
    Inputs { aileron: sign(0) * roll, elevator: -sign(1) * pitch, throttle: stick(z), rudder: 0.0 }
        .clamped()
}

/// Surfaces at neutral and throttle closed.
pub(super) fn released() -> Inputs {
    Inputs { aileron: 0.0, elevator: 0.0, throttle: 0.0, rudder: 0.0 }
}

/// Converts the pulse widths of ArduPilot's channels to commands by the channels' calibration: angles in steps of
/// 1/4500 of full travel, throttle in whole percent.
pub(super) fn ardupilot(pulses: [u16; 3], parameters: &Table) -> Inputs {
    let read = |channel: usize, name: &str| parameters.get(&format!("RC{channel}_{name}"));
    let angle = |channel: usize| {
        let pulse = f64::from(pulses[channel - 1]);
        let trim = read(channel, "TRIM");
        let end = if pulse > trim { read(channel, "MAX") } else { read(channel, "MIN") };
        // a channel without travel stays neutral, as in ArduPilot
        let share = if end == trim { 0.0 } else { (pulse - trim) / (end - trim).abs() };
        let sign = if read(channel, "REVERSED") == 1.0 { -1.0 } else { 1.0 };
        (4500.0 * sign * share.clamp(-1.0, 1.0)).trunc() / 4500.0
    };
    let (low, high) = (read(3, "MIN"), read(3, "MAX"));
    let throttle = match high > low {
        true => ((f64::from(pulses[2]) - low) / (high - low)).clamp(0.0, 1.0),
        false => 0.0,
    };
    let throttle = (100.0 * throttle).trunc() / 100.0;
    // ArduPilot's pitch input is positive nose up.
    let sign = |name: &str| if parameters.get(name) == 1.0 { -1.0 } else { 1.0 };
    Inputs {
        aileron: sign("SERVO1_REVERSED") * angle(1),
        elevator: -sign("SERVO2_REVERSED") * angle(2),
        throttle,
        rudder: 0.0,
    }
    .clamped()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn overridden(all: &[[u16; 3]], changed: &[(&str, f64)]) -> Inputs {
        let changed: Vec<_> = changed.iter().map(|(name, x)| ((*name).to_owned(), *x)).collect();
        let parameters = Table::new(Personality::Ardupilot, &changed).unwrap();
        let mut sticks = Sticks::default();
        for pulses in all {
            let mut message = RcChannelsOverride::default();
            message.channel[..3].copy_from_slice(pulses);
            sticks.override_channels(0, &message);
        }
        sticks.inputs(Personality::Ardupilot, &parameters, Inputs::default())
    }

    #[test]
    fn a_channel_that_is_left_unchanged_keeps_its_pulse() {
        let full = overridden(&[[2000, 1507, 1500], [u16::MAX, 1507, u16::MAX]], &[]);
        assert_eq!((full.aileron, full.throttle), (1.0, 0.5));
        let first = overridden(&[[u16::MAX, 1507, 1500]], &[]);
        assert!(first.aileron.abs() < 0.02, "{first:?}");
        assert_eq!(overridden(&[[u16::MAX; 3]], &[]), Inputs::default());
    }

    #[test]
    fn a_channel_without_travel_is_neutral() {
        let changed = [("RC1_MIN", 1494.0), ("RC3_MAX", 1000.0)];
        let inputs = overridden(&[[1494, 1507, 1000]], &changed);
        assert_eq!((inputs.aileron, inputs.throttle), (0.0, 0.0));
    }
}
