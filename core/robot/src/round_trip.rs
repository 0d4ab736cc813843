//! How long an answer takes, and how long to wait for one: smoothed as TCP does it (RFC 6298).
//!
//! Each question is answered for itself, so a repeated one needs no exception (Karn's rule).

use std::time::Duration;

/// No shorter pause before a question is asked again.
pub const ASK_AGAIN: Duration = Duration::from_millis(super::operator::ASK_AGAIN_MS);
/// Nor a longer one; chosen, not measured (links of up to 1 s there and back in docs/network.md).
pub const ASK_AGAIN_MOST: Duration = Duration::from_secs(4);
/// However slow the link, nobody waits longer than this, or than was asked for; chosen, not measured.
pub const PATIENCE_MOST: Duration = Duration::from_secs(15);
/// An answer may take this many round trips, measured with their deviation; chosen, not measured.
const PATIENT_FOR: u32 = 3;
/// A longer one counts as this long, so that one that was held up is forgotten again; chosen, not measured.
const LONGEST: Duration = Duration::from_secs(10);

/// The round trip of one link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RoundTrip {
    smoothed: Option<Duration>,
    deviation: Duration,
}

impl RoundTrip {
    /// An answer took this long.
    pub fn measured(&mut self, took: Duration) {
        let took = took.min(LONGEST);
        match self.smoothed {
            None => (self.smoothed, self.deviation) = (Some(took), took / 2),
            Some(before) => {
                self.deviation = (self.deviation * 3 + before.abs_diff(took)) / 4;
                self.smoothed = Some((before * 7 + took) / 8);
            }
        }
    }

    /// What it is; `None` = nothing was measured yet.
    #[must_use]
    pub fn smoothed(&self) -> Option<Duration> {
        self.smoothed
    }

    /// By then nearly every answer has come.
    #[must_use]
    pub fn bound(&self) -> Duration {
        self.smoothed.unwrap_or_default() + self.deviation * 4
    }

    /// An unanswered question is asked again after this long.
    #[must_use]
    pub fn ask_again(&self) -> Duration {
        self.bound().clamp(ASK_AGAIN, ASK_AGAIN_MOST)
    }

    /// How long to wait for an answer where `given` is enough on a fast link.
    #[must_use]
    pub fn patience(&self, given: Duration) -> Duration {
        given.max((self.bound() * PATIENT_FOR).min(PATIENCE_MOST))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn steady(round_trip: Duration) -> RoundTrip {
        let mut link = RoundTrip::default();
        (0..50).for_each(|_| link.measured(round_trip));
        link
    }

    #[test]
    fn a_fast_link_keeps_the_usual_times() {
        for link in [RoundTrip::default(), steady(ms(2))] {
            assert_eq!((link.ask_again(), link.patience(ms(2000))), (ASK_AGAIN, ms(2000)));
        }
    }

    #[test]
    fn a_slow_link_is_waited_for_within_bounds() {
        let mut first = RoundTrip::default();
        first.measured(ms(1000));
        assert_eq!(first.ask_again(), ms(3000), "one measurement may be far off");
        let link = steady(ms(1000));
        assert!((ms(1000)..ms(1100)).contains(&link.ask_again()), "{link:?}");
        assert!((ms(3000)..ms(3300)).contains(&link.patience(ms(2000))), "{link:?}");
        let link = steady(ms(60_000));
        assert_eq!((link.ask_again(), link.patience(ms(2000))), (ASK_AGAIN_MOST, PATIENCE_MOST));
        assert_eq!(link.patience(ms(40_000)), ms(40_000), "what was asked for counts");
    }

    #[test]
    fn it_follows_a_link_that_changes() {
        let mut link = steady(ms(10));
        link.measured(ms(800));
        assert!(link.bound() > ms(800), "{link:?}");
        (0..50).for_each(|_| link.measured(ms(10)));
        assert_eq!(link.ask_again(), ASK_AGAIN);
    }
}
