//! Wrong tokens, counted by where they come from: who tries many has to wait. Pure: time is an argument.
//!
//! Tokens are random and long, so nobody guesses one; this keeps those who try from filling the log and the
//! processor, and tells a person who mistypes when to try again.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::net::IpAddr;
use std::time::{Duration, Instant};

/// Wrong tokens from one address, of IPv6 from one /64, within [`WINDOW`].
pub(super) const MOST: u32 = 10;
/// They are forgotten after this.
pub(super) const WINDOW: Duration = Duration::from_secs(60);
/// Addresses that are remembered; the one that began first makes room.
const ADDRESSES: usize = 1024;

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Guesses {
    /// How many, and when the first of them came.
    wrong: BTreeMap<IpAddr, (u32, Instant)>,
}

impl Guesses {
    /// Whether this address has to wait.
    pub(super) fn is_blocked(&self, from: IpAddr, now: Instant) -> bool {
        let recent =
            self.wrong.get(&from).filter(|(_, since)| now.saturating_duration_since(*since) < WINDOW);
        recent.is_some_and(|(count, _)| *count >= MOST)
    }

    /// A wrong token came from it.
    pub(super) fn wrong(&mut self, from: IpAddr, now: Instant) {
        self.wrong.retain(|_, (_, since)| now.saturating_duration_since(*since) < WINDOW);
        if self.wrong.len() >= ADDRESSES && !self.wrong.contains_key(&from) {
            let first = self.wrong.iter().min_by_key(|(_, (_, since))| *since).map(|(from, _)| *from);
            first.and_then(|first| self.wrong.remove(&first));
        }
        self.wrong.entry(from).or_insert((0, now)).0 += 1;
    }
}

/// Whether both are the same, in a time that tells only their lengths.
pub(super) fn same(a: &str, b: &str) -> bool {
    let differing = a.bytes().zip(b.bytes()).fold(0, |differing, (a, b)| black_box(differing | (a ^ b)));
    a.len() == b.len() && differing == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    fn address(number: u32) -> IpAddr {
        Ipv4Addr::from_bits(0x0a00_0000 + number).into()
    }

    #[test]
    fn who_guesses_often_waits_and_nobody_else_does() {
        let (mut guesses, now) = (Guesses::default(), Instant::now());
        for _ in 0..MOST {
            assert!(!guesses.is_blocked(address(1), now));
            guesses.wrong(address(1), now);
        }
        assert!(guesses.is_blocked(address(1), now));
        assert!(!guesses.is_blocked(address(2), now));
        assert!(!guesses.is_blocked(address(1), now + WINDOW));
    }

    #[test]
    fn a_crowd_of_addresses_fills_no_memory() {
        let (mut guesses, now) = (Guesses::default(), Instant::now());
        for number in 0..5000 {
            guesses.wrong(address(number), now + Duration::from_millis(number.into()));
        }
        assert_eq!(guesses.wrong.len(), ADDRESSES);
        guesses.wrong(address(1), now + 3 * WINDOW);
        assert_eq!(guesses.wrong.len(), 1);
    }
}
