//! The MicroStrain 3DM-G's own frames: 38,400 baud, 8N1, big-endian.
//!
//! `0x0E` answers 11 bytes: header, roll, pitch, yaw (i16, 360/65536 deg), timer ticks (u16,
//! 6.5536 ms), check sum = header + the 16-bit words, modulo 65536. Continuous mode: `10 00 0E`,
//! stop: `10 00 00`; firmware: `F0` answers 5 bytes. Axes X north, Y east, Z down: yaw clockwise.
//! (`0x31`, 23 bytes, belongs to the later GX1: not this device.)
//!
//! ```text
//!   line opened ──► stop, ask for the firmware ──answer, or 100 ms──► start ──► frames
//!                      ▲                                                │
//!                      └──── silent, and 500 ms since the start ────────┘
//! ```

use xtb_control::controller::GyroSample;
use xtb_control::units::Stamp;

/// Asks for Euler angles, again and again.
pub const START_CONTINUOUS: [u8; 3] = [0x10, 0x00, EULER];
/// Ends continuous mode.
pub const STOP_CONTINUOUS: [u8; 3] = [0x10, 0x00, 0x00];
/// Asks for the firmware's version.
pub const QUERY_FIRMWARE: u8 = 0xF0;
/// Header of, and single request for, a frame of Euler angles.
pub const EULER: u8 = 0x0E;
/// Length of one.
pub const EULER_LEN: usize = 11;

/// One frame of Euler angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EulerFrame {
    /// The angles.
    pub angles: GyroSample,
    /// The device's own clock in ticks of 6.5536 ms.
    pub ticks: u16,
}

impl EulerFrame {
    /// As the device sends it.
    #[must_use]
    pub fn encode(&self) -> [u8; EULER_LEN] {
        let mut frame = [0; EULER_LEN];
        frame[0] = EULER;
        let GyroSample { roll, pitch, yaw } = self.angles;
        let words = [roll as u16, pitch as u16, yaw as u16, self.ticks];
        for (i, word) in words.iter().enumerate() {
            frame[1 + 2 * i..3 + 2 * i].copy_from_slice(&word.to_be_bytes());
        }
        let sum = checksum(&frame);
        frame[9..].copy_from_slice(&sum.to_be_bytes());
        frame
    }
}

fn checksum(frame: &[u8; EULER_LEN]) -> u16 {
    let words = frame[1..9].chunks_exact(2).map(|w| u16::from_be_bytes([w[0], w[1]]));
    words.fold(u16::from(frame[0]), u16::wrapping_add)
}

/// Length of the firmware's answer.
pub const FIRMWARE_LEN: usize = 5;
/// One tick of the device's clock, in ms.
pub const TICK_MS: f64 = 6.5536;
/// Time between two frames of continuous mode, in ms.
pub const PERIOD_MS: f64 = 10.0;

/// What the device sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GyroFrame {
    /// Euler angles.
    Euler(EulerFrame),
    /// The firmware's version: 1300 is 1.3.00.
    Firmware(u16),
}

/// The firmware's answer as the device sends it: header, version, check sum = header + version.
#[must_use]
pub fn encode_firmware(version: u16) -> [u8; FIRMWARE_LEN] {
    let [high, low] = version.to_be_bytes();
    let [sum_high, sum_low] = version.wrapping_add(u16::from(QUERY_FIRMWARE)).to_be_bytes();
    [QUERY_FIRMWARE, high, low, sum_high, sum_low]
}

/// Finds frames in a stream of bytes; never trusts one whose check sum is wrong.
#[derive(Debug, Clone, Default)]
pub struct GyroReader {
    window: [u8; EULER_LEN],
    len: usize,
    last_ticks: Option<u16>,
    /// Good frames so far.
    pub frames: u64,
    /// Bytes thrown away while looking for the next frame.
    pub skipped: u64,
    /// Frames that the device's clock says are missing.
    pub lost: u64,
}

impl GyroReader {
    /// Feeds bytes; `found` gets each good frame.
    pub fn push(&mut self, mut bytes: &[u8], mut found: impl FnMut(GyroFrame)) {
        while let Some(&first) = bytes.first() {
            let whole = bytes.split_first_chunk().filter(|_| self.len == 0 && first == EULER);
            if let Some((frame, rest)) = whole {
                (self.window, self.len, bytes) = (*frame, EULER_LEN, rest);
            } else {
                (self.window[self.len], bytes) = (first, &bytes[1..]);
                self.len += 1;
            }
            while let Some(frame) = self.next() {
                found(frame);
            }
        }
    }

    /// The line was cut: what comes next has nothing to do with what came before.
    pub fn forget(&mut self) {
        (self.len, self.last_ticks) = (0, None);
    }

    /// The frame at the start of the window, once it is complete; whatever is none is dropped.
    fn next(&mut self) -> Option<GyroFrame> {
        loop {
            let length = match *self.window.first().filter(|_| self.len > 0)? {
                EULER => EULER_LEN,
                QUERY_FIRMWARE => FIRMWARE_LEN,
                _ => {
                    self.skip();
                    continue;
                }
            };
            if self.len < length {
                return None;
            }
            if let Some(frame) = self.parse() {
                self.drop_first(length);
                self.frames += 1;
                return Some(frame);
            }
            self.skip();
        }
    }

    fn parse(&mut self) -> Option<GyroFrame> {
        let word = |i: usize| u16::from_be_bytes([self.window[i], self.window[i + 1]]);
        if self.window[0] == QUERY_FIRMWARE {
            let version = word(1);
            return (encode_firmware(version) == self.window[..FIRMWARE_LEN])
                .then_some(GyroFrame::Firmware(version));
        }
        if word(9) != checksum(&self.window) {
            return None;
        }
        let angles = GyroSample { roll: word(1) as i16, pitch: word(3) as i16, yaw: word(5) as i16 };
        let ticks = word(7);
        self.count_lost(ticks);
        Some(GyroFrame::Euler(EulerFrame { angles, ticks }))
    }

    fn count_lost(&mut self, ticks: u16) {
        if let Some(before) = self.last_ticks.replace(ticks) {
            let elapsed_ms = f64::from(ticks.wrapping_sub(before)) * TICK_MS;
            let periods = (elapsed_ms / PERIOD_MS + 0.5) as u64; // rounded
            self.lost += periods.saturating_sub(1);
        }
    }

    fn skip(&mut self) {
        self.drop_first(1);
        self.skipped += 1;
    }

    fn drop_first(&mut self, n: usize) {
        self.window.copy_within(n..self.len, 0);
        self.len -= n;
    }
}

/// After this long without an answer about the firmware the angles are started anyway.
const FIRMWARE_WITHIN_MS: u64 = 100;
/// A device that stays silent is asked again this often.
const ASK_AGAIN_MS: u64 = 500;
/// Ends whatever runs, then asks for the firmware.
const GREETING: [u8; 4] = [STOP_CONTINUOUS[0], STOP_CONTINUOUS[1], STOP_CONTINUOUS[2], QUERY_FIRMWARE];

#[derive(Debug, Clone, Copy, Default)]
enum Phase {
    #[default]
    Unasked,
    Greeted(Stamp),
    Started(Stamp),
}

/// Brings the device to send, and asks who it is on the way.
#[derive(Debug, Clone, Default)]
pub struct GyroStarter {
    phase: Phase,
    firmware: Option<u16>,
}

impl GyroStarter {
    /// The firmware's version, once it has answered.
    #[must_use]
    pub fn firmware(&self) -> Option<u16> {
        self.firmware
    }

    /// The firmware answered.
    pub fn heard_firmware(&mut self, version: u16) {
        self.firmware = Some(version);
    }

    /// The line was cut: another device may be plugged in.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// What to send now, if anything. `silent`: no angles have been heard lately.
    pub fn request(&mut self, now: Stamp, silent: bool) -> Option<&'static [u8]> {
        match self.phase {
            Phase::Greeted(at) if self.firmware.is_some() || now.since_ms(at) >= FIRMWARE_WITHIN_MS => {
                self.phase = Phase::Started(now);
                Some(&START_CONTINUOUS)
            }
            // Also if it sends already: it may have been left in continuous mode.
            Phase::Unasked => self.greet(now),
            Phase::Started(at) if silent && now.since_ms(at) >= ASK_AGAIN_MS => self.greet(now),
            _ => None,
        }
    }

    fn greet(&mut self, now: Stamp) -> Option<&'static [u8]> {
        (self.phase, self.firmware) = (Phase::Greeted(now), None);
        Some(&GREETING)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: EulerFrame =
        EulerFrame { angles: GyroSample { roll: 14, pitch: -3, yaw: 0x0E0E }, ticks: 77 };

    #[test]
    fn a_frame_round_trips_through_garbage() {
        let mut bytes = vec![0x0E, 0x01, 0x0E, 0xFF];
        for _ in 0..3 {
            bytes.extend(FRAME.encode());
        }
        let (mut reader, mut found) = (GyroReader::default(), Vec::new());
        reader.push(&bytes, |frame| found.push(frame));
        assert!(found.len() >= 2, "{found:?}");
        assert!(found.iter().all(|frame| *frame == GyroFrame::Euler(FRAME)));
    }

    #[test]
    fn a_flipped_bit_is_never_trusted() {
        for bit in 0..8 * EULER_LEN {
            let mut bytes = FRAME.encode();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let mut found = 0;
            GyroReader::default().push(&bytes, |_| found += 1);
            assert_eq!(found, 0, "bit {bit}");
        }
    }

    #[test]
    fn an_answer_about_the_firmware_is_found_between_angles() {
        let mut bytes = FRAME.encode().to_vec();
        bytes.extend(encode_firmware(1300));
        bytes.extend(FRAME.encode());
        let mut found = Vec::new();
        GyroReader::default().push(&bytes, |frame| found.push(frame));
        let angles = GyroFrame::Euler(FRAME);
        assert_eq!(found, [angles, GyroFrame::Firmware(1300), angles]);
    }

    #[test]
    fn the_devices_clock_tells_how_many_frames_are_missing() {
        let mut reader = GyroReader::default();
        // Every 10 ms in ticks of 6.5536 ms, from shortly before the clock wraps; five frames are lost.
        for i in (0..100_u32).filter(|i| !(40..44).contains(i) && *i != 70) {
            let ticks = (f64::from(65_500 + i) * PERIOD_MS / TICK_MS) as u64 as u16;
            reader.push(&EulerFrame { ticks, ..FRAME }.encode(), |_| {});
        }
        assert_eq!((reader.frames, reader.lost), (95, 5));
    }

    #[test]
    fn a_device_that_sends_already_is_asked_who_it_is() {
        let mut starter = GyroStarter::default();
        assert_eq!(starter.request(Stamp::ZERO, false), Some(&GREETING[..]));
        starter.heard_firmware(1300);
        assert_eq!(starter.request(Stamp::from_ms(5), false), Some(&START_CONTINUOUS[..]));
        assert_eq!(starter.request(Stamp::from_ms(9000), false), None);
    }

    #[test]
    fn a_silent_device_is_greeted_then_started_and_asked_again() {
        let mut starter = GyroStarter::default();
        assert_eq!(starter.request(Stamp::ZERO, true), Some(&GREETING[..]));
        assert_eq!(starter.request(Stamp::from_ms(50), true), None);
        starter.heard_firmware(1300);
        assert_eq!(starter.request(Stamp::from_ms(55), true), Some(&START_CONTINUOUS[..]));
        assert_eq!(starter.request(Stamp::from_ms(60), false), None);
        assert_eq!(starter.request(Stamp::from_ms(700), true), Some(&GREETING[..]));
        assert_eq!(starter.request(Stamp::from_ms(799), true), None);
        assert_eq!(starter.request(Stamp::from_ms(800), true), Some(&START_CONTINUOUS[..]));
    }
}
