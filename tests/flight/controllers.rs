//! The companion at played PX4 and ArduPilot controllers, in lockstep in this process.

use crate::controller_support::{Bench, STEP};
use greylag::control::envelope::EnvelopeLimiter;
use greylag::link::autopilot::Verdict;
use greylag::link::vehicle::Authority;
use greylag::model::GreyBox;
use greylag_sitl::air::{Air, Turbulence};
use greylag_sitl::plant::Truth;
use greylag_sitl::shim::controller::{FlightController, Mode};
use greylag_sitl::shim::{Distortion, Noise, Personality};
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavType};

use std::path::Path;

use crate::flight_support;
use Authority::{Attitude, Surfaces};
use Personality::{Ardupilot, Px4};

/// Roll and pitch in degrees: of the easy box, and one of the hard corners.
const TARGETS: [(f64, f64); 3] = [(30.0, 10.0), (-20.0, -5.0), (-55.0, -20.0)];

/// A bench that has read its controller's parameters, has its streams, flies by itself.
fn ready(personality: Personality, authority: Authority) -> Bench {
    let mut bench = Bench::new(personality, authority, |_| {});
    bench.run(6.0);
    bench
}

#[test]
fn an_attitude_is_held_through_every_stack() {
    // The bounds of issue 8: 0.3° through PX4's sticks at 100 Hz, 0.6° through ArduPilot's channels
    // at 50 Hz. When a controller of its own tracks the attitude, its loops stay off, as real ones do: 0.3° with
    // the companion's slow trim (issue 30) and what it adds for ArduPlane. The hard corner is shown only.
    for (personality, authority, seconds, bound) in [
        (Px4, Surfaces, 14.0, 0.3),
        (Ardupilot, Surfaces, 14.0, 0.6),
        (Px4, Attitude, 14.0, 0.3),
        (Ardupilot, Attitude, 20.0, 0.3),
    ] {
        for (i, (roll, pitch)) in TARGETS.into_iter().enumerate() {
            let mut bench = ready(personality, authority);
            bench.engage(roll, pitch);
            bench.steer(roll, pitch, seconds);
            let settled = bench.settled_deg(roll, pitch);
            println!("{personality} {authority:?} {roll}, {pitch}: settled error {settled:.4} deg");
            assert!(bench.said("engaged"), "{:?}", bench.texts());
            assert!(i == 2 || settled < bound, "{:?}", bench.texts());
        }
    }
}

#[test]
fn eight_attitudes_are_left_off_by_as_much_as_beside_real_px4() {
    // roll and pitch asked for, °; what real PX4 was off by in roll, mean of the last 3 of 12 s (run 3 of results/real-firmware.jsonl)
    let flown = [
        (0.0, 2.0, -0.085),
        (20.0, 2.0, 0.100),
        (-30.0, 2.0, -0.166),
        (0.0, 8.0, 0.101),
        (0.0, -6.0, 0.036),
        (35.0, 5.0, 0.152),
        (-45.0, 5.0, -0.151),
        (0.0, 2.0, 0.114),
    ];
    let mut bench = ready(Px4, Attitude);
    bench.engage(0.0, 2.0);
    for (i, (roll, pitch, real)) in flown.into_iter().enumerate() {
        bench.steer(roll, pitch, 12.0);
        let last = &bench.seen[bench.seen.len() - 300..];
        let mean = |get: fn(&Truth) -> f64| {
            last.iter().map(|s| get(&s.truth).to_degrees()).sum::<f64>() / last.len() as f64
        };
        let [off, up] = [mean(|t| t.roll_rad) - roll, mean(|t| t.pitch_rad) - pitch];
        println!("{roll} / {pitch}: {off:+.3} / {up:+.3} degrees, the real one {real:+.3} in roll");
        assert!(off.abs() < 0.3 && up.abs() < 0.3, "{roll} / {pitch}");
        // the first one depends on what was flown before
        assert!(i == 0 || (off - real).abs() < 0.05, "{roll} / {pitch}");
    }
}

#[test]
fn angles_of_attack_and_sideslip_are_estimated() {
    // Calm air with perfect sensors; then light turbulence with a wind of 7 m/s and noisy sensors.
    for (name, rough) in [("calm", false), ("wind, turbulence, noise", true)] {
        let mut bench = Bench::new(Px4, Surfaces, |options| {
            if rough {
                options.noise = Noise::REALISTIC;
                options.plant.air = Air {
                    wind_ned_mps: [5.0, -5.0, 0.0],
                    turbulence: Some(Turbulence { wind_20ft_mps: 15.0, severity: 3 }),
                    gusts: vec![],
                };
            }
        });
        bench.run(6.0);
        bench.engage(0.0, 3.0);
        for (roll, pitch) in [(0.0, 3.0), (40.0, 5.0), (-40.0, 10.0), (0.0, -10.0), (20.0, 0.0)] {
            bench.steer(roll, pitch, 6.0);
        }
        let flown = &bench.seen[600..];
        let rms = |error: &dyn Fn(usize) -> f64| {
            ((0..flown.len()).map(|i| error(i).powi(2)).sum::<f64>() / flown.len() as f64).sqrt()
        };
        let alpha = rms(&|i| (flown[i].state.state.alpha - flown[i].truth.alpha_rad).to_degrees());
        let beta = rms(&|i| (flown[i].state.state.beta - flown[i].truth.beta_rad).to_degrees());
        println!(
            "{name}: alpha rms {alpha:.2} deg, beta rms {beta:.2} deg over {} s",
            flown.len() / 100
        );
        // What the LQI can bear, and a tenth of the range in the manoeuvres: 1° calm. In turbulence
        // the vertical gusts themselves, 1 m/s in 20, are 3°: who sees none of them errs by as much.
        let bound = if rough { 3.0 } else { 1.0 };
        assert!(alpha < bound && beta < bound);
    }
}

/// A flight of 90 s between attitudes in light turbulence, beside a controller without vanes.
struct Limited {
    /// Share of the time in which the envelope limiter did not act because its model predicted wrongly.
    resting: f64,
    /// Share of the states with more than the largest load factor of the X8, 2.2 g.
    beyond: f64,
    /// Largest load factor, g.
    load: f64,
    /// Largest error of roll or pitch in the last 2 s of a target, degrees.
    off_deg: f64,
}

/// Flies with an LQI of the exact model, whose commands a limiter with `model` limits. `None`: without a limiter. The accelerometer
/// has white noise with the standard deviation `shaking` (m/s²).
fn limited(personality: Personality, model: Option<&str>, shaking: f64, seed: u32) -> Limited {
    let mut bench = Bench::new(personality, Surfaces, |options| {
        options.noise = Noise { accelerometer_mps2: shaking, ..Noise::REALISTIC };
        options.seed = seed.into();
        options.plant.seed = seed;
        options.plant.air = Air {
            wind_ned_mps: [4.0, -2.0, 0.0],
            turbulence: Some(Turbulence { wind_20ft_mps: 23.0, severity: 3 }),
            gusts: vec![],
        };
    });
    if let Some(model) = model {
        let model = GreyBox::load(&Path::new("params/x8").join(model)).unwrap();
        bench.desk.pilot().protect_with(EnvelopeLimiter::new(&model));
    }
    bench.run(6.0);
    // gusts can hide the answer to the pulses of the polarity check
    for _ in 0..3 {
        if bench.controller.mode() != Mode::Manual {
            bench.engage(0.0, 3.0);
            bench.steer(0.0, 3.0, 4.0);
        }
    }
    let start = bench.seen.len();
    let (mut resting, mut off_deg) = (0, 0.0f64);
    for k in 0..900 {
        let targets = [(0.0, 3.0), (40.0, 5.0), (-40.0, 10.0), (0.0, -10.0), (20.0, 0.0)];
        let (roll, pitch) = targets[k / 60 % 5];
        bench.steer(roll, pitch, 0.1);
        let limiter = bench.desk.pilot().protection();
        resting += usize::from(limiter.is_some_and(EnvelopeLimiter::distrusts));
        if k % 60 >= 40 {
            let truth = &bench.seen[bench.seen.len() - 1].truth;
            let off = [truth.roll_rad.to_degrees() - roll, truth.pitch_rad.to_degrees() - pitch];
            off_deg = off.iter().fold(off_deg, |most, off| most.max(off.abs()));
        }
    }
    assert_eq!(bench.controller.mode(), Mode::Manual, "{:?}", bench.texts());
    let loads = bench.seen[start..].iter().map(|seen| -seen.truth.specific_force_mps2[2] / 9.81);
    Limited {
        resting: resting as f64 / 900.0,
        beyond: loads.clone().filter(|load| *load > 2.2).count() as f64 / loads.len() as f64,
        load: loads.fold(0.0, f64::max),
        off_deg,
    }
}

#[test]
fn in_turbulence_without_vanes_the_limiter_rests_with_a_wrong_model_only() {
    for personality in [Px4, Ardupilot] {
        for seed in [11, 12] {
            let [exact, wrong] = ["jsbsim.toml", "prior-as-printed.toml"]
                .map(|model| limited(personality, Some(model), 0.3, seed));
            assert!(exact.resting < 0.01 && wrong.resting > 0.5);
            // what is beyond with the exact model is gusts; the wrong one does not limit
            assert!(exact.beyond < 0.5 * wrong.beyond && exact.load < 2.6);
            assert!(exact.off_deg < 3.0, "{}", exact.off_deg);
        }
    }
}

/// Prints the table of `results/notes/2026-11-30-angle-of-attack-in-turbulence.md`.
#[test]
#[ignore = "320 flights"]
fn in_turbulence_without_vanes_forty_flights_for_each_model() {
    let models = ["jsbsim.toml", "prior.toml", "prior-mild.toml", "prior-severe.toml"];
    let models = models.into_iter().chain(["prior-as-printed.toml"]).map(Some).chain([None]);
    let calm = models.map(|model| (model, 0.3));
    for (model, shaking) in calm.chain([(Some("jsbsim.toml"), 1.0), (Some("jsbsim.toml"), 3.0)]) {
        let flights: Vec<Limited> = (0..20)
            .flat_map(|k| [Px4, Ardupilot].map(|it| limited(it, model, shaking, 7000 + k)))
            .collect();
        let mean = |of: fn(&Limited) -> f64| flights.iter().map(of).sum::<f64>() / 40.0;
        let most = |of: fn(&Limited) -> f64| flights.iter().map(of).fold(0.0, f64::max);
        println!(
            "{}, accelerometer noise {shaking} m/s²: rests {:.1} % (most {:.1}); beyond 2.2 g {:.2} %, {:.2} g at most; off by {:.1} degrees at most, {:.1} in the mean flight",
            model.unwrap_or("no limiter"),
            100.0 * mean(|x| x.resting),
            100.0 * most(|x| x.resting),
            100.0 * mean(|x| x.beyond),
            most(|x| x.load),
            most(|x| x.off_deg),
            mean(|x| x.off_deg),
        );
    }
}

#[test]
fn parameters_that_do_not_fit_are_said_with_the_value_to_set() {
    for (personality, authority, name, value, words) in [
        (Px4, Surfaces, "COM_RC_IN_MODE", 0.0, "COM_RC_IN_MODE is 0: set it to 1"),
        (Px4, Surfaces, "FW_MAN_R_SC", 0.5, "FW_MAN_R_SC is 0.5: set it to 1"),
        (Px4, Surfaces, "NAV_RCL_ACT", 2.0, "NAV_RCL_ACT is 2: set it to 1"),
        (Ardupilot, Surfaces, "THR_FAILSAFE", 0.0, "THR_FAILSAFE is 0: set it to 1"),
        (Ardupilot, Surfaces, "FS_SHORT_ACTN", 3.0, "FS_SHORT_ACTN is 3: set it to 0"),
        (Ardupilot, Surfaces, "RC_OPTIONS", 34.0, "RC_OPTIONS is 34: set it to 32"),
        (Ardupilot, Attitude, "GUIDED_TIMEOUT", 3.0, "GUIDED_TIMEOUT is 3: set it to 0.5"),
        (Px4, Attitude, "COM_OF_LOSS_T", 5.0, "COM_OF_LOSS_T is 5: set it to 0.5"),
        (Ardupilot, Surfaces, "MAV_GCS_SYSID", 255.0, "MAV_GCS_SYSID is 255: set it to 1"),
        (Ardupilot, Surfaces, "RC_OVERRIDE_TIME", 3.0, "RC_OVERRIDE_TIME is 3: set it to 0.5"),
        (Ardupilot, Attitude, "SCHED_LOOP_RATE", 50.0, "SCHED_LOOP_RATE is 50: set it to 200"),
    ] {
        let mut bench = Bench::new(personality, authority, |options| {
            options.parameters = vec![(name.into(), value)];
        });
        bench.run(6.0);
        let Verdict::Rejected(said) = bench.desk.arm(bench.host) else { panic!("{name} accepted") };
        assert!(said.contains(words), "{said}");
        bench.run(1.0);
        assert_eq!(bench.controller.mode(), Mode::Hold, "{name}");
    }
}

#[test]
fn a_controller_of_another_stack_is_refused_by_name() {
    let mut bench = Bench::new(Px4, Surfaces, |_| {});
    bench.controller = Bench::new(Ardupilot, Surfaces, |_| {}).controller;
    bench.run(3.0);
    let Verdict::Rejected(said) = bench.desk.arm(bench.host) else { panic!() };
    assert!(said.contains("ArduPilot: fly it with --profile ardupilot"), "{said}");
}

#[test]
fn a_controller_that_signs_is_recognised_by_its_frames() {
    use greylag::link::signing::{Key, Signer};
    let mut bench = Bench::new(Ardupilot, Surfaces, |_| {});
    bench.signer = Some(Signer::new(Key::from_bytes([1; 32]), 0));
    bench.run(6.0);
    let Verdict::Rejected(said) = bench.desk.arm(bench.host) else { panic!() };
    assert!(said.contains("the controller signs") && said.contains("--sign-vehicle"), "{said}");
}

#[test]
fn a_disarmed_controller_is_not_engaged() {
    let mut bench = ready(Px4, Surfaces);
    bench.controller.arm(false);
    bench.run(2.0);
    let Verdict::Rejected(said) = bench.desk.arm(bench.host) else { panic!() };
    assert!(said.contains("not armed"), "{said}");
}

#[test]
fn a_wire_that_is_cut_hands_the_aircraft_back_and_only_a_request_takes_it_again() {
    for (personality, authority) in
        [(Px4, Surfaces), (Ardupilot, Surfaces), (Px4, Attitude), (Ardupilot, Attitude)]
    {
        let mut bench = ready(personality, authority);
        bench.engage(30.0, 5.0);
        bench.steer(30.0, 5.0, 4.0);
        bench.cut = true;
        let cut = bench.host;
        while !bench.said("not confirmed yet: no state") {
            bench.step();
        }
        let took = bench.host - cut;
        println!("{personality} {authority:?}: hand-back asked {took:?} after the cut");
        // Issue 8: within half a second of a dead link.
        assert!(took.as_secs_f64() <= 0.5);
        bench.run(3.0);
        // The controller's own failsafe, but for GUIDED, which ArduPilot leaves by itself never.
        let mode = bench.controller.mode();
        let guided = (personality, authority) == (Ardupilot, Attitude);
        assert!(guided || matches!(mode, Mode::Hold | Mode::Circle | Mode::Return), "{mode:?}");
        // What is not known is not claimed, and after two heartbeats it is said again.
        assert!(!bench.said("handed back") && bench.said("hand-back not confirmed"));
        bench.cut = false;
        bench.run(0.3);
        // No later than one repetition of the request, though the link was dead for its first ones.
        assert!(!guided || bench.controller.mode() == Mode::Hold, "{:?}", bench.texts());
        bench.run(6.0);
        assert!(bench.said("handed back"), "{:?}", bench.texts());
        assert!(!matches!(bench.controller.mode(), Mode::Manual | Mode::Guided));
        let level = bench.controller.measured().roll_rad.to_degrees().abs();
        assert!(level < 5.0, "{level}");
        // It goes on when asked.
        bench.engage(10.0, 3.0);
        bench.steer(10.0, 3.0, 8.0);
        let settled = bench.settled_deg(10.0, 3.0);
        println!("{personality} {authority:?}: settled {settled:.3} after 8 s");
        assert!(settled < 0.6, "{:?}", bench.texts());
    }
}

#[test]
fn px4_is_engaged_by_what_its_heartbeat_shows() {
    // Real PX4 acknowledged MANUAL at once, refused it, and stayed in HOLD: 6 of 6 engagements
    // failed, and the servos were blamed for it.
    for authority in [Surfaces, Attitude] {
        for start in 0..5 {
            let mut bench = ready(Px4, authority);
            // At every phase of the 10 Hz at which it looks at its requirements.
            (0..2 * start).for_each(|_| bench.step());
            bench.engage(20.0, 5.0);
            let steered = if authority == Surfaces { Mode::Manual } else { Mode::Guided };
            while !bench.said("engaged") {
                bench.step();
                assert!(!bench.said("hand"), "{:?}", bench.texts());
            }
            assert_eq!(bench.controller.mode(), steered, "{:?}", bench.texts());
            bench.steer(20.0, 5.0, 3.0);
            assert_eq!(bench.controller.mode(), steered, "{:?}", bench.texts());
            assert!(authority == Attitude || bench.said("signs are right"), "{:?}", bench.texts());
        }
    }
}

#[test]
fn a_dead_companion_leaves_ardupilot_on_a_radios_sticks_until_its_failsafe_acts() {
    // Without a radio the receiver's failsafe circles first; the ground station's brings either home.
    for (no_radio, left) in
        [(1.0, [Mode::Circle, Mode::Return]), (0.0, [Mode::Return, Mode::Return])]
    {
        let mut bench = Bench::new(Ardupilot, Surfaces, |options| {
            options.parameters = vec![("SIM_RC_FAIL".into(), no_radio)];
        });
        bench.run(6.0);
        bench.engage(15.0, 3.0);
        bench.steer(15.0, 3.0, 3.0);
        assert_eq!(bench.said("a radio is bound"), no_radio == 0.0, "{:?}", bench.texts());
        // The companion is dead: nothing goes up any more.
        bench.cut = true;
        bench.run(0.8);
        assert_eq!(bench.controller.mode(), Mode::Manual);
        let throttle = bench.controller.inputs().throttle;
        assert_eq!(throttle == 0.0, no_radio == 0.0, "{throttle}");
        // The receiver's failsafe neutralises the sticks at 1.0 s and acts at 1.2 s, the ground station's 2 s after the last heartbeat.
        bench.run(0.3);
        assert_eq!(bench.controller.mode(), Mode::Manual);
        assert_eq!(bench.controller.inputs().throttle, 0.0);
        bench.run(if no_radio == 1.0 { 0.9 } else { 2.0 });
        let mode = bench.controller.mode();
        assert!(left.contains(&mode), "{mode:?}");
        bench.run(2.5);
        assert_eq!(bench.controller.mode(), Mode::Return);
    }
}

#[test]
fn a_dead_companion_leaves_guided_where_a_radio_lets_the_ground_stations_failsafe_act() {
    // Without a radio ArduPlane has been in its long failsafe since the ground, and looks at no other.
    for (no_radio, action, ends) in
        [(0.0, 1.0, Mode::Return), (0.0, 0.0, Mode::Guided), (1.0, 1.0, Mode::Guided)]
    {
        let mut bench = Bench::new(Ardupilot, Attitude, |options| {
            options.parameters =
                vec![("SIM_RC_FAIL".into(), no_radio), ("FS_LONG_ACTN".into(), action)];
        });
        bench.run(6.0);
        bench.engage(15.0, 3.0);
        bench.steer(15.0, 3.0, 3.0);
        bench.cut = true;
        // The last heartbeat may be a second older than the cut.
        bench.run(0.9);
        assert_eq!(bench.controller.mode(), Mode::Guided, "{no_radio} {action}");
        bench.run(2.5);
        assert_eq!(bench.controller.mode(), ends, "{no_radio} {action}");
    }
}

#[test]
fn without_a_radio_ardupilot_flies_home_after_a_hand_back_from_surfaces() {
    use greylag::link::autopilot::Autopilot;
    // Its channels have ended with our overrides: LOITER is left by FS_LONG_ACTN.
    for (no_radio, ends) in [(1.0, Mode::Return), (0.0, Mode::Hold)] {
        let mut bench = Bench::new(Ardupilot, Surfaces, |options| {
            options.parameters = vec![("SIM_RC_FAIL".into(), no_radio)];
        });
        bench.run(6.0);
        bench.engage(15.0, 3.0);
        bench.steer(15.0, 3.0, 3.0);
        let now = bench.desk.now(bench.host);
        assert_eq!(bench.desk.pilot().disarm(now, true), Verdict::Accepted);
        bench.run(2.0);
        assert_eq!(bench.controller.mode(), Mode::Hold, "{:?}", bench.texts());
        bench.run(3.0);
        assert_eq!(bench.controller.mode(), ends, "{:?}", bench.texts());
    }
}

#[test]
fn the_shipped_parameters_are_what_both_ways_are_engaged_with() {
    for (personality, file) in
        [(Px4, "params/x8/px4.parm"), (Ardupilot, "params/x8/arduplane.parm")]
    {
        let shipped = greylag_sitl::parameter_file::read(std::path::Path::new(file)).unwrap();
        let played = |(name, _): &&(String, f64)| FlightController::plays(personality, name);
        let played: Vec<_> = shipped.iter().filter(played).cloned().collect();
        assert!(played.len() >= 7, "{file}: {played:?}");
        for authority in [Surfaces, Attitude] {
            let mut bench =
                Bench::new(personality, authority, |options| options.parameters = played.clone());
            bench.run(6.0);
            assert_eq!(bench.desk.vehicle().obstacle(), None, "{file} {authority:?}");
            bench.engage(10.0, 3.0);
            bench.steer(10.0, 3.0, 3.0);
            assert!(bench.said("engaged"), "{file} {authority:?}: {:?}", bench.texts());
        }
    }
}

#[test]
fn heartbeats_of_the_same_system_that_would_hide_a_dead_companion_are_an_obstacle_with_a_radio() {
    let gimbal = MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_GIMBAL,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        ..HEARTBEAT_DATA::DEFAULT
    });
    for (no_radio, refused) in [(0.0, true), (1.0, false)] {
        let mut bench = Bench::new(Ardupilot, Surfaces, |options| {
            options.parameters = vec![("SIM_RC_FAIL".into(), no_radio)];
        });
        bench.run(6.0);
        assert_eq!(bench.desk.vehicle().obstacle(), None);
        bench.beside(&flight_support::frame(1, 154, &gimbal));
        let obstacle = bench.desk.vehicle().obstacle().unwrap_or_default();
        let said = obstacle.contains("component 154 of system 1 sends heartbeats too");
        assert_eq!(said, refused, "{obstacle}");
        // It has gone.
        bench.run(3.5);
        assert_eq!(bench.desk.vehicle().obstacle(), None);
    }
}

#[test]
fn a_radio_without_a_failsafe_that_ends_manual_is_an_obstacle_by_surfaces_alone() {
    for (authority, refused) in [(Surfaces, true), (Attitude, false)] {
        let mut bench = Bench::new(Ardupilot, authority, |options| {
            options.parameters = vec![("SIM_RC_FAIL".into(), 0.0), ("FS_GCS_ENABL".into(), 0.0)];
        });
        bench.run(6.0);
        let obstacle = bench.desk.vehicle().obstacle();
        let said = obstacle.as_deref().unwrap_or("");
        assert_eq!(said.contains("FS_GCS_ENABL is 0: set it to 1"), refused, "{obstacle:?}");
        assert_eq!(obstacle.is_some(), refused, "{obstacle:?}");
    }
}

#[test]
fn px4_holds_after_a_hand_back_though_the_sticks_end() {
    use greylag::link::autopilot::Autopilot;
    let mut bench = ready(Px4, Surfaces);
    bench.engage(20.0, 5.0);
    bench.steer(20.0, 5.0, 2.0);
    let now = bench.desk.now(bench.host);
    assert_eq!(bench.desk.pilot().disarm(now, true), Verdict::Accepted);
    bench.run(2.0);
    // PX4 takes the end of the sticks for a lost radio: NAV_RCL_ACT decides, and 1 is HOLD.
    assert_eq!((bench.controller.counts.failsafes, bench.controller.mode()), (1, Mode::Hold));
}

#[test]
fn a_stream_that_ardupilot_denies_is_asked_for_no_more() {
    let mut bench = Bench::new(Ardupilot, Attitude, |options| {
        options.parameters = vec![("SCHED_LOOP_RATE".into(), 50.0)];
    });
    bench.run(4.0);
    let denials = bench.controller.counts.denied;
    // ATTITUDE_QUATERNION, HIGHRES_IMU, VFR_HUD, AOA_SSA: each denied once or, before its first
    // answer came, twice.
    assert!((4..=8).contains(&denials), "{denials}");
    bench.run(10.0);
    assert_eq!(bench.controller.counts.denied, denials);
    let told =
        bench.texts().iter().filter(|t| t.contains("SCHED_LOOP_RATE to 200, then reboot")).count();
    assert_eq!(told, 1, "{:?}", bench.texts());
}

#[test]
fn an_oscillation_by_delay_hands_the_aircraft_back() {
    // Real ArduPlane let the LQI swing at 2.6 Hz for 50 s, unnoticed. The delay that sets it off here
    // comes in flight, so that the check of signs has passed.
    let mut bench = ready(Ardupilot, Surfaces);
    bench.engage(0.0, 3.0);
    bench.steer(0.0, 3.0, 4.0);
    bench.controller.set_parameter("SIM_SERVO_DELAY", 150.0);
    let begun = bench.host;
    while !bench.said("it oscillates in") {
        bench.steer(0.0, 3.0, 0.1);
        assert!((bench.host - begun).as_secs_f64() < 15.0, "{:?}", bench.texts());
    }
    println!("said {:?} after the delay came", bench.host - begun);
    bench.run(1.0);
    assert_eq!(bench.controller.mode(), Mode::Hold);
    assert!(bench.said("handed back"), "{:?}", bench.texts());
}

#[test]
fn the_fastest_manoeuvres_and_turbulence_are_no_oscillation() {
    // Between the envelope's ends as fast as the LQI goes, in light turbulence with noisy sensors.
    for personality in [Px4, Ardupilot] {
        let mut bench = Bench::new(personality, Surfaces, |options| {
            options.noise = Noise::REALISTIC;
            options.plant.air = Air {
                wind_ned_mps: [5.0, -5.0, 0.0],
                turbulence: Some(Turbulence { wind_20ft_mps: 7.5, severity: 3 }),
                gusts: vec![],
            };
        });
        bench.run(6.0);
        bench.engage(0.0, 3.0);
        bench.steer(0.0, 3.0, 3.0);
        for seconds in [4.0, 1.5, 0.8, 0.4] {
            for sign in [1.0, -1.0, 1.0, -1.0] {
                bench.steer(60.0 * sign, 15.0 * sign, seconds);
            }
        }
        assert!(!bench.said("oscillates") && !bench.said("hand"), "{:?}", bench.texts());
        assert_eq!(bench.controller.mode(), Mode::Manual);
    }
}

#[test]
fn a_record_shows_surfaces_only_where_they_were_flown() {
    // Beside real PX4 the attitudes' record held an elevator of correlation −0.23 with the truth.
    use greylag::flight::recorder::{Place, Recorder};
    for authority in [Surfaces, Attitude] {
        let name = format!("record-{authority:?}-{}", std::process::id());
        let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        let mut bench = ready(Px4, authority);
        bench.desk.record(Recorder::start(&Place::Exactly(folder.clone())).unwrap());
        bench.engage(20.0, 5.0);
        bench.steer(20.0, 5.0, 3.0);
        drop(bench);
        let log = std::fs::read_to_string(folder.join("flight.csv")).unwrap();
        let header: Vec<&str> =
            log.lines().find(|line| line.contains("aileron_cmd")).unwrap().split(',').collect();
        let last: Vec<&str> = log.lines().last().unwrap().split(',').collect();
        let at = |name: &str| last[header.iter().position(|column| *column == name).unwrap()];
        for column in ["aileron_cmd", "elevator_cmd", "aileron_rad", "elevator_rad"] {
            assert_eq!(at(column).is_empty(), authority == Attitude, "{column}: {last:?}");
        }
        assert!(!at("throttle_cmd").is_empty());
        std::fs::remove_dir_all(folder).unwrap();
    }
}

#[test]
fn a_pilot_who_takes_the_aircraft_keeps_it() {
    let mut bench = ready(Px4, Surfaces);
    bench.engage(20.0, 5.0);
    bench.steer(20.0, 5.0, 3.0);
    bench.controller.set_mode(Mode::Return);
    bench.run(2.0);
    assert!(bench.said("left MANUAL"), "{:?}", bench.texts());
    bench.steer(20.0, 5.0, 3.0);
    assert_eq!(bench.controller.mode(), Mode::Return);
}

#[test]
fn lost_setpoints_hand_the_aircraft_back() {
    let mut bench = ready(Ardupilot, Surfaces);
    bench.engage(20.0, 5.0);
    bench.steer(20.0, 5.0, 3.0);
    bench.run(3.0);
    assert!(bench.said("setpoints lost") && bench.said("handed back"), "{:?}", bench.texts());
    assert_eq!(bench.controller.mode(), Mode::Hold);
}

#[test]
fn a_disarmed_companion_gives_the_aircraft_back_at_once() {
    use greylag::link::autopilot::Autopilot;
    let mut bench = ready(Px4, Surfaces);
    bench.engage(20.0, 5.0);
    bench.steer(20.0, 5.0, 2.0);
    let now = bench.desk.now(bench.host);
    assert_eq!(bench.desk.pilot().disarm(now, true), Verdict::Accepted);
    let begun = bench.host;
    while bench.controller.mode() != Mode::Hold {
        bench.step();
        assert!(bench.host - begun < 20 * STEP, "not handed back");
    }
}

#[test]
fn sensors_that_stand_still_hand_the_aircraft_back() {
    // Found by `greylag faults`: the estimator of the incidence went on by itself, so that the state
    // never repeated, and the aircraft was rolled over.
    for personality in [Px4, Ardupilot] {
        let mut bench = Bench::new(personality, Surfaces, |o| o.noise = Noise::REALISTIC);
        bench.run(6.0);
        bench.engage(30.0, 5.0);
        bench.steer(30.0, 5.0, 1.0);
        bench.controller.distort(Distortion { frozen: true, ..Distortion::default() });
        bench.steer(30.0, 5.0, 1.5);
        bench.run(1.0);
        assert!(bench.said("handed back"), "{:?}", bench.texts());
        assert_eq!(bench.controller.mode(), Mode::Hold);
        let worst = bench.seen.iter().map(|s| s.truth.roll_rad.abs()).fold(0.0, f64::max);
        println!("{personality}: {:.0} deg of roll at most", worst.to_degrees());
        assert!(worst.to_degrees() < 60.0);
    }
}

#[test]
fn a_controller_that_is_met_again_in_flight_has_the_aircraft() {
    // Found by `greylag faults`: three heartbeats lost in a row, and the parameters were forgotten
    // while the channels were driven on, by the wrong signs here.
    for seconds in [2.0, 2.9, 3.5] {
        let mut bench = Bench::new(Ardupilot, Surfaces, |options| {
            let reversed = ["RC1_REVERSED", "RC2_REVERSED"];
            options.parameters.extend(reversed.map(|name| (name.to_owned(), 1.0)));
        });
        bench.run(6.0);
        bench.engage(30.0, 5.0);
        bench.steer(30.0, 5.0, 2.0);
        // The heartbeat that is due comes first, so that the gap is a whole number of seconds.
        bench.heartless = true;
        bench.steer(30.0, 5.0, seconds);
        bench.heartless = false;
        bench.steer(30.0, 5.0, 2.0);
        let worst = bench.seen.iter().map(|s| s.truth.roll_rad.abs()).fold(0.0, f64::max);
        println!("{seconds} s without a heartbeat: {:.0} deg of roll at most", worst.to_degrees());
        assert!(worst.to_degrees() < 45.0, "{worst} {:?}", bench.texts());
        let steers = bench.controller.mode() == Mode::Manual;
        assert_ne!(steers, bench.said("handed back"), "{:?}", bench.texts());
        assert!(steers == (seconds < 2.5) || seconds == 2.9, "{:?}", bench.texts());
    }
}
