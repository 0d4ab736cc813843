//! A fault as a monitor keeps it: present while its cause is there, and a moment longer.

use std::sync::Arc;
use xtb_control::Stamp;

/// A fault stays present for so long after its cause was last seen, so that it does not flap and people see
/// it; chosen, not measured.
pub const HOLD_MS: u64 = 1000;

/// One fault of one monitor.
#[derive(Debug, Clone, Default)]
pub(super) struct Alarm {
    /// What was seen when it began.
    words: Option<Arc<str>>,
    quiet_since: Option<Stamp>,
}

impl Alarm {
    /// The cause is there; `words` say what was seen.
    pub(super) fn raise(&mut self, words: impl FnOnce() -> String) {
        self.quiet_since = None;
        self.words.get_or_insert_with(|| words().into());
    }

    /// The cause is not there.
    pub(super) fn quiet(&mut self, now: Stamp) {
        if self.words.is_some() && now.since_ms(*self.quiet_since.get_or_insert(now)) >= HOLD_MS {
            *self = Self::default();
        }
    }

    /// No time from before counts: it is present a whole moment more.
    pub(super) fn forget_time(&mut self) {
        self.quiet_since = None;
    }

    /// The cause is there, or it is not.
    pub(super) fn set(&mut self, now: Stamp, there: bool, words: impl FnOnce() -> String) {
        if there { self.raise(words) } else { self.quiet(now) }
    }

    /// What was seen, while the fault is present.
    pub(super) fn words(&self) -> Option<Arc<str>> {
        self.words.clone()
    }

    #[cfg(test)]
    pub(super) fn is_present(&self) -> bool {
        self.words.is_some()
    }
}

/// For how long something has not changed.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Still {
    since: Option<Stamp>,
    times: u32,
}

/// Fewer samples than this prove nothing, however long they took to come; chosen, not measured.
const FEW: u32 = 4;

impl Still {
    /// Another sample: whether it is `same` as the one before. True once that has been so for `limit_s`.
    pub(super) fn too_long(&mut self, now: Stamp, same: bool, limit_s: f64) -> bool {
        if !same {
            *self = Self { since: Some(now), times: 0 };
            return false;
        }
        self.times = self.times.saturating_add(1);
        let since = *self.since.get_or_insert(now);
        self.times >= FEW && now.since_s(since) >= limit_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_alarm_stays_for_a_second_after_its_cause_and_keeps_its_words() {
        let mut alarm = Alarm::default();
        alarm.raise(|| "first".to_owned());
        alarm.quiet(Stamp::from_ms(100));
        alarm.raise(|| "second".to_owned());
        alarm.quiet(Stamp::from_ms(200));
        alarm.quiet(Stamp::from_ms(1199));
        assert_eq!(alarm.words().as_deref(), Some("first"));
        alarm.quiet(Stamp::from_ms(1200));
        assert_eq!(alarm.words(), None);
    }

    #[test]
    fn a_pause_between_two_equal_samples_is_not_standing_still() {
        let mut still = Still::default();
        assert!(!still.too_long(Stamp::ZERO, false, 0.25));
        assert!(!still.too_long(Stamp::from_ms(5000), true, 0.25), "one pair");
        assert!(!still.too_long(Stamp::from_ms(5010), true, 0.25));
        assert!(!still.too_long(Stamp::from_ms(5020), false, 0.25));
        for ms in (5030..5270).step_by(10) {
            assert!(!still.too_long(Stamp::from_ms(ms), true, 0.25), "{ms}");
        }
        assert!(still.too_long(Stamp::from_ms(5270), true, 0.25));
    }
}
