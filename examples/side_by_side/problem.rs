//! The problems that all methods solve, and their description for PyTorch.

use std::path::Path;

use anyhow::Result;
use greylag::control::policy::observation::UNIT;
use greylag::control::policy::{ACTIONS, Actor, Agent, Critic, OBSERVATIONS, Origin, observe};
use greylag::control::task::Task;
use greylag::control::{Observation, Target};
use greylag::learn::dynamics::windows::{Track, Window, windows};
use greylag::learn::{Hyperparameters, Objective, Penalty};
use greylag::model::residual::{INPUTS, OUTPUTS, Scales};
use greylag::model::{GreyBox, Integrator, Memory, Residual, Twin};
use greylag::num::dense::Units;
use greylag::num::{Dense, stream};
use greylag::physics::actuators::Actuators;
use greylag::physics::{ActuatorState, Command, State, Time};
use rand::RngExt;
use serde_json::{Value, json};

use crate::in_burn::{levers, matrix};

/// Number of steps of a training rollout. `BATCH` is the number of rollouts.
pub const STEPS: usize = 20;
pub const BATCH: usize = 64;
/// Number of plans that are scored. `HORIZON` is the number of their steps.
pub const PLANS: usize = 1024;
pub const HORIZON: usize = 5;

/// The problem of a training step: the rollout loss with its gradient.
pub struct Rollouts {
    pub prior: GreyBox,
    pub network: Dense,
    pub objective: Objective,
    pub tracks: Vec<Track>,
    pub windows: Vec<Window>,
}

/// The problem of plan scoring: plans that all start from one state.
pub struct Scoring {
    pub name: &'static str,
    pub model: GreyBox,
    pub scales: Scales,
    pub residual: Dense,
    pub agent: Agent,
    pub seen: Observation,
    pub target: Target,
    /// For each step of the horizon, the actions of all plans.
    pub actions: Vec<Vec<[f32; ACTIONS]>>,
}

/// The prior of the X8 as shipped.
pub fn prior() -> Result<GreyBox> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    Ok(GreyBox::load(&folder.join("prior.toml"))?)
}

/// A residual network with random weights. Its output is not negligible. The weights do not affect the computing time.
fn residual() -> Result<Dense> {
    Ok(Dense::uniform(&[INPUTS, 64, 64, OUTPUTS], &mut stream::stream(1, &[]))?)
}

fn track(model: &GreyBox) -> Track {
    let mut twin = Twin::new(State::NEUTRAL, 600.0);
    let rows: Vec<_> = (0..1000)
        .map(|k| {
            let wave = |w: f64| 0.1 * (w * k as f64).sin();
            let row = (twin.state, twin.actuators.controls(), twin.altitude);
            let command =
                Command { aileron: wave(0.13), elevator: wave(0.07), throttle: 0.3, rudder: 0.0 };
            twin.step(model, &command);
            row
        })
        .collect();
    Track::new(model, rows.into_iter())
}

impl Rollouts {
    pub fn new(integrator: Integrator) -> Result<Rollouts> {
        let mut prior = prior()?;
        let tracks = vec![track(&prior)];
        prior.integrator = integrator;
        let all = windows(&tracks, STEPS);
        let chosen = all.iter().step_by(all.len() / BATCH).take(BATCH).copied().collect();
        let objective =
            Objective { scale: prior.scale(), penalty: Penalty::Ratio, unit: 1.0, lambda: 1.0 };
        let mut network = residual()?;
        network.parameters_mut().iter_mut().for_each(|p| *p *= 0.3);
        Ok(Rollouts { prior, network, objective, tracks, windows: chosen })
    }

    pub fn scales(&self) -> Scales {
        Scales::new(&self.prior.airframe, self.prior.scale())
    }

    /// The problem as JSON for PyTorch. It is the same for both integration schemes.
    pub fn told(&self) -> Value {
        let gather = |k: usize, get: &dyn Fn(&Track, usize) -> Value| -> Vec<Value> {
            let at = |w: &Window| get(&self.tracks[w.track as usize], w.start as usize - 1 + k);
            self.windows.iter().map(at).collect()
        };
        let states = |k| gather(k, &|t, s| json!(t.states[s].to_array()));
        let controls = |k| {
            gather(k, &|t, s| {
                let c = t.controls[s];
                json!([c.aileron, c.elevator, c.throttle])
            })
        };
        let density = |k| gather(k, &|t, s| json!(t.density[s]));
        json!({
            "model": told_model(&self.prior, &self.scales(), &self.network),
            "states": (0..STEPS + 2).map(states).collect::<Vec<_>>(),
            "controls": (0..=STEPS).map(controls).collect::<Vec<_>>(),
            "density": (0..=STEPS).map(density).collect::<Vec<_>>(),
            "scale": self.objective.scale,
            "unit": self.objective.unit,
            "lambda": self.objective.lambda,
        })
    }
}

fn told_layers(network: &Dense) -> Value {
    let layers = network.layers().map(|layer| {
        let rows: Vec<_> = layer.weights.chunks_exact(layer.bias.len()).collect();
        json!([rows, layer.bias])
    });
    layers.collect()
}

fn told_model(model: &GreyBox, scales: &Scales, network: &Dense) -> Value {
    let (numbers, thrust) = matrix(model);
    let (geometry, body) = (&model.airframe.geometry, &model.body);
    json!({
        "coefficients": numbers.chunks_exact(6).collect::<Vec<_>>(),
        "thrust": thrust,
        "residual": told_layers(network),
        "scales": [scales.offset.to_vec(), scales.factor.to_vec(), scales.output.to_vec()],
        "levers": levers(model),
        "span": geometry.span,
        "chord": geometry.chord,
        "gravity": model.atmosphere.gravity,
        "mass": body.mass,
        "jx": body.jx,
        "jy": body.jy,
        "jz": body.jz,
        "jxz": body.jxz,
    })
}

/// A policy with random networks, where `actor` and `critic` are the sizes of the hidden layers.
fn agent(model: &GreyBox, actor: &[usize], critic: &[usize]) -> Result<Agent> {
    let mut rng = stream::stream(2, &[]);
    let mut network = |sizes: Vec<usize>| Dense::uniform(&sizes, &mut rng);
    let actor = Actor::new(network([&[OBSERVATIONS], actor, &[ACTIONS]].concat())?)?;
    let sizes = [&[OBSERVATIONS + ACTIONS], critic, &[1]].concat();
    let critics = [Critic::new(network(sizes.clone())?)?, Critic::new(network(sizes)?)?];
    let origin = Origin {
        schema: Origin::SCHEMA.into(),
        airframe: greylag::model::residual::fingerprint(&model.airframe),
        model: model.name.clone(),
        model_sha256: String::new(),
        seed: 2,
        steps: 0,
        evaluation: None,
        program: "greylag".into(),
    };
    Ok(Agent { actor: actor.into(), critics: Some(critics.into()), origin })
}

impl Scoring {
    /// The critics of the policy.
    pub fn critics(&self) -> &[Critic; 2] {
        self.agent.critics.as_deref().expect("made with critics")
    }

    pub fn new(name: &'static str, actor: &[usize], critic: &[usize]) -> Result<Scoring> {
        let mut model = prior()?;
        let network = residual()?;
        let x_c = model.scale().map(|x| 1e-2 * x);
        model.residual = Some(Residual::new(network.clone(), &model.airframe, x_c)?);
        let mut rng = stream::stream(3, &[]);
        let mut action = || std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        Ok(Scoring {
            name,
            agent: agent(&model, actor, critic)?,
            scales: Scales::new(&model.airframe, x_c),
            residual: network,
            seen: Observation {
                time: Time::default(),
                state: State { alpha: 0.05, ..State::NEUTRAL },
                incidence_sd: [0.0; 2],
                actuators: ActuatorState::default(),
                altitude: 600.0,
                previous: [Command::IDLE; 2],
            },
            target: Target { roll: 0.6, pitch: 0.2, airspeed: State::NEUTRAL.airspeed },
            actions: (0..HORIZON).map(|_| (0..PLANS).map(|_| action()).collect()).collect(),
            model,
        })
    }

    /// The mean return of all plans with the terminal value, computed for one plan after the other in double precision.
    pub fn expected(&self) -> f64 {
        let figures = &self.model.airframe.actuators;
        let task = Task::PAPER;
        let mut units = Units::new(0.0_f64);
        let worth = |plan: usize| {
            let mut state = self.seen.state;
            let mut actuators =
                Actuators::from_observed(&self.seen.actuators, &self.seen.previous, figures);
            let (mut sum, mut weight, mut memory) = (0.0, 1.0, Memory::default());
            for actions in &self.actions {
                let command = greylag::control::policy::command(actions[plan].map(f64::from));
                let controls = actuators.controls();
                state = self.model.step(&state, &controls, self.seen.altitude, &mut memory);
                actuators.step(&command, figures);
                sum += weight * task.reward(&state, &self.target);
                weight *= task.discount;
            }
            let view = observe(&state, &actuators.observed(figures), &self.target);
            let action = self.agent.actor.act(&mut units, &view);
            let [one, two] = self.critics();
            let values = [one, two].map(|critic| critic.value(&mut units, &view, &action));
            sum + weight * values[0].min(values[1])
        };
        (0..PLANS).map(worth).sum::<f64>() / PLANS as f64
    }

    pub fn density(&self) -> f64 {
        self.model.atmosphere.density_at(self.seen.altitude)
    }

    /// The problem as JSON for PyTorch.
    pub fn told(&self) -> Value {
        let (figures, task) = (&self.model.airframe.actuators, Task::PAPER);
        let [one, two] = self.critics();
        json!({
            "model": told_model(&self.model, &self.scales, &self.residual),
            "actions": self.actions,
            "state": self.seen.state.to_array(),
            "density": self.density(),
            "unit": UNIT,
            "airspeed": State::NEUTRAL.airspeed,
            "actor": told_layers(self.agent.actor.network()),
            "critic1": told_layers(one.network()),
            "critic2": told_layers(two.network()),
            "limit": figures.aileron.travel.largest(),
            "surface": figures.aileron.filter,
            "throttle": figures.throttle,
            "target": [self.target.roll, self.target.pitch, self.target.airspeed],
            "reward": [
                [task.roll_scale, task.roll_cap],
                [task.pitch_scale, task.pitch_cap],
                [task.airspeed_scale, task.airspeed_cap],
            ],
            "discount": task.discount,
        })
    }
}

/// All problems as JSON for PyTorch.
pub fn told(rollouts: &Rollouts, scorings: &[Scoring]) -> Value {
    let settings = Hyperparameters::default();
    let scorings: serde_json::Map<_, _> =
        scorings.iter().map(|s| (s.name.to_string(), s.told())).collect();
    json!({
        "rollouts": rollouts.told(),
        "scoring": scorings,
        "td3": {
            "actor": settings.actor_sizes(),
            "critic": settings.critic_sizes(),
            "batch": settings.batch,
        },
    })
}
