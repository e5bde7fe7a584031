//! Exports a model as the files of a JSBSim aircraft.

mod aerodynamics;
mod conditions;
mod effectors;
mod engine;

use std::fmt::Write;

use super::GreyBox;
use conditions::Conditions;
pub use conditions::ConditionsError;
use greylag_physics::airframe::ActuatorFigures;
use greylag_physics::rigid_body::ForceAxes;
use greylag_physics::servos::Surface;

/// Pound of force in newtons.
const LBF: f64 = 4.448_221_615_260_5;
/// Length of a foot, m.
const FT: f64 = 0.3048;
/// Pound of mass in kilograms.
const LB: f64 = 0.453_592_37;
/// Slug times foot squared, kg m².
const SLUG_FT2: f64 = 1.355_817_948_331_4;

/// The files of an exported aircraft. Their paths are relative to the aircraft's folder.
#[derive(Clone, Debug)]
pub struct Exported {
    /// Path and text of each file.
    pub files: Vec<(String, String)>,
    /// Names of what the export omits: effects, force axes, the learned residual, rate limits.
    pub left_out: Vec<String>,
}

const ALPHA: &str = "aero/alpha-rad";
const BETA: &str = "aero/beta-rad";
const AILERON: &str = "fcs/effective-aileron-pos";
const ELEVATOR: &str = "fcs/elevator-pos-rad";
const RUDDER: &str = "fcs/rudder-pos-rad";
const THROTTLE: &str = "fcs/throttle-pos-norm";

/// Exports `model` as the aircraft `name`, for a single condition such as one flap setting.
pub fn export(model: &GreyBox, name: &str) -> Exported {
    written(&Conditions::one(model), name)
}

/// Exports the aircraft `name` that `models` describe in several conditions, for example flap settings.
///
/// The models differ in their aerodynamic coefficients, and in the value of one JSBSim property in the `[conditions]` of their
/// airframes. The exported aircraft reads this property. Its aerodynamic forces and moments are interpolated between the
/// values. Beyond the lowest and the highest value they are constant.
///
/// # Errors
/// [`ConditionsError`], if the models differ in another quantity, or do not differ in exactly one condition.
pub fn export_in_conditions(models: &[GreyBox], name: &str) -> Result<Exported, ConditionsError> {
    Ok(written(&Conditions::of(models)?, name))
}

/// Names of what the export omits from `model`.
fn left_out(model: &GreyBox) -> Vec<String> {
    let effect = |full: &str| full.split('.').next().unwrap_or_default().to_owned();
    let known = |name: &str| aerodynamics::knows(name) || engine::knows(name);
    // the exported mass and inertia already include these effects
    let of_body = |name: &str| name.starts_with("mass_error.") || name.starts_with("inertia_xz.");
    let lost = model
        .coefficients()
        .iter()
        .filter(|c| !known(&c.name) && !of_body(&c.name) && c.value != 0.0);
    let mut left_out: Vec<String> = lost.map(|c| effect(&c.name)).collect();
    if model.axes != ForceAxes::Wind {
        left_out.push("force axes that are not those of the wind".into());
    }
    if model.residual.is_some() {
        left_out.push("the residual network".into());
    }
    let ActuatorFigures { aileron, elevator, rudder, .. } = &model.airframe.actuators;
    let surfaces =
        [("aileron", Some(aileron)), ("elevator", Some(elevator)), ("rudder", rudder.as_ref())];
    for (surface, _) in surfaces.iter().filter(|(_, s)| s.is_some_and(|s| s.rate_max.is_some())) {
        left_out.push(format!("the largest rate of the {surface}"));
    }
    left_out
}

fn written(conditions: &Conditions, name: &str) -> Exported {
    let mut left_out: Vec<String> = conditions.models().flat_map(left_out).collect();
    left_out.sort();
    left_out.dedup();
    let (motor, thruster) = (format!("{name}_motor"), format!("{name}_direct"));
    let files = vec![
        (format!("{name}.xml"), document(conditions, name, [&motor, &thruster])),
        (
            format!("Engines/{motor}.xml"),
            format!(
                "<?xml version=\"1.0\"?>\n<!-- Gives the aircraft a throttle; the thrust is an external force. -->\n\
                 <electric_engine name=\"{motor}\">\n  <power unit=\"WATTS\"> 0.0 </power>\n</electric_engine>\n"
            ),
        ),
        (
            format!("Engines/{thruster}.xml"),
            format!("<?xml version=\"1.0\"?>\n<direct name=\"{thruster}\"/>\n"),
        ),
    ];
    Exported { files, left_out }
}

fn document(conditions: &Conditions, name: &str, [motor, thruster]: [&str; 2]) -> String {
    let model = conditions.first();
    let (geometry, body) = (model.airframe.geometry, &model.body);
    let place = "<x> 0 </x> <y> 0 </y> <z> 0 </z>";
    let mut out = format!(
        "<?xml version=\"1.0\"?>\n<!-- Written by `greylag aircraft export jsbsim` from the model {}. -->\n\
         <fdm_config name=\"{name}\" version=\"2.0\" release=\"BETA\">\n\n  <metrics>\n    <wingarea unit=\"M2\"> {:?} \
         </wingarea>\n    <wingspan unit=\"M\"> {:?} </wingspan>\n    <chord unit=\"M\"> {:?} </chord>\n",
        // a comment in XML must not contain a double hyphen
        conditions.names().replace("--", "__"),
        geometry.area,
        geometry.span,
        geometry.chord
    );
    for point in ["AERORP", "EYEPOINT", "VRP"] {
        let _ = writeln!(out, "    <location name=\"{point}\" unit=\"M\"> {place} </location>");
    }
    let _ = write!(
        out,
        "  </metrics>\n\n  <mass_balance negated_crossproduct_inertia=\"false\">\n    <ixx unit=\"SLUG*FT2\"> {:?} </ixx>\n\
         \x20   <iyy unit=\"SLUG*FT2\"> {:?} </iyy>\n    <izz unit=\"SLUG*FT2\"> {:?} </izz>\n    <ixz unit=\"SLUG*FT2\"> {:?} \
         </ixz>\n    <emptywt unit=\"LBS\"> {:?} </emptywt>\n    <location name=\"CG\" unit=\"M\"> {place} </location>\n  \
         </mass_balance>\n\n  <ground_reactions/>\n\n  <propulsion>\n    <engine file=\"{motor}\">\n      <thruster \
         file=\"{thruster}\">\n        <location unit=\"M\"> {place} </location>\n        <orient unit=\"DEG\"> <roll> 0 \
         </roll> <pitch> 0 </pitch> <yaw> 0 </yaw> </orient>\n      </thruster>\n    </engine>\n  </propulsion>\n\n",
        body.jx / SLUG_FT2,
        body.jy / SLUG_FT2,
        body.jz / SLUG_FT2,
        body.jxz / SLUG_FT2,
        body.mass / LB
    );
    out.push_str(&engine::force(model));
    out.push_str(&controls(conditions, name));
    out.push_str(&aerodynamics::section(conditions));
    out.push_str("</fdm_config>\n");
    out
}

/// Value of the coefficient `name`. Zero if the model has no such coefficient.
fn coefficient(model: &GreyBox, name: &str) -> f64 {
    model.coefficients().iter().find(|c| c.name == name).map_or(0.0, |c| c.value)
}

fn product(value: f64, factors: &[&str], indent: &str) -> String {
    if factors.is_empty() {
        // JSBSim warns about a product with a single factor
        return format!("{indent}<value>{value:?}</value>\n");
    }
    let properties: String = factors.iter().map(|f| format!(" <property>{f}</property>")).collect();
    format!("{indent}<product> <value>{value:?}</value>{properties} </product>\n")
}

fn controls(conditions: &Conditions, name: &str) -> String {
    let model = conditions.first();
    let figures = &model.airframe.actuators;
    let mut out = format!("  <flight_control name=\"{name}\">\n");
    out.push_str(&conditions.declaration());
    let apart = model.airframe.mixer.as_ref().and_then(|m| effectors::channels(m, figures));
    out.push_str(&apart.unwrap_or_else(|| usual_surfaces(figures)));
    // the coefficient b of the throttle's discrete filter is k/(2 + k) with k = step/lag
    let [b, _] = figures.throttle;
    let lag = figures.step * (1.0 - b) / (2.0 * b);
    let _ = write!(
        out,
        "    <channel name=\"throttle\">\n      <lag_filter name=\"fcs/throttle-actuator\">\n        <input> \
         fcs/throttle-cmd-norm </input>\n        <c1> {:?} </c1>\n        <output> {THROTTLE} </output>\n      </lag_filter>\n{}    \
         </channel>\n    <channel name=\"density\">\n      <fcs_function name=\"fcs/density-ratio\">\n        <function> \
         <quotient> <property>atmosphere/rho-slugs_ft3</property> <value>{:?}</value> </quotient> </function>\n      \
         </fcs_function>\n      <fcs_function name=\"fcs/mag-elevator-pos-rad\">\n        <function> <abs> \
         <property>{ELEVATOR}</property> </abs> </function>\n      </fcs_function>\n    </channel>\n{}  </flight_control>\n\n",
        1.0 / lag,
        engine::lag(model),
        // 1.225 kg/m³ in slug/ft³
        1.225 / (LBF / FT / (FT * FT * FT)),
        conditions.weights(),
    );
    out
}

/// Channels with the filters of aileron, elevator and rudder for JSBSim's usual commands.
fn usual_surfaces(figures: &ActuatorFigures) -> String {
    let surfaces = [
        ("aileron", Some(&figures.aileron), AILERON),
        ("elevator", Some(&figures.elevator), ELEVATOR),
        ("rudder", figures.rudder.as_ref(), RUDDER),
    ];
    let one = |(name, figure, position): (&str, Option<&Surface>, &str)| {
        let command = format!("fcs/{name}-cmd-norm");
        figure.map(|figure| surface(name, figure, figures.step, &command, position))
    };
    surfaces.into_iter().filter_map(one).collect()
}

/// Natural frequency (rad/s) and damping ratio of a surface's discrete filter, by the inverse bilinear transform. `step` is in s.
fn analogue(surface: &Surface, step: f64) -> [f64; 2] {
    let [b, _, a2] = surface.filter;
    // with w = natural frequency × step: b = w²/d, a2 = (4 − 4ζw + w²)/d, d = 4 + 4ζw + w², so 1 + a2 = (8 + 2w²)/d
    let square = 8.0 * b / (1.0 + a2 - 2.0 * b);
    let w = square.sqrt();
    let d = square / b;
    [w / step, (d - 4.0 - square) / (4.0 * w)]
}

fn surface(name: &str, surface: &Surface, step: f64, command: &str, position: &str) -> String {
    let [w, damping] = analogue(surface, step);
    let (least, most) = (surface.travel.least, surface.travel.most);
    let (square, middle) = (w * w, 2.0 * damping * w);
    format!(
        "    <channel name=\"{name}\">\n      <aerosurface_scale name=\"fcs/{name}-cmd-rad\">\n        <input> \
         {command} </input>\n        <range> <min> {least:?} </min> <max> {most:?} </max> </range>\n      \
         </aerosurface_scale>\n      <second_order_filter name=\"fcs/{name}-actuator\">\n        <input> fcs/{name}-cmd-rad \
         </input>\n        <c1> 0 </c1> <c2> 0 </c2> <c3> {square:?} </c3>\n        <c4> 1 </c4> <c5> {middle:?} </c5> <c6> \
         {square:?} </c6>\n        <clipto> <min> {least:?} </min> <max> {most:?} </max> </clipto>\n        <output> {position} \
         </output>\n      </second_order_filter>\n    </channel>\n"
    )
}
