//! The registry of controllers: their names, what they need, and their construction.
//!
//! A planner is a controller that searches for a sequence of commands in simulations of the model. Its method is CEM
//! (cross-entropy method), MPPI (model predictive path integral) or iLQR (iterative linear quadratic regulator). A policy is a
//! trained network. The LQI is a linear quadratic controller with integral action.

use std::fmt;
use std::str::FromStr;

use crate::policy::{Agent, Policy};
use crate::{Controller, adaptive, any, cem, ilqr, lqi, pid};
use greylag_model::GreyBox;

/// Reason why a controller cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The registry has no controller of this name.
    #[error("there is no controller {name:?}; there are {}", ControllerKind::names())]
    Unknown {
        /// The name that was requested.
        name: String,
    },
    /// No LQI can be designed from the model.
    #[error(
        "cannot design an LQI from model {model}: it has no steady flight that can be stabilised at \
         roll {roll_deg:.0}°, pitch {pitch_deg:.0}° at any airspeed; use a better model (--model)"
    )]
    Design {
        /// Name of the model.
        model: String,
        /// Roll angle at which the design failed, degrees.
        roll_deg: f64,
        /// Pitch angle at which the design failed, degrees.
        pitch_deg: f64,
    },
    /// The model has an effect that was proposed by a search and that the user has not accepted.
    #[error(
        "cannot fly model {model}: its effect {effect} was proposed by a search; look at it, then write status = \
         \"accepted\" into the effect's file"
    )]
    Proposed {
        /// Name of the model.
        model: String,
        /// Name of the effect.
        effect: &'static str,
    },
    /// The controller needs a trained policy, but no policy was given.
    #[error("a controller that was trained needs its files; give their folder with --policy")]
    Untrained,
    /// The shipped policy for all aircraft cannot be used.
    #[error(
        "the policy for any aircraft cannot be read: {why}; train it again with params/any/train.py and build anew"
    )]
    Any {
        /// Description of the error.
        why: String,
    },
    /// The planner needs critics (networks that estimate the value of a state), but the policy has none.
    #[error(
        "controller {name} values the end of its plans with critics, and this policy has none; fly it as \
         `policy` or `cem-policy`, or export it with its critics"
    )]
    Criticless {
        /// Name of the controller.
        name: &'static str,
    },
    /// A change of a setting has no effect on the planner.
    #[error(
        "controller {name} cannot use {change}: it has no {lacked}; leave {change} out, or choose a controller that \
         has one, such as hybrid-lqi"
    )]
    Ineffective {
        /// Name of the controller.
        name: &'static str,
        /// The change of a setting.
        change: cem::Change,
        /// What the controller would need to use the setting.
        lacked: &'static str,
    },
}

/// Inputs from which a controller is built.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// The model from which the LQI is designed and with which planners simulate. Its airframe is used by all controllers.
    pub model: &'a GreyBox,
    /// The networks of a trained policy. `None` if there is no policy.
    pub agent: Option<&'a Agent>,
    /// Changes of a planner's default settings.
    pub changes: &'a [cem::Change],
}

impl<'a> From<&'a GreyBox> for Source<'a> {
    fn from(model: &'a GreyBox) -> Source<'a> {
        Source { model, agent: None, changes: &[] }
    }
}

impl<'a> Source<'a> {
    fn agent(&self) -> Result<&'a Agent, SetupError> {
        self.agent.ok_or(SetupError::Untrained)
    }

    /// A planner with `settings` and the user's changes. It has no base controller, that is, no controller that flies on after
    /// the end of a plan.
    fn planner(&self, name: &'static str, settings: cem::Settings) -> Result<cem::Cem, SetupError> {
        self.planner_over(None, name, settings)
    }

    /// A planner with the model's LQI as base controller. Without a policy, no policy's plans are among the candidates.
    fn planner_over_lqi(
        &self,
        name: &'static str,
        settings: cem::Settings,
    ) -> Result<cem::Cem, SetupError> {
        let proposals = if self.agent.is_some() { settings.proposals } else { 0 };
        let settings = cem::Settings { proposals, ..settings };
        self.planner_over(Some(lqi::Lqi::new(self.model)?), name, settings)
    }

    fn planner_over(
        &self,
        base: Option<lqi::Lqi>,
        name: &'static str,
        settings: cem::Settings,
    ) -> Result<cem::Cem, SetupError> {
        let settings = settings.with(self.changes);
        let agent = if settings.needs_policy() { Some(self.agent()?.clone()) } else { None };
        let criticless = agent.as_ref().is_some_and(|agent| agent.critics.is_none());
        if settings.alpha.is_some() && criticless {
            return Err(SetupError::Criticless { name });
        }
        let ilqr = base.clone().filter(|_| settings.ilqr);
        let ilqr = ilqr.map(|lqi| ilqr::Ilqr::new(self.model, lqi));
        let aids = cem::Aids { agent, base, ilqr };
        if let Some((change, lacked)) =
            self.changes.iter().find_map(|c| Some((*c, c.lacks(&aids)?)))
        {
            return Err(SetupError::Ineffective { name, change, lacked });
        }
        Ok(cem::Cem::new(name, self.model, settings, aids))
    }
}

/// The thread on which a controller must run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// The thread of the control loop, for a controller that needs microseconds per command.
    Immediate,
    /// An own thread, for a controller that plans and may miss the deadline of a tick.
    Planned,
}

/// Inputs that a controller requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Only the controller's fixed gains or weights, and the airframe.
    Gains,
    /// A model of the aircraft.
    Model,
    /// The networks of a trained policy.
    Policy,
    /// A model and a policy.
    Both,
    /// A model and optionally a policy. The policy's plans are then among the candidates.
    ModelAndAnyPolicy,
}

impl Needs {
    /// Whether a policy is required.
    pub fn policy(self) -> bool {
        matches!(self, Needs::Policy | Needs::Both)
    }
}

macro_rules! controllers {
    ($($kind:ident $name:literal $seat:ident $needs:ident $about:literal => |$from:ident| $build:expr),* $(,)?) => {
        /// A controller of the registry.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum ControllerKind { $(#[doc = $about] $kind,)* }

        impl ControllerKind {
            /// All controllers of the registry.
            pub const ALL: &'static [ControllerKind] = &[$(ControllerKind::$kind),*];

            /// The name of the controller on the command line.
            pub const fn name(self) -> &'static str {
                match self { $(ControllerKind::$kind => $name,)* }
            }

            /// The thread on which the controller must run.
            pub const fn pace(self) -> Pace {
                match self { $(ControllerKind::$kind => Pace::$seat,)* }
            }

            /// The inputs that the controller requires.
            pub const fn needs(self) -> Needs {
                match self { $(ControllerKind::$kind => Needs::$needs,)* }
            }
        }

        /// Builds a controller from the inputs that [`ControllerKind::needs`] requires.
        ///
        /// # Errors
        ///
        /// If no LQI can be designed from the model, the model has an effect that was not accepted, a required policy or its
        /// critics are missing, a changed setting has no effect, or the shipped policy for all aircraft cannot be read.
        pub fn build<'a>(
            kind: ControllerKind,
            source: impl Into<Source<'a>>,
        ) -> Result<Box<dyn Controller>, SetupError> {
            let source = source.into();
            if let (Needs::Model | Needs::Both | Needs::ModelAndAnyPolicy, Some(effect)) = (kind.needs(), source.model.proposed()) {
                return Err(SetupError::Proposed { model: source.model.name.clone(), effect });
            }
            match kind { $(ControllerKind::$kind => { let $from = source; Ok(Box::new($build)) })* }
        }
    };
}

controllers! {
    Pid "pid" Immediate Gains "PID with the gains published with the simulator." => |_from| pid::Pid::new(pid::PUBLIC),
    PidRetuned "pid-retuned" Immediate Gains "PID retuned, at a safer airspeed." => |_from| pid::Pid::new(pid::RETUNED),
    Adaptive "adaptive" Immediate Gains "Attitude hold of an aircraft without a model: control powers are estimated in flight." => |from| adaptive::Adaptive::new(&from.model.airframe),
    Any "any" Immediate Gains "One recurrent policy for any fixed wing, trained on aircraft drawn from a distribution." => |from| any::AnyPolicy::new(&from.model.airframe)?,
    Lqi "lqi" Immediate Model "Gain-scheduled LQI designed from the model." => |from| lqi::Lqi::new(from.model)?,
    LqiDamped "lqi-damped" Immediate Model "The LQI with softer loops, for a link with more delay." => |from| lqi::Lqi::weighted("lqi-damped", from.model, &lqi::Weights::DAMPED)?,
    Ilqr "ilqr" Planned Model "iLQR over half a second, together with the model's LQI: offset-free." => |from| ilqr::Ilqr::new(from.model, lqi::Lqi::new(from.model)?),
    HybridIlqr "hybrid-ilqr" Planned ModelAndAnyPolicy "iLQR along a path inside the limits of load factor, angle of attack and bank, started from its last plan, the LQI's and the policy's: offset-free." => |from| ilqr::Ilqr::with("hybrid-ilqr", from.model, lqi::Lqi::new(from.model)?, from.agent, ilqr::Settings::HYBRID),
    Cem "cem" Planned Model "CEM-MPC over five steps of the model." => |from| from.planner("cem", cem::Settings::PAPER)?,
    Mppi "mppi" Planned Model "MPPI over the same five steps." => |from| from.planner("mppi", cem::Settings::MPPI)?,
    CemPolicy "cem-policy" Planned Both "CEM-MPC with the policy's proposals." => |from| from.planner("cem-policy", cem::Settings::POLICY)?,
    CemCritic "cem-critic" Planned Both "CEM-MPC with the critics' terminal value." => |from| from.planner("cem-critic", cem::Settings::CRITICS)?,
    Hybrid "hybrid" Planned Both "The hybrid controller: proposals and critics, eq. (26)." => |from| from.planner("hybrid", cem::Settings::HYBRID)?,
    HybridPolicy "hybrid-policy" Planned Both "The hybrid whose policy continues after each plan." => |from| from.planner("hybrid-policy", cem::Settings::OVER_POLICY)?,
    HybridLqi "hybrid-lqi" Planned ModelAndAnyPolicy "The hybrid over the model's LQI, which continues after each plan: offset-free." => |from| from.planner_over_lqi("hybrid-lqi", cem::Settings::OVER_LQI)?,
    Policy "policy" Immediate Policy "A trained policy alone." => |from| Policy::new(from.agent()?),
}

impl ControllerKind {
    /// Whether the controller searches with [`cem::Settings`], so that a [`cem::Change`] has an effect on it.
    pub fn searches(self) -> bool {
        self.pace() == Pace::Planned
            && !matches!(self, ControllerKind::Ilqr | ControllerKind::HybridIlqr)
    }

    fn names() -> String {
        ControllerKind::ALL.iter().map(|k| k.name()).collect::<Vec<_>>().join(", ")
    }
}

impl FromStr for ControllerKind {
    type Err = SetupError;
    fn from_str(name: &str) -> Result<ControllerKind, SetupError> {
        let found = ControllerKind::ALL.iter().find(|k| k.name() == name);
        found.copied().ok_or_else(|| SetupError::Unknown { name: name.into() })
    }
}

impl fmt::Display for ControllerKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
