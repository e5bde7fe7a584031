//! Checks of the estimates of a diagnosis for physically impossible values: constants of sensors and wind in each flight, and
//! coefficients of the model. If one is impossible, the diagnosis makes no statement about forces and moments.

use crate::diagnose::answer::result::Tuned;
use crate::flight_path::impossible::{SURELY, of_flight};
use crate::flight_path::reconstruction::Reconstruction;
use crate::text::with_interval;

/// A lift slope below this fraction of its prior mean counts as impossible.
const NO_WING: f64 = 0.2;

/// A sentence for each impossible estimate in `flights` and among the coefficients `tuned`, with advice on what to check.
pub fn impossible(flights: &[&Reconstruction], tuned: &[Tuned]) -> Vec<String> {
    let of_coefficient = |t: &Tuned| coefficient(t, flights.len());
    let constants = flights.iter().flat_map(|flight| of_flight(flight));
    constants.chain(tuned.iter().filter_map(of_coefficient)).collect()
}

/// A sentence on a damping derivative with the wrong sign or on a lift slope near zero; `None` for any other estimate. `flights`
/// is the number of flights to which the coefficient was fitted.
fn coefficient(t: &Tuned, flights: usize) -> Option<String> {
    let own = t.name.rsplit('.').next()?;
    let damps = ["Cmq", "Clp", "Cnr"].contains(&own);
    let drives = damps && t.prior < 0.0 && t.value - SURELY * t.sd > 0.0;
    let no_wing = own == "CLalpha" && t.value + SURELY * t.sd < NO_WING * t.prior;
    let why = match (drives, no_wing) {
        (true, _) if flights == 1 => {
            "a damping that drives. On a single flight a missing effect can cause it: diagnose several flights together. If it \
             stays, look for a hover, a wrong axis or sign, or a clock that is off"
        }
        (true, _) => {
            "a damping that drives; look for a hover, a wrong axis or sign, or a clock that is off"
        }
        (_, true) => {
            "a wing that hardly lifts; look at airspeed and angle of attack, or for a hover"
        }
        _ => return None,
    };
    Some(format!("{} is tuned to {}: {why}.", t.name, with_interval(t.value, t.sd, "")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damping_that_drives_and_a_wing_that_does_not_lift_are_said() {
        let of = |name: &str, prior, value| Tuned {
            name: name.into(),
            prior,
            prior_sd: 0.1,
            value,
            sd: 0.05,
        };
        let one = coefficient(&of("pitch_linear.Cmq", -1.0, 1.6), 1).unwrap();
        let two = coefficient(&of("pitch_linear.Cmq", -1.0, 1.6), 2).unwrap();
        assert!(one.contains("several flights") && !two.contains("several flights"));
        assert!(coefficient(&of("pitch_linear.Cmq", -1.0, 0.1), 1).is_none());
        assert!(coefficient(&of("lift_linear.CLalpha", 5.3, 0.24), 1).is_some());
        assert!(coefficient(&of("lift_linear.CLalpha", 5.3, 4.0), 1).is_none());
    }
}
