//! Mixer of an aircraft whose surfaces and motors are commanded one by one.
//!
//! The shim shares no code with the companion, which makes each a check of the other. This mixer has its own method: it
//! computes the controls from the positions by least squares (normal equations).

use super::{Inputs, Properties};

/// A surface or motor of the aircraft.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// Name of the surface or motor.
    pub name: String,
    /// Property of its command; `None` if the aircraft itself derives the command from aileron, elevator, rudder and throttle.
    pub command: Option<String>,
    /// Property of its position: rad for a surface, 0..1 for a motor.
    pub position: String,
    /// Command per unit of the aileron, elevator, rudder and throttle command.
    pub gains: [f64; 4],
    /// Deflections at the commands −1 and 1, rad; `None` for a motor.
    pub travel: Option<[f64; 2]>,
}

impl Moved {
    /// A single motor that follows the aircraft's throttle.
    pub fn throttle(properties: &Properties) -> Moved {
        Moved {
            name: "throttle".into(),
            command: None,
            position: properties.throttle_position.clone(),
            gains: [0.0, 0.0, 0.0, 1.0],
            travel: None,
        }
    }

    /// Half the travel, rad; 1 for a motor.
    fn unit(&self) -> f64 {
        self.travel.map_or(1.0, |[least, most]| 0.5 * (most - least))
    }

    fn limited(&self, command: f64) -> f64 {
        command.clamp(if self.travel.is_some() { -1.0 } else { 0.0 }, 1.0)
    }
}

/// Surfaces and motors of an aircraft, and the controls computed from their positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixing {
    moved: Vec<Moved>,
    /// For each surface or motor, the value of each control (rad; throttle 0..1) per unit of its position (rad; motor 0..1).
    shares: Vec<[f64; 4]>,
    has_rudder: bool,
}

const CONTROLS: [&str; 4] = ["aileron", "elevator", "rudder", "throttle"];

impl Mixing {
    /// Makes the mixing of the surfaces and motors `moved`.
    ///
    /// # Errors
    /// A message for the user if nothing moves the aileron, elevator or throttle, or if two controls move the surfaces in the
    /// same way.
    pub fn new(moved: Vec<Moved>) -> Result<Mixing, String> {
        let used: [bool; 4] = std::array::from_fn(|j| moved.iter().any(|m| m.gains[j] != 0.0));
        if let Some(j) = [0, 1, 3].into_iter().find(|j| !used[*j]) {
            return Err(format!(
                "no surface or motor moves the {}; give one a gain for it",
                CONTROLS[j]
            ));
        }
        let mut normal = [[0.0; 4]; 4];
        for (i, row) in normal.iter_mut().enumerate() {
            for (j, x) in row.iter_mut().enumerate() {
                *x = moved.iter().map(|m| m.gains[i] * m.gains[j]).sum();
            }
            if !used[i] {
                row[i] = 1.0;
            }
        }
        let inverse = inverse(normal).ok_or(
            "the surfaces move with two controls alike: give one of them a gain of the other sign",
        )?;
        let unit: [f64; 4] = std::array::from_fn(|j| mean_unit(&moved, j));
        let shares = moved
            .iter()
            .map(|m| {
                std::array::from_fn(|j| {
                    let row: f64 = inverse[j].iter().zip(m.gains).map(|(a, g)| a * g).sum();
                    row * unit[j] / m.unit()
                })
            })
            .collect();
        Ok(Mixing { moved, shares, has_rudder: used[2] })
    }

    /// The surfaces and motors.
    pub fn moved(&self) -> &[Moved] {
        &self.moved
    }

    /// Whether a surface or motor moves with the rudder.
    pub fn has_rudder(&self) -> bool {
        self.has_rudder
    }

    /// Commands of the surfaces and motors, in the order of `moved`.
    pub(super) fn mix(&self, inputs: &Inputs) -> impl Iterator<Item = f64> {
        let asked = [inputs.aileron, inputs.elevator, inputs.rudder, inputs.throttle];
        let sum = move |m: &Moved| m.gains.iter().zip(asked).map(|(g, c)| g * c).sum::<f64>();
        self.moved.iter().map(move |m| m.limited(sum(m)))
    }

    /// Aileron, elevator, rudder (rad) and throttle (0..1) at the `positions` of surfaces (rad) and motors (0..1).
    pub(super) fn controls(&self, positions: &[f64]) -> [f64; 4] {
        std::array::from_fn(|j| self.shares.iter().zip(positions).map(|(s, x)| s[j] * x).sum())
    }
}

/// Value of control `j` at the command 1: the mean over the surfaces that it moves, or over motors if it moves no surface.
fn mean_unit(moved: &[Moved], j: usize) -> f64 {
    let all = || moved.iter().filter(|m| m.gains[j] != 0.0);
    let surfaces: Vec<f64> = all()
        .filter(|m| m.travel.is_some() && j != 3)
        .map(|m| m.gains[j].abs() * m.unit())
        .collect();
    match surfaces.is_empty() {
        false => surfaces.iter().sum::<f64>() / surfaces.len() as f64,
        true if j == 3 => 1.0,
        true => all().map(|m| m.gains[j].abs()).sum::<f64>() / all().count().max(1) as f64,
    }
}

/// Inverse by Gauss–Jordan elimination with pivoting; `None` if the matrix is singular.
fn inverse(mut a: [[f64; 4]; 4]) -> Option<[[f64; 4]; 4]> {
    let mut out: [[f64; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for k in 0..4 {
        let pivot = (k..4).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs()))?;
        if a[pivot][k].abs() < 1e-9 {
            return None;
        }
        a.swap(k, pivot);
        out.swap(k, pivot);
        let scale = a[k][k];
        a[k].iter_mut().chain(&mut out[k]).for_each(|x| *x /= scale);
        let (row, own) = (a[k], out[k]);
        for i in (0..4).filter(|i| *i != k) {
            let factor = a[i][k];
            a[i].iter_mut().zip(row).for_each(|(x, y)| *x -= factor * y);
            out[i].iter_mut().zip(own).for_each(|(x, y)| *x -= factor * y);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn elevon(name: &str, aileron: f64) -> Moved {
        Moved {
            name: name.into(),
            command: None,
            position: format!("fcs/{name}-pos-rad"),
            gains: [aileron, 1.0, 0.0, 0.0],
            travel: Some([-0.5, 0.5]),
        }
    }

    fn motor() -> Moved {
        Moved { gains: [0.0, 0.0, 0.0, 1.0], travel: None, ..elevon("motor", 0.0) }
    }

    #[test]
    fn elevons_say_what_aileron_and_elevator_do() {
        let mixing =
            Mixing::new(vec![elevon("left", 1.0), elevon("right", -1.0), motor()]).unwrap();
        let inputs = Inputs { aileron: 0.25, elevator: -0.5, throttle: 0.7, rudder: 0.0 };
        let given: Vec<f64> = mixing.mix(&inputs).collect();
        assert_eq!(given, [-0.25, -0.75, 0.7]);
        let controls = mixing.controls(&[0.5 * given[0], 0.5 * given[1], 0.7]);
        for (a, b) in controls.into_iter().zip([0.125, -0.25, 0.0, 0.7]) {
            assert!((a - b).abs() < 1e-12, "{controls:?}");
        }
        assert!(!mixing.has_rudder());
    }

    #[test]
    fn surfaces_that_move_alike_are_refused() {
        let alike = Mixing::new(vec![elevon("left", 1.0), elevon("right", 1.0), motor()]);
        assert!(alike.unwrap_err().contains("other sign"));
        assert!(Mixing::new(vec![elevon("left", 1.0)]).unwrap_err().contains("throttle"));
    }
}
