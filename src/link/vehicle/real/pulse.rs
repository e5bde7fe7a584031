//! Watchdog for flights in which the companion commands the surfaces. It checks the rates of received states and of executed
//! control cycles, and the fraction of lost frames. If a check fails, control authority is returned to the flight controller.

use std::time::Duration;

/// Length of a counting window.
const WINDOW: Duration = Duration::from_millis(500);
/// Nominal rate of states and of control cycles, Hz.
const RATE: f64 = 100.0;
/// Fraction of the nominal rate below which control authority is returned.
const LEAST: f64 = 0.4;

/// Largest fraction of lost frames in a counting window. Two consecutive windows above it fail the check. The companion's
/// commands are probably lost at the same rate, and the loop oscillates if only every fourth command reaches the surfaces. A
/// single gap of 0.2 s exceeds the limit in one window at most.
const LOSSY: f64 = 0.35;

/// Counters of states and control cycles in the present window.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pulse {
    since: Option<Duration>,
    states: u32,
    cycles: u32,
    /// Total numbers of frames received and lost, at the window's start.
    before: Option<[u64; 2]>,
    /// Whether too many frames were lost in the previous window.
    lossy: bool,
}

impl Pulse {
    /// Counts a new state.
    pub(super) fn state(&mut self) {
        self.states += 1;
    }

    /// Resets the counters while the companion has no control authority.
    pub(super) fn rest(&mut self) {
        *self = Pulse::default();
    }

    /// Counts a control cycle at the time `host`. If this ends a window with too few cycles or states, or the second window in
    /// succession with too many lost frames, returns a text about it; otherwise `None`. `frames` are the total numbers of frames
    /// received and lost.
    pub(super) fn cycle(&mut self, host: Duration, frames: [u64; 2]) -> Option<String> {
        self.cycles += 1;
        let before = *self.before.get_or_insert(frames);
        let since = *self.since.get_or_insert(host);
        let length = host.saturating_sub(since);
        if length < WINDOW {
            return None;
        }
        let [received, lost] = [0, 1].map(|k| frames[k].saturating_sub(before[k]) as f64);
        let lossy = lost > LOSSY * (lost + received);
        let next = Pulse { since: Some(host), before: Some(frames), lossy, ..Pulse::default() };
        let Pulse { states, cycles, lossy: lossy_before, .. } = std::mem::replace(self, next);
        let due = RATE * length.as_secs_f64();
        let little = |count: u32| f64::from(count) < LEAST * due;
        let counted = |count: u32, what: &str| {
            let ms = length.as_millis();
            Some(format!("only {count} of {due:.0} {what} in {ms} ms"))
        };
        match (little(cycles), little(states)) {
            (true, _) => counted(cycles, "cycles of this computer"),
            (false, true) => counted(states, "states of the vehicle"),
            (false, false) if lossy && lossy_before => {
                let share = 100.0 * lost / (lost + received);
                Some(format!("the link loses {share:.0} % of the frames"))
            }
            (false, false) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Text that is returned within 1 s, with a cycle every `cycle_ms` and a state in every `state`-th cycle.
    fn second(cycle_ms: u64, state: u64) -> Option<String> {
        let mut pulse = Pulse::default();
        (0..1000 / cycle_ms).find_map(|i| {
            if i.is_multiple_of(state) {
                pulse.state();
            }
            pulse.cycle(Duration::from_millis(cycle_ms * i), [0, 0])
        })
    }

    /// Text that is returned within 2 s, with `lost` of ten frames lost from `from_ms` to `to_ms`.
    fn lossy(lost: u64, from_ms: u64, to_ms: u64) -> Option<String> {
        let mut pulse = Pulse::default();
        let mut frames = [0, 0];
        (0..200).find_map(|i| {
            let at_ms = 10 * i;
            let gone = if (from_ms..to_ms).contains(&at_ms) { lost } else { 0 };
            frames = [frames[0] + 10 - gone, frames[1] + gone];
            pulse.state();
            pulse.cycle(Duration::from_millis(at_ms), frames)
        })
    }

    #[test]
    fn a_link_that_loses_frames_is_left_and_one_with_a_gap_is_not() {
        assert_eq!(lossy(3, 0, 2000), None);
        assert_eq!(lossy(10, 400, 600), None);
        assert_eq!(lossy(10, 600, 800), None);
        assert!(lossy(5, 300, 2000).unwrap().contains("50 % of the frames"));
    }

    #[test]
    fn half_of_states_and_cycles_is_enough_and_a_third_is_not() {
        assert_eq!(second(10, 1), None);
        assert_eq!(second(10, 2), None);
        assert_eq!(second(20, 1), None);
        assert!(second(10, 3).unwrap().contains("of 50 states"));
        assert!(second(30, 1).unwrap().contains("cycles of this computer"));
    }

    #[test]
    fn each_window_begins_where_the_last_ended() {
        // No state from the second window on. The shortage is reported when this window closes, at 1 s.
        let mut pulse = Pulse::default();
        let said = (0..200).find_map(|i| {
            if i <= 50 {
                pulse.state();
            }
            let words = pulse.cycle(Duration::from_millis(10 * i), [0, 0])?;
            Some((10 * i, words))
        });
        let (at_ms, words) = said.unwrap();
        assert!(at_ms == 1000 && words.contains("only 0 of 50 states"), "{at_ms} ms: {words}");
    }
}
