//! The MicroStrain 3DM-G's own frames: 38,400 baud, 8N1, big-endian.
//!
//! `0x0E` answers 11 bytes: header, roll, pitch, yaw (i16, 360/65536 deg), timer ticks (u16,
//! 6.5536 ms), check sum = header + the 16-bit words, modulo 65536. Continuous mode: `10 00 0E`,
//! stop: `10 00 00`; firmware: `F0` answers 5 bytes. Axes X north, Y east, Z down: yaw clockwise.
//! (`0x31`, 23 bytes, belongs to the later GX1: not this device.)

use xtb_control::controller::GyroSample;

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

/// Finds frames in a stream of bytes; never trusts one whose check sum is wrong.
#[derive(Debug, Clone, Default)]
pub struct EulerReader {
    window: [u8; EULER_LEN],
    len: usize,
    /// Good frames so far.
    pub frames: u64,
    /// Bytes thrown away while looking for the next frame.
    pub skipped: u64,
}

impl EulerReader {
    /// Feeds bytes; `found` gets each good frame.
    pub fn push(&mut self, bytes: &[u8], mut found: impl FnMut(EulerFrame)) {
        for &byte in bytes {
            self.window[self.len] = byte;
            self.len += 1;
            self.resynchronise();
            if self.len < EULER_LEN {
                continue;
            }
            if let Some(frame) = self.parse() {
                self.len = 0;
                self.frames += 1;
                found(frame);
            } else {
                self.drop_first();
                self.resynchronise();
            }
        }
    }

    fn parse(&self) -> Option<EulerFrame> {
        let word = |i: usize| u16::from_be_bytes([self.window[i], self.window[i + 1]]);
        let angles = GyroSample { roll: word(1) as i16, pitch: word(3) as i16, yaw: word(5) as i16 };
        (word(9) == checksum(&self.window)).then(|| EulerFrame { angles, ticks: word(7) })
    }

    /// Drops bytes until the window starts with a header or is empty.
    fn resynchronise(&mut self) {
        while self.len > 0 && self.window[0] != EULER {
            self.drop_first();
        }
    }

    fn drop_first(&mut self) {
        self.window.copy_within(1..self.len, 0);
        self.len -= 1;
        self.skipped += 1;
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
        let (mut reader, mut found) = (EulerReader::default(), Vec::new());
        reader.push(&bytes, |frame| found.push(frame));
        assert!(found.len() >= 2, "{found:?}");
        assert!(found.iter().all(|frame| *frame == FRAME));
    }

    #[test]
    fn a_flipped_bit_is_never_trusted() {
        for bit in 0..8 * EULER_LEN {
            let mut bytes = FRAME.encode();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let mut found = 0;
            EulerReader::default().push(&bytes, |_| found += 1);
            assert_eq!(found, 0, "bit {bit}");
        }
    }
}
