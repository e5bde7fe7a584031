//! Whether there is enough of everything to steer by surfaces: states that arrive, cycles that run.

use std::time::Duration;

/// Counted over windows of this length.
const WINDOW: Duration = Duration::from_millis(500);
/// States and cycles are due this often, Hz.
const RATE: f64 = 100.0;
/// Below this share of them the controller flies better by itself.
const LEAST: f64 = 0.4;

/// The watchdog of steering by surfaces: states and cycles counted in the window that is open.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pulse {
    since: Option<Duration>,
    states: u32,
    cycles: u32,
}

impl Pulse {
    /// A new state has come.
    pub(super) fn state(&mut self) {
        self.states += 1;
    }

    /// Nobody steers: what was counted does not matter.
    pub(super) fn rest(&mut self) {
        *self = Pulse::default();
    }

    /// A cycle at `host`; what there was too little of in the window that it closes.
    pub(super) fn cycle(&mut self, host: Duration) -> Option<String> {
        self.cycles += 1;
        let since = *self.since.get_or_insert(host);
        let length = host.saturating_sub(since);
        if length < WINDOW {
            return None;
        }
        let Pulse { states, cycles, .. } = std::mem::take(self);
        self.since = Some(host);
        let due = RATE * length.as_secs_f64();
        let little = |count: u32| f64::from(count) < LEAST * due;
        let counted = |count: u32, what: &str| {
            let ms = length.as_millis();
            Some(format!("only {count} of {due:.0} {what} in {ms} ms"))
        };
        match (little(cycles), little(states)) {
            (true, _) => counted(cycles, "cycles of this computer"),
            (false, true) => counted(states, "states of the vehicle"),
            (false, false) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a second of cycles every `cycle_ms` says, every `state`-th of them with a state.
    fn second(cycle_ms: u64, state: u64) -> Option<String> {
        let mut pulse = Pulse::default();
        (0..1000 / cycle_ms).find_map(|i| {
            if i.is_multiple_of(state) {
                pulse.state();
            }
            pulse.cycle(Duration::from_millis(cycle_ms * i))
        })
    }

    #[test]
    fn half_of_states_and_cycles_is_enough_and_a_third_is_not() {
        assert_eq!(second(10, 1), None);
        assert_eq!(second(10, 2), None);
        assert_eq!(second(20, 1), None);
        assert!(second(10, 3).unwrap().contains("of 50 states"));
        assert!(second(30, 1).unwrap().contains("cycles of this computer"));
    }
}
