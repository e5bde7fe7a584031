//! The grey box with its rollout loss in tensors of burn, against which kernels written by hand are held.
//!
//! Every quantity is a column of the batch, `[rows, 1]`; the linear effects of the X8's priors are one
//! product of features with a matrix of coefficients. Nothing is divided by a number: the slope of that is rounded
//! to single precision in burn 0.22, whatever the tensor's.

use burn::tensor::{DType, Device, Gradients, Tensor, TensorData};
use greylag::learn::dynamics::windows::{Track, Window};
use greylag::learn::{Gradient, Objective};
use greylag::model::residual::Scales;
use greylag::model::{GreyBox, Integrator, STEP};
use greylag::num::Dense;
use std::f64::consts::TAU;

pub type Column = Tensor<2>;
pub type Triple = [Column; 3];
pub type Octet = [Column; 8];

/// Columns of the coefficients' matrix.
const EFFECTS: [&str; 6] = [
    "drag_linear",
    "side_force_linear",
    "lift_linear",
    "roll_linear",
    "pitch_linear",
    "yaw_linear",
];
/// Its rows: what stands behind the letters of a coefficient's name.
const FEATURES: [&str; 8] = ["0", "alpha", "beta", "p", "q", "r", "da", "de"];

/// Where tensors live, and in which precision.
#[derive(Clone)]
pub struct Place {
    pub device: Device,
    pub precision: DType,
}

impl Place {
    pub fn new(precision: DType) -> Place {
        Place { device: Device::flex(), precision }
    }

    /// Rows of `width` numbers.
    pub fn rows(&self, numbers: Vec<f64>, width: usize) -> Column {
        let data = TensorData::new(numbers.clone(), [numbers.len() / width, width]);
        Tensor::from_data(data.convert_dtype(self.precision), (&self.device, self.precision))
    }
}

/// A residual's network with a prior of the X8's linear effects.
pub struct InBurn {
    place: Place,
    model: GreyBox,
    scales: [Column; 3],
    pub layers: Vec<(Column, Column)>,
    /// Features × effects.
    pub coefficients: Column,
    pub thrust: Column,
    pub jxz: Column,
    /// ½ S times the lever of each effect.
    levers: Column,
}

/// Windows of tracks, a row each.
#[derive(Clone)]
pub struct Rows {
    states: Vec<Column>,
    controls: Vec<Triple>,
    density: Vec<Column>,
    one: Column,
}

/// What the prior says at a point.
struct Said {
    acceleration: Triple,
    spin: Triple,
    rate: Octet,
}

/// Sine and cosine.
fn turned(angle: &Column) -> (Column, Column) {
    (angle.clone().sin(), angle.clone().cos())
}

/// The columns of a tensor.
pub fn columns<const N: usize>(all: &Column) -> [Column; N] {
    std::array::from_fn(|i| all.clone().narrow(1, i, 1))
}

fn sums<const N: usize>(a: &[Column; N], b: &[Column; N], factor: f64) -> [Column; N] {
    std::array::from_fn(|i| a[i].clone() + b[i].clone() * factor)
}

/// Row and column of a coefficient; `None` for the thrust's.
fn entry(name: &str) -> Option<(usize, usize)> {
    let (effect, coefficient) = name.split_once('.').expect("effect.coefficient");
    let column = EFFECTS.iter().position(|e| *e == effect)?;
    let row = FEATURES.iter().position(|f| coefficient[2..] == **f).expect("a feature");
    Some((row, column))
}

/// The coefficients of a model as features × effects, and the thrust's.
pub fn matrix(model: &GreyBox) -> (Vec<f64>, f64) {
    let mut numbers = vec![0.0; FEATURES.len() * EFFECTS.len()];
    let mut thrust = 0.0;
    for c in model.coefficients() {
        match entry(&c.name) {
            Some((row, column)) => numbers[row * EFFECTS.len() + column] = c.value,
            None => thrust = c.value,
        }
    }
    (numbers, thrust)
}

/// ½ S times the lever of each effect.
pub fn levers(model: &GreyBox) -> [f64; 6] {
    let g = &model.airframe.geometry;
    [1.0, 1.0, 1.0, g.span, g.chord, g.span].map(|l| 0.5 * g.area * l)
}

impl Rows {
    pub fn new(place: &Place, tracks: &[Track], windows: &[Window], steps: usize) -> Rows {
        let gather = |k: usize, width: usize, get: &dyn Fn(&Track, usize) -> Vec<f64>| {
            let all = windows
                .iter()
                .flat_map(|w| get(&tracks[w.track as usize], w.start as usize - 1 + k));
            place.rows(all.collect(), width)
        };
        let controls = |k: usize| {
            [0, 1, 2].map(|i| {
                gather(k, 1, &|t, s| {
                    let c = t.controls[s];
                    vec![[c.aileron, c.elevator, c.throttle][i]]
                })
            })
        };
        Rows {
            states: (0..steps + 2)
                .map(|k| gather(k, 8, &|t, s| t.states[s].to_array().to_vec()))
                .collect(),
            controls: (0..=steps).map(controls).collect(),
            density: (0..=steps).map(|k| gather(k, 1, &|t, s| vec![t.density[s]])).collect(),
            one: place.rows(vec![1.0; windows.len()], 1),
        }
    }

    /// The same as constants of a tape.
    pub fn taped(self) -> Rows {
        let tape = |t: Vec<Column>| t.into_iter().map(Tensor::autodiff).collect();
        Rows {
            states: tape(self.states),
            controls: self.controls.into_iter().map(|c| c.map(Tensor::autodiff)).collect(),
            density: tape(self.density),
            one: self.one.autodiff(),
        }
    }
}

impl InBurn {
    /// # Panics
    /// If the prior has other effects than the X8's linear ones, or other axes.
    pub fn new(place: &Place, model: &GreyBox, scales: &Scales, network: &Dense) -> InBurn {
        let (numbers, thrust) = matrix(model);
        let number = |x: f32| f64::from(x);
        let layers = network.layers().map(|layer| {
            let width = layer.bias.len();
            let of = |n: &[f32]| place.rows(n.iter().copied().map(number).collect(), width);
            (of(layer.weights), of(layer.bias))
        });
        InBurn {
            scales: [
                place.rows(scales.offset.to_vec(), 9),
                place.rows(scales.factor.to_vec(), 9),
                place.rows(scales.output.to_vec(), 8),
            ],
            layers: layers.collect(),
            coefficients: place.rows(numbers, EFFECTS.len()),
            thrust: place.rows(vec![thrust], 1),
            jxz: place.rows(vec![model.bare_body().jxz], 1),
            levers: place.rows(levers(model).to_vec(), 6),
            place: place.clone(),
            model: model.clone(),
        }
    }

    /// The same on a new tape, gradients followed of all that is learned.
    pub fn followed(&self) -> InBurn {
        let leaf = |t: &Column| t.clone().autodiff().require_grad();
        let fixed = |t: &Column| t.clone().autodiff();
        InBurn {
            place: self.place.clone(),
            model: self.model.clone(),
            scales: [0, 1, 2].map(|i| fixed(&self.scales[i])),
            layers: self.layers.iter().map(|(w, b)| (leaf(w), leaf(b))).collect(),
            coefficients: leaf(&self.coefficients),
            thrust: leaf(&self.thrust),
            jxz: leaf(&self.jxz),
            levers: fixed(&self.levers),
        }
    }

    /// The gradients in the order of the kernel's.
    pub fn gradient(&self, gradients: &Gradients) -> Gradient {
        let numbers = |t: &Column| -> Vec<f64> {
            let data = t.grad(gradients).expect("every parameter has a slope").into_data();
            data.convert::<f64>().try_into_vec().expect("numbers")
        };
        let network =
            self.layers.iter().flat_map(|(w, b)| [numbers(w), numbers(b)].concat()).collect();
        let (matrix, thrust) = (numbers(&self.coefficients), numbers(&self.thrust));
        let mut prior: Vec<f64> = self
            .model
            .coefficients()
            .iter()
            .map(|c| entry(&c.name).map_or(thrust[0], |(i, j)| matrix[i * EFFECTS.len() + j]))
            .collect();
        prior.extend(numbers(&self.jxz));
        Gradient { network, prior }
    }

    /// F_a.
    fn learned(&self, s: &Octet, controls: &Triple) -> Octet {
        let [_, _, v, p, q, r, alpha, beta] = s.clone();
        let [aileron, elevator, throttle] = controls.clone();
        let [offset, factor, output] = self.scales.clone();
        let seen = Tensor::cat(vec![v, p, q, r, alpha, beta, aileron, elevator, throttle], 1);
        let last = self.layers.len() - 1;
        let mut x = (seen - offset) * factor;
        for (k, (w, b)) in self.layers.iter().enumerate() {
            x = x.matmul(w.clone()) + b.clone();
            if k < last {
                x = burn::tensor::activation::relu(x);
            }
        }
        columns(&(x * output))
    }

    /// What the prior says, eqs. (7) to (12) and (35) to (46) of [GSFM26].
    fn ask(&self, s: &Octet, controls: &Triple, density: &Column, one: &Column) -> Said {
        let [roll, pitch, v, p, q, r, alpha, beta] = s.clone();
        let [aileron, elevator, throttle] = controls.clone();
        let ((sa, ca), (sb, cb)) = (turned(&alpha), turned(&beta));
        let ((sr, cr), (sp, cp)) = (turned(&roll), turned(&pitch));
        let g = &self.model.airframe.geometry;
        let per_2v = v.clone().recip() * 0.5;
        let (per_span, per_chord) = (per_2v.clone() * g.span, per_2v * g.chord);
        let features = vec![
            one.clone(),
            alpha,
            beta,
            p.clone() * per_span.clone(),
            q.clone() * per_chord,
            r.clone() * per_span,
            aileron,
            elevator,
        ];
        let pressure = density.clone() * v.clone().square();
        let wrench = Tensor::cat(features, 1).matmul(self.coefficients.clone())
            * self.levers.clone()
            * pressure;
        let [drag, side, lift, l, m, n] = columns(&wrench);
        let body = &self.model.body;
        let gravity = self.model.atmosphere.gravity;
        let push =
            lift.clone() * sa.clone() - drag.clone() * ca.clone() + throttle * self.thrust.clone();
        let per_mass = 1.0 / body.mass;
        let x = push * per_mass - sp.clone() * gravity;
        let y = side * per_mass + sr.clone() * cp.clone() * gravity;
        let z =
            (drag * sa.clone() + lift * ca.clone()) * -per_mass + cr.clone() * cp.clone() * gravity;
        let spin = self.spin([&l, &m, &n], [&p, &q, &r]);
        let turn = (sr.clone() * q.clone() + cr.clone() * r.clone()) / cp;
        let forward = x.clone() * ca.clone() + z.clone() * sa.clone();
        let downward = z.clone() * ca.clone() - x.clone() * sa.clone();
        let across = v.clone() * sb.clone();
        let drift = across * (p.clone() * ca.clone() + r.clone() * sa.clone());
        let rate = [
            p.clone() + sp * turn,
            cr * q.clone() - sr * r.clone(),
            forward.clone() * cb.clone() + y.clone() * sb.clone(),
            spin[0].clone(),
            spin[1].clone(),
            spin[2].clone(),
            q + (downward - drift) / (v.clone() * cb.clone()),
            p * sa - r * ca + (y.clone() * cb - sb * forward) / v,
        ];
        Said { acceleration: [x, y, z], spin, rate }
    }

    /// Angular acceleration, eq. (10).
    fn spin(&self, [l, m, n]: [&Column; 3], [p, q, r]: [&Column; 3]) -> Triple {
        let body = &self.model.body;
        let jxz = self.jxz.clone();
        let gamma = jxz.clone().square() * -1.0 + body.jx * body.jz;
        let (pq, qr) = (p.clone() * q.clone(), q.clone() * r.clone());
        let pr = p.clone() * r.clone();
        let roll = l.clone() + pq.clone() * jxz.clone() - qr.clone() * (body.jz - body.jy);
        let squares = p.clone().square() - r.clone().square();
        let pitch = m.clone() + pr * (body.jz - body.jx) - squares * jxz.clone();
        let yaw = n.clone() - qr * jxz.clone() + pq * (body.jx - body.jy);
        [
            (roll.clone() * body.jz + yaw.clone() * jxz.clone()) / gamma.clone(),
            pitch * (1.0 / body.jy),
            (roll * jxz + yaw * body.jx) / gamma,
        ]
    }

    /// The objective over `rows`, eqs. (20) to (24), the penalty being the ratio.
    pub fn objective(&self, rows: &Rows, objective: &Objective) -> Tensor<1> {
        let per_scale = objective.scale.map(|x| 1.0 / x).to_vec();
        let per_scale = self.place.rows(per_scale, 8).autodiff();
        let flown = match self.model.integrator {
            Integrator::Rk4 => self.fly_rk4(rows),
            Integrator::Jsbsim => self.fly_jsbsim(rows),
        };
        let per_point = 1.0 / (rows.states[0].dims()[0] * flown.len()) as f64;
        let square = |x: Column| (x * per_scale.clone()).square().sum();
        let mut total: Option<[Tensor<1>; 3]> = None;
        for (k, (state, prior, learned)) in flown.into_iter().enumerate() {
            let mut off = Vec::from(state);
            off[0] = off[0].clone() - rows.states[k + 2].clone().narrow(1, 0, 1);
            // the short way round; the number of turns has no slope
            off[0] = off[0].clone() - (off[0].clone().detach() * (1.0 / TAU)).round() * TAU;
            let [first, rest] = [off.remove(0), Tensor::cat(off, 1)];
            let rest = rest - rows.states[k + 2].clone().narrow(1, 1, 7);
            let part = [
                square(Tensor::cat(vec![first, rest], 1)),
                square(Tensor::cat(prior.into(), 1)),
                square(Tensor::cat(learned.into(), 1)),
            ];
            total = Some(match total {
                None => part,
                Some(all) => {
                    let [a, b, c] = all;
                    let [x, y, z] = part;
                    [a + x, b + y, c + z]
                }
            });
        }
        let [error, prior, learned] = total.expect("a step at least");
        let ratio = (learned * per_point).sqrt() / (prior * per_point).sqrt();
        error * (per_point / objective.unit) + ratio * (1.0 / objective.lambda)
    }

    /// The state a step later, with F_p and F_a at its start.
    pub fn step_rk4(
        &self,
        start: &Octet,
        controls: &Triple,
        [density, one]: [&Column; 2],
    ) -> (Octet, Octet, Octet) {
        let (mut at, mut state) = (start.clone(), start.clone());
        let mut norms = None;
        for (ahead, weight) in [(0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)] {
            let prior = self.ask(&at, controls, density, one).rate;
            let learned = self.learned(&at, controls);
            let rate = sums(&prior, &learned, 1.0);
            norms = norms.or(Some((prior, learned)));
            at = sums(start, &rate, ahead * STEP);
            state = sums(&state, &rate, weight * STEP / 6.0);
        }
        let (prior, learned) = norms.expect("four stages");
        (state, prior, learned)
    }

    /// The state after each step, with F_p and F_a at its start.
    fn fly_rk4(&self, rows: &Rows) -> Vec<(Octet, Octet, Octet)> {
        let mut state: Octet = columns(&rows.states[1]);
        let fly = |k: usize| {
            let step = self.step_rk4(&state, &rows.controls[k], [&rows.density[k], &rows.one]);
            state = step.0.clone();
            step
        };
        (1..rows.controls.len()).map(fly).collect()
    }

    /// Likewise by JSBSim's scheme, which remembers the step before the start.
    fn fly_jsbsim(&self, rows: &Rows) -> Vec<(Octet, Octet, Octet)> {
        let mut state: Octet = columns(&rows.states[0]);
        let mut memory: Option<Triple> = None;
        let mut flown = Vec::new();
        for k in 0..rows.controls.len() {
            let said = self.ask(&state, &rows.controls[k], &rows.density[k], &rows.one);
            let mut learned = self.learned(&state, &rows.controls[k]);
            // the scheme knows accelerations only
            let none = rows.one.clone() * 0.0;
            (learned[0], learned[1]) = (none.clone(), none);
            let turn = [learned[3].clone(), learned[4].clone(), learned[5].clone()];
            let push = sums(&said.acceleration, &push_of(&state, &learned), 1.0);
            let spin = sums(&said.spin, &turn, 1.0);
            let (next, last) = advance_jsbsim(&state, push, spin, memory);
            memory = Some(last);
            state = next.clone();
            if k == 0 {
                state = columns(&rows.states[1]);
            } else {
                flown.push((next, said.rate, learned));
            }
        }
        flown
    }
}

/// The acceleration in body axes that changes airspeed and flow angles at these rates.
fn push_of(s: &Octet, rate: &Octet) -> Triple {
    let ((sa, ca), (sb, cb)) = (turned(&s[6]), turned(&s[7]));
    let v = s[2].clone();
    let across = v.clone() * rate[7].clone();
    let forward = rate[2].clone() * cb.clone() - across.clone() * sb.clone();
    let downward = v * cb.clone() * rate[6].clone();
    [
        forward.clone() * ca.clone() - downward.clone() * sa.clone(),
        rate[2].clone() * sb + across * cb,
        forward * sa + downward * ca,
    ]
}

fn to_horizon(roll: &Column, pitch: &Column, [x, y, z]: Triple) -> Triple {
    let ((sr, cr), (sp, cp)) = (turned(roll), turned(pitch));
    let turned = y.clone() * sr.clone() + z.clone() * cr.clone();
    [x.clone() * cp.clone() + turned.clone() * sp.clone(), y * cr - z * sr, turned * cp - x * sp]
}

fn to_body(roll: &Column, pitch: &Column, [n, e, d]: Triple) -> Triple {
    let ((sr, cr), (sp, cp)) = (turned(roll), turned(pitch));
    let turned = n.clone() * sp.clone() + d.clone() * cp.clone();
    [n * cp - d * sp, e.clone() * cr.clone() + turned.clone() * sr.clone(), turned * cr - e * sr]
}

fn to_heading([n, e, d]: Triple, (sin, cos): &(Column, Column)) -> Triple {
    [n.clone() * cos.clone() + e.clone() * sin.clone(), e * cos.clone() - n * sin.clone(), d]
}

/// JSBSim's step, and what it remembers.
fn advance_jsbsim(s: &Octet, push: Triple, spin: Triple, last: Option<Triple>) -> (Octet, Triple) {
    let [roll, pitch, v, p, q, r, alpha, beta] = s.clone();
    let ((sa, ca), (sb, cb)) = (turned(&alpha), turned(&beta));
    let push = to_horizon(&roll, &pitch, push);
    let along = v.clone() * cb;
    let velocity = to_horizon(&roll, &pitch, [along.clone() * ca, v * sb, along * sa]);
    let last = last.unwrap_or_else(|| push.clone());
    let velocity = sums(&sums(&velocity, &push, 1.5 * STEP), &last, -0.5 * STEP);
    // the quaternion of roll and pitch, an explicit step of Euler's
    let ((sr, cr), (sp, cp)) = (turned(&(roll * 0.5)), turned(&(pitch * 0.5)));
    let (w, x) = (cr.clone() * cp.clone(), sr.clone() * cp);
    let (y, z) = (cr * sp.clone(), sr * sp * -1.0);
    let [hp, hq, hr] = [&p, &q, &r].map(|rate| rate.clone() * (0.5 * STEP));
    let times = |a: &Column, b: &Column| a.clone() * b.clone();
    let a = w.clone() - times(&x, &hp) - times(&y, &hq) - times(&z, &hr);
    let b = x.clone() + times(&w, &hp) + times(&y, &hr) - times(&z, &hq);
    let c = y.clone() + times(&w, &hq) + times(&z, &hp) - times(&x, &hr);
    let d = z + times(&w, &hr) + times(&x, &hq) - times(&y, &hp);
    let [aa, bb, cc, dd] = [&a, &b, &c, &d].map(|x| x.clone().square());
    let norm = aa.clone() + bb.clone() + cc.clone() + dd.clone();
    let next_roll = ((times(&a, &b) + times(&c, &d)) * 2.0)
        .atan2(aa.clone() - bb.clone() - cc.clone() + dd.clone());
    let next_pitch = ((times(&a, &c) - times(&b, &d)) * 2.0 / norm).asin();
    let turn = ((times(&a, &d) + times(&b, &c)) * 2.0).atan2(aa + bb - cc - dd);
    let heading = turned(&turn);
    let [u, v, w] = to_body(&next_roll, &next_pitch, to_heading(velocity, &heading));
    let airspeed = (u.clone().square() + v.clone().square() + w.clone().square()).sqrt();
    let [dp, dq, dr] = spin.map(|x| x * STEP);
    let next = [
        next_roll,
        next_pitch,
        airspeed.clone(),
        p + dp,
        q + dq,
        r + dr,
        w.atan2(u),
        (v / airspeed).asin(),
    ];
    (next, to_heading(push, &heading))
}
