//! Constants of a sensor installation and of single flights that a model file states:
//!
//! ```toml
//! [installation]                       # holds for every flight whose own entry does not state axes or sensors
//! source = "greylag amend: 3 flights"
//! axes_deg = [0.0, -9.2, 0.0]          # roll, pitch, yaw of the measured axes relative to the body axes
//!
//! [flights."flight-1.csv"]
//! source = "greylag amend"
//! axes_deg = [0.3, -9.0, 0.1]          # replaces the installation's axes
//! trims = { CL0 = 0.021, Cm0 = -0.004 }
//! sensors = { airspeed_share = 0.01, alpha_rad = -0.002 }
//! ```

use std::collections::BTreeMap;

use serde::Deserialize;

/// Names of the trims of a flight: constants that are added to the model's coefficients in this flight, and a fraction of the
/// model's thrust that is added to the thrust.
pub const TRIMS: [&str; 7] = ["CD0", "CL0", "CY0", "Cl0", "Cm0", "Cn0", "thrust_share"];
/// Names of the constant sensor errors that remain in the reconstructed state: that of the airspeed as a fraction of it, then
/// those of body rates, α and β in the units of their names.
pub const SENSORS: [&str; 6] =
    ["airspeed_share", "p_radps", "q_radps", "r_radps", "alpha_rad", "beta_rad"];
/// Largest rotation angle of the measured axes that a model file may state, degrees. The section `[board]` of a mapping file
/// (see `logs`) states larger ones.
pub const MOST_DEG: f64 = 30.0;

/// Constants of a flight, or of the installation that all flights share. A constant that is not stated is unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlightConstants {
    /// Where the constants come from, in words.
    pub source: String,
    /// Rotation angles from the body axes to the measured axes, about body x, y and z, degrees.
    pub axes_deg: Option<[f64; 3]>,
    /// Values of the trims, dimensionless, in the order of [`TRIMS`]. Always `None` for an installation.
    pub trims: Option<[f64; TRIMS.len()]>,
    /// Sensor errors that remain in the reconstructed state, in the order and units of [`SENSORS`].
    pub sensors: Option<[f64; SENSORS.len()]>,
}

/// The constants that a model file states for the installation and for single flights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// Constants of the installation. `None` if the file has none.
    pub installation: Option<FlightConstants>,
    /// Constants of single flights, by the name of the flight.
    pub flights: BTreeMap<String, FlightConstants>,
}

impl FlightConstants {
    /// The rotation angles `axes_deg` in rad. Zero if they are unknown.
    pub fn axes_rad(&self) -> [f64; 3] {
        self.axes_deg.unwrap_or_default().map(f64::to_radians)
    }
}

impl Known {
    /// Whether the file states no such constants.
    pub fn is_empty(&self) -> bool {
        self.installation.is_none() && self.flights.is_empty()
    }

    /// Constants of `flight`. Axes and sensor errors that its own entry does not state are those of the installation. `None` if
    /// the file has neither an entry for the flight nor one for the installation.
    pub fn of(&self, flight: &str) -> Option<FlightConstants> {
        let shared = self.installation.as_ref();
        let Some(own) = self.flights.get(flight) else { return shared.cloned() };
        let mut own = own.clone();
        own.axes_deg = own.axes_deg.or(shared.and_then(|all| all.axes_deg));
        own.sensors = own.sensors.or(shared.and_then(|all| all.sensors));
        Some(own)
    }

    /// Whether the file has an own entry for `flight`.
    pub fn names(&self, flight: &str) -> bool {
        self.flights.contains_key(flight)
    }
}

/// Constants as they are written in a model file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConstantsFile {
    source: String,
    axes_deg: Option<[f64; 3]>,
    trims: Option<BTreeMap<String, f64>>,
    sensors: Option<BTreeMap<String, f64>>,
}

/// Checks the sections `installation` and `flights` of a model file and converts them. The error text names the faulty entry.
pub(super) fn checked(
    installation: Option<ConstantsFile>,
    flights: BTreeMap<String, ConstantsFile>,
) -> Result<Known, String> {
    if installation.as_ref().is_some_and(|all| all.trims.is_some()) {
        return Err(
            "installation.trims: trims that all flights share belong to the coefficients of \
                    [effects]; [flights.NAME] holds what one flight adds to them"
                .into(),
        );
    }
    let installation = installation.map(|all| constants("installation", all)).transpose()?;
    let one = |(name, own): (String, ConstantsFile)| {
        let constants = constants(&format!("flights.{name:?}"), own)?;
        Ok((name, constants))
    };
    let flights = flights.into_iter().map(one).collect::<Result<_, String>>()?;
    Ok(Known { installation, flights })
}

fn constants(place: &str, written: ConstantsFile) -> Result<FlightConstants, String> {
    let axes = written.axes_deg;
    if axes.is_some_and(|all| all.iter().any(|x| x.is_nan() || x.abs() > MOST_DEG)) {
        return Err(format!(
            "{place}.axes_deg: each angle must lie within ±{MOST_DEG}°; `[board]` in a mapping turns a log by more"
        ));
    }
    Ok(FlightConstants {
        source: written.source,
        axes_deg: axes,
        trims: written.trims.map(|all| named(place, "trims", all, TRIMS)).transpose()?,
        sensors: written.sensors.map(|all| named(place, "sensors", all, SENSORS)).transpose()?,
    })
}

/// The `values` in the order of `names`. Absent values become zero. Refuses unknown names and values outside −1..1.
fn named<const N: usize>(
    place: &str,
    key: &str,
    values: BTreeMap<String, f64>,
    names: [&str; N],
) -> Result<[f64; N], String> {
    if let Some(other) = values.keys().find(|name| !names.contains(&name.as_str())) {
        return Err(format!("{place}.{key}.{other} is unknown; it has {}", names.join(", ")));
    }
    if let Some((name, value)) = values.iter().find(|(_, x)| x.is_nan() || x.abs() > 1.0) {
        return Err(format!("{place}.{key}.{name} = {value} must lie within −1..1"));
    }
    Ok(names.map(|name| values.get(name).copied().unwrap_or(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Deserialize)]
    struct Part {
        installation: Option<ConstantsFile>,
        #[serde(default)]
        flights: BTreeMap<String, ConstantsFile>,
    }

    fn read(text: &str) -> Result<Known, String> {
        let part: Part = toml::from_str(text).unwrap();
        checked(part.installation, part.flights)
    }

    #[test]
    fn a_flight_has_its_own_constants_and_else_those_of_the_installation() {
        let known = read(
            "[installation]\nsource = \"s\"\naxes_deg = [0, -9, 0]\nsensors = { alpha_rad = 0.01 }\n\
             [flights.\"a.csv\"]\nsource = \"s\"\naxes_deg = [1, 0, 0]\ntrims = { Cm0 = 0.02 }\n",
        )
        .unwrap();
        let a = known.of("a.csv").unwrap();
        assert_eq!(a.axes_rad(), [1f64.to_radians(), 0.0, 0.0]);
        assert_eq!(a.trims.unwrap()[4], 0.02);
        assert_eq!(a.sensors.unwrap()[4], 0.01);
        let other = known.of("b.csv").unwrap();
        assert_eq!(other.axes_deg.unwrap()[1], -9.0);
        assert_eq!(other.trims, None);
        assert!(known.names("a.csv") && !known.names("b.csv"));
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_place() {
        let said = |text: &str| read(text).unwrap_err();
        let own = "[flights.x]\nsource = \"s\"\n";
        assert!(said(&format!("{own}trims = {{ CM0 = 0.1 }}")).contains("trims.CM0 is unknown"));
        assert!(said(&format!("{own}axes_deg = [0, 90, 0]")).contains("[board]"));
        assert!(
            said("[installation]\nsource = \"s\"\ntrims = { Cm0 = 0.1 }").contains("[effects]")
        );
    }
}
