//! Setpoints that come too late: a robot takes only those that echo a state of at most 300 ms before, so a link
//! with a longer round trip cannot be driven over. Pure.

use std::time::Duration;
use xtb_protocol::Name;
use xtb_protocol::messages::RobotState;

/// The robot's limit for the echo of its clock.
const ECHO_MS: u64 = 300;

/// Whether the robot refuses what it is sent as too old.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Lateness {
    /// What it had refused as too old when it was looked at last.
    stale: Option<u64>,
    since_ms: Option<u64>,
}

impl Lateness {
    /// A state of the robot, `now_ms` on this computer's clock.
    pub(super) fn saw(&mut self, now_ms: u64, state: &RobotState) {
        let refused =
            self.stale.replace(state.rejected.stale).is_some_and(|before| state.rejected.stale > before);
        if state.input_age_ms.setpoint.is_some_and(|ms| ms <= ECHO_MS) {
            self.since_ms = None;
        } else if refused {
            self.since_ms.get_or_insert(now_ms);
        }
    }

    /// For how long it has taken none, in ms; `None` = it takes them, or was sent none.
    pub(super) fn for_ms(&self, now_ms: u64) -> Option<u64> {
        self.since_ms.map(|since| now_ms.saturating_sub(since))
    }
}

/// Why, and what to do instead.
pub(super) fn words(robot: &Name, round_trip: Option<Duration>) -> String {
    let link = match round_trip {
        Some(took) => format!("the round trip takes {:.1} s", took.as_secs_f64()),
        None => "the link is too slow".to_owned(),
    };
    format!(
        "{robot} refuses the setpoints: they have to echo a state at most {ECHO_MS} ms old, but {link}; \
         `goto` works on such a link"
    )
}

/// Whether a link with this round trip cannot be driven over.
pub(super) fn is_too_long(round_trip: Option<Duration>) -> bool {
    round_trip.is_some_and(|took| took > Duration::from_millis(ECHO_MS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake;

    fn state(stale: u64, setpoint: Option<u64>) -> RobotState {
        let mut state = fake::state("xtb-1");
        (state.rejected.stale, state.input_age_ms.setpoint) = (stale, setpoint);
        state
    }

    #[test]
    fn only_what_is_refused_now_counts() {
        let mut late = Lateness::default();
        late.saw(0, &state(17, None));
        assert_eq!(late.for_ms(50), None, "from before");
        late.saw(100, &state(18, None));
        late.saw(200, &state(19, Some(2000)));
        assert_eq!(late.for_ms(300), Some(200));
        late.saw(400, &state(20, Some(40)));
        assert_eq!(late.for_ms(500), None, "one was taken");
    }

    #[test]
    fn the_reason_names_the_limit_and_the_round_trip() {
        let said = words(&fake::name("xtb-1"), Some(Duration::from_millis(1000)));
        assert!(said.contains("at most 300 ms old") && said.contains("round trip takes 1.0 s"), "{said}");
        assert!(is_too_long(Some(Duration::from_millis(301))) && !is_too_long(None));
    }
}
