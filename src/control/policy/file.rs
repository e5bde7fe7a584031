//! The files of a policy folder: `actor.safetensors` and, for planners, `critic1.safetensors` and `critic2.safetensors`.
//!
//! A target (commanded attitude) is easy if |roll| < 45° and |pitch| < 25°. It is hard if |roll| is 45..60° and |pitch| 25..30°.
//! The settled error of a flight to a target is the error in the last fifth of the flight: the mean of the RMS errors of roll
//! and pitch.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use safetensors::SafeTensorError;
use serde::{Deserialize, Serialize};

use crate::policy::{Actor, Agent, Critic, ShapeError};
use greylag_model::residual::fingerprint;
use greylag_model::weights;
use greylag_num::Dense;
use greylag_physics::Airframe;

/// Names of the files in the order of writing. The actor is last: if it exists, the other files are complete.
const FILES: [&str; 3] = ["critic1.safetensors", "critic2.safetensors", "actor.safetensors"];

/// Index of the actor in [`FILES`].
const ACTOR: usize = 2;

/// Provenance of a policy, stored in the header of each of its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Schema of the file header: [`Origin::SCHEMA`].
    pub schema: String,
    /// Fingerprint of the airframe for which the policy was trained, see [`fingerprint`].
    pub airframe: String,
    /// Name of the model in which the policy was trained, or `jsbsim`.
    pub model: String,
    /// SHA-256 of the files of this model, hexadecimal. Empty for JSBSim.
    pub model_sha256: String,
    /// Random seed of the training run.
    pub seed: u64,
    /// Number of environment steps of the training run.
    pub steps: u64,
    /// Evaluation of the policy in its training environment. `None` if there was no evaluation.
    pub evaluation: Option<Evaluated>,
    /// Name and version of the program that trained the policy.
    pub program: String,
}

/// Evaluation of a policy in the environment of its training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evaluated {
    /// Number of targets flown.
    pub targets: usize,
    /// Mean settled error on easy targets, degrees.
    pub easy_deg: f64,
    /// Mean settled error on hard targets, degrees.
    pub hard_deg: f64,
    /// Fraction of the targets with a settled error above 10°. The settled error is 180° if the aircraft was lost.
    pub divergence_rate: f64,
}

/// Reason why a policy folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    /// A file cannot be read.
    #[error("cannot read policy {path}: {why}; a policy folder holds {}, or the last one alone", FILES.join(", "), path = path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        why: std::io::Error,
    },
    /// A file is not a valid policy file.
    #[error("policy {path}: {why}; train it again with `greylag train policy`", path = path.display())]
    Content {
        /// Path of the file.
        path: PathBuf,
        /// Description of the invalid content.
        why: String,
    },
    /// The policy was trained for another airframe.
    #[error("policy {path} was trained for another airframe than {airframe}; fly it with the airframe of model {model}, train one for this with `greylag train policy --env model:FILE`, or fly hybrid-lqi or lqi, which need none", path = path.display())]
    Airframe {
        /// Path of the folder.
        path: PathBuf,
        /// Name of the airframe to be flown.
        airframe: String,
        /// Name of the model in which the policy was trained.
        model: String,
    },
    /// The files come from different training runs.
    #[error("policy {path}: its files come from different trainings; copy all of {} from one", FILES.join(", "), path = path.display())]
    Mixed {
        /// Path of the folder.
        path: PathBuf,
    },
}

impl Origin {
    /// The schema that this program reads and writes.
    pub const SCHEMA: &'static str = "greylag.policy/1";
}

impl Agent {
    /// Names and contents of the policy's files, in the order in which they must be written.
    ///
    /// # Errors
    ///
    /// If safetensors cannot serialise a network.
    pub fn to_files(&self) -> Result<Vec<(&'static str, Vec<u8>)>, SafeTensorError> {
        let critics = self.critics.iter().flat_map(|both| both.iter().map(Critic::network));
        let first = if self.critics.is_some() { 0 } else { ACTOR };
        let networks = critics.chain([self.actor.network()]);
        FILES[first..]
            .iter()
            .zip(networks)
            .map(|(name, network)| Ok((*name, weights::to_bytes(network, None, &self.origin)?)))
            .collect()
    }

    /// Paths of the files of a policy in `folder`. [`Agent::load`] reads those that exist.
    pub fn files(folder: &Path) -> [PathBuf; 3] {
        FILES.map(|name| folder.join(name))
    }

    /// Loads the policy in `folder` for `airframe`. A folder may have no critics, but not only one of the two.
    ///
    /// # Errors
    ///
    /// If a file is missing or invalid, or belongs to another airframe or training run.
    pub fn load(folder: &Path, airframe: &Airframe) -> Result<Agent, AgentError> {
        let alone = FILES[..ACTOR].iter().all(|name| !folder.join(name).exists());
        let (actor, origin) = read(&folder.join(FILES[ACTOR]))?;
        if origin.airframe != fingerprint(airframe) {
            let (path, airframe) = (folder.into(), airframe.name.clone());
            return Err(AgentError::Airframe { path, airframe, model: origin.model });
        }
        let shape = |name: &str| {
            let path = folder.join(name);
            move |e: ShapeError| AgentError::Content { path, why: e.to_string() }
        };
        let critic = |name: &str| {
            let (network, of) = read(&folder.join(name))?;
            match of == origin {
                true => Critic::new(network).map_err(shape(name)),
                false => Err(AgentError::Mixed { path: folder.into() }),
            }
        };
        let critics = match alone {
            true => None,
            false => Some(Arc::new([critic(FILES[0])?, critic(FILES[1])?])),
        };
        let actor = Arc::new(Actor::new(actor).map_err(shape(FILES[ACTOR]))?);
        Ok(Agent { actor, critics, origin })
    }
}

/// Reads a policy file and returns its network and its provenance.
fn read(path: &Path) -> Result<(Dense, Origin), AgentError> {
    let bytes = std::fs::read(path).map_err(|why| AgentError::Read { path: path.into(), why })?;
    let content = |why: String| AgentError::Content { path: path.into(), why };
    let origin: Origin = weights::origin(&bytes).map_err(content)?;
    if origin.schema != Origin::SCHEMA {
        let why =
            format!("its schema is {:?}, this program reads {}", origin.schema, Origin::SCHEMA);
        return Err(content(why));
    }
    Ok((weights::network(&bytes).map_err(content)?, origin))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::{ACTIONS, OBSERVATIONS};
    use greylag_num::stream;

    fn airframe() -> Airframe {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8");
        Airframe::load(&folder.join("airframe.toml")).unwrap()
    }

    fn agent(seed: u64) -> Agent {
        let mut rng = stream::stream(seed, &[]);
        let mut network = |sizes: &[usize]| Dense::uniform(sizes, &mut rng).unwrap();
        let actor = Actor::new(network(&[OBSERVATIONS, 20, ACTIONS])).unwrap();
        let mut critic = || Critic::new(network(&[OBSERVATIONS + ACTIONS, 20, 1])).unwrap();
        let origin = Origin {
            schema: Origin::SCHEMA.into(),
            airframe: fingerprint(&airframe()),
            model: "x8".into(),
            model_sha256: String::new(),
            seed,
            steps: 1000,
            evaluation: Some(Evaluated {
                targets: 24,
                easy_deg: 0.1 + 0.2,
                hard_deg: 1.0 / 3.0,
                divergence_rate: 0.0,
            }),
            program: "greylag 0".into(),
        };
        let critics = Some(Arc::new([critic(), critic()]));
        Agent { actor: Arc::new(actor), critics, origin }
    }

    fn write(agent: &Agent, folder: &Path, keep: impl Fn(&str) -> bool) {
        for (name, bytes) in agent.to_files().unwrap() {
            if keep(name) {
                std::fs::write(folder.join(name), bytes).unwrap();
            }
        }
    }

    #[test]
    fn a_folder_gives_the_same_policy_back() {
        let folder = tempfile::tempdir().unwrap();
        let agent = agent(3);
        write(&agent, folder.path(), |_| true);
        assert_eq!(Agent::load(folder.path(), &airframe()).unwrap(), agent);
    }

    #[test]
    fn a_policy_alone_has_no_critics_and_one_critic_is_too_few() {
        let folder = tempfile::tempdir().unwrap();
        let alone = Agent { critics: None, ..agent(3) };
        write(&alone, folder.path(), |_| true);
        assert_eq!(Agent::load(folder.path(), &airframe()).unwrap(), alone);
        write(&agent(3), folder.path(), |name| name.starts_with("critic1"));
        let said = Agent::load(folder.path(), &airframe()).unwrap_err().to_string();
        assert!(said.contains("critic2.safetensors"), "{said}");
    }

    #[test]
    fn what_is_missing_mixed_foreign_or_cut_short_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let load = || Agent::load(folder.path(), &airframe());
        assert!(load().unwrap_err().to_string().contains("a policy folder holds critic1"));
        write(&agent(3), folder.path(), |_| true);
        write(&agent(4), folder.path(), |name| name.starts_with("actor"));
        assert!(matches!(load(), Err(AgentError::Mixed { .. })));
        let mut foreign = agent(3);
        foreign.origin.airframe = "another".into();
        write(&foreign, folder.path(), |_| true);
        let said = load().unwrap_err().to_string();
        assert!(said.contains("another airframe than") && said.contains("model x8"), "{said}");
        let mut newer = agent(3);
        newer.origin.schema = "greylag.policy/2".into();
        write(&newer, folder.path(), |_| true);
        assert!(load().unwrap_err().to_string().contains("greylag.policy/2"));
        write(&agent(3), folder.path(), |_| true);
        let path = folder.path().join("critic2.safetensors");
        let bytes = std::fs::read(&path).unwrap();
        for length in (0..bytes.len()).step_by(311) {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(matches!(load(), Err(AgentError::Content { .. })), "{length} bytes");
        }
    }

    #[test]
    fn a_number_that_is_none_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut agent = agent(3);
        Arc::make_mut(&mut agent.actor).network_mut().parameters_mut()[7] = f32::NAN;
        write(&agent, folder.path(), |_| true);
        let said = Agent::load(folder.path(), &airframe()).unwrap_err().to_string();
        assert!(said.contains("parameter 7") && said.contains("actor.safetensors"), "{said}");
    }
}
