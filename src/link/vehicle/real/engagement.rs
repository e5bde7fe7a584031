//! Who has the aircraft: from asking the controller for it to handing it back.

use std::time::Duration;

/// The controller is asked for a mode again after this time.
pub(super) const ASK_AGAIN: Duration = Duration::from_millis(250);
/// It has this long to go over.
const PATIENCE: Duration = Duration::from_secs(3);
/// It is asked to take the aircraft back this often.
const HAND_BACKS: u32 = 5;
/// A heartbeat that was under way when the mode changed may still tell the old one.
const GRACE: Duration = Duration::from_millis(1300);

/// Where things stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase {
    /// The controller flies, or its pilot.
    Idle,
    /// It is being asked for the mode in which we steer; what we send it meanwhile is a stream of
    /// commands that it wants to see first.
    Entering { since: Duration, asked: Option<Duration> },
    /// We steer.
    Engaged { since: Duration },
    /// It is being told to fly by itself.
    Releasing { asked: Option<Duration>, times: u32 },
}

/// The phase with what it was told.
#[derive(Clone, Copy, Debug)]
pub(super) struct Engagement {
    pub(super) phase: Phase,
    /// Result of the last refusal of the mode.
    refused: Option<u8>,
    /// After a hand-back nothing is begun until the demand has ended once.
    barred: bool,
}

impl Engagement {
    pub(super) fn new() -> Self {
        Engagement { phase: Phase::Idle, refused: None, barred: false }
    }

    /// Whether commands are to be sent.
    pub(super) fn steers(&self) -> bool {
        matches!(self.phase, Phase::Entering { .. } | Phase::Engaged { .. })
    }

    /// Somebody wants to steer.
    pub(super) fn begin(&mut self, host: Duration) {
        if !self.barred && !self.steers() {
            self.phase = Phase::Entering { since: host, asked: None };
            self.refused = None;
        }
    }

    /// Nobody wants to steer.
    pub(super) fn rest(&mut self) {
        self.barred = false;
        if self.steers() {
            self.phase = Phase::Releasing { asked: None, times: 0 };
        }
    }

    /// The aircraft goes back to the controller, and stays there until somebody asks again.
    pub(super) fn hand_back(&mut self) {
        self.barred = true;
        self.phase = Phase::Releasing { asked: None, times: 0 };
    }

    /// The controller, or its pilot, has taken it.
    pub(super) fn taken(&mut self) {
        self.barred = true;
        self.phase = Phase::Idle;
    }

    /// The controller has answered a request for a mode.
    pub(super) fn answered(&mut self, host: Duration, result: u8) {
        if let Phase::Entering { .. } = self.phase {
            match result {
                0 => self.phase = Phase::Engaged { since: host },
                // In progress.
                5 => {}
                _ => self.refused = Some(result),
            }
        }
    }

    /// The controller's heartbeat has told its mode; whether it has left the one we steer in.
    pub(super) fn told(&mut self, host: Duration, steered: bool) -> bool {
        match self.phase {
            Phase::Entering { .. } if steered => {
                self.phase = Phase::Engaged { since: host };
                false
            }
            Phase::Engaged { since } => !steered && host.saturating_sub(since) > GRACE,
            Phase::Releasing { times, .. } if !steered && times > 0 => {
                self.phase = Phase::Idle;
                false
            }
            _ => false,
        }
    }

    /// Why it takes too long, if it does.
    pub(super) fn overdue(&self, host: Duration) -> Option<String> {
        match self.phase {
            Phase::Entering { since, .. } if host.saturating_sub(since) > PATIENCE => {
                Some(match self.refused {
                    Some(result) => format!("it refused (MAV_RESULT {result})"),
                    None => "it did not answer".into(),
                })
            }
            _ => None,
        }
    }

    /// Whether a request is due at `host`: `true` in the answer is for the steered mode, `false`
    /// for the one in which the controller flies.
    pub(super) fn request(&mut self, host: Duration) -> Option<bool> {
        let due =
            |asked: Option<Duration>| asked.is_none_or(|at| host.saturating_sub(at) >= ASK_AGAIN);
        match self.phase {
            Phase::Entering { since, asked } if due(asked) => {
                self.phase = Phase::Entering { since, asked: Some(host) };
                Some(true)
            }
            Phase::Releasing { asked, times } if due(asked) && times < HAND_BACKS => {
                self.phase = Phase::Releasing { asked: Some(host), times: times + 1 };
                Some(false)
            }
            Phase::Releasing { asked, .. } if due(asked) => {
                self.phase = Phase::Idle;
                None
            }
            _ => None,
        }
    }
}
