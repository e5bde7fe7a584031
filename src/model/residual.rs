//! The learned residual F_a(s, z; θ_a), eq. (19) of \[GSFM26\] (see `src/lib.rs`): a small neural network with the parameters
//! θ_a. Its output for the state s and the actuator state z is added to the state rates (time derivatives of the state) of the
//! model's physical part.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use safetensors::SafeTensorError;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::data_envelope::DataEnvelope;
use crate::weights::{self, Square};
use greylag_num::dense::{DenseError, ON_STACK};
use greylag_num::{Dense, Real};
use greylag_physics::airframe::{ActuatorFigures, Geometry, Reference};
use greylag_physics::{Airframe, Controls, State};

/// Number of inputs of the network: V, p, q, r, α, β, then δa, δe, δt.
///
/// Roll and pitch are not inputs. The attitude acts on the aircraft only through gravity, which the physical part models
/// exactly. A residual that was learned in one attitude is therefore valid in every other.
pub const INPUTS: usize = 9;

/// Number of outputs of the network: the rates of the eight states, in units of x_c per second. x_c is the characteristic scale
/// of each state (eq. 21).
pub const OUTPUTS: usize = 8;

/// Name of the tensor in a residual's file that describes the envelope of its training data, see [`DataEnvelope`].
const ENVELOPE: &str = "data_envelope";

/// A learned contribution to the state rates.
#[derive(Clone, Debug, PartialEq)]
pub struct Residual {
    network: Arc<Dense>,
    scales: Scales,
    envelope: Option<Arc<DataEnvelope>>,
}

/// Fixed scales of the network's inputs and outputs. They come from the airframe, not from data. The scaled inputs are of order
/// one within the flight envelope. The outputs are in units of x_c, the characteristic scale of each state (eq. 21).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// Offset that is subtracted from each input, in the input's unit.
    pub offset: [f64; INPUTS],
    /// Factor by which each input is multiplied after the offset, in the inverse of the input's unit.
    pub factor: [f64; INPUTS],
    /// Factor by which each output is multiplied, x_c.
    pub output: [f64; OUTPUTS],
}

/// Origin of a residual, as stated in its file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Name and version of the file's format, [`Origin::SCHEMA`].
    pub schema: String,
    /// Fingerprint of the airframe to which the residual belongs, see [`fingerprint`].
    pub airframe: String,
    /// SHA-256 of the training data, hexadecimal.
    pub data: String,
    /// Seed of the training.
    pub seed: u64,
    /// Name and version of the program that trained the residual.
    pub program: String,
}

/// Reason why a residual cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ResidualError {
    /// The file cannot be read.
    #[error("cannot read residual {path}: {why}; a model folder holds model.toml and residual.safetensors", path = path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        why: std::io::Error,
    },
    /// The file does not contain a residual.
    #[error("residual {path}: {why}; train it again with `greylag train dynamics`", path = path.display())]
    Content {
        /// Path of the file.
        path: PathBuf,
        /// Description of the error.
        why: String,
    },
    /// The residual was trained for another airframe.
    #[error("residual {path} was learned for another airframe than {airframe}; use the airframe file it came with, or train it again", path = path.display())]
    Airframe {
        /// Path of the file.
        path: PathBuf,
        /// Name of the airframe to be flown.
        airframe: String,
    },
    /// The network has a wrong number of inputs or outputs.
    #[error("a residual takes a network of {INPUTS} inputs and {OUTPUTS} outputs, not {0:?}")]
    Shape(Vec<usize>),
    /// A layer has too many units.
    #[error("a residual's layers have up to {ON_STACK} units, not {0:?}; choose fewer")]
    Wide(Vec<usize>),
    /// The parameters do not form a network.
    #[error(transparent)]
    Network(#[from] DenseError),
}

impl Origin {
    /// Name and version of the format that this program reads and writes.
    pub const SCHEMA: &'static str = "greylag.residual/1";
}

/// SHA-256 of the airframe's properties on which a residual depends: name, geometry, actuators and reference airspeed.
pub fn fingerprint(airframe: &Airframe) -> String {
    hash(fingerprinted(airframe).as_bytes())
}

/// The text from which the fingerprint is computed. Its first part has the fields of schema 1 of the airframe file in a fixed
/// form, so that policies and residuals stay valid when an airframe gets further fields.
fn fingerprinted(airframe: &Airframe) -> String {
    let Geometry { area, span, chord } = airframe.geometry;
    let ActuatorFigures { aileron, elevator, throttle, step, .. } = airframe.actuators;
    let (surface, deflection_max) = (aileron.filter, aileron.travel.most);
    let mut text = format!(
        "{} Geometry {{ area: {area:?}, span: {span:?}, chord: {chord:?} }} ActuatorFigures {{ surface: \
         {surface:?}, throttle: {throttle:?}, deflection_max: {deflection_max:?}, step: {step:?} }}",
        airframe.name
    );
    if !fits_schema_1(&airframe.actuators) {
        let rudder = airframe.actuators.rudder;
        text += &format!(" aileron {aileron:?} elevator {elevator:?} rudder {rudder:?}");
    }
    // a residual's inputs and outputs are scaled by the reference airspeed
    if airframe.reference != Reference::OF_SCHEMA_1 {
        text += &format!(" reference airspeed {:?}", airframe.reference.airspeed);
    }
    text
}

/// Whether schema 1 can represent `figures`: identical surfaces, symmetric travel, no rate limit and no rudder.
fn fits_schema_1(figures: &ActuatorFigures) -> bool {
    let ActuatorFigures { aileron, elevator, rudder, .. } = figures;
    let plain = aileron.travel.is_symmetric() && aileron.rate_max.is_none();
    plain && elevator == aileron && rudder.is_none()
}

/// SHA-256 of `bytes` in hexadecimal digits.
pub fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

impl Scales {
    /// Scales for the aircraft of `airframe`. The scaled airspeed is its difference from V0 in units of V0/4. V0 is the reference
    /// airspeed, the airspeed's x_c. The units of p, q and r are 0.1, 0.02 and 0.05 times their x_c, which are typical of fast
    /// manoeuvres. The unit of α and β is 0.2 rad, about the stall angle. The unit of a deflection is the largest deflection of
    /// its surface. The scaled throttle is the difference from 0.5 in units of 0.5.
    pub fn new(airframe: &Airframe, x_c: [f64; OUTPUTS]) -> Scales {
        let [_, _, v0, p, q, r, _, _] = x_c;
        let unit = [0.25 * v0, 0.1 * p, 0.02 * q, 0.05 * r, 0.2, 0.2];
        let ActuatorFigures { aileron, elevator, .. } = airframe.actuators;
        let [aileron, elevator] = [aileron, elevator].map(|s| 1.0 / s.travel.largest());
        let mut factor = [aileron, elevator, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        factor.rotate_right(6);
        factor[..6].copy_from_slice(&unit.map(|u| 1.0 / u));
        let mut offset = [0.0; INPUTS];
        (offset[0], offset[8]) = (v0, 0.5);
        Scales { offset, factor, output: x_c }
    }

    /// Scaled inputs of the network for a state and controls.
    #[inline(always)]
    pub fn inputs<R: Real>(&self, state: &State<R>, controls: &Controls<R>) -> [R; INPUTS] {
        let State { airspeed, p, q, r, alpha, beta, .. } = *state;
        let Controls { aileron, elevator, throttle, .. } = *controls;
        // a plain loop: a closure might not be inlined, and would then not use the vector instructions of the caller
        let mut x = [airspeed, p, q, r, alpha, beta, aileron, elevator, throttle];
        for (i, x) in x.iter_mut().enumerate() {
            *x = (*x - R::from_f64(self.offset[i])).scale(self.factor[i]);
        }
        x
    }

    /// The state rates from the network's outputs, in the units of [`State`] per second.
    #[inline(always)]
    pub fn rate<R: Real>(&self, mut outputs: [R; OUTPUTS]) -> State<R> {
        for (x, scale) in outputs.iter_mut().zip(&self.output) {
            *x = x.scale(*scale);
        }
        State::from_array(outputs)
    }
}

impl Residual {
    /// A residual of `network` for the aircraft of `airframe`. `x_c` is the characteristic scale of each state, eq. (21).
    ///
    /// # Errors
    /// If the network does not have `INPUTS` inputs and `OUTPUTS` outputs, or a layer is too wide.
    pub fn new(
        network: Dense,
        airframe: &Airframe,
        x_c: [f64; OUTPUTS],
    ) -> Result<Residual, ResidualError> {
        let sizes = network.sizes();
        if (sizes[0], sizes[sizes.len() - 1]) != (INPUTS, OUTPUTS) {
            return Err(ResidualError::Shape(sizes.into()));
        }
        if sizes.iter().any(|n| *n > ON_STACK) {
            return Err(ResidualError::Wide(sizes.into()));
        }
        let scales = Scales::new(airframe, x_c);
        Ok(Residual { network: Arc::new(network), scales, envelope: None })
    }

    /// The same residual with the envelope of its training data `samples`.
    pub fn trained_on<'a>(
        mut self,
        samples: impl Iterator<Item = (&'a State, &'a Controls)>,
    ) -> Residual {
        let inputs: Vec<_> = samples.map(|(x, u)| self.scales.inputs(x, u)).collect();
        self.envelope = DataEnvelope::of(&self.network, &inputs).map(Arc::new);
        self
    }

    /// Distance of the point (`state`, `controls`) from the training data. It is at most 1 for 99.9 % of the training samples.
    /// Zero if the residual has no envelope.
    pub fn distance(&self, state: &State, controls: &Controls) -> f64 {
        let inputs = self.scales.inputs(state, controls);
        self.envelope.as_ref().map_or(0.0, |e| e.distance(&self.network, &inputs))
    }

    /// The network that computes the residual.
    pub fn network(&self) -> &Dense {
        &self.network
    }

    /// Contribution to the state rates, in the units of [`State`] per second.
    #[inline(always)]
    pub fn rate<R: Real>(&self, state: &State<R>, controls: &Controls<R>) -> State<R> {
        self.scales.rate(self.network.evaluate(self.scales.inputs(state, controls)))
    }

    /// Content of the residual's file in the format safetensors.
    ///
    /// # Errors
    /// If safetensors cannot serialise the tensors.
    pub fn to_bytes(&self, origin: &Origin) -> Result<Vec<u8>, SafeTensorError> {
        let envelope = self.envelope.as_ref().map(|e| Square {
            name: ENVELOPE,
            size: e.features(),
            entries: e.whitening(),
        });
        weights::to_bytes(&self.network, envelope, origin)
    }

    /// Reads the file of a residual for `airframe`. `x_c` is the characteristic scale of each state, eq. (21).
    ///
    /// # Errors
    /// If the file cannot be read, is not a residual, or is a residual of another airframe.
    pub fn load(
        path: &Path,
        airframe: &Airframe,
        x_c: [f64; OUTPUTS],
    ) -> Result<(Residual, Origin), ResidualError> {
        let bytes =
            std::fs::read(path).map_err(|why| ResidualError::Read { path: path.into(), why })?;
        let content = |why: String| ResidualError::Content { path: path.into(), why };
        let origin = origin(&bytes).map_err(content)?;
        let network = weights::network(&bytes).map_err(content)?;
        if origin.airframe != fingerprint(airframe) {
            let airframe = airframe.name.clone();
            return Err(ResidualError::Airframe { path: path.into(), airframe });
        }
        let whitening = weights::matrix(&bytes, ENVELOPE).map_err(content)?;
        // this rejects a network of another shape before the envelope is computed with it
        let residual = Residual::new(network, airframe, x_c)?;
        let envelope = whitening.map(|w| DataEnvelope::new(w, &residual.network)).transpose();
        let envelope = envelope.map_err(content)?.map(Arc::new);
        Ok((Residual { envelope, ..residual }, origin))
    }
}

/// The origin of a residual from the metadata of its file.
fn origin(bytes: &[u8]) -> Result<Origin, String> {
    let origin: Origin = weights::origin(bytes)?;
    match origin.schema.as_str() {
        Origin::SCHEMA => Ok(origin),
        other => Err(format!("its schema is {other:?}, this program reads {}", Origin::SCHEMA)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GreyBox;
    use greylag_num::stream;
    use rand::RngExt;

    fn model() -> GreyBox {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8");
        GreyBox::load(&folder.join("prior.toml")).unwrap()
    }

    #[test]
    fn the_fingerprint_of_schema_1_stays_what_it_was() {
        let airframe = model().airframe;
        // the fingerprint of the policy in params/x8/policy, which was trained before the form of the text was fixed
        let shipped = "b6f028741a1b461a25f87aa5eb0301411d7b376dcf4090784acced3ed87224c6";
        assert_eq!(fingerprint(&airframe), shipped);
        // an aircraft that schema 1 cannot describe has another fingerprint
        let mut other = airframe.clone();
        other.actuators.elevator.travel.least *= 0.9;
        assert_ne!(fingerprint(&other), shipped);
        let mut faster = airframe.clone();
        faster.reference.airspeed = 25.0;
        assert_ne!(fingerprint(&faster), shipped);
    }

    fn residual(model: &GreyBox) -> Residual {
        let mut rng = stream::stream(3, &[]);
        let mut network = Dense::silent(&[INPUTS, 16, OUTPUTS], &mut rng).unwrap();
        network.parameters_mut().iter_mut().for_each(|p| *p = rng.random_range(-0.3..0.3));
        Residual::new(network, &model.airframe, model.scale()).unwrap()
    }

    fn origin_of(model: &GreyBox) -> Origin {
        Origin {
            schema: Origin::SCHEMA.into(),
            airframe: fingerprint(&model.airframe),
            data: hash(b"flights"),
            seed: 7,
            program: "greylag 0".into(),
        }
    }

    #[test]
    fn inputs_are_of_order_one_and_know_no_attitude() {
        let model = model();
        let scales = Scales::new(&model.airframe, model.scale());
        let stop = model.airframe.actuators.aileron.travel.most;
        let controls =
            Controls { aileron: stop, elevator: -stop, throttle: 1.0, rudder: 0.0, lagged: None };
        let stall = State { airspeed: 1.25 * 16.67, alpha: 0.2, beta: -0.2, ..State::NEUTRAL };
        let there = scales.inputs(&stall, &controls);
        for (x, expected) in there.iter().zip([1.0, 0.0, 0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 1.0]) {
            assert!((x - expected).abs() < 1e-12, "{there:?}");
        }
        assert_eq!(scales.inputs(&State { roll: 1.0, pitch: -1.0, ..stall }, &controls), there);
    }

    #[test]
    fn files_give_the_same_residual_back_and_equal_ones_are_equal() {
        let model = model();
        let samples = [(State::NEUTRAL, Controls::default())];
        let trained = residual(&model).trained_on(samples.iter().map(|(x, u)| (x, u)));
        let (residual, origin) = (trained, origin_of(&model));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("residual.safetensors");
        let bytes = residual.to_bytes(&origin).unwrap();
        assert_eq!(bytes, residual.to_bytes(&origin).unwrap());
        std::fs::write(&path, bytes).unwrap();
        let (read, said) = Residual::load(&path, &model.airframe, model.scale()).unwrap();
        assert_eq!((read, said), (residual, origin));
    }

    #[test]
    fn files_of_another_airframe_or_cut_short_are_refused() {
        let model = model();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("residual.safetensors");
        let load = || Residual::load(&path, &model.airframe, model.scale());
        assert!(matches!(load(), Err(ResidualError::Read { .. })));
        let bytes = residual(&model).to_bytes(&origin_of(&model)).unwrap();
        let foreign = Origin { airframe: hash(b"another"), ..origin_of(&model) };
        std::fs::write(&path, residual(&model).to_bytes(&foreign).unwrap()).unwrap();
        assert!(matches!(load(), Err(ResidualError::Airframe { .. })));
        for length in (0..bytes.len()).step_by(97) {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(matches!(load(), Err(ResidualError::Content { .. })), "{length} bytes");
        }
        let newer = Origin { schema: "greylag.residual/2".into(), ..origin_of(&model) };
        std::fs::write(&path, residual(&model).to_bytes(&newer).unwrap()).unwrap();
        let said = load().unwrap_err().to_string();
        assert!(said.contains("greylag.residual/2") && said.contains("train it again"), "{said}");
    }
}
