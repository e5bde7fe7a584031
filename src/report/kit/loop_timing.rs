//! Computing times of the cycles of the control loop.

/// One cycle of the control loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// End of the cycle, s, on the flight's clock.
    pub time_s: f64,
    /// Duration of the cycle, µs.
    pub duration_us: f64,
}

/// Durations of all cycles of the control loop, with their budget.
#[derive(Clone, Debug)]
pub struct LoopTiming {
    /// Name of the timed interval, such as "state frame to actuator command".
    pub measure: String,
    /// Largest permitted duration of a cycle, µs. A longer cycle is late.
    pub budget_us: f64,
    /// The cycles, in time order.
    pub cycles: Vec<Cycle>,
}

impl LoopTiming {
    /// Number of cycles longer than the budget.
    pub fn late(&self) -> usize {
        self.cycles.iter().filter(|c| c.duration_us > self.budget_us).count()
    }

    /// Quantiles of the cycle duration, µs, at the probabilities `shares` (0..1), by nearest rank; NaN without cycles.
    pub fn percentiles_us<const N: usize>(&self, shares: [f64; N]) -> [f64; N] {
        let mut sorted: Vec<f64> =
            self.cycles.iter().map(|c| c.duration_us).filter(|d| d.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        shares.map(|share| {
            let rank = (share * sorted.len() as f64).ceil() as usize;
            sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(durations_us: impl IntoIterator<Item = f64>) -> LoopTiming {
        let cycle = |duration_us| Cycle { time_s: 0.0, duration_us };
        LoopTiming {
            measure: "test".into(),
            budget_us: 990.0,
            cycles: durations_us.into_iter().map(cycle).collect(),
        }
    }

    #[test]
    fn percentiles_are_nearest_ranks() {
        // The durations are 1 to 1000, so each duration equals its rank.
        let timing = timing((1..=1000).rev().map(f64::from));
        assert_eq!(timing.percentiles_us([0.5, 0.99, 0.999, 1.0]), [500.0, 990.0, 999.0, 1000.0]);
        assert_eq!(timing.late(), 10);
    }

    #[test]
    fn no_cycle_has_no_percentile() {
        assert!(timing([]).percentiles_us([0.5])[0].is_nan());
    }
}
