//! Texts of the airframe file and the model file of an aircraft that is imported from JSBSim.

use greylag_sitl::plant::{MassProperties, Stops, Travel};

use super::effects::Effect;
use super::fits::line;
use super::propulsion::Propulsion;
use super::{Polar, Subject};
use greylag_model::textbook::{Estimate, incidence_limits, numbers};
use greylag_num::{Grid, Table};
use greylag_physics::atmosphere::{SEA_LEVEL_DENSITY, STANDARD_GRAVITY, standard_density};

/// Largest nonlinearity of the pitching moment for which only a straight line is written. It is the rms deviation from the
/// line as a fraction of the moment's standard deviation.
const STRAIGHT: f64 = 1e-3;

/// Text of the airframe file.
pub(super) fn airframe(
    subject: &Subject,
    name: &str,
    travel: &Travel,
    (surfaces, lag): &([[f64; 2]; 3], f64),
    lift_max: f64,
    polar: &Polar,
    thrust: &[Estimate],
) -> String {
    let cruise = subject.start.airspeed_mps;
    let density = standard_density(subject.start.altitude_m);
    let stall = (2.0 * subject.mass.mass_kg * STANDARD_GRAVITY
        / (density * subject.area * lift_max))
        .sqrt();
    let slowest = (1.25 * stall).min(0.9 * cruise);
    let mut out = format!(
        "# Written by `greylag aircraft import jsbsim`.\nschema = 2\nname = {name:?}\n\n[geometry]\n\
         wing_area_m2 = {{ value = {:.6}, source = \"JSBSim\" }}\nspan_m = {{ value = {:.6}, source = \"JSBSim\" \
         }}\nmean_chord_m = {{ value = {:.6}, source = \"JSBSim\" }}\n\n[reference]\nairspeed_mps = {{ value = \
         {cruise:?}, source = \"given\" }}\naltitude_m = {{ value = {:?}, source = \"given\" }}\n\n",
        subject.area, subject.span, subject.chord, subject.start.altitude_m
    );
    let stops = [Some(travel.aileron), Some(travel.elevator), travel.rudder];
    for ((surface, stops), [frequency, damping]) in
        ["aileron", "elevator", "rudder"].into_iter().zip(stops).zip(surfaces)
    {
        if let Some(Stops { least_rad, most_rad }) = stops {
            out += &format!(
                "[controls.{surface}]\nfrequency_radps = {{ value = {frequency:.2}, source = \"step of the \
                 command\" }}\ndamping = {{ value = {damping:.3}, source = \"step of the command\" }}\n\
                 travel_min_rad = {{ value = {least_rad:.6}, source = \"JSBSim\" }}\ntravel_max_rad = {{ value \
                 = {most_rad:.6}, source = \"JSBSim\" }}\n\n"
            );
        }
    }
    let lift =
        2.0 * subject.mass.mass_kg * STANDARD_GRAVITY / (density * subject.area * cruise * cruise);
    let incidence = polar.incidence(lift);
    let limits = incidence_limits(incidence, polar.incidence(lift_max));
    let descent = descent(subject, polar, thrust, [incidence, lift]);
    // 10° to 15° below the pitch of level flight, or of the idle glide if full throttle cannot hold level flight; never above
    // −15°
    let lowest = (5.0 * ((incidence - descent).to_degrees() / 5.0 - 2.0).floor()).min(-15.0);
    out += &format!(
        "[controls.throttle]\nlag_s = {{ value = {lag:.4}, source = \"step of the command\" }}\n\n{limits}\
         # The lift table's largest coefficient stalls at {stall:.1} m/s. Correct the rest to your mission.\n\
         [envelope]\nbank_max_deg = 45.0\npitch_max_deg = 15.0\npitch_min_deg = {lowest:.1}\nload_factor_max = 2.0\n\
         airspeed_min_mps = {slowest:.2}\nairspeed_max_mps = {:.2}\nairspeed_cruise_mps = {cruise:?}\n\
         surface_slew_per_s = 20.0\n",
        1.4 * cruise
    );
    out
}

/// Descent angle of the idle glide at the reference airspeed, rad. Zero if the thrust at full throttle is at least the drag of
/// level flight. `alpha` and `lift` are the angle of attack (rad) and the lift coefficient of level flight.
/// `lift` are the angle of attack (rad) and the lift coefficient of level flight.
fn descent(subject: &Subject, polar: &Polar, thrust: &[Estimate], [alpha, lift]: [f64; 2]) -> f64 {
    let v = subject.start.airspeed_mps;
    let density = standard_density(subject.start.altitude_m);
    let at = |d: f64| {
        let terms = [1.0, d, d * d, v, d * v, v * v];
        let sum: f64 = terms.iter().zip(thrust).map(|(x, (_, value, ..))| x * value).sum();
        sum * density / SEA_LEVEL_DENSITY / (0.5 * density * v * v * subject.area)
    };
    let drag = Table::new(&polar.alpha, &polar.drag).map_or(0.0, |table| table.at(alpha));
    if at(1.0) >= drag { 0.0 } else { ((drag - at(0.0)) / lift).atan().max(0.0) }
}

/// Text of the model file.
pub(super) fn model_file(
    name: &str,
    mass: &MassProperties,
    polar: &Polar,
    effects: &[Effect],
    propulsion: &Propulsion,
    has_rudder: bool,
) -> String {
    let mut out = format!(
        "# Written by `greylag aircraft import jsbsim`{}.\nschema = 1\nname = {:?}\ndescription = \"Central \
         differences of JSBSim's loads.\"\nairframe = \"airframe.toml\"\nintegrator = \"jsbsim\"\nforce_axes = \
         \"wind\"\n\n[rigid_body]\n",
        if has_rudder { "" } else { "; the aircraft has no rudder" },
        format!("{name}-import")
    );
    let [jx, jy, jz, jxz] = mass.inertia_kgm2;
    let of = |name, value| -> Estimate { (name, value, 0.01, "JSBSim") };
    numbers(
        &mut out,
        &[
            of("mass_kg", mass.mass_kg),
            of("jx_kgm2", jx),
            of("jy_kgm2", jy),
            of("jz_kgm2", jz),
            of("jxz_kgm2", jxz),
        ],
    );
    out += "\n[air]\ngravity_mps2 = { value = 9.806, source = \"effective gravity in middle latitudes\" }\ndensity \
            = \"standard\"\n";
    for (effect, estimates) in effects {
        out += &format!("\n[effects.{effect}]\n");
        numbers(&mut out, estimates);
    }
    match &propulsion.table {
        Some(table) => out += &thrust_table(table),
        None => {
            out += "\n[effects.propeller]\n";
            numbers(&mut out, &propulsion.thrust);
        }
    }
    let settled = "least squares over JSBSim's moment of the engines";
    let one_each = [
        ("thrust_lag", "tau_s", propulsion.lag, 0.2, "JSBSim's answer to a step of the throttle"),
        ("motor_torque", "k_nm", propulsion.torque, 0.1, settled),
        ("thrust_line_offset", "z_m", propulsion.arm, 0.1, settled),
    ];
    for (effect, name, value, width, source) in one_each {
        if let Some(value) = value {
            out += &format!("\n[effects.{effect}]\n");
            numbers(&mut out, &[(name, value, width, source)]);
        }
    }
    out + &tables(polar)
}

/// The table of thrust over throttle and airspeed.
fn thrust_table(table: &Grid) -> String {
    let [throttles, airspeeds] = table.axes();
    let list = |values: &mut dyn Iterator<Item = f64>| {
        values.map(|x| format!("{x:.5}")).collect::<Vec<_>>().join(", ")
    };
    let row =
        |d: &f64| format!("    [{}],\n", list(&mut airspeeds.iter().map(|v| table.at(*d, *v))));
    format!(
        "\n[effects.thrust_table]\nk = {{ value = 1.0, source = \"the table as it is\" }}\n\n[effects.thrust_table.T_n]\n\
         throttle = [{}]\nairspeed_mps = [{}]\nvalue = [\n{}]\nsource = \"JSBSim's thrust, the engines settled\"\n",
        list(&mut throttles.iter().copied()),
        list(&mut airspeeds.iter().copied()),
        throttles.iter().map(row).collect::<String>()
    )
}

/// Tables of lift and drag over the angle of attack. A third table has the nonlinear part of the pitching moment, if it is
/// not negligible.
fn tables(polar: &Polar) -> String {
    let mut out = String::new();
    let [zero, slope, bent] = line(polar);
    let beside: Vec<f64> =
        polar.alpha.iter().zip(&polar.pitch).map(|(a, m)| m - zero - slope * a).collect();
    let tables = [
        ("lift_table", "CL", &polar.lift),
        ("drag_table", "CD", &polar.drag),
        ("pitch_table", "Cm", &beside),
    ];
    let count = if bent > STRAIGHT { 3 } else { 2 };
    for (effect, ordinate, values) in tables.into_iter().take(count) {
        let list = |values: &[f64]| {
            values.iter().map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(", ")
        };
        out += &format!(
            "\n[effects.{effect}]\nk = {{ value = 1.0, source = \"the table as it is\" }}\n\n[effects.{effect}.{ordinate}]\n\
             alpha_rad = [{}]\nvalue = [{}]\nsource = \"JSBSim's loads\"\n",
            list(&polar.alpha),
            list(values)
        );
    }
    out
}
