//! A gyro that hangs: its timer or its angles stand still.
//!
//! The timer of a 3DM-G counts on with every frame (10 ms are more than a tick of 6.5536 ms), and three angles of
//! 0.0055° a count never stay the same by themselves: noise moves each of them. A BNO085 counts its frames, and
//! filters its angles, which may well stay the same while the truck stands; then the noise of its accelerations
//! shows that it is alive.

use super::alarm::{Alarm, Still};
use xtb_control::Stamp;
use xtb_control::controller::GyroSample;
use xtb_control::vehicle::GuardLimits;
use xtb_protocol::bno085::Bno085Sample;
use xtb_protocol::gyro_3dmg::EulerFrame;

/// What of a frame shows that the unit is alive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SignsOfLife {
    /// The timer's ticks, or the frame's number.
    counter: u16,
    angles: GyroSample,
    /// Of a BNO085.
    acceleration_mg: Option<[i16; 3]>,
}

impl From<&EulerFrame> for SignsOfLife {
    fn from(frame: &EulerFrame) -> Self {
        Self { counter: frame.ticks, angles: frame.angles, acceleration_mg: None }
    }
}

impl From<&Bno085Sample> for SignsOfLife {
    fn from(sample: &Bno085Sample) -> Self {
        let angles = GyroSample { roll: sample.roll_cdeg, pitch: sample.pitch_cdeg, yaw: sample.yaw_cdeg };
        Self { counter: sample.index.into(), angles, acceleration_mg: Some(sample.acceleration_mg) }
    }
}

/// Watches one gyro.
#[derive(Debug, Clone, Default)]
pub(super) struct GyroMonitor {
    last: Option<SignsOfLife>,
    counter: Still,
    angles: Still,
    pub(super) frozen: Alarm,
}

impl GyroMonitor {
    /// True if the frame is the last one again, unchanged. `turning`: the truck's wheels turn.
    pub(super) fn frame(
        &mut self,
        limits: &GuardLimits,
        now: Stamp,
        frame: SignsOfLife,
        turning: bool,
    ) -> bool {
        let before = self.last.replace(frame);
        let same =
            |part: fn(&SignsOfLife, &SignsOfLife) -> bool| before.is_some_and(|before| part(&before, &frame));
        let same_counter = same(|a, b| a.counter == b.counter);
        let same_angles = same(|a, b| a.angles == b.angles);
        let same_acceleration = same(|a, b| a.acceleration_mg == b.acceleration_mg);
        let counter = self.counter.too_long(now, same_counter, limits.frozen_s);
        let still = same_angles && (same_acceleration || turning);
        let angles = self.angles.too_long(now, still, limits.frozen_s);
        self.frozen.set(now, counter || angles, || {
            let (unit, name) = match frame.acceleration_mg {
                None => ("", "timer"),
                Some(_) => ("BNO085: ", "frame number"),
            };
            match (counter, angles) {
                (true, true) => format!("{unit}{name} and angles do not change"),
                (true, false) => format!("{unit}{name} does not change"),
                _ => format!("{unit}angles do not change"),
            }
        });
        same_counter && same_angles && same_acceleration
    }

    pub(super) fn forget(&mut self) {
        (self.last, self.counter, self.angles) = (None, Still::default(), Still::default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said after a second of `frame(i)`, and after how many ms it was first said.
    fn after_a_second(frame: impl Fn(u16) -> (i16, u16)) -> (Option<String>, Option<u64>) {
        let (mut monitor, mut first) = (GyroMonitor::default(), None);
        for i in 0..100 {
            let (yaw, ticks) = frame(i);
            let (now, angles) = (Stamp::from_ms(10 * u64::from(i)), GyroSample { roll: 3, pitch: 4, yaw });
            monitor.frame(&GuardLimits::default(), now, (&EulerFrame { angles, ticks }).into(), false);
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

    /// What is said of a BNO085 after a second of `sample(i)`.
    fn of_bno085(turning: bool, sample: impl Fn(u8) -> (u8, i16, i16)) -> Option<String> {
        let mut monitor = GyroMonitor::default();
        for i in 0..100 {
            let (index, yaw_cdeg, z_mg) = sample(i);
            let acceleration_mg = [3, -4, z_mg];
            let sample = Bno085Sample { index, yaw_cdeg, acceleration_mg, ..Bno085Sample::default() };
            let now = Stamp::from_ms(10 * u64::from(i));
            monitor.frame(&GuardLimits::default(), now, (&sample).into(), turning);
        }
        monitor.frozen.words().map(|words| words.to_string())
    }

    #[test]
    fn a_bno085_at_rest_may_keep_its_angles_while_it_shakes_and_not_on_turning_wheels() {
        assert_eq!(of_bno085(false, |i| (i, 100, 1000 + i16::from(i % 2))), None);
        for (turning, sample, words) in [
            (
                true,
                (|i| (i, 100, 1000 + i16::from(i % 2))) as fn(u8) -> (u8, i16, i16),
                "angles do not change",
            ),
            (false, |i| (i, 100, 1000), "angles do not change"),
            (false, |i| (7, i.into(), 1000), "frame number does not change"),
            (false, |_| (7, 100, 1000), "frame number and angles do not change"),
        ] {
            assert_eq!(of_bno085(turning, sample), Some(format!("BNO085: {words}")));
        }
    }

    #[test]
    fn one_count_of_noise_now_and_then_is_enough_to_be_alive() {
        assert_eq!(after_a_second(|i| ((i / 20) as i16, i)), (None, None));
    }
}
