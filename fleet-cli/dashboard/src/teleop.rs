//! Driving by hand from a page: which of its setpoints go on to the robot. Pure.
//!
//! The page sends setpoints while something is held, and names with each the last frame that it had. A
//! setpoint is passed on once, at once, and never repeated, so that silence anywhere (a closed socket, a
//! frozen tab, a lost radio) ends in neutral by the robot's own 200 ms. One that was held up on its way,
//! or made by a hand that sees an old picture, is dropped: what comes late in a burst drives nobody.

use serde::{Deserialize, Serialize};
use xtb_protocol::Name;

/// The picture that a hand acts on is at most this old; a robot's own limit for the echo of its clock.
const PICTURE_MS: u64 = 300;
/// Without a setpoint for so long, control is given back.
const IDLE_MS: u64 = 30_000;

/// Where the page's hand is, 20 times a second while something is held.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Hand {
    /// Counts the page's setpoints.
    pub(crate) seq: u64,
    /// Number of the last frame that the page had when it made this.
    pub(crate) seen: u64,
    /// −1..=1, + = ahead.
    pub(crate) throttle: f64,
    /// −1..=1, + = right.
    pub(crate) steering: f64,
}

/// How it stands.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Said {
    /// Whom.
    pub(crate) robot: Name,
    /// Whether it goes on.
    pub(crate) state: State,
    /// Why it has ended.
    pub(crate) why: Option<String>,
}

/// Whether a page drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum State {
    /// Setpoints are forwarded.
    Driving,
    /// They are not.
    Ended,
}

/// Which setpoints go on.
#[derive(Debug)]
pub(crate) struct DeadMan {
    last_seq: Option<u64>,
    last_ms: u64,
}

impl DeadMan {
    /// Control was granted at `now_ms`.
    pub(crate) fn new(now_ms: u64) -> Self {
        Self { last_seq: None, last_ms: now_ms }
    }

    /// Throttle and steering that go on now, if any. `picture_ms` is the age of the picture that the hand
    /// saw; `None` = nobody knows. Letting go always goes on.
    pub(crate) fn hand(&mut self, now_ms: u64, hand: Hand, picture_ms: Option<u64>) -> Option<(f64, f64)> {
        let Hand { seq, throttle, steering, .. } = hand;
        let is_in_range = |value: f64| value.is_finite() && (-1.0..=1.0).contains(&value);
        if !is_in_range(throttle) || !is_in_range(steering) || self.last_seq.is_some_and(|last| seq <= last) {
            return None;
        }
        self.last_seq = Some(seq);
        if throttle != 0.0 && picture_ms.is_none_or(|age_ms| age_ms > PICTURE_MS) {
            return None;
        }
        self.last_ms = now_ms;
        Some((throttle, steering))
    }

    /// Whether nobody has had a hand on the wheel for long.
    pub(crate) fn is_idle(&self, now_ms: u64) -> bool {
        now_ms.saturating_sub(self.last_ms) > IDLE_MS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hand(seq: u64, throttle: f64) -> Hand {
        Hand { seq, seen: 1, throttle, steering: 0.25 }
    }

    #[test]
    fn each_setpoint_goes_on_once() {
        let mut dead_man = DeadMan::new(0);
        assert_eq!(dead_man.hand(0, hand(1, 0.5), Some(50)), Some((0.5, 0.25)));
        assert_eq!(dead_man.hand(0, hand(1, 0.5), Some(50)), None, "a repetition");
        assert_eq!(dead_man.hand(0, hand(3, 0.6), Some(50)), Some((0.6, 0.25)));
        assert_eq!(dead_man.hand(0, hand(2, 0.5), Some(50)), None, "an older one");
    }

    #[test]
    fn a_hand_that_sees_an_old_picture_can_only_let_go() {
        let mut dead_man = DeadMan::new(0);
        for (seq, age_ms) in [(1, Some(301)), (2, None), (3, Some(u64::MAX))] {
            assert_eq!(dead_man.hand(0, hand(seq, 1.0), age_ms), None, "{age_ms:?}");
        }
        assert_eq!(dead_man.hand(0, hand(4, 0.0), None), Some((0.0, 0.25)));
        assert_eq!(dead_man.hand(0, hand(5, 1.0), Some(300)), Some((1.0, 0.25)));
    }

    #[test]
    fn what_is_no_share_of_full_throttle_is_dropped() {
        let mut dead_man = DeadMan::new(0);
        for (seq, bad) in [f64::NAN, f64::INFINITY, 1.01, -1.01].into_iter().enumerate() {
            assert_eq!(dead_man.hand(0, hand(seq as u64, bad), Some(0)), None, "{bad}");
            let steering = Hand { steering: bad, ..hand(seq as u64, 0.0) };
            assert_eq!(dead_man.hand(0, steering, Some(0)), None, "{bad}");
        }
    }

    #[test]
    fn a_wheel_that_nobody_touches_is_given_back() {
        let mut dead_man = DeadMan::new(1000);
        assert!(!dead_man.is_idle(31_000) && dead_man.is_idle(31_001));
        dead_man.hand(31_000, hand(1, 1.0), Some(0));
        assert!(!dead_man.is_idle(61_000) && dead_man.is_idle(61_001));
        dead_man.hand(61_000, hand(2, 1.0), None);
        assert!(dead_man.is_idle(61_001), "what is dropped is no hand");
    }
}
