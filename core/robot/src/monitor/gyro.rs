//! A gyro that hangs: its timer or its angles stand still.
//!
//! The timer counts on with every frame (10 ms are more than a tick of 6.5536 ms), and three angles of
//! 0.0055° a count never stay the same by themselves: noise moves each of them.

use super::alarm::{Alarm, Still};
use xtb_control::Stamp;
use xtb_control::vehicle::GuardLimits;
use xtb_protocol::gyro_3dmg::EulerFrame;

/// Watches one gyro.
#[derive(Debug, Clone, Default)]
pub(super) struct GyroMonitor {
    last: Option<EulerFrame>,
    timer: Still,
    angles: Still,
    pub(super) frozen: Alarm,
}

impl GyroMonitor {
    /// True if the frame is the last one again, unchanged.
    pub(super) fn frame(&mut self, limits: &GuardLimits, now: Stamp, frame: &EulerFrame) -> bool {
        let before = self.last.replace(*frame);
        let same_ticks = before.is_some_and(|before| before.ticks == frame.ticks);
        let same_angles = before.is_some_and(|before| before.angles == frame.angles);
        let timer = self.timer.too_long(now, same_ticks, limits.frozen_s);
        let angles = self.angles.too_long(now, same_angles, limits.frozen_s);
        self.frozen.set(now, timer || angles, || {
            let what = match (timer, angles) {
                (true, true) => "timer and angles do not change",
                (true, false) => "timer does not change",
                _ => "angles do not change",
            };
            what.to_owned()
        });
        same_ticks && same_angles
    }

    pub(super) fn forget(&mut self) {
        (self.last, self.timer, self.angles) = (None, Still::default(), Still::default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::controller::GyroSample;

    /// What is said after a second of `frame(i)`, and after how many ms it was first said.
    fn after_a_second(frame: impl Fn(u16) -> (i16, u16)) -> (Option<String>, Option<u64>) {
        let (mut monitor, mut first) = (GyroMonitor::default(), None);
        for i in 0..100 {
            let (yaw, ticks) = frame(i);
            let (now, angles) = (Stamp::from_ms(10 * u64::from(i)), GyroSample { roll: 3, pitch: 4, yaw });
            monitor.frame(&GuardLimits::default(), now, &EulerFrame { angles, ticks });
            if monitor.frozen.is_present() {
                first.get_or_insert(now.ms());
            }
        }
        (monitor.frozen.words().map(|words| words.to_string()), first)
    }

    #[test]
    fn a_timer_or_angles_that_stand_still_for_a_quarter_of_a_second_are_frozen() {
        for (frame, words) in [
            ((|i| (i as i16, 7)) as fn(u16) -> (i16, u16), "timer does not change"),
            (|i| (5, i), "angles do not change"),
            (|_| (5, 7), "timer and angles do not change"),
        ] {
            assert_eq!(after_a_second(frame), (Some(words.to_owned()), Some(250)));
        }
    }

    #[test]
    fn one_count_of_noise_now_and_then_is_enough_to_be_alive() {
        assert_eq!(after_a_second(|i| ((i / 20) as i16, i)), (None, None));
    }
}
