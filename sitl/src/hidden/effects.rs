//! The list of effects that can be hidden in an aircraft.

use super::Effect;
use super::document::{Axis, Surface};
use super::expression::{INPUT, abs, product, property, sum, value};

/// Newtons per pound of force.
const LBF: f64 = 4.448_221_615_260_5;
const FT: f64 = 0.3048;
/// Airspeed at which speed-dependent effects vanish, m/s: that of the neutral start.
const V0_MPS: f64 = 16.67;
/// Throttle at which the propeller-wash effect vanishes: level trim at 16.67 m/s.
const THROTTLE0: f64 = 0.118;
/// Newton metres per lbf ft, which is also kg m² per slug ft².
const LBF_FT: f64 = LBF * FT;
/// Bound of the magnitude of coefficients: a larger amplitude is refused as a probable typing error.
const ANY: f64 = 1e3;
/// Bound of the magnitude of amplitudes that scale with the size of the aircraft (N, N m, N m s, kg m²).
const LARGE: f64 = 1e7;

/// The catalogue of hidden effects.
pub static EFFECTS: [Effect; 29] = [
    Effect {
        id: "drag_alpha2",
        formula: "drag Q a α², in addition to the drag table",
        unit: "",
        bounds: (-ANY, ANY),
        write: |d, a| d.force(Axis::Drag, "drag-alpha2", a, &[alpha(), alpha()]),
    },
    Effect {
        id: "drag_beta2",
        formula: "drag Q a β²",
        unit: "",
        bounds: (-ANY, ANY),
        write: |d, a| d.force(Axis::Drag, "drag-beta2", a, &[beta(), beta()]),
    },
    Effect {
        id: "drag_elevator_abs",
        formula: "drag Q a |δe|",
        unit: "1/rad",
        bounds: (-ANY, ANY),
        write: |d, a| {
            let elevator = abs(d.deflection(Surface::Elevator));
            d.force(Axis::Drag, "drag-elevator-abs", a, &[elevator])
        },
    },
    Effect {
        id: "pitch_break",
        formula: "pitching moment Q c a α³",
        unit: "",
        bounds: (-ANY, ANY),
        write: |d, a| d.moment(Axis::Pitch, "pitch-break", a, &[alpha(), alpha(), alpha()]),
    },
    Effect {
        id: "cg_shift",
        formula: "centre of gravity moved aft by a",
        unit: "m",
        bounds: (-1.0, 1.0),
        write: |d, a| d.shift_cg(a),
    },
    Effect {
        id: "unsteady_lift",
        formula: "lift Q c/(2V) a α̇, pitching moment −Q c²/(4V) a α̇ (α̇ is one step old)",
        unit: "",
        bounds: (-20.0, 20.0),
        write: |d, a| {
            let lag = [property("aero/ci2vel"), property("aero/alphadot-rad_sec")];
            d.force(Axis::Lift, "unsteady-lift", a, &lag)?;
            d.moment(Axis::Pitch, "unsteady-pitch", -0.5 * a, &lag)
        },
    },
    Effect {
        id: "thrust_decay",
        formula: "thrust T (1 − a (V/16.67 m/s − 1))",
        unit: "",
        bounds: (-10.0, 10.0),
        write: |d, a| {
            let excess = sum(&[value(a), product(&[value(-a * FT / V0_MPS), airspeed()])]);
            d.add_thrust(product(&[excess, thrust()]));
            Ok(())
        },
    },
    Effect {
        id: "thrust_scale",
        formula: "thrust a δt",
        unit: "N",
        bounds: (-LARGE, LARGE),
        write: |d, a| {
            let throttle = d.throttle();
            d.add_thrust(product(&[value(a / LBF), throttle]));
            Ok(())
        },
    },
    Effect {
        id: "thrust_lag",
        formula: "the thrust acts through a first-order lag of time constant a",
        unit: "s",
        bounds: (0.0, 100.0),
        write: |d, a| {
            d.lag_thrust(a);
            Ok(())
        },
    },
    Effect {
        id: "thrust_line_offset",
        formula: "pitching moment a T: the thrust acts a below the centre of gravity",
        unit: "m",
        bounds: (-1.0, 1.0),
        write: |d, a| {
            d.offset_thrust(a / FT);
            Ok(())
        },
    },
    Effect {
        id: "motor_torque",
        formula: "rolling moment −a δt",
        unit: "N m",
        bounds: (-LARGE, LARGE),
        write: |d, a| {
            let terms = [value(-a / LBF_FT), d.throttle()];
            d.function(Axis::Roll, "motor-torque", &product(&terms))
        },
    },
    Effect {
        id: "propeller_gyro",
        formula: "pitching moment a r, yawing moment −a q",
        unit: "N m s",
        bounds: (-LARGE, LARGE),
        write: |d, a| {
            let pitch = product(&[value(a / LBF_FT), property("velocities/r-rad_sec")]);
            let yaw = product(&[value(-a / LBF_FT), property("velocities/q-rad_sec")]);
            d.function(Axis::Pitch, "propeller-gyro-pitch", &pitch)?;
            d.function(Axis::Yaw, "propeller-gyro-yaw", &yaw)
        },
    },
    Effect {
        id: "propwash",
        formula: "deflections act as δ (1 + a (δt − 0.118))",
        unit: "",
        bounds: (-10.0, 10.0),
        write: |d, a| {
            let throttle = product(&[value(a), d.throttle()]);
            d.scale_deflections(sum(&[value(1.0 - a * THROTTLE0), throttle]));
            Ok(())
        },
    },
    Effect {
        id: "aeroelastic_loss",
        formula: "deflections act as δ (1 − a ((V/16.67 m/s)² − 1))",
        unit: "",
        bounds: (-10.0, 10.0),
        write: |d, a| {
            let scale = -a * (FT / V0_MPS).powi(2);
            let loss = product(&[value(scale), airspeed(), airspeed()]);
            d.scale_deflections(sum(&[value(1.0 + a), loss]));
            Ok(())
        },
    },
    Effect {
        id: "actuator_lag",
        formula: "deflections act through a first-order lag of time constant a",
        unit: "s",
        bounds: (0.0, 10.0),
        write: |d, a| {
            let constant = format!("<c1>{}</c1>", 1.0 / a);
            d.pass_deflections("lag_filter", &constant);
            Ok(())
        },
    },
    Effect {
        id: "time_delay",
        formula: "deflections act a later; a whole number of steps",
        unit: "s",
        bounds: (0.0, 2.0),
        write: |d, a| {
            let delay = d.delay(a)?;
            d.pass_deflections("actuator", &delay);
            Ok(())
        },
    },
    Effect {
        id: "dead_zone",
        formula: "deflections act as 0 within ±a, as δ ∓ a beyond",
        unit: "rad",
        bounds: (0.0, 1.0),
        write: |d, a| {
            d.pass_deflections("deadband", &format!("<width>{}</width>", 2.0 * a));
            Ok(())
        },
    },
    Effect {
        id: "backlash",
        formula: "deflections act through a play of total width a",
        unit: "rad",
        bounds: (0.0, 1.0),
        write: |d, a| {
            d.pass_deflections("actuator", &format!("<hysteresis_width>{a}</hysteresis_width>"));
            Ok(())
        },
    },
    Effect {
        id: "rate_limit",
        formula: "deflections act with at most a of rate; 0 is no limit",
        unit: "rad/s",
        bounds: (0.0, ANY),
        write: |d, a| {
            d.pass_deflections("actuator", &format!("<rate_limit>{a}</rate_limit>"));
            Ok(())
        },
    },
    Effect {
        id: "servo_aileron",
        formula: "the aileron acts as δa (1 + a) where positive, as δa (1 − a) where negative",
        unit: "",
        bounds: (-0.9, 0.9),
        write: |d, a| {
            d.pass_each([("aerosurface_scale", sides(a).as_str()), UNCHANGED]);
            Ok(())
        },
    },
    Effect {
        id: "servo_elevator",
        formula: "the elevator acts as δe (1 + a) where positive, as δe (1 − a) where negative",
        unit: "",
        bounds: (-0.9, 0.9),
        write: |d, a| {
            d.pass_each([UNCHANGED, ("aerosurface_scale", sides(a).as_str())]);
            Ok(())
        },
    },
    Effect {
        id: "servo_aileron_curve",
        formula: "the aileron acts as δa (1 + a |δa|)",
        unit: "1/rad",
        bounds: (-2.0, 2.0),
        write: |d, a| {
            d.pass_each([("fcs_function", curve(a).as_str()), UNCHANGED]);
            Ok(())
        },
    },
    Effect {
        id: "servo_elevator_curve",
        formula: "the elevator acts as δe (1 + a |δe|)",
        unit: "1/rad",
        bounds: (-2.0, 2.0),
        write: |d, a| {
            d.pass_each([UNCHANGED, ("fcs_function", curve(a).as_str())]);
            Ok(())
        },
    },
    Effect {
        id: "mass_error",
        formula: "empty mass × (1 + a), inertias as they are",
        unit: "",
        bounds: (-0.9, 10.0),
        write: |d, a| d.change("emptywt", |mass, _| mass * (1.0 + a)),
    },
    Effect {
        id: "inertia_xz",
        formula: "product of inertia Jxz + a, with −Jxz in the inertia matrix",
        unit: "kg m²",
        bounds: (-LARGE, LARGE),
        write: |d, a| {
            // JSBSim's ixz is −Jxz, unless the document sets negated_crossproduct_inertia to false.
            let sign = if d.has("negated_crossproduct_inertia=\"false\"") { 1.0 } else { -1.0 };
            let in_unit = |unit: &str| if unit.contains("SLUG") { a / LBF_FT } else { a };
            d.change("ixz", |ixz, unit| ixz + sign * in_unit(unit))
        },
    },
    Effect {
        id: "asymmetry",
        formula: "rolling moment Q b a, yawing moment Q b a, side force Q a",
        unit: "",
        bounds: (-1.0, 1.0),
        write: |d, a| {
            d.moment(Axis::Roll, "asymmetry-roll", a, &[])?;
            d.moment(Axis::Yaw, "asymmetry-yaw", a, &[])?;
            d.force(Axis::Side, "asymmetry-side", a, &[])
        },
    },
    Effect {
        id: "dihedral_alpha",
        formula: "rolling moment Q b a α β",
        unit: "",
        bounds: (-ANY, ANY),
        write: |d, a| d.moment(Axis::Roll, "dihedral-alpha", a, &[alpha(), beta()]),
    },
    Effect {
        id: "roll_control_alpha",
        formula: "rolling moment Q b a α δa",
        unit: "1/rad",
        bounds: (-ANY, ANY),
        write: |d, a| {
            let aileron = d.deflection(Surface::Aileron);
            d.moment(Axis::Roll, "roll-control-alpha", a, &[alpha(), aileron])
        },
    },
    Effect {
        id: "effectiveness_saturation",
        formula: "in roll and pitch deflections act as δ (1 + a δ²)",
        unit: "1/rad²",
        bounds: (-ANY, ANY),
        write: |d, a| {
            d.saturate(a);
            Ok(())
        },
    },
];

/// A flight-control component, with its settings, that leaves a deflection unchanged.
const UNCHANGED: (&str, &str) = ("pure_gain", "<gain>1</gain>");

/// Settings of a component that has the gain 1 + a for positive and 1 − a for negative inputs.
fn sides(a: f64) -> String {
    let ends = |min: f64, max: f64| format!("<min>{min}</min><max>{max}</max>");
    format!("<domain>{}</domain><range>{}</range>", ends(-1.0, 1.0), ends(a - 1.0, 1.0 + a))
}

/// Settings of a component that has the gain 1 + a |input|: JSBSim multiplies the function of an `fcs_function` by its input.
fn curve(a: f64) -> String {
    let gain = sum(&[value(1.0), product(&[value(a), abs(property(INPUT))])]);
    format!("<function>{gain}</function>")
}

fn alpha() -> String {
    property("aero/alpha-rad")
}

fn beta() -> String {
    property("aero/beta-rad")
}

fn airspeed() -> String {
    property("velocities/vt-fps")
}

fn thrust() -> String {
    property("propulsion/engine/thrust-lbs")
}
