//! The engine of an aircraft that is exported to JSBSim: thrust as an external force, with its lag, its lever arm and the
//! engine's torque.

use super::{FT, LBF, THROTTLE, coefficient, product};
use crate::GreyBox;
use greylag_num::Grid;

const SPEED: &str = "velocities/vt-fps";
/// JSBSim property with the lagged throttle, which drives the engine if the thrust has a lag.
const LATE_THROTTLE: &str = "fcs/engine-throttle-norm";
const LAG: &str = "thrust_lag.tau_s";
const DENSITY: &str = "fcs/density-ratio";
/// Coefficient by which the thrust table is multiplied.
const TABLE: &str = "thrust_table.k";
const ARM: &str = "thrust_line_offset.z_m";
const TORQUE: &str = "motor_torque.k_nm";

/// Terms of the thrust: name of the model's coefficient, and the JSBSim properties by which it is multiplied. JSBSim's airspeed
/// is in ft/s.
const THRUST: &[(&str, &[&str])] = &[
    ("thrust_linear.Cp_n", &[THROTTLE]),
    ("propeller.T0_n", &[DENSITY]),
    ("propeller.Tt_n", &[DENSITY, THROTTLE]),
    ("propeller.Ttt_n", &[DENSITY, THROTTLE, THROTTLE]),
    ("propeller.TV_nspm", &[DENSITY, SPEED]),
    ("propeller.TtV_nspm", &[DENSITY, THROTTLE, SPEED]),
    ("propeller.TVV_ns2pm2", &[DENSITY, SPEED, SPEED]),
];

/// Whether the exported engine uses the model's coefficient `name`.
pub(super) fn knows(name: &str) -> bool {
    THRUST.iter().any(|(term, _)| *term == name) || [TABLE, LAG, ARM, TORQUE].contains(&name)
}

/// JSBSim property with the throttle that drives the engine of `model`.
fn throttle(model: &GreyBox) -> &'static str {
    if coefficient(model, LAG) > 0.0 { LATE_THROTTLE } else { THROTTLE }
}

/// XML of the lag filter from the actuator's throttle position to the throttle that drives the engine. Empty if the thrust has
/// no lag.
pub(super) fn lag(model: &GreyBox) -> String {
    let lag = coefficient(model, LAG);
    if lag <= 0.0 {
        return String::new();
    }
    format!(
        "      <lag_filter name=\"fcs/engine-lag\">\n        <input> {THROTTLE} </input>\n        <c1> {:?} </c1>\n        \
         <output> {LATE_THROTTLE} </output>\n      </lag_filter>\n",
        1.0 / lag
    )
}

/// XML section of external reactions, with the thrust along body x.
pub(super) fn force(model: &GreyBox) -> String {
    let throttle = throttle(model);
    let terms: String = THRUST
        .iter()
        .map(|(name, factors)| {
            let speeds = factors.iter().filter(|f| **f == SPEED).count();
            let value = coefficient(model, name) / LBF * FT.powi(speeds as i32);
            let acting: Vec<&str> =
                factors.iter().map(|f| if *f == THROTTLE { throttle } else { *f }).collect();
            product(value, &acting, "          ")
        })
        .chain(model.thrust_grid().map(|grid| tabulated(grid, coefficient(model, TABLE), throttle)))
        .collect();
    // the z axis of JSBSim's structural frame points up
    let below = coefficient(model, ARM);
    let z = if below == 0.0 { "0".to_owned() } else { format!("{:?}", -below) };
    format!(
        "  <external_reactions>\n    <force name=\"thrust\" frame=\"BODY\">\n      <location unit=\"M\"> <x> 0 </x> <y> 0 </y> \
         <z> {z} </z> </location>\n      <direction> <x> 1 </x> <y> 0 </y> <z> 0 </z> </direction>\n      <function \
         name=\"external_reactions/thrust/magnitude\">\n        <sum>\n{terms}        </sum>\n      </function>\n    </force>\n  \
         </external_reactions>\n\n"
    )
}

/// XML of the thrust table times `factor`, in lbf, over throttle (rows) and airspeed in ft/s (columns).
fn tabulated(grid: &Grid, factor: f64, throttle: &str) -> String {
    let [throttles, airspeeds] = grid.axes();
    let heads: String = airspeeds.iter().map(|v| format!(" {:?}", v / FT)).collect();
    let row = |d: &f64| -> String {
        let thrusts = airspeeds.iter().map(|v| format!(" {:?}", factor * grid.at(*d, *v) / LBF));
        format!("                {d:?}{}\n", thrusts.collect::<String>())
    };
    let rows: String = throttles.iter().map(row).collect();
    format!(
        "          <product>\n            <property>{DENSITY}</property>\n            <table>\n              <independentVar \
         lookup=\"row\">{throttle}</independentVar>\n              <independentVar \
         lookup=\"column\">{SPEED}</independentVar>\n              <tableData>\n               {heads}\n{rows}              \
         </tableData>\n            </table>\n          </product>\n"
    )
}

/// XML of the rolling moment of the engine's torque. A positive torque rolls the aircraft to the left.
pub(super) fn torque(model: &GreyBox) -> String {
    let torque = coefficient(model, TORQUE);
    if torque == 0.0 {
        return String::new();
    }
    let moment = product(-torque / (LBF * FT), &[throttle(model)], "        ");
    format!("      <function name=\"aero/engine-torque\">\n{moment}      </function>\n")
}
