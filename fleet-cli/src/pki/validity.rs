//! From when, and for how long, a certificate is valid.

use std::time::{Duration, SystemTime};
use xtb_identity::issue::LIFE;

const DAY: Duration = Duration::from_secs(24 * 3600);

/// From when, and for how long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Validity {
    /// The first moment (the certificate begins an hour before).
    pub from: SystemTime,
    /// From then on.
    pub life: Duration,
}

impl Validity {
    /// A year from now on.
    #[must_use]
    pub fn year(now: SystemTime) -> Self {
        Self { from: now, life: LIFE }
    }

    /// So many days from `from` on, a year unless they are given; a negative number ended so many days before it.
    #[must_use]
    pub fn days(from: SystemTime, days: Option<i32>) -> Self {
        let Some(days) = days else { return Self::year(from) };
        let whole = DAY * days.unsigned_abs();
        if days > 0 { Self { from, life: whole } } else { Self { from: from - whole - DAY, life: DAY } }
    }

    /// Its last moment.
    #[must_use]
    pub fn expires(self) -> SystemTime {
        self.from + self.life
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_negative_life_ended_before_it_began() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(1_800_000_000);
        assert_eq!(Validity::days(now, Some(2)).expires(), now + 2 * DAY);
        assert_eq!(Validity::days(now, Some(-1)).expires(), now - DAY);
        assert_eq!(Validity::days(now, None).expires(), now + LIFE);
    }
}
