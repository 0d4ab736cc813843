//! The 3DM-G orientation sensor: silent until asked, then 11-byte frames at 100 Hz.
//!
//! Yaw is clockwise from an arbitrary north (each truck's own) and drifts; axes X ahead, Y to the
//! right, Z down, so pitch is positive nose up and roll positive right side down.

use crate::faults::GyroFault;
use crate::line::Outbox;
use crate::parameters::GyroTruth;
use crate::rng::Rng;
use xtb_control::controller::GyroSample;
use xtb_control::odometry::GYRO_DEG_PER_COUNT;
use xtb_control::units::Stamp;
use xtb_protocol::gyro_3dmg::{EULER, EulerFrame, QUERY_FIRMWARE, START_CONTINUOUS, encode_firmware};

const PERIOD_NS: u64 = 10_000_000;
const TICK_NS: u64 = 6_553_600;
/// Version 1.3.00, the one of the memorandum's manual.
const FIRMWARE: u16 = 1300;

/// How the truck lies in space.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Attitude {
    /// Compass heading, clockwise from +y.
    pub(crate) heading_deg: f64,
    /// Nose up.
    pub(crate) pitch_deg: f64,
    /// Right side down.
    pub(crate) roll_deg: f64,
}

#[derive(Debug, Clone)]
pub(crate) struct Gyro {
    noise_deg: f64,
    offset_deg: f64,
    drift_dps: f64,
    /// How many bytes of a three-byte command have come.
    command_bytes: usize,
    /// When the next frame of continuous mode is due.
    next_ns: Option<u64>,
    outbox: Outbox,
    fault: GyroFault,
    /// The last frame sent.
    last: EulerFrame,
}

impl Gyro {
    pub(crate) fn new(truth: &GyroTruth, noise: &mut Rng) -> Self {
        Self {
            noise_deg: truth.noise_deg,
            offset_deg: noise.uniform(0.0, 360.0),
            drift_dps: noise.uniform(0.0, truth.yaw_drift_dps),
            command_bytes: 0,
            next_ns: None,
            outbox: Outbox::new(noise.fork()),
            fault: GyroFault::None,
            last: EulerFrame { angles: GyroSample::default(), ticks: 0 },
        }
    }

    /// Bytes from the agent.
    pub(crate) fn rx(&mut self, bytes: &[u8], now: Stamp, attitude: &Attitude, noise: &mut Rng) {
        for &byte in bytes {
            match (self.command_bytes, byte) {
                (2, _) => {
                    self.command_bytes = 0;
                    // The third byte names the frame to repeat; anything but Euler angles ends it.
                    // Asked again while it sends, it goes on as before.
                    let next_ns = self.next_ns.unwrap_or(now.ns() + PERIOD_NS);
                    self.next_ns = (byte == EULER).then_some(next_ns);
                }
                (1, byte) if byte == START_CONTINUOUS[1] => self.command_bytes = 2,
                (_, byte) if byte == START_CONTINUOUS[0] => self.command_bytes = 1,
                (_, EULER) => {
                    self.command_bytes = 0;
                    self.send_angles(now, attitude, noise);
                }
                (_, QUERY_FIRMWARE) => {
                    self.command_bytes = 0;
                    self.outbox.send(&encode_firmware(FIRMWARE));
                }
                _ => self.command_bytes = 0,
            }
        }
    }

    /// Sends what is due in continuous mode.
    pub(crate) fn step(&mut self, now: Stamp, attitude: &Attitude, noise: &mut Rng) {
        while let Some(due_ns) = self.next_ns.filter(|&due_ns| due_ns <= now.ns()) {
            self.next_ns = Some(due_ns + PERIOD_NS);
            self.send_angles(now, attitude, noise);
        }
    }

    /// Breaks or mends it.
    pub(crate) fn set_fault(&mut self, fault: GyroFault) {
        self.fault = fault;
    }

    pub(crate) fn outbox(&mut self) -> &mut Outbox {
        &mut self.outbox
    }

    pub(crate) fn dropped(&self) -> u64 {
        self.outbox.dropped()
    }

    fn send_angles(&mut self, now: Stamp, attitude: &Attitude, noise: &mut Rng) {
        let mut counts = |deg: f64| {
            let noisy_deg = deg + noise.bell(self.noise_deg);
            // Beyond half a turn the 16-bit word wraps, as the angle does.
            rounded(noisy_deg / GYRO_DEG_PER_COUNT) as i16
        };
        let yaw_deg = attitude.heading_deg + self.offset_deg + self.drift_dps * now.s();
        let angles = GyroSample {
            roll: counts(attitude.roll_deg),
            pitch: counts(attitude.pitch_deg),
            yaw: counts(yaw_deg),
        };
        let ticks = (now.ns() / TICK_NS) as u16;
        self.last = match self.fault {
            GyroFault::None => EulerFrame { angles, ticks },
            GyroFault::AnglesFrozen => EulerFrame { ticks, ..self.last },
            GyroFault::TimerFrozen => EulerFrame { angles, ..self.last },
            GyroFault::Frozen => self.last,
        };
        self.outbox.send(&self.last.encode());
    }
}

/// The nearest whole number, ties away from zero, as far as there are such.
fn rounded(value: f64) -> i64 {
    let whole = value as i64;
    // The rest is exact.
    let rest = value - whole as f64;
    whole.saturating_add(i64::from(rest >= 0.5) - i64::from(rest <= -0.5))
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::gyro_3dmg::{GyroFrame, GyroReader, STOP_CONTINUOUS};

    #[test]
    fn rounding_goes_to_the_nearest_and_from_the_middle_away_from_zero() {
        let values =
            [0.0, 0.49, 0.5, 0.499_999_999_999_999_94, 1.5, 2.5, -0.3, -0.5, -1.5, -2.51, 1e9 + 0.5, 7e15];
        for value in values {
            assert_eq!(rounded(value), libm::round(value) as i64, "{value}");
        }
    }

    const LEVEL: Attitude = Attitude { heading_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };

    fn gyro() -> (Gyro, Rng) {
        let mut noise = Rng::new(5, 0);
        (
            Gyro::new(&GyroTruth { noise_deg: 0.0, yaw_drift_dps: 0.0, ..GyroTruth::default() }, &mut noise),
            noise,
        )
    }

    fn frames(gyro: &mut Gyro) -> Vec<EulerFrame> {
        let (mut bytes, mut found) = (Vec::new(), Vec::new());
        gyro.outbox().take(&mut bytes);
        GyroReader::default().push(&bytes, |frame| match frame {
            GyroFrame::Euler(frame) => found.push(frame),
            GyroFrame::Firmware(version) => panic!("nobody asked for firmware {version}"),
        });
        found
    }

    fn run(gyro: &mut Gyro, noise: &mut Rng, from_ms: u64, to_ms: u64) {
        for ms in (from_ms..=to_ms).step_by(5) {
            gyro.step(Stamp::from_ms(ms), &LEVEL, noise);
        }
    }

    #[test]
    fn it_is_silent_until_started_then_sends_at_100_hz_until_stopped() {
        let (mut gyro, mut noise) = gyro();
        run(&mut gyro, &mut noise, 0, 1000);
        assert_eq!(frames(&mut gyro).len(), 0);
        gyro.rx(&START_CONTINUOUS, Stamp::from_ms(1000), &LEVEL, &mut noise);
        run(&mut gyro, &mut noise, 1005, 2000);
        assert_eq!(frames(&mut gyro).len(), 100);
        gyro.rx(&STOP_CONTINUOUS, Stamp::from_ms(2000), &LEVEL, &mut noise);
        run(&mut gyro, &mut noise, 2005, 3000);
        assert_eq!(frames(&mut gyro).len(), 0);
    }

    #[test]
    fn asked_again_and_again_it_still_sends() {
        let (mut gyro, mut noise) = gyro();
        for ms in (0..1000).step_by(5) {
            gyro.rx(&START_CONTINUOUS, Stamp::from_ms(ms), &LEVEL, &mut noise);
            gyro.step(Stamp::from_ms(ms + 5), &LEVEL, &mut noise);
        }
        assert_eq!(frames(&mut gyro).len(), 100);
    }

    #[test]
    fn one_request_gets_one_frame_with_the_devices_own_time() {
        let (mut gyro, mut noise) = gyro();
        gyro.rx(&[0x99, EULER], Stamp::from_ms(6554), &LEVEL, &mut noise);
        let found = frames(&mut gyro);
        assert_eq!((found.len(), found[0].ticks), (1, 1000));
    }

    #[test]
    fn a_command_may_come_byte_by_byte() {
        let (mut gyro, mut noise) = gyro();
        for byte in START_CONTINUOUS {
            gyro.rx(&[byte], Stamp::ZERO, &LEVEL, &mut noise);
        }
        run(&mut gyro, &mut noise, 5, 100);
        assert_eq!(frames(&mut gyro).len(), 10);
    }

    #[test]
    fn the_firmware_answers_five_bytes() {
        let (mut gyro, mut noise) = gyro();
        gyro.rx(&[QUERY_FIRMWARE], Stamp::ZERO, &LEVEL, &mut noise);
        let mut bytes = Vec::new();
        gyro.outbox().take(&mut bytes);
        assert_eq!(bytes, [0xF0, 0x05, 0x14, 0x06, 0x04]);
    }

    #[test]
    fn in_continuous_mode_the_firmware_is_answered_between_two_frames() {
        let (mut gyro, mut noise) = gyro();
        gyro.rx(&START_CONTINUOUS, Stamp::ZERO, &LEVEL, &mut noise);
        run(&mut gyro, &mut noise, 5, 20);
        gyro.rx(&[QUERY_FIRMWARE], Stamp::from_ms(20), &LEVEL, &mut noise);
        run(&mut gyro, &mut noise, 25, 50);
        let (mut bytes, mut kinds) = (Vec::new(), Vec::new());
        gyro.outbox().take(&mut bytes);
        GyroReader::default().push(&bytes, |frame| kinds.push(matches!(frame, GyroFrame::Euler(_))));
        assert_eq!(kinds, [true, true, false, true, true, true]);
    }

    #[test]
    fn yaw_grows_clockwise_and_wraps() {
        let (mut gyro, mut noise) = gyro();
        let mut yaw = |heading_deg: f64| {
            gyro.rx(&[EULER], Stamp::ZERO, &Attitude { heading_deg, ..LEVEL }, &mut noise);
            frames(&mut gyro)[0].angles.yaw
        };
        let start = yaw(0.0);
        assert_eq!(yaw(90.0).wrapping_sub(start), 16_384);
        assert_eq!(yaw(270.0).wrapping_sub(start), -16_384);
    }
}
