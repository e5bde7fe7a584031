//! Rate limit on each sender of datagrams. If a sender floods the socket, only its own packets are dropped.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

/// Datagrams per second that are accepted from one sender. A flight controller that sends each message in its own datagram
/// sends 500. A parameter list or a log at full speed takes 1000.
const PER_SECOND: f64 = 4000.0;
/// Number of datagrams that are accepted from one sender at once. As many arrive after a stall of 2 s from a flight controller
/// that sends 500 per second.
const BURST: f64 = 1000.0;
/// Number of senders that have their own limit. All other senders share one limit.
const SENDERS: usize = 64;
/// Time without datagrams after which a sender's limit is given to a new sender.
const GONE: Duration = Duration::from_secs(1);

/// Token buckets of the senders: an accepted datagram takes one token, and tokens are added at a constant rate.
#[derive(Debug, Default)]
pub(super) struct Senders {
    known: Vec<(SocketAddr, Allowance)>,
    /// Index of the last datagram's sender in `known`. It is tried first.
    last: usize,
    /// The bucket that all senders outside `known` share.
    strangers: Allowance,
}

/// A token bucket: the number of tokens left, and the time of the last update.
#[derive(Clone, Copy, Debug)]
struct Allowance {
    left: f64,
    at: Option<Instant>,
}

impl Default for Allowance {
    fn default() -> Self {
        Allowance { left: BURST, at: None }
    }
}

impl Allowance {
    /// Takes one token at `now`. The result is `false` if there is none.
    fn take(&mut self, now: Instant) -> bool {
        let passed =
            self.at.replace(now).map_or(Duration::ZERO, |at| now.saturating_duration_since(at));
        self.left = (self.left + PER_SECOND * passed.as_secs_f64()).min(BURST);
        let taken = self.left >= 1.0;
        if taken {
            self.left -= 1.0;
        }
        taken
    }
}

impl Senders {
    /// Whether a datagram from `sender` at `now` is accepted.
    pub(super) fn may(&mut self, sender: SocketAddr, now: Instant) -> bool {
        let known = self.known.get(self.last).is_some_and(|(known, _)| *known == sender);
        let place = if known { Some(self.last) } else { self.place(sender, now) };
        match place {
            Some(at) => {
                self.last = at;
                self.known[at].1.take(now)
            }
            None => self.strangers.take(now),
        }
    }

    /// Index of the bucket of `sender`. A new sender gets a new bucket or that of a silent sender; `None` if there is neither.
    fn place(&mut self, sender: SocketAddr, now: Instant) -> Option<usize> {
        let own = self.known.iter().position(|(known, _)| *known == sender);
        if own.is_some() {
            return own;
        }
        let fresh = (sender, Allowance::default());
        if self.known.len() < SENDERS {
            self.known.push(fresh);
            return Some(self.known.len() - 1);
        }
        let gone =
            |at: Option<Instant>| at.is_none_or(|at| now.saturating_duration_since(at) >= GONE);
        let at = self.known.iter().position(|(_, allowance)| gone(allowance.at))?;
        self.known[at] = fresh;
        Some(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sender(port: u16) -> SocketAddr {
        ([127, 0, 0, 1], port).into()
    }

    #[test]
    fn a_flood_of_one_sender_is_cut_and_the_other_is_heard_whole() {
        let start = Instant::now();
        let mut senders = Senders::default();
        let mut taken = [0; 2];
        // for ten seconds one sender sends 40,000 datagrams per second, the other 20 per second
        for i in 0..400_000u64 {
            let now = start + Duration::from_micros(25 * i);
            taken[0] += u32::from(senders.may(sender(1), now));
            if i % 2000 == 0 {
                taken[1] += u32::from(senders.may(sender(2), now));
            }
        }
        // 4000 datagrams per second and the first burst of 1000
        assert!((40_900..=41_000).contains(&taken[0]), "{taken:?}");
        assert_eq!(taken[1], 200);
    }

    #[test]
    fn a_flood_of_many_invented_senders_does_not_displace_one_that_speaks() {
        let start = Instant::now();
        let mut senders = Senders::default();
        let (mut taken, mut own) = (0, 0);
        for i in 0..400_000u64 {
            let now = start + Duration::from_micros(25 * i);
            if i % 2000 == 0 {
                own += u32::from(senders.may(sender(1), now));
            }
            taken += u32::from(senders.may(sender(2 + (i % 60_000) as u16), now));
        }
        assert_eq!(own, 200);
        // The other senders share 4000 datagrams per second and one burst of 1000. Through each of the 64 separate buckets about
        // one more datagram per second is accepted.
        assert!(taken < 41_000 + 10 * 64, "{taken}");
    }
}
