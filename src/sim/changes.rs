//! Sudden changes of the aircraft in a simulated flight, such as a stuck surface.

use greylag_model::{GreyBox, JoinError};
use greylag_physics::Command;
use greylag_physics::rigid_body::RigidBody;

/// Time of the change after the start of the flight, s.
pub const CHANGE_S: f64 = 30.0;
/// Mass after the change, as a multiple of the mass before.
const MASS: f64 = 1.3;
/// Aft shift of the centre of gravity, as a fraction of the mean chord.
const AFT: f64 = 0.05;

/// A sudden change of the aircraft.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The coefficients of rolling moment, yawing moment and side force due to the aileron (Clda, Cnda, CYda) fall to half.
    HalfAileron,
    /// Mass and inertia rise by 30 %. The centre of gravity stays.
    Mass,
    /// The centre of gravity moves aft by 5 % of the mean chord.
    CentreOfGravity,
    /// The left elevon jams. On an aircraft without elevons, the left aileron jams.
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
}

/// An aircraft after a change.
#[derive(Clone, Debug)]
pub struct Changed {
    change: Change,
    model: GreyBox,
    elevons: Elevons,
}

impl Changed {
    /// The aircraft of `model` after `change`. A stuck surface does not change the model; [`command`](Changed::command)
    /// represents it.
    ///
    /// # Errors
    /// If the model already has an effect that moves its centre of gravity.
    pub fn new(change: Change, model: &GreyBox, elevons: Elevons) -> Result<Changed, JoinError> {
        let mut changed = model.clone();
        match change {
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
            Change::CentreOfGravity => {
                changed.join("cg_shift", &[AFT * model.airframe.geometry.chord])?;
            }
            Change::StuckSurface => {}
        }
        Ok(Changed { change, model: changed, elevons })
    }

    /// Kind of the change.
    pub fn change(&self) -> Change {
        self.change
    }

    /// The model after the change.
    pub fn model(&self) -> &GreyBox {
        &self.model
    }

    /// The command that the surfaces execute if the controller gives `command`. A stuck surface keeps the deflection that it has
    /// under `stuck`, the command at the time of the change.
    pub fn command(&self, command: Command, stuck: Command) -> Command {
        if self.change != Change::StuckSurface {
            return command;
        }
        match self.elevons {
            Elevons::Yes => {
                // the elevons are mixed as right = elevator + aileron, left = elevator − aileron
                let left = stuck.elevator - stuck.aileron;
                let right = command.elevator + command.aileron;
                let (elevator, aileron) = (0.5 * (right + left), 0.5 * (right - left));
                Command { aileron, elevator, ..command }
            }
            Elevons::No => Command { aileron: 0.5 * (command.aileron + stuck.aileron), ..command },
        }
    }
}

/// Whether the aircraft has elevons, which act both as ailerons and as elevator.
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn x8() -> GreyBox {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
        GreyBox::load(&path).unwrap()
    }

    #[test]
    fn each_change_is_what_its_name_says() {
        let model = x8();
        let changed =
            |change| Changed::new(change, &model, Elevons::Yes).map(|c| c.model().clone());
        let half = changed(Change::HalfAileron).unwrap();
        let clda = "roll_linear.Clda";
        assert_eq!(value(&half, clda), value(&model, clda) / 2.0);
        let heavy = changed(Change::Mass).unwrap();
        assert!((heavy.body.mass / model.body.mass - 1.3).abs() < 1e-12);
        let aft = changed(Change::CentreOfGravity).unwrap();
        let chord = model.airframe.geometry.chord;
        assert!((value(&aft, "cg_shift.x_m") - 0.05 * chord).abs() < 1e-12);
        assert!(
            Changed::new(Change::CentreOfGravity, &aft, Elevons::Yes).is_err(),
            "moved already"
        );
    }

    #[test]
    fn a_stuck_surface_leaves_the_other_one() {
        let stuck = Command { aileron: 0.1, elevator: 0.2, ..Command::IDLE };
        let wanted = Command { aileron: 0.4, elevator: 0.0, ..Command::IDLE };
        let of =
            |change, elevons| Changed::new(change, &x8(), elevons).unwrap().command(wanted, stuck);
        let flown = of(Change::StuckSurface, Elevons::Yes);
        assert!((flown.elevator - flown.aileron - 0.1).abs() < 1e-12, "left stays");
        assert!((flown.elevator + flown.aileron - 0.4).abs() < 1e-12, "right follows");
        let flown = of(Change::StuckSurface, Elevons::No);
        assert_eq!([flown.aileron, flown.elevator], [0.25, 0.0]);
        assert_eq!(of(Change::Mass, Elevons::Yes), wanted);
    }
}
