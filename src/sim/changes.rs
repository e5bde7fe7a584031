//! Sudden changes of the aircraft in flight.

use greylag_model::GreyBox;
use greylag_physics::Command;
use greylag_physics::rigid_body::RigidBody;

/// When the aircraft changes, s after the start.
pub const CHANGE_S: f64 = 30.0;
/// Mass after the change, as a multiple of the mass before.
const MASS: f64 = 1.3;
/// How far aft the centre of gravity moves, as a fraction of the mean chord.
const AFT: f64 = 0.05;

/// A sudden change of the aircraft.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// All moments and forces of the aileron fall to half.
    HalfAileron,
    /// Mass and inertia rise by 30 %; the centre of gravity stays.
    Mass,
    /// The centre of gravity moves aft by 5 % of the mean chord.
    CentreOfGravity,
    /// The left elevon, or the left aileron where there are no elevons, stays where it is.
    StuckSurface,
}

impl Change {
    /// All changes.
    pub const ALL: [Change; 4] =
        [Change::HalfAileron, Change::Mass, Change::CentreOfGravity, Change::StuckSurface];

    /// Description in tables.
    pub fn name(self) -> &'static str {
        match self {
            Change::HalfAileron => "half the aileron",
            Change::Mass => "mass +30 %",
            Change::CentreOfGravity => "centre of gravity 5 % aft",
            Change::StuckSurface => "one surface stuck",
        }
    }

    /// The aircraft of `model`, whose aerodynamics are linear, after the change. A stuck surface changes the commands, not
    /// the model.
    pub fn of(self, model: &GreyBox) -> GreyBox {
        let mut changed = model.clone();
        match self {
            Change::HalfAileron => {
                for name in ["roll_linear.Clda", "yaw_linear.Cnda", "side_force_linear.CYda"] {
                    let half = value(model, name) / 2.0;
                    changed.set_coefficient(name, half);
                }
            }
            Change::Mass => {
                let RigidBody { mass, jx, jy, jz, jxz } = *model.bare_body();
                let [mass, jx, jy, jz, jxz] = [mass, jx, jy, jz, jxz].map(|x| MASS * x);
                changed.set_body(RigidBody { mass, jx, jy, jz, jxz });
            }
            Change::CentreOfGravity => moved_aft(model, &mut changed),
            Change::StuckSurface => {}
        }
        changed
    }

    /// The command that the surfaces follow when `stuck` (aileron and elevator, fractions of full deflection) was the
    /// command at the change.
    pub fn command(self, command: Command, stuck: Command, elevons: Elevons) -> Command {
        if self != Change::StuckSurface {
            return command;
        }
        // the left surface by the mixer, right = elevator + aileron and left = elevator − aileron
        match elevons {
            Elevons::Yes => {
                let left = stuck.elevator - stuck.aileron;
                let right = command.elevator + command.aileron;
                let (elevator, aileron) = (0.5 * (right + left), 0.5 * (right - left));
                Command { aileron, elevator, ..command }
            }
            Elevons::No => Command { aileron: 0.5 * (command.aileron + stuck.aileron), ..command },
        }
    }
}

/// Whether the same two surfaces are aileron and elevator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elevons {
    /// Two elevons.
    Yes,
    /// Ailerons and an elevator.
    No,
}

fn value(model: &GreyBox, name: &str) -> f64 {
    model.coefficients().iter().find(|c| c.name == name).map_or(0.0, |c| c.value)
}

/// Moments of lift and side force about a centre of gravity further aft: Cm += (x/c) CL, Cn += (x/b) CY. The damping by
/// the pitch rate changes in the second order and is kept.
fn moved_aft(model: &GreyBox, changed: &mut GreyBox) {
    let geometry = &model.airframe.geometry;
    for of in ["0", "alpha", "de"] {
        let name = format!("pitch_linear.Cm{of}");
        let lift = value(model, &format!("lift_linear.CL{of}"));
        changed.set_coefficient(&name, value(model, &name) + AFT * lift);
    }
    let arm = AFT * geometry.chord / geometry.span;
    for of in ["0", "beta", "da"] {
        let name = format!("yaw_linear.Cn{of}");
        let side = value(model, &format!("side_force_linear.CY{of}"));
        changed.set_coefficient(&name, value(model, &name) + arm * side);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn x8() -> GreyBox {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
        GreyBox::load(&path).unwrap()
    }

    #[test]
    fn each_change_is_what_its_name_says() {
        let model = x8();
        let half = Change::HalfAileron.of(&model);
        let clda = "roll_linear.Clda";
        assert_eq!(value(&half, clda), value(&model, clda) / 2.0);
        let heavy = Change::Mass.of(&model);
        assert!((heavy.body.mass / model.body.mass - 1.3).abs() < 1e-12);
        let aft = Change::CentreOfGravity.of(&model);
        let [before, after] = [&model, &aft].map(|m| value(m, "pitch_linear.Cmalpha"));
        // the static margin −Cmα/CLα falls by the move
        let moved = (after - before) / value(&model, "lift_linear.CLalpha");
        assert!((moved - 0.05).abs() < 1e-12, "{moved}");
    }

    #[test]
    fn a_stuck_surface_leaves_the_other_one() {
        let stuck = Command { aileron: 0.1, elevator: 0.2, ..Command::IDLE };
        let wanted = Command { aileron: 0.4, elevator: 0.0, ..Command::IDLE };
        let flown = Change::StuckSurface.command(wanted, stuck, Elevons::Yes);
        assert!((flown.elevator - flown.aileron - 0.1).abs() < 1e-12, "left stays");
        assert!((flown.elevator + flown.aileron - 0.4).abs() < 1e-12, "right follows");
        let flown = Change::StuckSurface.command(wanted, stuck, Elevons::No);
        assert_eq!([flown.aileron, flown.elevator], [0.25, 0.0]);
        assert_eq!(Change::Mass.command(wanted, stuck, Elevons::Yes), wanted);
    }
}
