//! Tests that every hidden effect acts in the expected channels, by the formula of the catalogue.

use crate::flights::{plant, plant_with};
use greylag_sitl::plant::{DT_S, Inputs, Plant, Start, Truth};

const LBF: f64 = 4.448_221_615_260_5;
const LBF_FT: f64 = LBF * 0.3048;
/// Wing area, m².
const S: f64 = 0.75;
/// Span, m.
const B: f64 = 2.10;
/// Chord, m.
const C: f64 = 0.3571;

/// A start at which every state-dependent effect acts, below the stall angle.
const LIVELY: Start = Start {
    airspeed_mps: 20.0,
    alpha_rad: 0.1,
    beta_rad: 0.08,
    p_radps: 0.7,
    q_radps: -0.4,
    r_radps: 0.5,
    ..Start::NEUTRAL
};

/// Commands that move all actuators.
const FIRM: Inputs = Inputs { aileron: 0.9, elevator: -0.8, throttle: 1.0, rudder: 0.0 };

/// Loads on the aircraft: drag, side force and lift in wind axes, N; moments, N m; thrust, N.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Loads {
    drag: f64,
    side: f64,
    lift: f64,
    l: f64,
    m: f64,
    n: f64,
    thrust: f64,
}

impl Loads {
    const NONE: Loads =
        Loads { drag: 0.0, side: 0.0, lift: 0.0, l: 0.0, m: 0.0, n: 0.0, thrust: 0.0 };

    fn of(plant: &mut Plant) -> Loads {
        let mut read = |name: &str, unit: f64| plant.property(name).unwrap() * unit;
        // JSBSim's forces in wind axes have positive drag and lift.
        let (drag, side, lift) = (
            read("forces/fwx-aero-lbs", LBF),
            read("forces/fwy-aero-lbs", LBF),
            read("forces/fwz-aero-lbs", LBF),
        );
        let (l, m, n) = (
            read("moments/l-total-lbsft", LBF_FT),
            read("moments/m-total-lbsft", LBF_FT),
            read("moments/n-total-lbsft", LBF_FT),
        );
        Loads { drag, side, lift, l, m, n, thrust: plant.truth().thrust_n }
    }

    fn array(self) -> [f64; 7] {
        [self.drag, self.side, self.lift, self.l, self.m, self.n, self.thrust]
    }
}

/// Resets `plant` to `LIVELY` and makes `steps` steps with `FIRM`.
///
/// After one step, the surfaces have not yet changed the state. Two aircraft that differ by an effect of the controls are then
/// still in the same state, with the same deflections.
fn lively(plant: &mut Plant, steps: u32) -> Truth {
    plant.reset(&LIVELY).unwrap();
    for _ in 0..steps {
        plant.step(FIRM).unwrap();
    }
    plant.truth()
}

/// Asserts that `effect` changes the loads after `steps` steps by the result of `expected`, which gets the plant, its truth and
/// ½ρV², Pa.
fn acts(effect: &str, steps: u32, expected: impl Fn(&mut Plant, &Truth, f64) -> Loads) {
    let (mut plain, mut hidden) = (plant(), plant_with(&[effect]));
    let (a, b) = (lively(&mut plain, steps), lively(&mut hidden, steps));
    assert!((a.alpha_rad - b.alpha_rad).abs() < 1e-12 && (a.p_radps - b.p_radps).abs() < 1e-12);
    let (before, after) = (Loads::of(&mut plain).array(), Loads::of(&mut hidden).array());
    let pressure = 0.5 * b.air_density_kgpm3 * b.airspeed_mps.powi(2);
    let expected = expected(&mut hidden, &b, pressure).array();
    assert!(expected.iter().any(|x| x.abs() > 1e-4), "{effect} expects nothing: {expected:?}");
    for i in 0..7 {
        let change = after[i] - before[i];
        // The relative error of JSBSim's unit factors is 1e-8; the loads here are up to about 100 N.
        let tolerance = 1e-6 * (1.0 + expected[i].abs());
        assert!(
            (change - expected[i]).abs() < tolerance,
            "{effect}, load {i}: {change} for {}",
            expected[i]
        );
    }
}

#[test]
fn forces_and_moments_of_the_state_act_in_their_channels() {
    acts("drag_alpha2=1.5", 0, |_, t, q| Loads {
        drag: q * S * 1.5 * t.alpha_rad.powi(2),
        ..Loads::NONE
    });
    acts("drag_beta2=0.7", 0, |_, t, q| Loads {
        drag: q * S * 0.7 * t.beta_rad.powi(2),
        ..Loads::NONE
    });
    acts("pitch_break=-3.0", 0, |_, t, q| Loads {
        m: q * S * C * -3.0 * t.alpha_rad.powi(3),
        ..Loads::NONE
    });
    acts("dihedral_alpha=-0.8", 0, |_, t, q| Loads {
        l: q * S * B * -0.8 * t.alpha_rad * t.beta_rad,
        ..Loads::NONE
    });
    acts("asymmetry=0.004", 0, |_, _, q| Loads {
        side: q * S * 0.004,
        l: q * S * B * 0.004,
        n: q * S * B * 0.004,
        ..Loads::NONE
    });
    acts("propeller_gyro=0.05", 0, |_, t, _| Loads {
        m: 0.05 * t.r_radps,
        n: -0.05 * t.q_radps,
        ..Loads::NONE
    });
    acts("unsteady_lift=3.0", 0, |hidden, t, q| {
        let rate = hidden.property("aero/alphadot-rad_sec").unwrap() * C / (2.0 * t.airspeed_mps);
        Loads { lift: q * S * 3.0 * rate, m: q * S * C * -1.5 * rate, ..Loads::NONE }
    });
    acts("cg_shift=0.02", 0, |hidden, _, _| {
        let mut force =
            |axis: &str| hidden.property(&format!("forces/fb{axis}-aero-lbs")).unwrap() * LBF;
        Loads { m: -0.02 * force("z"), n: 0.02 * force("y"), ..Loads::NONE }
    });
}

#[test]
fn effects_of_throttle_act_in_their_channels() {
    let v0 = 16.67;
    acts("thrust_decay=0.6", 1, |_, t, _| {
        let plain = t.throttle * 5.900_496 * LBF;
        Loads { thrust: -0.6 * (t.airspeed_mps / v0 - 1.0) * plain, ..Loads::NONE }
    });
    acts("thrust_scale=-5.0", 1, |_, t, _| Loads { thrust: -5.0 * t.throttle, ..Loads::NONE });
    acts("thrust_line_offset=0.03", 1, |_, t, _| Loads { m: 0.03 * t.thrust_n, ..Loads::NONE });
    acts("motor_torque=0.5", 1, |_, t, _| Loads { l: -0.5 * t.throttle, ..Loads::NONE });
}

/// Loads of the X8 from changes of the deflections δa and δe, rad: force and moment coefficients times deflection.
fn of_deflections(q: f64, aileron: f64, elevator: f64, drag: f64) -> Loads {
    Loads {
        drag: q * S * 0.0633 * drag,
        side: q * S * 0.0433 * aileron,
        lift: q * S * 0.2781 * elevator,
        l: q * S * B * 0.1202 * aileron,
        m: q * S * C * -0.2292 * elevator,
        n: q * S * B * -0.00339 * aileron,
        thrust: 0.0,
    }
}

/// Change of the loads if `f` maps both deflections (rad) before they act.
fn acting_as(t: &Truth, q: f64, f: impl Fn(f64) -> f64) -> Loads {
    let (aileron, elevator) = (t.aileron_rad, t.elevator_rad);
    let drag = f(elevator).abs() - elevator.abs();
    of_deflections(q, f(aileron) - aileron, f(elevator) - elevator, drag)
}

#[test]
fn effects_on_the_surfaces_act_in_every_channel_the_surfaces_act_in() {
    acts("propwash=0.8", 1, |_, t, q| acting_as(t, q, |x| x * (1.0 + 0.8 * (t.throttle - 0.118))));
    acts("aeroelastic_loss=0.2", 1, |_, t, q| {
        acting_as(t, q, |x| x * (1.0 - 0.2 * ((t.airspeed_mps / 16.67).powi(2) - 1.0)))
    });
    acts("dead_zone=0.02", 1, |_, t, q| {
        acting_as(t, q, |x| x.signum() * (x.abs() - 0.02).max(0.0))
    });
    acts("backlash=0.02", 1, |_, t, q| acting_as(t, q, |x| x.signum() * (x.abs() - 0.01).max(0.0)));
    // After one step from rest, the deflection has moved by one step at the rate limit, by DT / (2 T + DT) of the
    // command with the lag (Tustin), or not at all with the delay.
    acts("rate_limit=0.5", 1, |_, t, q| acting_as(t, q, |x| x.signum() * 0.5 * DT_S));
    acts("actuator_lag=0.04", 1, |_, t, q| acting_as(t, q, |x| x * DT_S / (2.0 * 0.04 + DT_S)));
    acts("time_delay=0.05", 1, |_, t, q| acting_as(t, q, |_| 0.0));
    acts("effectiveness_saturation=-2.0", 1, |_, t, q| {
        let all = acting_as(t, q, |x| x * (1.0 - 2.0 * x * x));
        Loads { l: all.l, m: all.m, ..Loads::NONE }
    });
    acts("servo_aileron=0.3", 1, |_, t, q| of_deflections(q, 0.3 * t.aileron_rad.abs(), 0.0, 0.0));
    acts("servo_elevator=0.3", 1, |_, t, q| {
        let (before, after) = (t.elevator_rad, t.elevator_rad + 0.3 * t.elevator_rad.abs());
        of_deflections(q, 0.0, after - before, after.abs() - before.abs())
    });
    acts("servo_aileron_curve=0.6", 1, |_, t, q| {
        of_deflections(q, 0.6 * t.aileron_rad * t.aileron_rad.abs(), 0.0, 0.0)
    });
    acts("servo_elevator_curve=-0.6", 1, |_, t, q| {
        let (before, after) = (t.elevator_rad, t.elevator_rad * (1.0 - 0.6 * t.elevator_rad.abs()));
        of_deflections(q, 0.0, after - before, after.abs() - before.abs())
    });
    acts("roll_control_alpha=-0.6", 1, |_, t, q| Loads {
        l: q * S * B * -0.6 * t.alpha_rad * t.aileron_rad,
        ..Loads::NONE
    });
    acts("drag_elevator_abs=0.3", 1, |_, t, q| Loads {
        drag: q * S * 0.3 * t.elevator_rad.abs(),
        ..Loads::NONE
    });
}

#[test]
fn mass_error_scales_specific_force_and_no_moment() {
    let (mut plain, mut hidden) = (plant(), plant_with(&["mass_error=0.25"]));
    let (a, b) = (lively(&mut plain, 0), lively(&mut hidden, 0));
    for i in 0..3 {
        let (force, lighter) = (b.specific_force_mps2[i], a.specific_force_mps2[i] / 1.25);
        assert!((force - lighter).abs() < 1e-9, "axis {i}: {force} for {lighter}");
    }
    for rate in ["p", "q", "r"] {
        let name = format!("accelerations/{rate}dot-rad_sec2");
        let (a, b) = (plain.property(&name).unwrap(), hidden.property(&name).unwrap());
        assert!((a - b).abs() < 1e-9, "{name}: {a} {b}");
    }
}

#[test]
fn inertia_xz_changes_roll_and_yaw_acceleration_as_eulers_equations_say() {
    for (effect, jxz) in [(None, -0.9343), (Some("inertia_xz=0.3"), -0.6343)] {
        let mut plant = plant_with(&effect.into_iter().collect::<Vec<_>>());
        let t = lively(&mut plant, 0);
        let Loads { l, m, n, .. } = Loads::of(&mut plant);
        let (p, q, r) = (t.p_radps, t.q_radps, t.r_radps);
        let (jx, jy, jz) = (1.2290, 0.1702, 0.8808);
        // Jx ṗ − Jxz ṙ = l + (Jy − Jz) q r + Jxz p q, and correspondingly for pitch and yaw (Beard & McLain, section 3.3).
        let roll = l + (jy - jz) * q * r + jxz * p * q;
        let yaw = n + (jx - jy) * p * q - jxz * q * r;
        let gamma = jx * jz - jxz * jxz;
        let expected = [
            (jz * roll + jxz * yaw) / gamma,
            (m + (jz - jx) * p * r - jxz * (p * p - r * r)) / jy,
            (jxz * roll + jx * yaw) / gamma,
        ];
        for (name, expected) in ["p", "q", "r"].into_iter().zip(expected) {
            let got = plant.property(&format!("accelerations/{name}dot-rad_sec2")).unwrap();
            // The equations neglect the earth's rotation, 7e-5 rad/s.
            assert!((got - expected).abs() < 2e-3, "{effect:?} {name}: {got} for {expected}");
        }
    }
}
