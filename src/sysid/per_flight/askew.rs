//! Misalignment of the sensors: a small constant rotation of the measured axes relative to the body axes.
//!
//! ε (rad, body axes) is the rotation from the body axes to the axes of the sensor board or of the motion-capture markers. To
//! first order, a vector x has the coordinates x − ε × x = x + x × ε in the rotated axes (Stevens, Lewis and Johnson, Aircraft
//! Control and Simulation, section 1.3). This formula applies to body rates, specific force and the velocity relative to the
//! air.
//!
//! The reconstruction smooths the path in the rotated axes, which are those of gyros and attitude. Without vanes, α and β refer
//! to these axes too. Vanes measure in the body axes. With vanes, the reconstruction attributes the mean effect of the
//! misalignment on α and β to the vane biases. Apart from this mean, the reconstructed α and β follow the vanes.
//! For a pitch or a yaw of the board they have hardly any other change. A roll changes α by −β ε and β by α ε. The vanes then
//! contradict the board: the reconstruction estimates this roll (`board_roll`), and its α and β are those of the rotated axes.

use greylag_physics::State;

use crate::flight_path::reconstruction::{Instant, Reconstruction};

/// Number of steps in which [`turn_back`] rotates. An angle of 3° is then exact to 0.01°.
const STEPS: usize = 8;
/// Identifier of the misalignment in the list of measurement errors.
pub const ID: &str = "axes_askew";
/// Names of the angles, about body x, y and z.
pub const NAMES: [&str; 3] = ["askew_roll", "askew_pitch", "askew_yaw"];

/// Changes of the coordinates `x` of a vector, per rad of rotation about each body axis: x × e, with the unit vector e of the
/// axis.
pub fn vector(x: [f64; 3]) -> [[f64; 3]; 3] {
    let [x, y, z] = x;
    [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
}

/// Changes of α and β per rad of each angle. They follow from the rotation of the velocity V (cos α cos β, sin β, sin α cos β).
pub fn flow(alpha: f64, beta: f64) -> [[f64; 2]; 3] {
    let ((sin, cos), tan_beta) = (alpha.sin_cos(), beta.tan());
    [[-cos * tan_beta, sin], [1.0, 0.0], [-sin * tan_beta, -cos]]
}

/// Changes of roll and pitch per rad of each angle, from a rotation about the body axes. Not valid near vertical flight.
pub fn attitude(roll: f64, pitch: f64) -> [[f64; 2]; 3] {
    let ((sin, cos), tan_pitch) = (roll.sin_cos(), pitch.tan());
    [[1.0, 0.0], [tan_pitch * sin, cos], [tan_pitch * cos, -sin]]
}

/// Changes of the reconstructed α and β of a flight per rad of each misalignment angle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turning {
    /// Mean change of α over the flight; `None` without an angle-of-attack vane.
    alpha: Option<[f64; 3]>,
    /// Mean change of β over the flight; `None` without a sideslip vane.
    beta: Option<[f64; 3]>,
    /// Whether the reconstruction has estimated the roll of the board against the vanes. α and β then roll with the board.
    rolled: bool,
}

impl Turning {
    /// Computes the changes for `flight`, with means over `segments`.
    pub fn of(flight: &Reconstruction, segments: &[Vec<Instant>]) -> Turning {
        let estimated = |name: &str| flight.nuisances.iter().any(|n| n.name == name);
        let mut sums = [[0.0; 3]; 2];
        for at in segments.iter().flatten() {
            for (axis, turned) in flow(at.state.alpha, at.state.beta).iter().enumerate() {
                (0..2).for_each(|k| sums[k][axis] += turned[k]);
            }
        }
        let count = segments.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let [alpha, beta] = sums.map(|of| of.map(|x| x / count));
        Turning {
            alpha: estimated("alpha_bias").then_some(alpha),
            beta: estimated("beta_bias").then_some(beta),
            rolled: estimated("board_roll"),
        }
    }

    /// Returns the changes at `alpha` and `beta` (rad). For a flow angle with a vane, this is the mean change over the flight.
    /// For a flow angle without a vane, and for an estimated roll of the board, it is the change that [`flow`] returns.
    pub fn at(&self, alpha: f64, beta: f64) -> [[f64; 2]; 3] {
        let turned = flow(alpha, beta);
        std::array::from_fn(|axis| {
            let [alpha, beta] = turned[axis];
            if axis == 0 && self.rolled {
                return [alpha, beta];
            }
            [self.alpha.map_or(alpha, |of| of[axis]), self.beta.map_or(beta, |of| of[axis])]
        })
    }
}

/// Changes of the measured state `state` per rad of each angle, in the order and units of the state. `turning` gives the changes
/// of α and β.
pub fn state(turning: &Turning, state: &[f64; 8]) -> [[f64; 8]; NAMES.len()] {
    let [roll, pitch, _, p, q, r, alpha, beta] = *state;
    let attitude = attitude(roll, pitch);
    let (rates, flow) = (vector([p, q, r]), turning.at(alpha, beta));
    std::array::from_fn(|axis| {
        let ([roll, pitch], [p, q, r], [alpha, beta]) = (attitude[axis], rates[axis], flow[axis]);
        [roll, pitch, 0.0, p, q, r, alpha, beta]
    })
}

/// Rotates the measurements `at` back by the misalignment `angles` (rad about each body axis). `turning` gives the changes of α and
/// β. The angles are not small here: the change is made in steps.
pub fn turn_back(turning: &Turning, angles: &[f64; NAMES.len()], at: &mut Instant) {
    for _ in 0..STEPS {
        let mut now = at.state.to_array();
        let (states, forces) = (state(turning, &now), vector(at.specific_force));
        for (angle, (state, force)) in angles.iter().zip(states.iter().zip(&forces)) {
            let angle = angle / STEPS as f64;
            now.iter_mut().zip(state).for_each(|(x, by)| *x -= angle * by);
            at.specific_force.iter_mut().zip(force).for_each(|(f, by)| *f -= angle * by);
        }
        at.state = State::from_array(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight_path::reconstruction::Nuisance;
    use greylag_physics::Controls;
    use nalgebra::{Rotation3, Vector3};

    #[test]
    fn flow_angles_roll_with_a_board_whose_roll_against_the_vanes_is_known() {
        let constant = |name: &str| Nuisance {
            name: name.into(),
            value: 0.0,
            sd: 0.001,
            unit: "rad",
            prior: None,
        };
        let mut flight = Reconstruction::empty("a");
        flight.nuisances = ["alpha_bias", "beta_bias"].map(constant).to_vec();
        // without a sample the mean change is zero
        assert_eq!(Turning::of(&flight, &[]).at(0.2, -0.1), [[0.0; 2]; 3]);
        flight.nuisances.push(constant("board_roll"));
        let roll = flow(0.2, -0.1)[0];
        assert_eq!(Turning::of(&flight, &[]).at(0.2, -0.1), [roll, [0.0; 2], [0.0; 2]]);
    }

    #[test]
    fn an_angle_that_is_not_small_is_turned_back() {
        let right = |angles: [f64; 3]| {
            let board = Rotation3::new(Vector3::from(angles)).inverse();
            let turned = |x: [f64; 3]| board * Vector3::from(x);
            let (rates, force) = (turned([1.0, -0.5, 0.3]), turned([0.5, -1.0, -12.0]));
            let wind = turned([20.0 * 0.2_f64.cos(), 0.0, 20.0 * 0.2_f64.sin()]);
            let (alpha, beta) = (wind.z.atan2(wind.x), (wind.y / 20.0).asin());
            let [p, q, r] = rates.into();
            let mut at = Instant {
                time_s: 0.0,
                state: State { alpha, beta, p, q, r, ..State::NEUTRAL },
                yaw: 0.0,
                controls: Controls::default(),
                command: None,
                specific_force: force.into(),
                altitude: 0.0,
                density: 1.2,
            };
            turn_back(&Turning::default(), &angles, &mut at);
            at
        };
        let (straight, back) = (right([0.0; 3]), right([0.02, 0.044, -0.03]));
        let pairs = straight.specific_force.iter().zip(&back.specific_force);
        assert!(pairs.map(|(a, b)| (a - b).abs()).all(|off| off < 0.01), "{back:?}");
        let states = straight.state.to_array().into_iter().zip(back.state.to_array());
        // roll and pitch have no rotation here
        assert!(states.skip(2).all(|(a, b)| (a - b).abs() < 5e-4), "{back:?}");
    }

    /// The analytic changes must equal finite differences of rotation matrices.
    #[test]
    fn a_small_turn_moves_vectors_angles_and_attitude() {
        const STEP: f64 = 1e-6;
        let (alpha, beta, roll, pitch) = (0.2_f64, -0.1_f64, 0.6, 0.3);
        let air = Vector3::new(alpha.cos() * beta.cos(), beta.sin(), alpha.sin() * beta.cos());
        let body = Rotation3::from_euler_angles(roll, pitch, 1.0);
        for axis in 0..3 {
            let mut turn = Vector3::zeros();
            turn[axis] = STEP;
            let turn = Rotation3::from_scaled_axis(turn);
            let seen = turn.inverse() * air;
            let close = |a: f64, b: f64| assert!((a / STEP - b).abs() < 1e-5, "{axis} {a} {b}");
            (0..3).for_each(|k| close(seen[k] - air[k], vector(air.into())[axis][k]));
            let [of_alpha, of_beta] = flow(alpha, beta)[axis];
            close(seen.z.atan2(seen.x) - alpha, of_alpha);
            close(seen.y.asin() - beta, of_beta);
            let (r, p, _) = (body * turn).euler_angles();
            let [of_roll, of_pitch] = attitude(roll, pitch)[axis];
            close(r - roll, of_roll);
            close(p - pitch, of_pitch);
        }
    }
}
