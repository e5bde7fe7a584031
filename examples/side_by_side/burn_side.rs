//! The tasks in burn: the rollout loss with its automatic differentiation, and plans scored with its tensors.

use anyhow::Result;
use burn::tensor::DType;
use greylag::control::policy::ACTIONS;
use greylag::control::policy::observation::UNIT;
use greylag::control::task::Task;
use greylag::learn::Mlp;
use greylag::model::{Integrator, STEP};
use greylag::physics::State;

use crate::in_burn::{Column, InBurn, Octet, Place, Rows, columns};
use crate::problem::{PLANS, Rollouts, STEPS, Scoring};
use crate::{Timed, clock};

/// Makes a function that times training steps: the loss, and its gradient by reverse-mode differentiation.
pub fn rollouts(problem: &Rollouts) -> impl FnMut(usize) -> Result<Timed> {
    let place = Place::new(DType::F32);
    let bare = InBurn::new(&place, &problem.prior, &problem.scales(), &problem.network);
    let rows = Rows::new(&place, &problem.tracks, &problem.windows, STEPS);
    let objective = problem.objective;
    move |calls| {
        let mut timed = Timed::default();
        for _ in 0..calls {
            let start = clock::now();
            let rows = rows.clone().taped();
            let model = bare.followed();
            let loss = model.objective(&rows, &objective);
            let gradients = loss.backward();
            std::hint::black_box(model.gradient(&gradients));
            timed.seconds.push(clock::now() - start);
            timed.value = loss.into_scalar::<f32>().into();
        }
        Ok(timed)
    }
}

/// The model, the networks and the inputs of plan scoring, as tensors.
struct Scorer {
    model: InBurn,
    actor: Mlp,
    critics: [Mlp; 2],
    start: Column,
    actions: Vec<Column>,
    density: Column,
    one: Column,
    unit: Column,
}

/// State of a surface: the last two inputs, the last two outputs and the last two clipped outputs of its filter.
type Surface = [Column; 6];

pub fn scoring(problem: &Scoring) -> impl FnMut(usize) -> Result<Timed> + '_ {
    let place = Place::new(DType::F32);
    let repeated = |row: &[f64]| place.rows(row.repeat(PLANS), row.len());
    let [one, two] = problem.critics();
    assert_eq!(problem.model.integrator, Integrator::Rk4);
    let scorer = Scorer {
        model: InBurn::new(&place, &problem.model, &problem.scales, &problem.residual),
        actor: Mlp::new(problem.agent.actor.network(), &place.device),
        critics: [one, two].map(|c| Mlp::new(c.network(), &place.device)),
        start: repeated(&problem.seen.state.to_array()),
        actions: problem
            .actions
            .iter()
            .map(|plans| place.rows(plans.iter().flatten().map(|x| (*x).into()).collect(), ACTIONS))
            .collect(),
        density: repeated(&[problem.density()]),
        one: repeated(&[1.0]),
        unit: place.rows(UNIT.to_vec(), UNIT.len()),
    };
    move |calls| {
        let mut timed = Timed::default();
        for _ in 0..calls {
            let start = clock::now();
            let worth = scorer.worth(problem);
            let numbers = worth.into_data().try_into_vec::<f32>().expect("numbers");
            timed.seconds.push(clock::now() - start);
            timed.value = numbers.iter().map(|x| f64::from(*x)).sum::<f64>() / PLANS as f64;
        }
        Ok(timed)
    }
}

impl Scorer {
    fn worth(&self, problem: &Scoring) -> Column {
        let task = Task::PAPER;
        let figures = &problem.model.airframe.actuators;
        let zero = self.one.clone() * 0.0;
        let mut surfaces: [Surface; 2] = [0, 1].map(|_| std::array::from_fn(|_| zero.clone()));
        let mut throttle = [zero.clone(), zero.clone()];
        let mut state: Octet = columns(&self.start);
        let (mut total, mut weight) = (zero, 1.0);
        for actions in &self.actions {
            let [aileron, elevator, thrust] = columns(actions);
            let controls = [surfaces[0][4].clone(), surfaces[1][4].clone(), throttle[1].clone()];
            (state, ..) = self.model.step_rk4(&state, &controls, [&self.density, &self.one]);
            for (surface, action) in surfaces.iter_mut().zip([aileron, elevator]) {
                let limit = figures.aileron.travel.largest();
                let [b, a1, a2] = figures.aileron.filter;
                let [in1, in2, out1, out2, clipped, _] = surface.clone();
                let input = action * limit;
                let y =
                    (input.clone() + in1.clone() * 2.0 + in2) * b - out1.clone() * a1 - out2 * a2;
                let stopped = y.clone().clamp(-limit, limit);
                *surface = [input, in1, y, out1, stopped, clipped];
            }
            let command = (thrust + 1.0) * 0.5;
            let [b, a] = figures.throttle;
            throttle =
                [command.clone(), (command + throttle[0].clone()) * b + throttle[1].clone() * a];
            let terms = [
                (0, problem.target.roll, task.roll_scale, task.roll_cap),
                (1, problem.target.pitch, task.pitch_scale, task.pitch_cap),
                (2, problem.target.airspeed, task.airspeed_scale, task.airspeed_cap),
            ];
            for (i, wanted, scale, cap) in terms {
                let off = (state[i].clone() - wanted).abs() / scale;
                total = total - off.clamp_max(cap) * weight;
            }
            weight *= task.discount;
        }
        let seen = self.observed(problem, &state, &surfaces, &throttle[1]);
        let action = self.actor.forward(seen.clone()).tanh();
        let there = Column::cat(vec![seen, action], 1);
        let [one, two] = &self.critics;
        total + one.forward(there.clone()).min_pair(two.forward(there)) * weight
    }

    fn observed(
        &self,
        problem: &Scoring,
        state: &Octet,
        surfaces: &[Surface; 2],
        throttle: &Column,
    ) -> Column {
        let [roll, pitch, airspeed, p, q, r, alpha, beta] = state.clone();
        let rate = |s: &Surface| (s[4].clone() - s[5].clone()) / STEP;
        let seen = vec![
            roll.clone(),
            pitch.clone(),
            airspeed.clone() - State::NEUTRAL.airspeed,
            p,
            q,
            r,
            alpha,
            beta,
            surfaces[0][4].clone(),
            rate(&surfaces[0]),
            surfaces[1][4].clone(),
            rate(&surfaces[1]),
            throttle.clone() - 0.5,
            -roll + problem.target.roll,
            -pitch + problem.target.pitch,
            -airspeed.clone() + problem.target.airspeed,
        ];
        Column::cat(seen, 1) / self.unit.clone()
    }
}
