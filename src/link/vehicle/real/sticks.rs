//! Conversion of commands to stick positions: thousandths for PX4, pulse widths for ArduPilot.

use std::ops::RangeInclusive;

use super::parameters::{PULSE, Parameters};
use greylag_physics::Command;

/// Valid scales FW_MAN_R_SC and FW_MAN_P_SC of PX4's manual control. PX4 also allows 0, with which the sticks have no
/// effect. The companion divides by the scale, so 0 is invalid here.
const SCALE: RangeInclusive<f64> = 0.1..=1.0;
/// Valid trims TRIM_ROLL and TRIM_PITCH of PX4, normalised.
const TRIM: RangeInclusive<f64> = -0.5..=0.5;

/// Rounds to integers and carries the remainder over to the next command. The mean of the integers then approaches the mean
/// of the commands.
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

/// Rounding remainders of aileron, elevator and throttle, and the last valid scaling.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sticks {
    remainders: [Rounding; 3],
    /// Pulse widths of channels 1 to 3.
    channels: [Channel; 3],
    /// Scaling of roll and pitch by PX4.
    axes: [Scaling; 2],
}

/// PX4's scaling of an axis in MANUAL: torque = stick · scale + trim.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Scaling {
    scale: f64,
    trim: f64,
}

impl Default for Scaling {
    fn default() -> Self {
        Scaling { scale: 1.0, trim: 0.0 }
    }
}

impl Scaling {
    /// The scaling from the parameters named `scale` and `trim`. PX4's defaults replace unread parameters. `None` if a
    /// value is invalid.
    fn of(parameters: &Parameters, scale: &str, trim: &str) -> Option<Scaling> {
        let scale = parameters.get(scale).unwrap_or(1.0);
        let trim = parameters.get(trim).unwrap_or(0.0);
        (SCALE.contains(&scale) && TRIM.contains(&trim)).then_some(Scaling { scale, trim })
    }
}

/// Pulse widths of a channel, µs.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Channel {
    low: f64,
    centre: f64,
    high: f64,
    reversed: bool,
}

impl Default for Channel {
    fn default() -> Self {
        Channel { low: 1100.0, centre: 1500.0, high: 1900.0, reversed: false }
    }
}

impl Channel {
    /// Channel `number` from its RCn_MIN, RCn_TRIM, RCn_MAX and RCn_REVERSED. ArduPilot's defaults replace unread
    /// parameters. `None` if the values are invalid: an end outside 800 µs to 2200 µs, ends in the wrong order, or a
    /// trim that is not between them.
    fn of(parameters: &Parameters, number: usize) -> Option<Channel> {
        let read = |name: &str| parameters.get(&format!("RC{number}_{name}"));
        let usual = Channel::default();
        let low = read("MIN").unwrap_or(usual.low);
        let high = read("MAX").unwrap_or(usual.high);
        let centre = read("TRIM").unwrap_or_else(|| usual.centre.max(low).min(high));
        let reversed = read("REVERSED").unwrap_or(0.0);
        let valid = PULSE.contains(&low)
            && PULSE.contains(&high)
            && low < high
            && (low..=high).contains(&centre)
            && (reversed == 0.0 || reversed == 1.0);
        valid.then_some(Channel { low, centre, high, reversed: reversed == 1.0 })
    }

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
    /// The axes x (positive nose down), y (positive right) and z (throttle) of MANUAL_CONTROL for `command`, in thousandths.
    ///
    /// In MANUAL, PX4 computes roll torque = y · FW_MAN_R_SC + TRIM_ROLL and pitch torque (nose up) = −x · FW_MAN_P_SC
    /// + TRIM_PITCH. If the controller reports an invalid value in flight, the last valid scaling of the axis is used.
    pub(super) fn thousandths(&mut self, command: &Command, parameters: &Parameters) -> [i16; 3] {
        let names = [("FW_MAN_R_SC", "TRIM_ROLL"), ("FW_MAN_P_SC", "TRIM_PITCH")];
        for (axis, (scale, trim)) in self.axes.iter_mut().zip(names) {
            *axis = Scaling::of(parameters, scale, trim).unwrap_or(*axis);
        }
        let [by_roll, by_pitch] = self.axes;
        let roll = (command.aileron - by_roll.trim) / by_roll.scale;
        let pitch = (command.elevator + by_pitch.trim) / by_pitch.scale;
        let [a, e, t] = &mut self.remainders;
        [
            e.round(1000.0 * pitch, -1000.0, 1000.0) as i16,
            a.round(1000.0 * roll, -1000.0, 1000.0) as i16,
            t.round(1000.0 * command.throttle, 0.0, 1000.0) as i16,
        ]
    }

    /// Pulse widths of channels 1 to 3 (roll, pitch, throttle) for `command`, µs, from RCn_MIN, RCn_TRIM, RCn_MAX and
    /// RCn_REVERSED.
    ///
    /// ArduPilot's pitch channel is positive nose up, the elevator command positive nose down. If the controller
    /// reports an invalid value in flight, the last valid pulse widths of the channel are used.
    pub(super) fn pulses(&mut self, command: &Command, parameters: &Parameters) -> [u16; 3] {
        for (channel, number) in self.channels.iter_mut().zip(1..) {
            *channel = Channel::of(parameters, number).unwrap_or(*channel);
        }
        let [one, two, three] = self.channels;
        let wanted = [
            one.pulse(command.aileron),
            two.pulse(-command.elevator),
            three.range(command.throttle),
        ];
        std::array::from_fn(|i| {
            let Channel { low, high, .. } = self.channels[i];
            self.remainders[i].round(wanted[i], low, high) as u16
        })
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
            // The sum of a thousand rounded commands deviates from the exact sum by at most half a count.
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

    /// Pulse widths of roll, pitch and throttle, µs, at half right aileron, half up elevator and half throttle, without
    /// remainders of earlier commands.
    fn half(sticks: &Sticks, parameters: &Parameters) -> [u16; 3] {
        let command = Command { aileron: 0.5, elevator: -0.5, throttle: 0.5, rudder: 0.0 };
        let mut sticks = Sticks { remainders: Default::default(), ..*sticks };
        sticks.pulses(&command, parameters)
    }

    #[test]
    fn a_channel_that_is_reported_wrongly_in_flight_keeps_its_last_valid_pulses() {
        let reports = [
            ("RC1_MIN", f64::NAN),
            ("RC1_MAX", f64::NAN),
            ("RC1_TRIM", f64::INFINITY),
            ("RC1_MIN", 0.0),
            ("RC1_MIN", -3e38),
            ("RC1_MIN", 1950.0),
            ("RC1_MAX", 3e38),
            ("RC1_MAX", 900.0),
            ("RC1_MAX", 1000.0),
            ("RC1_TRIM", 0.0),
            ("RC1_TRIM", 2100.0),
            ("RC1_REVERSED", 7.0),
            ("RC2_MAX", 0.0),
            ("RC3_MIN", 3e38),
            ("RC3_MAX", f64::NAN),
        ];
        for (name, value) in reports {
            let mut parameters = Parameters::new(Stack::Ardupilot.rules(Authority::Surfaces));
            for n in 1..=3 {
                for (end, pulse) in [("MIN", 1000.0), ("TRIM", 1400.0), ("MAX", 1900.0)] {
                    parameters.take(&format!("RC{n}_{end}"), pulse);
                }
            }
            let mut sticks = Sticks::default();
            sticks.pulses(&Command::IDLE, &parameters);
            parameters.take(name, value);
            sticks.pulses(&Command::IDLE, &parameters);
            assert_eq!(half(&sticks, &parameters), [1650, 1650, 1450], "{name} = {value}");
            // A valid value is used again.
            parameters.take("RC1_MIN", 1000.0);
            parameters.take("RC1_TRIM", 1400.0);
            parameters.take("RC1_MAX", 2000.0);
            parameters.take("RC1_REVERSED", 0.0);
            assert_eq!(half(&sticks, &parameters)[0], 1700, "after {name} = {value}");
        }
    }

    #[test]
    fn a_scaling_of_px4_that_is_reported_wrongly_in_flight_keeps_its_last_valid_values() {
        for (name, value) in [
            ("FW_MAN_R_SC", 0.0),
            ("FW_MAN_R_SC", f64::NAN),
            ("FW_MAN_R_SC", 1e-30),
            ("FW_MAN_P_SC", -1.0),
            ("TRIM_ROLL", 10.0),
            ("TRIM_PITCH", f64::NEG_INFINITY),
        ] {
            let mut parameters = Parameters::new(Stack::Px4.rules(Authority::Surfaces));
            parameters.take("FW_MAN_R_SC", 0.5);
            parameters.take("TRIM_PITCH", 0.1);
            let mut sticks = Sticks::default();
            let mut sent = |parameters: &Parameters, aileron: f64, elevator: f64| {
                let command = Command { aileron, elevator, throttle: 0.0, rudder: 0.0 };
                sticks.thousandths(&command, parameters)
            };
            assert_eq!(sent(&parameters, 0.25, 0.2), [300, 500, 0]);
            parameters.take(name, value);
            // With a scale of 0, zero deflection would be 0 / 0, and the remainder would stay NaN.
            assert_eq!(sent(&parameters, 0.0, -0.1), [0, 0, 0], "{name} = {value}");
            assert_eq!(sent(&parameters, 0.25, 0.2), [300, 500, 0], "{name} = {value}");
        }
    }
}
