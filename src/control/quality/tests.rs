//! Tests of the quality measures with signals for which the results are known in closed form.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::*;
use greylag_model::STEP;
use greylag_physics::Airframe;

const LIMITS: Limits = Limits {
    bank_deg: 60.0,
    pitch_deg: [-30.0, 30.0],
    load_factor: [-1.0, 2.0],
    stall_deg: 12.0,
    sideslip_deg: 20.0,
    airspeed_mps: [10.0, 40.0],
    slew_per_s: 20.0,
};

/// A sample of level flight at the target airspeed. Each test changes some of its values.
fn level(time_s: f64) -> Moment {
    Moment {
        time_s,
        attitude: [0.0; 2],
        airspeed: 20.0,
        alpha: 0.05,
        beta: 0.0,
        load_factor: 1.0,
        command: Command::IDLE,
    }
}

/// A flight of `seconds` at 100 Hz towards a target roll and pitch (degrees). `moment` gives the sample at each time.
fn track(seconds: f64, [roll, pitch]: [f64; 2], moment: impl Fn(f64) -> Moment) -> Track {
    let count = (seconds / STEP).round() as usize;
    let target = Target { roll: roll.to_radians(), pitch: pitch.to_radians(), airspeed: 20.0 };
    let moments = (0..=count).map(|k| moment(k as f64 * STEP)).collect();
    Track { moments, target, before: None, lost_s: 0.0 }
}

/// The roll approaches 40° as a first-order system with a time constant of 0.5 s. Error integral, settling times and overshoot
/// then have closed forms.
#[test]
fn an_exponential_approach_has_the_integral_and_times_of_its_formula() {
    let tau = 0.5;
    let roll = |t: f64| 40.0 * (1.0 - (-t / tau).exp());
    let flight =
        track(8.0, [40.0, 0.0], |t| Moment { attitude: [roll(t).to_radians(), 0.0], ..level(t) });
    let q = flight.quality(&LIMITS);
    // the integral of 40° e^(−t/τ) is 40° τ = 20° s. With the sample interval dt of 0.01 s, the trapezoidal rule gives a value
    // that is larger by the fraction (dt/τ)²/12
    assert!((q.error_integral_deg_s - 20.0).abs() < 20.0 * 4e-5, "{q:?}");
    // the measured settling time is the time of the last sample outside the band. The exact times are τ ln(40/1) for 1° and τ
    // ln(20) for 5 %. The last sample is at most one sample interval earlier
    assert!((q.to_one_deg_s - tau * 40f64.ln()).abs() <= STEP);
    assert!((q.to_five_percent_s - tau * 20f64.ln()).abs() <= STEP);
    assert_eq!(q.overshoot_deg, [0.0, 0.0]);
    assert!((q.step_deg[0] - 40.0).abs() < 1e-9 && q.step_deg[1].abs() < 1e-9);
}

/// The step response of a second-order system with damping ζ overshoots by the fraction exp(−πζ/√(1 − ζ²)) of the step.
#[test]
fn a_second_order_step_overshoots_as_its_damping_says() {
    let (zeta, omega) = (0.4_f64, 4.0);
    let damped = (1.0 - zeta * zeta).sqrt();
    let part = |t: f64| {
        let phase = omega * damped * t;
        1.0 - (-zeta * omega * t).exp() * (phase.cos() + zeta / damped * phase.sin())
    };
    let flight = track(6.0, [-50.0, 20.0], |t| Moment {
        attitude: [-50.0 * part(t), 20.0 * part(t)].map(f64::to_radians),
        ..level(t)
    });
    let expected = (-std::f64::consts::PI * zeta / damped).exp();
    let q = flight.quality(&LIMITS);
    // the sample closest to the peak is at most half a sample interval dt from it. It is lower than the peak by at most about the
    // fraction (ω dt)²/8 of the overshoot, with the natural frequency ω
    assert!((q.overshoot_deg[0] / 50.0 - expected).abs() < 3e-4 * expected, "{q:?}");
    assert!((q.overshoot_deg[1] / 20.0 - expected).abs() < 3e-4 * expected, "{q:?}");
}

#[test]
fn an_error_that_only_shrinks_from_the_other_side_is_no_overshoot() {
    let flight = track(1.0, [0.0, 10.0], |t| Moment {
        attitude: [0.0, (20.0 - t).to_radians()],
        ..level(t)
    });
    assert_eq!(flight.quality(&LIMITS).overshoot_deg[1], 0.0);
    // if the target equals the initial attitude, every deviation counts as overshoot
    let still = track(1.0, [0.0, 0.0], |t| Moment { attitude: [0.0, -0.1 * t], ..level(t) });
    assert!((still.quality(&LIMITS).overshoot_deg[1] - 0.1_f64.to_degrees()).abs() < 1e-9);
}

#[test]
fn what_never_stays_takes_the_whole_flight_and_a_lost_one_counts_as_upside_down() {
    let flight = track(2.0, [30.0, 0.0], level);
    let q = flight.quality(&LIMITS);
    assert!((q.to_one_deg_s - 2.0).abs() < 1e-9 && (q.error_integral_deg_s - 60.0).abs() < 1e-9);
    let lost = Track { lost_s: 3.0, ..flight }.quality(&LIMITS);
    assert!((lost.error_integral_deg_s - (60.0 + 360.0 * 3.0)).abs() < 1e-9);
    assert!(lost.lost && !lost.kept && (lost.to_one_deg_s - 5.0).abs() < 1e-9);
}

/// A sine of amplitude A and frequency f has the total variation 4 A f T over whole periods of total duration T. The mean square
/// of its rate is (2π f A)²/2.
#[test]
fn a_sine_of_a_surface_travels_four_amplitudes_a_period() {
    let (amplitude, hertz, seconds) = (0.3, 0.5, 8.0);
    let wave = |t: f64| amplitude * (TAU * hertz * t).sin();
    let flight = track(seconds, [0.0; 2], |t| Moment {
        command: Command { elevator: wave(t), throttle: 0.4, ..Command::IDLE },
        ..level(t)
    });
    let q = flight.quality(&LIMITS);
    let travel = 4.0 * amplitude * hertz * seconds;
    assert!((q.travel.elevator - travel).abs() < 0.01 * travel, "{q:?}");
    assert_eq!(
        [q.travel.aileron, q.travel.throttle, q.travel.surfaces() - q.travel.elevator],
        [0.0; 3]
    );
    let square = (TAU * hertz * amplitude).powi(2) / 2.0;
    assert!((q.mean_square_rate.elevator - square).abs() < 0.01 * square, "{q:?}");
    assert_eq!([q.surface_saturated, q.saturated.throttle], [0.0; 2]);
}

/// The travel includes the change from the command before the first sample (`before`) to the first command. If `before` is
/// unknown, the travel starts at the first command.
#[test]
fn the_first_change_counts_from_the_command_before() {
    let command = Command { aileron: 0.5, ..Command::IDLE };
    let flight = track(1.0, [0.0; 2], |t| Moment { command, ..level(t) });
    assert_eq!(flight.quality(&LIMITS).travel.aileron, 0.0);
    let after = Track { before: Some(Command::IDLE), ..flight }.quality(&LIMITS);
    assert_eq!(after.travel.aileron, 0.5);
    // a change of 0.5 in a sample interval of 0.01 s is a rate of 50 per second, more than the limit of 20
    assert!((after.outside_s.slew - STEP).abs() < 1e-9);
}

/// The aileron moves at 15 per second, within the limit of 20. A sample that was not recorded doubles the change between its
/// neighbours and the time between them.
#[test]
fn a_missing_sample_makes_no_rate() {
    let mut flight = track(0.1, [0.0; 2], |t| {
        let command = Command { aileron: 15.0 * t - 0.75, ..Command::IDLE };
        Moment { command, ..level(t) }
    });
    flight.moments.remove(4);
    let q = flight.quality(&LIMITS);
    assert_eq!(q.outside_s.slew, 0.0);
    assert!((q.mean_square_rate.aileron - 225.0).abs() < 1e-6, "{q:?}");
}

/// The load factor 1 + 2 sin is above 2 for a third of each period and never below −1.
#[test]
fn seconds_outside_are_those_of_the_sine_above_the_limit() {
    let flight = track(12.0, [0.0; 2], |t| {
        let sine = (TAU * t / 3.0).sin();
        Moment { load_factor: 1.0 + 2.0 * sine, alpha: 0.1 + 0.2 * sine, ..level(t) }
    });
    let q = flight.quality(&LIMITS);
    assert!((q.outside_s.load_factor - 4.0).abs() <= 8.0 * STEP, "{q:?}");
    assert_eq!(q.outside_s.load_factor_low, 0.0);
    assert!((q.load_factor[1] - 3.0).abs() < 1e-3 && (q.load_factor[0] + 1.0).abs() < 1e-3);
    let above = 1.0 - 2.0 * ((12f64.to_radians() - 0.1) / 0.2).asin() / std::f64::consts::PI;
    assert!((q.outside_s.stall - 6.0 * above).abs() <= 8.0 * STEP, "{q:?}");
    assert!(!q.kept);
    assert!((q.outside_s.any - q.outside_s.load_factor.max(q.outside_s.stall)).abs() < 1e-9);
}

#[test]
fn every_limit_is_judged_by_its_own_quantity() {
    let outside = |departs: &dyn Fn(&mut Moment)| {
        let flight = track(1.0, [0.0; 2], |t| {
            let mut moment = level(t);
            departs(&mut moment);
            moment
        });
        let outside = flight.quality(&LIMITS).outside_s;
        outside
            .passed()
            .into_iter()
            .map(|(limit, s)| (limit.name(), (s * 100.0).round()))
            .collect::<Vec<_>>()
    };
    assert_eq!(outside(&|_| ()), []);
    assert_eq!(outside(&|m| m.attitude[0] = -1.1), [("bank", 100.0)]);
    assert_eq!(outside(&|m| m.attitude[1] = -0.6), [("pitch", 100.0)]);
    assert_eq!(outside(&|m| m.load_factor = -1.1), [("least load factor", 100.0)]);
    assert_eq!(outside(&|m| m.load_factor = 2.1), [("load factor", 100.0)]);
    assert_eq!(outside(&|m| m.alpha = 0.22), [("stall", 100.0)]);
    assert_eq!(outside(&|m| m.beta = -0.4), [("sideslip", 100.0)]);
    assert_eq!(outside(&|m| m.airspeed = 9.0), [("least airspeed", 100.0)]);
    assert_eq!(outside(&|m| m.airspeed = 41.0), [("largest airspeed", 100.0)]);
    assert_eq!(outside(&|m| m.alpha = f64::NAN), []);
}

/// Load factor and angle of attack may exceed their limits by a twentieth of the limit, but not by more.
#[test]
fn a_transient_may_pass_load_factor_and_stall_by_a_twentieth() {
    assert!(LIMITS.kept([-1.04, 2.09], [-5.0, 12.5]));
    assert!(!LIMITS.kept([-1.06, 1.0], [0.0; 2]) && !LIMITS.kept([1.0, 2.11], [0.0; 2]));
    assert!(!LIMITS.kept([1.0; 2], [0.0, 12.7]));
    assert!(LIMITS.kept([f64::NAN; 2], [f64::NAN; 2]));
}

#[test]
fn airspeed_and_stops_are_measured_over_the_ticks() {
    let flight = track(1.0, [0.0; 2], |t| {
        let stop = if t < 0.25 - 1e-9 { 1.0 } else { 0.0 };
        let command = Command { aileron: -stop, throttle: 1.0, ..Command::IDLE };
        Moment { airspeed: 20.0 - 3.0 * (t * FRAC_PI_2).sin().signum(), command, ..level(t) }
    });
    let q = flight.quality(&LIMITS);
    assert!((q.surface_saturated - 0.25).abs() < 1e-9 && q.saturated.throttle == 1.0, "{q:?}");
    assert!((q.airspeed_rms_mps - 3.0).abs() < 0.01 && q.airspeed_mps == [17.0, 17.0], "{q:?}");
}

#[test]
fn a_file_that_states_no_stall_has_no_limit_of_it() {
    let path =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/a430/airframe.toml");
    let limits = Limits::of(&Airframe::load(&path).unwrap());
    assert_eq!([limits.stall_deg, limits.sideslip_deg], [f64::INFINITY; 2]);
    assert_eq!(limits.load_factor[0], f64::NEG_INFINITY);
}

/// If the attitude is unknown in the whole flight, both settling times must be NaN, not zero. If only the initial attitude is
/// unknown, the size of the step is unknown. Then only the time to 5 % of the step must be NaN.
/// is the size of the step, and only the time to 5 % of the step must be NaN.
#[test]
fn an_unknown_attitude_has_no_settling_time() {
    let unknown = |t: f64| Moment { attitude: [f64::NAN; 2], ..level(t) };
    let q = track(2.0, [30.0, 0.0], unknown).quality(&LIMITS);
    assert!(q.to_one_deg_s.is_nan() && q.to_five_percent_s.is_nan(), "{q:?}");
    let late = |t: f64| if t < 0.5 { unknown(t) } else { level(t) };
    let q = track(2.0, [30.0, 0.0], late).quality(&LIMITS);
    assert!(q.to_five_percent_s.is_nan() && (q.to_one_deg_s - 2.0).abs() < 1e-9, "{q:?}");
}
