//! A model as an aircraft of JSBSim.

mod effectors;

use std::fmt::Write;

use super::GreyBox;
use crate::num::Table;
use crate::physics::airframe::ActuatorFigures;
use crate::physics::rigid_body::ForceAxes;
use crate::physics::servos::Surface;

/// Newtons per pound of force.
const LBF: f64 = 4.448_221_615_260_5;
/// Metres per foot.
const FT: f64 = 0.3048;
/// Kilograms per pound.
const LB: f64 = 0.453_592_37;
/// kg m² per slug ft².
const SLUG_FT2: f64 = 1.355_817_948_331_4;

/// The files of an aircraft, by their path below the folder of the aircraft's name.
#[derive(Clone, Debug)]
pub struct Exported {
    /// Path and text.
    pub files: Vec<(String, String)>,
    /// Effects of the model that the files do not have.
    pub left_out: Vec<String>,
}

/// Where a coefficient acts: axis, then the factors beside q S (and b or c for a moment).
type Factor = (&'static str, &'static str, &'static [&'static str]);

const ALPHA: &str = "aero/alpha-rad";
const BETA: &str = "aero/beta-rad";
const AILERON: &str = "fcs/effective-aileron-pos";
const ELEVATOR: &str = "fcs/elevator-pos-rad";
const RUDDER: &str = "fcs/rudder-pos-rad";
const THROTTLE: &str = "fcs/throttle-pos-norm";
const SPEED: &str = "velocities/vt-fps";
const P: [&str; 2] = ["aero/bi2vel", "velocities/p-aero-rad_sec"];
const Q: [&str; 2] = ["aero/ci2vel", "velocities/q-aero-rad_sec"];
const R: [&str; 2] = ["aero/bi2vel", "velocities/r-aero-rad_sec"];

/// The coefficients that JSBSim has as products of properties.
const FACTORS: &[Factor] = &[
    ("lift_linear.CL0", "LIFT", &[]),
    ("lift_linear.CLalpha", "LIFT", &[ALPHA]),
    ("lift_linear.CLq", "LIFT", &Q),
    ("lift_linear.CLde", "LIFT", &[ELEVATOR]),
    ("drag_linear.CD0", "DRAG", &[]),
    ("drag_linear.CDalpha", "DRAG", &[ALPHA]),
    ("drag_linear.CDq", "DRAG", &Q),
    ("drag_linear.CDde", "DRAG", &[ELEVATOR]),
    ("drag_alpha2.CDalpha2", "DRAG", &[ALPHA, ALPHA]),
    ("drag_beta2.CDbeta", "DRAG", &["aero/mag-beta-rad"]),
    ("drag_beta2.CDbeta2", "DRAG", &[BETA, BETA]),
    ("drag_elevator_abs.CDde", "DRAG", &["fcs/mag-elevator-pos-rad"]),
    ("side_force_linear.CY0", "SIDE", &[]),
    ("side_force_linear.CYbeta", "SIDE", &[BETA]),
    ("side_force_linear.CYp", "SIDE", &P),
    ("side_force_linear.CYr", "SIDE", &R),
    ("side_force_linear.CYda", "SIDE", &[AILERON]),
    ("rudder_linear.CYdr", "SIDE", &[RUDDER]),
    ("roll_linear.Cl0", "ROLL", &[]),
    ("roll_linear.Clbeta", "ROLL", &[BETA]),
    ("roll_linear.Clp", "ROLL", &P),
    ("roll_linear.Clr", "ROLL", &R),
    ("roll_linear.Clda", "ROLL", &[AILERON]),
    ("rudder_linear.Cldr", "ROLL", &[RUDDER]),
    ("pitch_linear.Cm0", "PITCH", &[]),
    ("pitch_linear.Cmalpha", "PITCH", &[ALPHA]),
    ("pitch_linear.Cmq", "PITCH", &Q),
    ("pitch_linear.Cmde", "PITCH", &[ELEVATOR]),
    ("yaw_linear.Cn0", "YAW", &[]),
    ("yaw_linear.Cnbeta", "YAW", &[BETA]),
    ("yaw_linear.Cnp", "YAW", &P),
    ("yaw_linear.Cnr", "YAW", &R),
    ("yaw_linear.Cnda", "YAW", &[AILERON]),
    ("rudder_linear.Cndr", "YAW", &[RUDDER]),
];

/// The thrust's terms: coefficient, factors; airspeed is in ft/s there.
const THRUST: &[(&str, &[&str])] = &[
    ("thrust_linear.Cp_n", &[THROTTLE]),
    ("propeller.T0_n", &["fcs/density-ratio"]),
    ("propeller.Tt_n", &["fcs/density-ratio", THROTTLE]),
    ("propeller.Ttt_n", &["fcs/density-ratio", THROTTLE, THROTTLE]),
    ("propeller.TV_nspm", &["fcs/density-ratio", SPEED]),
    ("propeller.TtV_nspm", &["fcs/density-ratio", THROTTLE, SPEED]),
    ("propeller.TVV_ns2pm2", &["fcs/density-ratio", SPEED, SPEED]),
];

/// The files of `model` as the aircraft `name`.
pub fn export(model: &GreyBox, name: &str) -> Exported {
    let mut known: Vec<&str> =
        FACTORS.iter().map(|f| f.0).chain(THRUST.iter().map(|t| t.0)).collect();
    known.extend(["lift_table.k", "drag_table.k", "pitch_table.k"]);
    let effect = |full: &str| full.split('.').next().unwrap_or_default().to_owned();
    // what changes mass and inertia has changed the body
    let of_body = |name: &str| name.starts_with("mass_error.") || name.starts_with("inertia_xz.");
    let lost = model
        .coefficients()
        .iter()
        .filter(|c| !known.contains(&c.name.as_str()) && !of_body(&c.name) && c.value != 0.0);
    let mut left_out: Vec<String> = lost.map(|c| effect(&c.name)).collect();
    left_out.sort();
    left_out.dedup();
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
    let (motor, thruster) = (format!("{name}_motor"), format!("{name}_direct"));
    let files = vec![
        (format!("{name}.xml"), document(model, name, [&motor, &thruster])),
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

fn document(model: &GreyBox, name: &str, [motor, thruster]: [&str; 2]) -> String {
    let (geometry, body) = (model.airframe.geometry, &model.body);
    let place = "<x> 0 </x> <y> 0 </y> <z> 0 </z>";
    let mut out = format!(
        "<?xml version=\"1.0\"?>\n<!-- Written by `greylag aircraft export jsbsim` from the model {}. -->\n\
         <fdm_config name=\"{name}\" version=\"2.0\" release=\"BETA\">\n\n  <metrics>\n    <wingarea unit=\"M2\"> {:?} \
         </wingarea>\n    <wingspan unit=\"M\"> {:?} </wingspan>\n    <chord unit=\"M\"> {:?} </chord>\n",
        model.name, geometry.area, geometry.span, geometry.chord
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
    out.push_str(&thrust(model));
    out.push_str(&controls(model, name));
    out.push_str(&aerodynamics(model));
    out.push_str("</fdm_config>\n");
    out
}

/// The coefficient of that full name; zero without it.
fn coefficient(model: &GreyBox, name: &str) -> f64 {
    model.coefficients().iter().find(|c| c.name == name).map_or(0.0, |c| c.value)
}

fn product(value: f64, factors: &[&str], indent: &str) -> String {
    let properties: String = factors.iter().map(|f| format!(" <property>{f}</property>")).collect();
    format!("{indent}<product> <value>{value:?}</value>{properties} </product>\n")
}

fn thrust(model: &GreyBox) -> String {
    let terms: String = THRUST
        .iter()
        .map(|(name, factors)| {
            let speeds = factors.iter().filter(|f| **f == SPEED).count();
            let value = coefficient(model, name) / LBF * FT.powi(speeds as i32);
            product(value, factors, "          ")
        })
        .collect();
    format!(
        "  <external_reactions>\n    <force name=\"thrust\" frame=\"BODY\">\n      <location unit=\"M\"> <x> 0 </x> <y> 0 </y> \
         <z> 0 </z> </location>\n      <direction> <x> 1 </x> <y> 0 </y> <z> 0 </z> </direction>\n      <function \
         name=\"external_reactions/thrust/magnitude\">\n        <sum>\n{terms}        </sum>\n      </function>\n    </force>\n  \
         </external_reactions>\n\n"
    )
}

fn controls(model: &GreyBox, name: &str) -> String {
    let figures = &model.airframe.actuators;
    let mut out = format!("  <flight_control name=\"{name}\">\n");
    let apart = model.airframe.mixer.as_ref().and_then(|m| effectors::channels(m, figures));
    out.push_str(&apart.unwrap_or_else(|| usual_surfaces(figures)));
    // b = k/(2 + k), k = step/lag
    let [b, _] = figures.throttle;
    let lag = figures.step * (1.0 - b) / (2.0 * b);
    let _ = write!(
        out,
        "    <channel name=\"throttle\">\n      <lag_filter name=\"fcs/throttle-actuator\">\n        <input> \
         fcs/throttle-cmd-norm </input>\n        <c1> {:?} </c1>\n        <output> {THROTTLE} </output>\n      </lag_filter>\n    \
         </channel>\n    <channel name=\"density\">\n      <fcs_function name=\"fcs/density-ratio\">\n        <function> \
         <quotient> <property>atmosphere/rho-slugs_ft3</property> <value>{:?}</value> </quotient> </function>\n      \
         </fcs_function>\n      <fcs_function name=\"fcs/mag-elevator-pos-rad\">\n        <function> <abs> \
         <property>{ELEVATOR}</property> </abs> </function>\n      </fcs_function>\n    </channel>\n  </flight_control>\n\n",
        1.0 / lag,
        // 1.225 kg/m³
        1.225 / (LBF / FT / (FT * FT * FT)),
    );
    out
}

/// Aileron, elevator and rudder by JSBSim's usual commands.
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

/// Frequency (rad/s) and damping of a surface's filter: the bilinear transform backwards.
fn analogue(surface: &Surface, step: f64) -> [f64; 2] {
    let [b, _, a2] = surface.filter;
    // b = w²/d, a2 = (4 − 4ζw + w²)/d, d = 4 + 4ζw + w²: 1 + a2 = (8 + 2w²)/d
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

fn aerodynamics(model: &GreyBox) -> String {
    let mut out = "  <aerodynamics>\n".to_owned();
    for (axis, length) in [
        ("DRAG", ""),
        ("SIDE", ""),
        ("LIFT", ""),
        ("ROLL", "metrics/bw-ft"),
        ("PITCH", "metrics/cbarw-ft"),
        ("YAW", "metrics/bw-ft"),
    ] {
        let terms: String = FACTORS
            .iter()
            .filter(|(_, of, _)| *of == axis)
            .map(|(name, _, factors)| (coefficient(model, name), factors))
            .filter(|(value, _)| *value != 0.0)
            .map(|(value, factors)| product(value, factors, "            "))
            .collect();
        let table: String = model
            .tables()
            .filter(|(id, _)| {
                [("LIFT", "lift_table"), ("DRAG", "drag_table"), ("PITCH", "pitch_table")]
                    .contains(&(axis, id))
            })
            .map(|(id, table)| tabulated(table, coefficient(model, &format!("{id}.k"))))
            .collect();
        let length = if length.is_empty() {
            String::new()
        } else {
            format!("          <property>{length}</property>\n")
        };
        let lower = axis.to_lowercase();
        let _ = write!(
            out,
            "    <axis name=\"{axis}\">\n      <function name=\"aero/{lower}\">\n        <product>\n          \
             <property>aero/qbar-psf</property>\n          <property>metrics/Sw-sqft</property>\n{length}          <sum>\n            \
             <value>0.0</value>\n{terms}{table}          </sum>\n        </product>\n      </function>\n    </axis>\n"
        );
    }
    out.push_str("  </aerodynamics>\n");
    out
}

fn tabulated(table: &Table, factor: f64) -> String {
    let rows: String = table
        .points()
        .into_iter()
        .map(|(x, y)| format!("                {x:?} {:?}\n", factor * y))
        .collect();
    format!(
        "            <table>\n              <independentVar lookup=\"row\">{ALPHA}</independentVar>\n              <tableData>\n{rows}              \
         </tableData>\n            </table>\n"
    )
}
