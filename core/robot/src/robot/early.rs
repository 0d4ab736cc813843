//! PWM frames before their time: the wheels of a new setpoint do not wait for the next frame of the period.
//!
//! Such a frame carries what the controller has decided already and makes no step of its own: samples, steps
//! and recordings are the same with it and without it. A token bucket bounds them to what the line has room
//! for beside its other frames ([`LineRates::board`](xtb_protocol::board::rates::LineRates::board)).

use xtb_control::Stamp;
use xtb_protocol::board::rates::EARLY_PWM_A_SECOND;

/// So many may follow each other at once: setpoints that are sent 50 ms apart arrive closer now and then.
const BURST: u64 = 2;
/// A token comes back after this time: with the burst, any second has [`EARLY_PWM_A_SECOND`] at most.
const TOKEN_NS: u64 = 1_000_000_000 / (EARLY_PWM_A_SECOND as u64 - BURST);

/// The bucket.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct EarlyFrames {
    /// When all tokens are back.
    full_at: Stamp,
}

impl EarlyFrames {
    /// Whether a frame may go now; if so, it counts as sent.
    pub(super) fn admit(&mut self, now: Stamp) -> bool {
        let full_at = self.full_at.max(now).plus_ns(TOKEN_NS);
        let admitted = full_at <= now.plus_ns(BURST * TOKEN_NS);
        if admitted {
            self.full_at = full_at;
        }
        admitted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn admitted(each_ms: usize) -> Vec<u64> {
        let mut early = EarlyFrames::default();
        let times = (0..10_000).step_by(each_ms);
        times.filter(|ms| early.admit(Stamp::from_ms(*ms))).collect()
    }

    #[test]
    fn any_second_has_25_at_most_however_many_are_asked_for() {
        let times = admitted(1);
        let within = |from: u64| times.iter().filter(|ms| (from..=from + 1000).contains(*ms)).count();
        assert_eq!((0..9_000).map(within).max(), Some(EARLY_PWM_A_SECOND as usize));
    }

    #[test]
    fn setpoints_20_times_a_second_are_all_admitted_also_if_two_arrive_together() {
        assert_eq!(admitted(50).len(), 200);
        let mut early = EarlyFrames::default();
        for pair in 0..100 {
            let at = Stamp::from_ms(1000 + 100 * pair);
            assert!(early.admit(at) && early.admit(at), "{pair}");
            assert!(!early.admit(at), "{pair}");
        }
    }
}
