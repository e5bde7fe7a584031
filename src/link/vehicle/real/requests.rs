//! Requests for message streams from the flight controller ("controller"), and its replies.

use std::collections::{BTreeSet, VecDeque};

use super::profile::{Stack, Stream};

/// Meaning of a reply to a stream request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// The reply changes nothing.
    Nothing,
    /// The controller sends the message with this id at the requested rate from now on.
    Granted(u32),
    /// The controller does not send the message at the requested rate, and will not after another request.
    Denied,
}

/// Stream requests that wait for a reply, and the replies so far. A reply does not name its message, but replies come in the
/// order of the requests. Requests are made in rounds. A request without a reply is discarded when the next round starts.
#[derive(Clone, Debug, Default)]
pub(super) struct Requests {
    waiting: VecDeque<u32>,
    granted: BTreeSet<u32>,
    denied: BTreeSet<u32>,
    reported: bool,
}

impl Requests {
    /// Starts a new round: discards the requests without a reply.
    pub(super) fn turn(&mut self) {
        self.waiting.clear();
    }

    /// Whether the message `id` may be requested: it was not denied before. If so, the request is stored.
    pub(super) fn ask(&mut self, id: u32) -> bool {
        let may = !self.denied.contains(&id);
        if may {
            self.waiting.push_back(id);
        }
        may
    }

    /// Assigns a reply with this MAV_RESULT to the oldest request, and returns its meaning.
    pub(super) fn answered(&mut self, result: u8) -> Answer {
        let Some(id) = self.waiting.pop_front() else { return Answer::Nothing };
        match result {
            0 if self.granted.insert(id) => Answer::Granted(id),
            // 2 is MAV_RESULT_DENIED, 3 is MAV_RESULT_UNSUPPORTED
            2 | 3 => {
                self.denied.insert(id);
                Answer::Denied
            }
            _ => Answer::Nothing,
        }
    }

    /// Whether the controller denied the message `id`.
    pub(super) fn is_denied(&self, id: u32) -> bool {
        self.denied.contains(&id)
    }

    /// The text of [`words`](Requests::words) when it is called first with such a text; `None` afterwards.
    pub(super) fn complaint(&mut self, stack: Stack) -> Option<String> {
        let words = self.words(stack).filter(|_| !self.reported)?;
        self.reported = true;
        Some(words)
    }

    /// A text that names the denied streams which are needed for engagement, with a remedy; `None` if no such stream was denied.
    pub(super) fn words(&self, stack: Stack) -> Option<String> {
        let denied = |stream: &&Stream| stream.needed && self.denied.contains(&stream.id);
        let names: Vec<String> = stack
            .streams()
            .iter()
            .filter(denied)
            .map(|stream| format!("{} at {:.0} Hz", stream.name, stream.hz))
            .collect();
        let remedy = match stack {
            Stack::Ardupilot => "set SCHED_LOOP_RATE to 200, then reboot the controller",
            Stack::Px4 => "its firmware does not stream it",
        };
        let names = names.join(", ");
        (!names.is_empty()).then(|| format!("the controller denies {names}: {remedy}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_denied_is_asked_for_no_more_and_said_once() {
        let mut requests = Requests::default();
        assert!([31, 105, 74, 33].into_iter().all(|id| requests.ask(id)));
        // three requests are denied, as by ArduPlane with a loop rate of 50 Hz, which sends at 40 Hz at most
        let answers = [2, 2, 2, 0].map(|result| requests.answered(result));
        assert_eq!(answers[2..], [Answer::Denied, Answer::Granted(33)]);
        requests.turn();
        assert!(!requests.ask(31) && requests.ask(33));
        // a second grant of the same message changes nothing
        assert_eq!(requests.answered(0), Answer::Nothing);
        let words = requests.complaint(Stack::Ardupilot).unwrap();
        assert!(words.contains("ATTITUDE_QUATERNION at 100 Hz") && words.contains("reboot"));
        assert_eq!(requests.complaint(Stack::Ardupilot), None);
    }
}
