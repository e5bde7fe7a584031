//! Reader of the log that XFLR5 writes in a stability analysis. It has derivatives with respect to α, β, pb/2V, qc/2V, rb/2V and
//! one control, in stability axes.
//!
//! The log has no reference area, chord and span. The user adds them as `Sref = …`, `Cref = …` and `Bref = …`. The analysis is
//! made at trim: the lift balances the weight at the log's airspeed, and the pitching moment is zero.

use super::numbers::Numbers;
use super::{Column, Control, Derivatives, DerivativesError, Tool, about_body, to_body};
use greylag_physics::atmosphere::{SEA_LEVEL_DENSITY, STANDARD_GRAVITY};

const FROM: &str = "it stands in the log of XFLR5's stability analysis (\"Longitudinal derivatives\" and below), and \
                    Sref, Cref and Bref are to be added on top as \"Sref = 0.45\"";

/// Whether `text` is a log of XFLR5.
pub(super) fn is_here(text: &str) -> bool {
    text.contains("Longitudinal derivatives") && text.contains("CLa=")
}

pub(super) fn read(text: &str) -> Result<Derivatives, DerivativesError> {
    let numbers = Numbers::read(text)?;
    let need = |name: &str| numbers.need(name, FROM);
    let alpha = need("Alpha")?.to_radians();
    let reference = numbers.reference(FROM)?;
    // the log omits the derivatives that are zero for a symmetric aircraft
    let stability = |values: [Option<f64>; 5]| -> Column {
        to_body(values.map(Option::unwrap_or_default), alpha)
    };
    let by_alpha = stability([None, Some(need("CLa")?), None, Some(need("Cma")?), None]);
    let lateral = |suffix: &str| -> Result<Column, DerivativesError> {
        let [side, roll, yaw] = ["CY", "Cl", "Cn"].map(|n| need(&format!("{n}{suffix}")));
        Ok(stability([Some(side?), None, Some(roll?), None, Some(yaw?)]))
    };
    let pitch = stability([None, Some(need("CLq")?), None, Some(need("Cmq")?), None]);
    let rates = [lateral("p")?, pitch, lateral("r")?];
    let pressure = 0.5 * SEA_LEVEL_DENSITY * need("VInf")?.powi(2);
    let lift = need("Mass")? * STANDARD_GRAVITY / (pressure * reference[0]);
    let mut notes = vec![format!(
        "the lift coefficient {lift:.3} is that which carries the log's mass at its speed at sea level, the pitching \
         moment of its trim is zero"
    )];
    let runs = text.matches("Longitudinal derivatives").count();
    if runs > 1 {
        notes.push(format!("the log has {runs} analyses: the first is read"));
    }
    Ok(Derivatives {
        tool: Tool::Xflr5,
        reference,
        point: numbers.get("CoG_x").map(|x| [x, numbers.get("CoG_z").unwrap_or(0.0)]),
        alpha,
        totals: [lift, 0.0],
        by_alpha,
        by_beta: lateral("b")?,
        by_rates: about_body(rates, alpha),
        controls: control(&numbers, alpha, &mut notes).into_iter().collect(),
        notes,
    })
}

/// The control whose derivatives the log has. The log does not name it: it is taken for the aileron, the elevator or the rudder,
/// depending on whether its rolling, pitching or yawing moment is largest. `None` if the log has no control derivatives.
fn control(numbers: &Numbers, alpha: f64, notes: &mut Vec<String>) -> Option<Control> {
    let get = |name: &str| numbers.get(name).unwrap_or(0.0);
    let moments = [get("CLde"), get("CMde"), get("CNde")];
    let names = ["aileron", "elevator", "rudder"];
    let (name, size) =
        names.iter().zip(moments.map(f64::abs)).max_by(|a, b| a.1.total_cmp(&b.1))?;
    if size < 1e-4 {
        notes.push(
            "the log has no control derivatives: give the plane a control gain and run it again"
                .into(),
        );
        return None;
    }
    notes.push(format!(
        "the log's one control is taken for the {name}: it makes most of that moment. XFLR5 writes one control a run; the others are textbook estimates"
    ));
    let column = [get("CYde"), -get("CZde"), moments[0], moments[1], moments[2]];
    Some(Control { name: (*name).to_owned(), column: to_body(column, alpha) })
}
