//! Keys of stored results. A key contains a hash of all inputs of a result. A stored result is therefore valid if its key
//! equals the key for the present inputs.

use std::path::{Path, PathBuf};
use std::{fs, io};

use super::bench::Inner;
use super::session::{Accepted, Role};
use greylag_physics::formula::register;
use greylag_sysid::amend::document::sha256;

impl Inner {
    /// Key of a result of the kind `what`. The inputs are the version of the program, the model, the options for reading logs,
    /// the flights with their roles, and `effects`.
    pub fn key(&self, what: &str, effects: &[Accepted]) -> String {
        // flight names are included because results contain them; logs that cannot be read are not used
        let logs = |role: Role| -> String {
            let places = self.usable(&[role]);
            let named = places.iter().zip(self.names(&places));
            named.map(|(k, name)| self.session.logs[*k].sha256.clone() + &name).collect()
        };
        let text = |id: &str| register::find(id).map_or("", |effect| effect.text.as_str());
        let accepted = |e: &Accepted| format!("{}{}{}", e.id, e.anyway, text(&e.id));
        let effects: Vec<String> = effects.iter().map(accepted).collect();
        let all = [
            env!("CARGO_PKG_VERSION"),
            &self.session.model_sha256,
            &self.mapping.text,
            &format!("{:?}{}", self.given.tolerance, self.given.source_words()),
            &logs(Role::Fit),
            // a diagnosis does not use hold-out flights
            &if what == "diagnosis" { String::new() } else { logs(Role::HoldOut) },
            &effects.join("+"),
        ];
        format!("{what}-{}", &sha256(all.join("|").as_bytes())[..16])
    }

    /// Whether a file of the model has changed, or cannot be read, since the session read it.
    pub fn model_changed(&self) -> bool {
        fingerprint(&self.session.model).map_or(true, |now| now != self.session.model_sha256)
    }
}

/// One SHA-256 over all files of the model at `path`: the model file, its airframe, its residual and its effect files.
pub fn fingerprint(path: &Path) -> io::Result<String> {
    let text = fs::read_to_string(path)?;
    let table: toml::Table = toml::from_str(&text).unwrap_or_default();
    let folder = path.parent().unwrap_or(Path::new("."));
    let named = ["airframe", "residual"].into_iter().filter_map(|key| table.get(key));
    let own = table.get("effect_files").and_then(toml::Value::as_array).into_iter().flatten();
    let mut all = sha256(text.as_bytes());
    for name in named.chain(own).filter_map(toml::Value::as_str) {
        for file in files(&folder.join(name))? {
            all += &sha256(&fs::read(file)?);
        }
    }
    Ok(sha256(all.as_bytes()))
}

/// The file at `path` or, if `path` is a folder, all `.toml` files in it.
fn files(path: &Path) -> io::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.into()]);
    }
    let all = fs::read_dir(path)?.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?;
    let mut files: Vec<_> =
        all.into_iter().filter(|p| p.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_that_makes_a_model_is_in_its_fingerprint() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("effects")).unwrap();
        let model = "airframe = 'a.toml'\nresidual = 'r.safetensors'\neffect_files = ['effects']\n";
        let names = ["model.toml", "a.toml", "r.safetensors", "effects/own.toml"];
        for (name, text) in names.iter().zip([model, "a", "r", "e"]) {
            fs::write(at(name), text).unwrap();
        }
        let mut seen = vec![fingerprint(&at("model.toml")).unwrap()];
        for name in names {
            let text = fs::read_to_string(at(name)).unwrap();
            fs::write(at(name), text + "\n").unwrap();
            let now = fingerprint(&at("model.toml")).unwrap();
            assert!(!seen.contains(&now), "{name}");
            seen.push(now);
        }
    }
}
