//! Rate limit on each sender of datagrams: a flood loses only packets of its own sender.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

/// Datagrams per second that are accepted from one sender. A flight controller that sends each message separately sends
/// 500. A parameter list or a log at full speed takes 1000.
const PER_SECOND: f64 = 4000.0;
/// Burst in datagrams. A flight controller that sends 500 per second accumulates as many in a stall of 2 s.
const BURST: f64 = 1000.0;
/// Number of senders with a separate limit. All other senders share one limit.
const SENDERS: usize = 64;
/// Time without datagrams after which a sender's entry is reused.
const GONE: Duration = Duration::from_secs(1);

/// Token buckets of the senders.
#[derive(Debug, Default)]
pub(super) struct Senders {
    known: Vec<(SocketAddr, Allowance)>,
    /// Index of the last sender, which is tried first.
    last: usize,
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
    /// Takes one token at `now`; `false` if there is none.
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

    /// Index of the bucket of `sender`: its own, a new or an expired bucket. `None` if all buckets are in use.
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
        // Ten seconds of 40,000 datagrams per second, and a client with 20 per second.
        for i in 0..400_000u64 {
            let now = start + Duration::from_micros(25 * i);
            taken[0] += u32::from(senders.may(sender(1), now));
            if i % 2000 == 0 {
                taken[1] += u32::from(senders.may(sender(2), now));
            }
        }
        // 4000 per second and the first burst.
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
        // The other senders share 4000 per second and the first burst. Each of the 64 separate buckets adds about one
        // per second.
        assert!(taken < 41_000 + 10 * 64, "{taken}");
    }
}
