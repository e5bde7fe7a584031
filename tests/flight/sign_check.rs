//! The gentle check of signs beside played controllers, in lockstep in this process.

use crate::controller_support::Bench;
use greylag::link::vehicle::Authority::{Attitude, Surfaces};
use greylag_sitl::air::{Air, Turbulence};
use greylag_sitl::shim::controller::Mode;
use greylag_sitl::shim::{Noise, Personality};

use Personality::{Ardupilot, Px4};

/// Departure from where it was that a wrong sign may cause before the controller has it again, degrees.
const DEPARTURE: f64 = 30.0;

/// What lies between stick and surface.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wiring {
    Right,
    RollReversed,
    PitchReversed,
    BothReversed,
}

const WIRINGS: [Wiring; 4] =
    [Wiring::Right, Wiring::RollReversed, Wiring::PitchReversed, Wiring::BothReversed];

impl Wiring {
    /// The parameters that wire the played controller so; its own loops do not mind.
    fn parameters(self, personality: Personality) -> Vec<(String, f64)> {
        let (roll, pitch) = match self {
            Wiring::Right => (0.0, 0.0),
            Wiring::RollReversed => (1.0, 0.0),
            Wiring::PitchReversed => (0.0, 1.0),
            Wiring::BothReversed => (1.0, 1.0),
        };
        match personality {
            Px4 => vec![("PWM_MAIN_REV".into(), roll + 2.0 * pitch)],
            Ardupilot => {
                vec![("SERVO1_REVERSED".into(), roll), ("SERVO2_REVERSED".into(), pitch)]
            }
        }
    }
}

/// The air, and how noisy the sensors are.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Weather {
    /// Severity of the turbulence, of 7; none at 0.
    severity: u8,
    /// Wind at 20 ft, m/s.
    wind_mps: f64,
    noise: Noise,
}

const CALM: Weather = Weather { severity: 0, wind_mps: 0.0, noise: Noise::NONE };
const NOISY: Weather = Weather { noise: Noise::REALISTIC, ..CALM };
const ROUGH: Weather = Weather { severity: 3, wind_mps: 15.0, noise: Noise::REALISTIC };
const SEVERE: Weather = Weather { severity: 6, wind_mps: 20.0, noise: Noise::REALISTIC };

/// What came of a flight.
#[derive(Clone, Debug)]
struct Outcome {
    passed: bool,
    refused: bool,
    /// From engaging to the verdict, s.
    took_s: f64,
    /// Largest change of roll and pitch from engaging until a second after the verdict, degrees.
    departed_deg: f64,
    texts: Vec<String>,
}

fn bench(personality: Personality, wiring: Wiring, weather: Weather, seed: u64) -> Bench {
    let mut bench = Bench::new(personality, Surfaces, |options| {
        options.seed = seed;
        options.plant.seed = seed as u32;
        options.noise = weather.noise;
        options.parameters = wiring.parameters(personality);
        options.plant.air = Air {
            wind_ned_mps: [0.3 * weather.wind_mps, -0.3 * weather.wind_mps, 0.0],
            turbulence: (weather.severity > 0).then_some(Turbulence {
                wind_20ft_mps: weather.wind_mps,
                severity: weather.severity,
            }),
            gusts: vec![],
        };
    });
    // The moment of engaging is another one in each flight.
    bench.run(6.0 + 0.13 * (seed % 17) as f64);
    bench
}

/// Engages, and flies until a second after the verdict.
fn checked(bench: &mut Bench) -> Outcome {
    bench.engage(30.0, 5.0);
    let said = |bench: &Bench, words: &str| bench.said(words);
    let attitude = |bench: &Bench| {
        let t = bench.controller.measured();
        [t.roll_rad.to_degrees(), t.pitch_rad.to_degrees()]
    };
    let mut start = None;
    let (mut steps, mut verdict, mut departed) = (0, None, 0.0f64);
    for step in 0..500 {
        if step % 10 == 0 {
            bench.wish(30.0, 5.0);
        }
        bench.step();
        if bench.controller.mode() == Mode::Manual && start.is_none() {
            start = Some(attitude(bench));
        }
        steps += usize::from(start.is_some() && verdict.is_none());
        if verdict.is_none() && (said(bench, "signs are right") || said(bench, "handed back")) {
            verdict = Some(step);
        }
        let refused = said(bench, "handed back");
        if let Some(start) = start.filter(|_| verdict.is_none() || refused) {
            let now = attitude(bench);
            departed = (0..2).map(|i| (now[i] - start[i]).abs()).fold(departed, f64::max);
        }
        if verdict.is_some_and(|at| step > at + if refused { 30 } else { 0 }) {
            break;
        }
    }
    Outcome {
        passed: said(bench, "signs are right"),
        refused: said(bench, "handed back"),
        took_s: steps as f64 * 0.01,
        departed_deg: departed,
        texts: bench.texts(),
    }
}

#[test]
fn right_signs_pass_and_the_flight_goes_on() {
    for personality in [Px4, Ardupilot] {
        let mut bench = bench(personality, Wiring::Right, NOISY, 1);
        let outcome = checked(&mut bench);
        println!("{personality}: {outcome:?}");
        assert!(outcome.passed && !outcome.refused, "{outcome:?}");
        bench.steer(30.0, 5.0, 10.0);
        assert!(bench.settled_deg(30.0, 5.0) < 1.0, "{:?}", bench.texts());
    }
}

#[test]
fn wrong_signs_are_refused_with_the_axis_and_the_remedy() {
    for (personality, wiring, words) in [
        (Px4, Wiring::RollReversed, ["rolls left", "CA_SV_CSn_TRQ_R or PWM_MAIN_REV"]),
        (Px4, Wiring::PitchReversed, ["pitches up", "CA_SV_CSn_TRQ_P or PWM_MAIN_REV"]),
        (Ardupilot, Wiring::RollReversed, ["rolls left", "RC1_REVERSED or SERVOn_REVERSED"]),
        (Ardupilot, Wiring::PitchReversed, ["pitches up", "RC2_REVERSED or SERVOn_REVERSED"]),
    ] {
        let mut bench = bench(personality, wiring, NOISY, 1);
        let outcome = checked(&mut bench);
        println!("{personality} {wiring:?}: {outcome:?}");
        assert!(outcome.refused && !outcome.passed, "{outcome:?}");
        assert!(words.iter().all(|words| bench.said(words)), "{:?}", outcome.texts);
        assert!(outcome.departed_deg < DEPARTURE, "{outcome:?}");
        bench.run(4.0);
        // Without a radio ArduPlane's LOITER becomes RTL three seconds after its channels have ended.
        let home = personality == Ardupilot && bench.controller.mode() == Mode::Return;
        assert!(home || bench.controller.mode() == Mode::Hold, "{:?}", bench.controller.mode());
        let level = bench.controller.measured().roll_rad.to_degrees().abs();
        assert!(level < 5.0, "{level}");
    }
}

#[test]
fn a_controller_that_is_commanded_attitudes_is_not_checked() {
    let mut bench = Bench::new(Px4, Attitude, |_| {});
    bench.run(6.0);
    bench.engage(30.0, 5.0);
    bench.steer(30.0, 5.0, 14.0);
    assert!(!bench.said("signs"), "{:?}", bench.texts());
    assert!(bench.settled_deg(30.0, 5.0) < 0.1);
}

/// Numbers of one kind of flight.
#[derive(Debug, Default)]
struct Tally {
    /// Wrong signs that were not refused.
    missed: usize,
    /// Wrong signs that were refused without being named.
    unnamed: usize,
    /// Right signs of which it was told that they are wrong.
    slandered: usize,
    /// Right signs that were refused because nothing could be told.
    untold: usize,
    took_s: Vec<f64>,
    departed_deg: f64,
}

impl Tally {
    fn add(&mut self, wiring: Wiring, o: &Outcome) {
        let told = o.texts.concat().contains("wrong sign");
        let right = wiring == Wiring::Right;
        self.missed += usize::from(!right && (o.passed || !o.refused));
        self.unnamed += usize::from(!right && o.refused && !told);
        self.slandered += usize::from(right && told);
        self.untold += usize::from(right && o.refused && !told);
        self.took_s.push(o.took_s);
        self.departed_deg = self.departed_deg.max(o.departed_deg);
    }
}

/// Seeds of each kind from the environment: `SIGNS=300`.
#[test]
#[ignore = "a campaign of a minute, for docs/validation/real-flight-controllers.md"]
fn hundreds_of_checks_in_every_air() {
    let seeds = std::env::var("SIGNS").ok().and_then(|n| n.parse().ok()).unwrap_or(100u64);
    for personality in [Px4, Ardupilot] {
        for (name, weather) in
            [("calm", CALM), ("noisy", NOISY), ("rough", ROUGH), ("severe", SEVERE)]
        {
            for wiring in WIRINGS {
                let mut tally = Tally::default();
                for seed in 0..seeds {
                    tally.add(wiring, &checked(&mut bench(personality, wiring, weather, seed)));
                }
                tally.took_s.sort_by(f64::total_cmp);
                println!(
                    "{personality} {name} {wiring:?}, {seeds} flights: {} missed, {} unnamed, {} slandered, {} untold; verdict \
                     after {:.2} s (median), {:.2} s at most; departed by {:.0} deg at most",
                    tally.missed,
                    tally.unnamed,
                    tally.slandered,
                    tally.untold,
                    tally.took_s[tally.took_s.len() / 2],
                    tally.took_s[tally.took_s.len() - 1],
                    tally.departed_deg
                );
                assert_eq!(tally.missed, 0);
                // Where gusts turn the aircraft faster than the pulses do, it is refused to be safe.
                assert!(tally.untold + tally.slandered == 0 || weather == SEVERE);
                assert!(tally.departed_deg < DEPARTURE);
            }
        }
    }
}
