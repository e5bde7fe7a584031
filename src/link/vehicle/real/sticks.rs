//! Conversion of commands to stick positions: thousandths for PX4, pulse widths for ArduPilot.

use super::parameters::Parameters;
use greylag_physics::Command;

/// Rounds to integers and carries the remainder over to the next command. The mean is then exact.
#[derive(Clone, Copy, Debug, Default)]
struct Rounding(f64);

impl Rounding {
    fn round(&mut self, wanted: f64, low: f64, high: f64) -> f64 {
        let whole = (wanted + self.0).round().clamp(low, high);
        // the part of the command beyond the limit is not carried over
        self.0 = (wanted + self.0 - whole).clamp(-0.5, 0.5);
        whole
    }
}

/// Rounding remainders of aileron, elevator, throttle.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sticks([Rounding; 3]);

/// Pulse widths of a channel, µs.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Channel {
    low: f64,
    centre: f64,
    high: f64,
    reversed: bool,
}

impl Channel {
    /// Pulse width for a deflection of −1..1, before rounding.
    fn pulse(&self, deflection: f64) -> f64 {
        let x = if self.reversed { -deflection } else { deflection };
        let half = if x > 0.0 { self.high - self.centre } else { self.centre - self.low };
        self.centre + half * x
    }

    /// Pulse width for a throttle of 0..1, before rounding.
    fn range(&self, throttle: f64) -> f64 {
        let share = if self.reversed { 1.0 - throttle } else { throttle };
        self.low + (self.high - self.low) * share
    }
}

impl Sticks {
    /// Axes of MANUAL_CONTROL in thousandths: x (positive nose down), y (positive right), z (throttle).
    ///
    /// In MANUAL, PX4 computes roll torque = y · FW_MAN_R_SC + TRIM_ROLL and pitch torque (nose up) = −x · FW_MAN_P_SC
    /// + TRIM_PITCH.
    pub(super) fn thousandths(&mut self, command: &Command, parameters: &Parameters) -> [i16; 3] {
        let read = |name: &str, default: f64| parameters.get(name).unwrap_or(default);
        let roll = (command.aileron - read("TRIM_ROLL", 0.0)) / read("FW_MAN_R_SC", 1.0);
        let pitch = (command.elevator + read("TRIM_PITCH", 0.0)) / read("FW_MAN_P_SC", 1.0);
        let [a, e, t] = &mut self.0;
        [
            e.round(1000.0 * pitch, -1000.0, 1000.0) as i16,
            a.round(1000.0 * roll, -1000.0, 1000.0) as i16,
            t.round(1000.0 * command.throttle, 0.0, 1000.0) as i16,
        ]
    }

    /// Pulse widths of channels 1 to 3 (roll, pitch, throttle), µs, from RCn_MIN, RCn_TRIM, RCn_MAX, RCn_REVERSED.
    ///
    /// ArduPilot's pitch channel is positive nose up, the elevator command positive nose down.
    pub(super) fn pulses(&mut self, command: &Command, parameters: &Parameters) -> [u16; 3] {
        let [one, two, three] = [1, 2, 3].map(|n| channel(n, parameters));
        let wanted = [
            one.pulse(command.aileron),
            two.pulse(-command.elevator),
            three.range(command.throttle),
        ];
        let channels = [one, two, three];
        std::array::from_fn(|i| {
            self.0[i].round(wanted[i], channels[i].low, channels[i].high) as u16
        })
    }
}

fn channel(number: usize, parameters: &Parameters) -> Channel {
    let read =
        |name: &str, default: f64| parameters.get(&format!("RC{number}_{name}")).unwrap_or(default);
    let (low, high) = (read("MIN", 1100.0), read("MAX", 1900.0));
    Channel {
        low,
        centre: read("TRIM", 1500.0).clamp(low, high.max(low)),
        high: high.max(low),
        reversed: read("REVERSED", 0.0) == 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::super::profile::{Authority, Stack};
    use super::*;

    #[test]
    fn the_mean_of_what_is_sent_is_what_was_meant() {
        let parameters = Parameters::new(Stack::Px4.rules(Authority::Surfaces));
        let command =
            Command { aileron: 0.123_45, elevator: -0.067_89, throttle: 0.333_33, rudder: 0.0 };
        let mut sticks = Sticks::default();
        let mut sums = [0.0; 3];
        for _ in 0..1000 {
            let sent = sticks.thousandths(&command, &parameters);
            sums.iter_mut().zip(sent).for_each(|(sum, x)| *sum += f64::from(x));
        }
        for (sum, wanted) in sums.iter().zip([command.elevator, command.aileron, command.throttle])
        {
            // Rounding errs by at most half a count over a thousand commands.
            assert!((sum * 1e-6 - wanted).abs() < 1e-6, "{sum} for {wanted}");
        }
    }

    #[test]
    fn pulses_follow_the_channels_ends_trim_and_reversal() {
        let mut parameters = Parameters::new(Stack::Ardupilot.rules(Authority::Surfaces));
        for (name, value) in [
            ("RC1_MIN", 1000.0),
            ("RC1_TRIM", 1450.0),
            ("RC1_MAX", 2000.0),
            ("RC1_REVERSED", 1.0),
            ("RC2_MIN", 1100.0),
            ("RC2_TRIM", 1500.0),
            ("RC2_MAX", 1900.0),
            ("RC2_REVERSED", 0.0),
            ("RC3_MIN", 1000.0),
            ("RC3_MAX", 2000.0),
            ("RC3_REVERSED", 0.0),
        ] {
            parameters.take(name, value);
        }
        let sent = |aileron: f64, elevator: f64, throttle: f64| {
            Sticks::default()
                .pulses(&Command { aileron, elevator, throttle, rudder: 0.0 }, &parameters)
        };
        assert_eq!(sent(0.0, 0.0, 0.0), [1450, 1500, 1000]);
        // Right aileron on a reversed channel is a shorter pulse. Elevator down is stick forward.
        assert_eq!(sent(1.0, 1.0, 1.0), [1000, 1100, 2000]);
        assert_eq!(sent(-1.0, -0.5, 0.25), [2000, 1700, 1250]);
    }

    #[test]
    fn full_deflection_is_full_stick_and_px4s_trims_are_taken_off() {
        let mut parameters = Parameters::new(Stack::Px4.rules(Authority::Surfaces));
        let sent = |parameters: &Parameters, aileron: f64, elevator: f64, throttle: f64| {
            let command = Command { aileron, elevator, throttle, rudder: 0.0 };
            Sticks::default().thousandths(&command, parameters)
        };
        assert_eq!(sent(&parameters, 1.0, 1.0, 1.0), [1000; 3]);
        assert_eq!(sent(&parameters, -1.0, -1.0, 0.0), [-1000, -1000, 0]);
        for (name, value) in
            [("TRIM_ROLL", 0.1), ("TRIM_PITCH", -0.05), ("FW_MAN_R_SC", 0.5), ("FW_MAN_P_SC", 0.8)]
        {
            parameters.take(name, value);
        }
        // (0.3 − 0.1) / 0.5 and (0.25 − 0.05) / 0.8
        assert_eq!(sent(&parameters, 0.3, 0.25, 0.5), [250, 400, 500]);
    }

    #[test]
    fn half_of_a_deflection_is_half_of_its_own_side_of_the_channel() {
        let mut parameters = Parameters::new(Stack::Ardupilot.rules(Authority::Surfaces));
        for (name, value) in [
            ("RC1_MIN", 1000.0),
            ("RC1_TRIM", 1400.0),
            ("RC1_MAX", 2000.0),
            ("RC3_MIN", 1000.0),
            ("RC3_MAX", 2000.0),
            ("RC3_REVERSED", 1.0),
        ] {
            parameters.take(name, value);
        }
        let sent = |aileron: f64, throttle: f64| {
            let command = Command { aileron, elevator: 0.0, throttle, rudder: 0.0 };
            let [roll, _, throttle] = Sticks::default().pulses(&command, &parameters);
            (roll, throttle)
        };
        // The throttle channel is reversed: idle is the longest pulse.
        assert_eq!(sent(-0.5, 0.0), (1200, 2000));
        assert_eq!(sent(0.5, 0.25), (1700, 1750));
        assert_eq!(sent(0.0, 1.0), (1400, 1000));
    }
}
