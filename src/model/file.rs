//! Reader of model files. A model file is a TOML file with the model's effects (terms of forces, moments, body or actuators)
//! and their coefficients. It states the source of every number.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;

use super::grey_box::{Points, Term};
use super::known::{self, ConstantsFile};
use super::residual::hash;
use super::{GreyBox, Integrator, Named, Residual};
use greylag_num::{Grid, Table};
use greylag_physics::Airframe;
use greylag_physics::actuators::LAGS;
use greylag_physics::airframe::{
    FileError, Sourced, check_schema, named, positive, toml_error, within,
};
use greylag_physics::atmosphere::{Atmosphere, Density};
use greylag_physics::effects::{Coefficient, Description, Kind};
use greylag_physics::formula::{Written, register};
use greylag_physics::rigid_body::{ForceAxes, RigidBody};
use greylag_physics::size::Size;
use greylag_physics::{catalogue, inputs};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    name: String,
    description: String,
    airframe: String,
    integrator: Integrator,
    force_axes: ForceAxes,
    rigid_body: BodyFile,
    air: AirFile,
    residual: Option<String>,
    /// Paths of effect files and of folders with effect files, relative to the model file.
    #[serde(default)]
    effect_files: Vec<String>,
    effects: toml::Table,
    installation: Option<ConstantsFile>,
    #[serde(default)]
    flights: BTreeMap<String, ConstantsFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BodyFile {
    mass_kg: Sourced,
    jx_kgm2: Sourced,
    jy_kgm2: Sourced,
    jz_kgm2: Sourced,
    jxz_kgm2: Sourced,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AirFile {
    gravity_mps2: Sourced,
    density: DensityFile,
}

#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "density must be \"standard\" or { kgpm3 = { value = …, source = … } }"
)]
enum DensityFile {
    Constant(ConstantDensity),
    Law(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConstantDensity {
    kgpm3: Sourced,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TableFile {
    alpha_rad: Vec<f64>,
    value: Vec<f64>,
    #[serde(rename = "source")]
    _source: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GridFile {
    throttle: Vec<f64>,
    airspeed_mps: Vec<f64>,
    /// The values, with one row for each throttle and one column for each airspeed.
    value: Vec<Vec<f64>>,
    #[serde(rename = "source")]
    _source: String,
}

impl GreyBox {
    /// Reads a model file (`schema = 1`) and the files that it names. Their paths are relative to the model file.
    ///
    /// # Errors
    /// If a file cannot be read, has a syntax error or another schema, names an unknown effect or coefficient, lacks a
    /// coefficient, or has a number that is not physical.
    pub fn load(path: &Path) -> Result<GreyBox, FileError> {
        let what = "model file";
        let text = greylag_physics::text_file::read(path).map_err(|why| FileError::Read {
            what,
            path: path.into(),
            why,
            example: "prior.toml",
        })?;
        GreyBox::parse(&text, path)
    }

    /// Parses the text of a model file and reads the files that it names. `path` is the present or intended path of the model
    /// file. Paths in the text are relative to it.
    ///
    /// # Errors
    /// The same as for [`GreyBox::load`], except that the model file itself is not read.
    pub fn parse(text: &str, path: &Path) -> Result<GreyBox, FileError> {
        let what = "model file";
        let content = |why| FileError::Content { what, path: path.into(), why };
        let file: File = toml::from_str(text).map_err(|e| content(toml_error(text, &e)))?;
        check_schema(file.schema, 1).map_err(content)?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let airframe = Airframe::load(&folder.join(&file.airframe))?;
        for own in &file.effect_files {
            register::load(&folder.join(own))?;
        }
        let learned = file.residual.clone();
        let mut model = file.into_model(airframe).map_err(content)?;
        let mut bytes = text.as_bytes().to_vec();
        if let Some(name) = learned {
            let path = folder.join(name);
            let read = Residual::load(&path, &model.airframe, model.scale());
            model.residual = Some(read.map_err(|e| content(e.to_string()))?.0);
            bytes.extend(std::fs::read(&path).map_err(|e| content(e.to_string()))?);
        }
        model.written().for_each(|own| bytes.extend(own.text.as_bytes()));
        model.sha256 = hash(&bytes);
        Ok(model)
    }
}

impl GreyBox {
    /// Makes a model from the texts of a model file and its airframe file, without files on disk. The model file must name
    /// neither a residual (learned network) nor effect files.
    ///
    /// # Errors
    /// If a text has a fault as for [`GreyBox::load`], or names a residual or effect files.
    pub fn from_texts(model: &str, airframe: &str) -> Result<GreyBox, String> {
        let file: File = toml::from_str(model).map_err(|e| toml_error(model, &e))?;
        check_schema(file.schema, 1)?;
        if file.residual.is_some() || !file.effect_files.is_empty() {
            return Err("it names files beside it; load it from its folder".into());
        }
        let mut read = file.into_model(Airframe::parse(airframe)?)?;
        read.sha256 = hash(model.as_bytes());
        Ok(read)
    }
}

/// Accepted moments of inertia, kg m²: from aircraft of a few grams to airliners.
const INERTIA: [f64; 2] = [1e-7, 1e9];

fn inertia(field: &str, number: &Sourced) -> Result<f64, String> {
    within(field, number, INERTIA)
}

impl File {
    fn into_model(self, airframe: Airframe) -> Result<GreyBox, String> {
        let body = self.rigid_body.checked()?;
        let known = known::checked(self.installation, self.flights)?;
        let size = Size::new(&body, &airframe.geometry).lifted_at(
            airframe.envelope.airspeed_min_mps,
            &body,
            &airframe.geometry,
        );
        let mut terms = Vec::new();
        let (mut coefficients, mut acting) = (Vec::new(), Vec::new());
        for (id, content) in &self.effects {
            let first = coefficients.len();
            if let Some(kind) = inputs::Kind::from_id(id) {
                coefficients.extend(effect(&kind.describe(), None, content, &size)?.0);
                acting.push((kind, first));
                continue;
            }
            let kind = Kind::from_id(id).ok_or_else(|| unknown_effect(id))?;
            let (named, points) = effect(&kind.describe(), kind.written(), content, &size)?;
            coefficients.extend(named);
            terms.push(Term::new(kind, first, points));
        }
        if terms.is_empty() {
            return Err(
                "it names no effect, so nothing would hold the aircraft up; add [effects.…]".into(),
            );
        }
        can_be_remembered(acting.len(), &terms)?;
        let mut model = GreyBox {
            lags: 0,
            rudder_is_left: false,
            name: named(self.name)?,
            description: self.description,
            sha256: String::new(),
            airframe,
            body,
            bare_body: body,
            atmosphere: self.air.checked()?,
            axes: self.force_axes,
            integrator: self.integrator,
            residual: None,
            terms,
            independent: 0,
            inputs: acting,
            coefficients,
            known: Arc::new(known),
        };
        model.settle();
        if model.body.is_physical() {
            return Ok(model);
        }
        Err("its effects leave no positive mass, or jx·jz not above jxz²; give them smaller values"
            .into())
    }
}

/// Checks that the model has no more input effects (between actuators and surfaces), lags and delays than its memory can hold.
fn can_be_remembered(inputs: usize, terms: &[Term]) -> Result<(), String> {
    if inputs > inputs::MOST {
        return Err(format!(
            "it names {inputs} effects between actuators and surfaces; {} is the most",
            inputs::MOST
        ));
    }
    let lags: usize =
        terms.iter().filter_map(|t| t.kind.written()).map(|e| e.memories().len()).sum();
    match lags > LAGS {
        true => Err(format!(
            "the formulas of its effects have {lags} lags and delays; {LAGS} is the most"
        )),
        false => Ok(()),
    }
}

impl BodyFile {
    fn checked(&self) -> Result<RigidBody, String> {
        let body = RigidBody {
            mass: positive("rigid_body.mass_kg", &self.mass_kg, 1e6)?,
            jx: inertia("rigid_body.jx_kgm2", &self.jx_kgm2)?,
            jy: inertia("rigid_body.jy_kgm2", &self.jy_kgm2)?,
            jz: inertia("rigid_body.jz_kgm2", &self.jz_kgm2)?,
            jxz: self.jxz_kgm2.value,
        };
        if body.is_physical() {
            return Ok(body);
        }
        Err(format!(
            "rigid_body.jxz_kgm2 = {} is not physical: jx·jz = {} must exceed its square",
            body.jxz,
            body.jx * body.jz
        ))
    }
}

impl AirFile {
    fn checked(&self) -> Result<Atmosphere, String> {
        let density = match &self.density {
            DensityFile::Constant(ConstantDensity { kgpm3 }) => {
                Density::Constant(positive("air.density.kgpm3", kgpm3, 2.0)?)
            }
            DensityFile::Law(law) if law == "standard" => Density::Standard,
            DensityFile::Law(law) => {
                return Err(format!(
                    "air.density = {law:?} is unknown; write \"standard\" or {{ kgpm3 = {{ value = …, source = … }} }}"
                ));
            }
        };
        Ok(Atmosphere { density, gravity: positive("air.gravity_mps2", &self.gravity_mps2, 12.0)? })
    }
}

/// Coefficients and tables of one effect from its TOML table. If the effect comes from an effect file, coefficients that the
/// table lacks have the values of that file.
fn effect(
    about: &Description,
    written: Option<&Written>,
    content: &toml::Value,
    size: &Size,
) -> Result<(Vec<Named>, Points), String> {
    let id = about.id;
    let entries = content
        .as_table()
        .ok_or_else(|| format!("effects.{id} must be a table of coefficients"))?;
    let tables = about.table.into_iter().chain(about.grid);
    let names: Vec<_> = about.coefficients.iter().map(|c| c.name).chain(tables).collect();
    if let Some(key) = entries.keys().find(|key| !names.contains(&key.as_str())) {
        return Err(format!("effects.{id}.{key} is unknown; {id} has {}", names.join(", ")));
    }
    let get = |key: &str| {
        entries.get(key).cloned().ok_or_else(|| format!("effects.{id}.{key} is missing; add it"))
    };
    let mut named = Vec::new();
    for (place, c) in about.coefficients.iter().enumerate() {
        let own = written.filter(|_| !entries.contains_key(c.name));
        let number = match own {
            Some(own) => own.number(place),
            None => get(c.name)?.try_into().map_err(|e: toml::de::Error| {
                let why = e.message().lines().collect::<Vec<_>>().join("; ");
                format!("effects.{id}.{}: {why}", c.name)
            })?,
        };
        named.push(checked(id, c, &number, size)?);
    }
    let at = |key: &str, why: String| format!("effects.{id}.{key}: {why}");
    let table = |key: &str| -> Result<Table, String> {
        let points: TableFile = points(get(key)?).map_err(|why| at(key, why))?;
        Table::new(&points.alpha_rad, &points.value).map_err(|e| at(key, e.to_string()))
    };
    let grid = |key: &str| -> Result<Grid, String> {
        let GridFile { throttle, airspeed_mps, value, .. } =
            points(get(key)?).map_err(|why| at(key, why))?;
        Grid::new(&throttle, &airspeed_mps, &value).map_err(|e| at(key, e.to_string()))
    };
    let points = Points {
        table: about.table.map(table).transpose()?,
        grid: about.grid.map(grid).transpose()?,
    };
    Ok((named, points))
}

/// The coefficient `about` of the effect `id` with the value `number`, checked against its bounds. The bounds are those in the
/// file, or else the physical bounds for an aircraft of `size`.
fn checked(id: &str, about: &Coefficient, number: &Sourced, size: &Size) -> Result<Named, String> {
    let name = about.name;
    let own = number.bounds.map(|[low, high]| (low, high));
    if own.is_some_and(|(low, high)| !(low < high && (high - low).is_finite())) {
        return Err(format!("effects.{id}.{name}.bounds must be [least, most]"));
    }
    let (low, high) = own.unwrap_or_else(|| size.bounds(about));
    if !(low..=high).contains(&number.value) {
        return Err(format!(
            "effects.{id}.{name} = {} is not physical: {} lies in {low}..{high} {}",
            number.value, about.meaning, about.unit
        ));
    }
    if number.sd.is_some_and(|sd| !(sd.is_finite() && sd > 0.0)) {
        return Err(format!("effects.{id}.{name}.sd must be a positive number"));
    }
    let (value, sd, bounds) = (number.value, number.sd, number.bounds);
    Ok(Named { name: format!("{id}.{name}"), value, sd, bounds })
}

fn points<T: serde::de::DeserializeOwned>(content: toml::Value) -> Result<T, String> {
    content.try_into().map_err(|e| e.message().lines().collect::<Vec<_>>().join("; "))
}

fn unknown_effect(id: &str) -> String {
    let ids: Vec<_> = catalogue::all().map(|about| about.id).collect();
    format!(
        "effects.{id:?} is unknown to this program; an effect of a file needs that file in effect_files = […]; the \
         catalogue has {}",
        ids.join(", ")
    )
}
