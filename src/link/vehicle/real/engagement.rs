//! Engagement: how the companion requests control authority from the flight controller ("controller") and returns it.
//!
//! The "steered mode" is the controller's mode in which it executes the companion's commands. The companion has control
//! authority when HEARTBEAT or CURRENT_MODE show this mode. COMMAND_ACK does not suffice: PX4 sends two replies to a mode
//! request, the first is always ACCEPTED, and the link may lose either.

use std::time::Duration;

use super::profile::{Authority, Stack};

/// Interval at which a mode request is repeated.
pub(super) const ASK_AGAIN: Duration = Duration::from_millis(250);
/// Longest time from the first mode request until the controller shows the steered mode.
const PATIENCE: Duration = Duration::from_secs(3);
/// Time after which it is reported that the controller has not confirmed the return of control authority. Two heartbeats are
/// due in this time.
const UNCONFIRMED: Duration = Duration::from_secs(2);
/// Time after engagement for which another mode is ignored, because HEARTBEAT and CURRENT_MODE may arrive in the wrong order.
const GRACE: Duration = Duration::from_millis(100);

/// Phase of the engagement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase {
    /// The controller or its remote pilot flies.
    Idle,
    /// The steered mode is requested. The companion already sends commands, because the controller accepts the mode only while
    /// it receives them.
    Entering { since: Duration, asked: Option<Duration> },
    /// The companion has control authority.
    Engaged { since: Duration },
    /// The controller's hold mode is requested, until the controller shows a mode other than the steered one.
    Releasing { since: Option<Duration>, asked: Option<Duration> },
}

/// What a mode that the controller shows means for the engagement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shown {
    /// No change of the phase.
    Nothing,
    /// The companion has control authority from now on.
    Engaged,
    /// The controller or its remote pilot has taken control.
    Taken,
    /// The controller has confirmed the return.
    Confirmed,
}

/// The phase of the engagement, and the controller's replies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Engagement {
    pub(super) phase: Phase,
    /// Time for which commands are streamed before the first mode request.
    lead: Duration,
    /// The last MAV_RESULT that refused a mode request in this engagement.
    refused: Option<u8>,
    /// Whether a mode request was accepted in this engagement.
    accepted: bool,
    /// Whether engagement is blocked. The loss or return of control authority blocks it until [`rest`](Engagement::rest) is
    /// called.
    barred: bool,
    /// Whether it was reported that the return is not confirmed.
    reminded: bool,
}

impl Engagement {
    pub(super) fn new(lead: Duration) -> Self {
        Engagement {
            phase: Phase::Idle,
            lead,
            refused: None,
            accepted: false,
            barred: false,
            reminded: false,
        }
    }

    /// Whether the companion sends commands.
    pub(super) fn steers(&self) -> bool {
        matches!(self.phase, Phase::Entering { .. } | Phase::Engaged { .. })
    }

    /// Whether the controller executes the commands.
    pub(super) fn is_engaged(&self) -> bool {
        matches!(self.phase, Phase::Engaged { .. })
    }

    /// Starts engagement at `host`, unless it is blocked or has started already. Returns whether it starts now.
    pub(super) fn begin(&mut self, host: Duration) -> bool {
        let begins = !self.barred && !self.steers();
        if begins {
            self.phase = Phase::Entering { since: host, asked: None };
            (self.refused, self.accepted) = (None, false);
        }
        begins
    }

    /// To be called if the companion does not demand control authority. Ends the blocking of engagement. Begins the return of
    /// control authority if the companion has or requests it.
    pub(super) fn rest(&mut self) {
        self.barred = false;
        if self.steers() {
            self.release();
        }
    }

    /// Begins the return of control authority. Engagement is blocked until [`rest`](Engagement::rest) is called.
    pub(super) fn hand_back(&mut self) {
        self.barred = true;
        self.release();
    }

    fn release(&mut self) {
        self.phase = Phase::Releasing { since: None, asked: None };
        self.reminded = false;
    }

    /// Stores the MAV_RESULT of a mode request. An acceptance alone does not engage.
    pub(super) fn answered(&mut self, result: u8) {
        match (self.phase, result) {
            (Phase::Entering { .. }, 0) => self.accepted = true,
            // 5 (MAV_RESULT_IN_PROGRESS) is no refusal
            (Phase::Entering { .. }, 1..=4 | 6..) => self.refused = Some(result),
            _ => {}
        }
    }

    /// Changes the phase according to a mode that the controller shows. `steered` states whether it is the steered mode.
    pub(super) fn shown(&mut self, host: Duration, steered: bool) -> Shown {
        match self.phase {
            // if the steered mode was active before the first request, the remote pilot chose it
            Phase::Entering { asked: Some(_), .. } if steered => {
                self.phase = Phase::Engaged { since: host };
                Shown::Engaged
            }
            Phase::Engaged { since } if !steered && host.saturating_sub(since) > GRACE => {
                self.barred = true;
                self.phase = Phase::Idle;
                Shown::Taken
            }
            Phase::Releasing { asked: Some(_), .. } if !steered => {
                self.phase = Phase::Idle;
                Shown::Confirmed
            }
            _ => Shown::Nothing,
        }
    }

    /// The likely reason for which the controller does not show the steered mode; `None` before the timeout.
    pub(super) fn overdue(
        &self,
        host: Duration,
        stack: Stack,
        authority: Authority,
    ) -> Option<String> {
        let Phase::Entering { since, .. } = self.phase else { return None };
        if host.saturating_sub(since) <= self.lead + PATIENCE {
            return None;
        }
        Some(match self.refused {
            Some(result) => refusal(result, stack, authority),
            None if self.accepted => {
                "it accepted, but showed another mode: its pilot's mode switch may hold it".into()
            }
            None => "it did not answer: check the link towards the controller".into(),
        })
    }

    /// Whether it is to be reported now that the controller has not confirmed the return. The result is `true` at most once per
    /// return.
    pub(super) fn unconfirmed(&mut self, host: Duration) -> bool {
        let Phase::Releasing { since: Some(since), .. } = self.phase else { return false };
        let late = host.saturating_sub(since) > UNCONFIRMED && !self.reminded;
        self.reminded |= late;
        late
    }

    /// The mode request that is due at `host`: `true` for the steered mode, `false` for the controller's hold mode, `None` if no
    /// request is due.
    pub(super) fn request(&mut self, host: Duration) -> Option<bool> {
        let due =
            |asked: Option<Duration>| asked.is_none_or(|at| host.saturating_sub(at) >= ASK_AGAIN);
        match self.phase {
            Phase::Entering { since, asked }
                if due(asked) && host.saturating_sub(since) >= self.lead =>
            {
                self.phase = Phase::Entering { since, asked: Some(host) };
                Some(true)
            }
            Phase::Releasing { since, asked } if due(asked) => {
                let since = since.or(Some(host));
                self.phase = Phase::Releasing { since, asked: Some(host) };
                Some(false)
            }
            _ => None,
        }
    }
}

/// Likely cause for which the controller refused the steered mode with this MAV_RESULT.
fn refusal(result: u8, stack: Stack, authority: Authority) -> String {
    match (result, stack, authority) {
        (1, Stack::Px4, Authority::Surfaces) => {
            "PX4 sees no sticks: set COM_RC_IN_MODE to 1 and check that nobody else sends sticks"
                .into()
        }
        (1, Stack::Px4, Authority::Attitude) => {
            "the requirements of OFFBOARD are not met: PX4 sees no setpoints, or its estimate is \
             not valid"
                .into()
        }
        (1, Stack::Ardupilot, _) => {
            "ArduPilot rejected it for now: ask again in level flight".into()
        }
        (2, ..) => {
            "it denied it: a failsafe or a geofence holds its mode, or the mode is disabled".into()
        }
        (3, ..) => "it does not support it: its firmware has no such mode".into(),
        (4, ..) => "it failed to change over: read its own messages at the ground station".into(),
        _ => format!("it refused (MAV_RESULT {result})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAD: Duration = Duration::from_millis(500);

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn an_acceptance_does_not_engage_and_a_later_refusal_is_the_reason() {
        let mut engagement = Engagement::new(LEAD);
        engagement.begin(ms(0));
        assert_eq!(engagement.request(ms(490)), None);
        assert_eq!(engagement.request(ms(500)), Some(true));
        // the two replies of PX4: the first comes from its MAVLink receiver, the second from its commander
        engagement.answered(0);
        engagement.answered(1);
        assert!(matches!(engagement.phase, Phase::Entering { .. }));
        assert_eq!(engagement.request(ms(750)), Some(true));
        let overdue = |at| engagement.overdue(ms(at), Stack::Px4, Authority::Attitude);
        assert_eq!(overdue(3500), None);
        assert!(overdue(3501).unwrap().contains("requirements of OFFBOARD"));
    }

    #[test]
    fn a_mode_that_was_on_before_it_was_asked_for_does_not_engage() {
        let mut engagement = Engagement::new(LEAD);
        engagement.begin(ms(0));
        assert_eq!(engagement.shown(ms(100), true), Shown::Nothing);
        engagement.request(ms(500));
        assert_eq!(engagement.shown(ms(510), true), Shown::Engaged);
    }

    #[test]
    fn a_hand_back_is_asked_for_until_another_mode_is_shown() {
        let mut engagement = Engagement::new(Duration::ZERO);
        engagement.begin(ms(0));
        engagement.request(ms(0));
        engagement.shown(ms(10), true);
        engagement.hand_back();
        // one minute without a reply, with four requests per second
        let asked = (0..6000).filter(|i| engagement.request(ms(10 * i)) == Some(false)).count();
        assert_eq!(asked, 240);
        assert!(engagement.unconfirmed(ms(60_000)) && !engagement.unconfirmed(ms(60_010)));
        assert_eq!(engagement.shown(ms(60_100), true), Shown::Nothing);
        assert_eq!(engagement.request(ms(60_250)), Some(false));
        assert_eq!(engagement.shown(ms(60_300), false), Shown::Confirmed);
        assert_eq!(engagement.request(ms(61_000)), None);
    }

    #[test]
    fn a_mode_that_overtakes_is_borne_for_a_tenth_of_a_second_and_no_longer() {
        for (late, shown) in [(100, Shown::Nothing), (101, Shown::Taken)] {
            let mut engagement = Engagement::new(Duration::ZERO);
            assert!(engagement.begin(ms(0)));
            engagement.request(ms(0));
            assert_eq!(engagement.shown(ms(10), true), Shown::Engaged);
            assert_eq!(engagement.shown(ms(10 + late), false), shown);
            // engagement cannot begin: it is active still, or blocked because the remote pilot has control
            assert!(!engagement.begin(ms(200)));
            assert_eq!(engagement.is_engaged(), shown == Shown::Nothing);
            engagement.rest();
            assert!(engagement.begin(ms(300)));
        }
    }

    #[test]
    fn each_refusal_is_said_in_its_own_words() {
        for (result, stack, authority, words) in [
            (1, Stack::Px4, Authority::Surfaces, "COM_RC_IN_MODE"),
            (1, Stack::Px4, Authority::Attitude, "requirements of OFFBOARD"),
            (1, Stack::Ardupilot, Authority::Surfaces, "level flight"),
            (2, Stack::Px4, Authority::Surfaces, "a failsafe or a geofence"),
            (3, Stack::Px4, Authority::Surfaces, "no such mode"),
            (4, Stack::Px4, Authority::Surfaces, "failed to change over"),
            (9, Stack::Px4, Authority::Surfaces, "MAV_RESULT 9"),
        ] {
            let mut engagement = Engagement::new(LEAD);
            engagement.begin(ms(0));
            // MAV_RESULT_IN_PROGRESS (5) does not replace the refusal
            [result, 5].into_iter().for_each(|result| engagement.answered(result));
            let said = engagement.overdue(ms(3501), stack, authority).unwrap();
            assert!(said.contains(words), "{said}");
        }
        let mut engagement = Engagement::new(LEAD);
        engagement.begin(ms(0));
        let silent = engagement.overdue(ms(3501), Stack::Px4, Authority::Surfaces).unwrap();
        assert!(silent.contains("did not answer"), "{silent}");
        engagement.answered(0);
        let held = engagement.overdue(ms(3501), Stack::Px4, Authority::Surfaces).unwrap();
        assert!(held.contains("it accepted"), "{held}");
    }

    #[test]
    fn a_hand_back_is_said_again_once_more_than_two_seconds_have_passed() {
        let mut engagement = Engagement::new(Duration::ZERO);
        engagement.begin(ms(0));
        engagement.hand_back();
        engagement.request(ms(0));
        let said = [1990, 2000, 2001, 2010, 9000].map(|at| engagement.unconfirmed(ms(at)));
        assert_eq!(said, [false, false, true, false, false]);
    }
}
