//! What is added to the attitude commanded to ArduPlane beside the slow trim.
//!
//! **Roll.** ArduPlane demands the body rate (commanded − measured)/τ about the roll axis and no rate of the turn
//! (`AP_RollController`). A steady turn at the rate ψ̇ has the body rate `−ψ̇ sin θ`, so the roll stays off by τ times that for
//! as long as the turn lasts: 1.1° at 45° of bank and 5° of pitch. The addition is this error, with the rate of a coordinated
//! turn at the commanded attitude. PX4 demands the rate itself.
//!
//! **Pitch.** ArduPlane's integrator has a time constant of 3.6 s, (P + FF)/I + τ with the gains of the X8. What a roll from one
//! bank to the other leaves in it is a pitch error for that long. The slow trim takes it for a steady one, and when it has passed
//! the trim overshoots. An addition in proportion to the error halves it, as half of PTCH2SRV_TCONST would.
//!
//! Real ArduPlane 4.8 on JSBSim's X8 (30 November 2026): 0.48° at most without the additions, 0.22° with them.

use greylag_physics::Time;

/// ArduPlane's time constant of the roll angle, RLL2SRV_TCONST, as shipped, s. The slow trim removes what another value leaves.
const TIME_CONSTANT_S: f64 = 0.5;
/// Addition to the pitch per pitch error. Beside real ArduPlane 3 was steady too.
const STIFFER: f64 = 1.0;
/// Time constant of the low-pass on the pitch error, s.
const SMOOTH_S: f64 = 0.15;
/// Largest addition in roll and in pitch, rad.
const MOST: [f64; 2] = [5.0 * DEGREE, 2.0 * DEGREE];
/// Largest bank of which the rate of turn is taken, rad.
const BANK: f64 = 65.0 * DEGREE;
/// Lowest airspeed that is used, m/s.
const SLOWEST_MPS: f64 = 8.0;
/// Time between two states above which the low-pass begins anew, s.
const GAP_S: f64 = 0.5;
/// Standard gravity, m/s².
const GRAVITY: f64 = 9.80665;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// The additions, with the time and value of the low-pass on the pitch error, rad.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ArduplaneLead {
    smooth: Option<(Time, f64)>,
}

impl ArduplaneLead {
    /// Begins anew while ArduPlane flies by itself.
    pub(super) fn rest(&mut self) {
        self.smooth = None;
    }

    /// What to add to the roll and pitch sent at `now`, rad, for the commanded roll and pitch `wanted` and the measured `seen`
    /// (rad), at a true airspeed (m/s).
    pub(super) fn command(
        &mut self,
        now: Time,
        wanted: [f64; 2],
        seen: [f64; 2],
        airspeed: f64,
    ) -> [f64; 2] {
        let error = wanted[1] - seen[1];
        let smooth = match self.smooth {
            Some((last, smooth)) if now.since(last).as_secs_f64() <= GAP_S => {
                let dt = now.since(last).as_secs_f64();
                smooth + (error - smooth) * dt / (SMOOTH_S + dt)
            }
            _ => error,
        };
        // what is no number is forgotten
        self.smooth = smooth.is_finite().then_some((now, smooth));
        let turn = GRAVITY / airspeed.max(SLOWEST_MPS) * wanted[0].clamp(-BANK, BANK).tan();
        let added = [-TIME_CONSTANT_S * turn * wanted[1].sin(), STIFFER * smooth];
        std::array::from_fn(|axis| match added[axis].is_finite() {
            true => added[axis].clamp(-MOST[axis], MOST[axis]),
            false => 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(tick: u64) -> Time {
        Time::from_micros(10_000 * tick)
    }

    /// Roll error, °, after 20 s of ArduPlane's roll law with ideal rates in a coordinated turn at 19.5 m/s. `leads` is 1 with
    /// the additions, 0 without them.
    fn settled(roll: f64, pitch: f64, leads: f64) -> f64 {
        let wanted = [roll * DEGREE, pitch * DEGREE];
        let (mut lead, mut bank) = (ArduplaneLead::default(), 0.0_f64);
        for tick in 0..2000 {
            let [added, _] = lead.command(at(tick), wanted, [bank, wanted[1]], 19.5);
            let body_rate = (wanted[0] + leads * added - bank) / 0.5;
            let turn = GRAVITY / 19.5 * bank.tan();
            bank += 0.01 * (body_rate + turn * wanted[1].sin());
        }
        bank / DEGREE - roll
    }

    #[test]
    fn a_climbing_turn_of_arduplane_keeps_no_roll_error() {
        // the slow trim beside real ArduPlane went to -0.74° and +1.09° (30 November 2026)
        for (roll, pitch, left) in [(35.0, 5.0, 0.74), (-45.0, 5.0, -1.09)] {
            let [without, with] = [settled(roll, pitch, 0.0), settled(roll, pitch, 1.0)];
            println!(
                "{roll} / {pitch}: {without:+.2} degrees without, {with:+.3} with the addition"
            );
            assert!((without / left - 1.0).abs() < 0.4, "{without}");
            assert!(with.abs() < 0.05, "{with}");
        }
        assert_eq!(settled(0.0, 8.0, 1.0), 0.0, "level flight");
    }

    /// Pitch error, °, after 6 s of a pitch that is off by 3° at first and that ArduPlane's integrator brings back.
    fn passing(leads: f64) -> f64 {
        // rate loop: demanded rate in, error of the rate out; P + FF = 0.47, I = 0.15, the disturbance is a torque
        let (mut lead, mut pitch, mut integral) = (ArduplaneLead::default(), 0.0, -0.05);
        for tick in 0..600 {
            let [_, added] = lead.command(at(tick), [0.0, 0.0], [0.0, pitch], 20.0);
            let demanded = (leads * added - pitch) / 0.5;
            let rate = demanded + integral / 0.47;
            integral += 0.01 * 0.15 * (demanded - rate);
            pitch += 0.01 * rate;
        }
        pitch / DEGREE
    }

    #[test]
    fn a_pitch_error_that_passes_is_halved() {
        let [without, with] = [passing(0.0), passing(1.0)];
        println!("{without:+.3} degrees without, {with:+.3} with the addition");
        assert!(without < -0.3 && (with / without - 0.5).abs() < 0.15, "{without}, {with}");
    }

    #[test]
    fn additions_are_bounded_and_what_is_no_number_adds_nothing() {
        let mut lead = ArduplaneLead::default();
        let nan = f64::NAN;
        assert_eq!(lead.command(at(0), [nan, 0.1], [nan, nan], nan), [0.0, 0.0]);
        assert_eq!(lead.command(at(1), [0.0, 0.1], [0.0, 0.1], nan), [0.0, 0.0]);
        let added = lead.command(at(2), [1.5, 1.5], [-1.5, -1.5], 0.0);
        assert!(added[0].abs() <= MOST[0] && added[1].abs() <= MOST[1], "{added:?}");
        lead.rest();
        assert_eq!(lead.command(at(3), [0.0, 0.2], [0.0, 0.2], 20.0), [0.0, 0.0]);
    }
}
