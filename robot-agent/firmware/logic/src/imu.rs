//! The inertial unit on the board's own UART: BNO085 in UART-RVC mode, 100 frames a second.
//!
//! ```text
//!   AA AA · index · yaw · pitch · roll (i16, 0.01°) · ax · ay · az (i16, mg) · 3 reserved · sum of bytes 2..=17
//! ```
//! Its frames go on to the agent as they are, in a frame of the board's, so that the agent needs one line only.

const LEN: usize = 19;
const MARK: u8 = 0xAA;

/// A good frame of the inertial unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ImuSample {
    /// Counts the unit's frames modulo 256.
    pub index: u8,
    /// Bad frames since power-on, modulo 256.
    pub bad: u8,
    /// In 0.01°, as the unit sends it; which way it grows has to be seen on hardware.
    pub yaw: i16,
    /// In 0.01°.
    pub pitch: i16,
    /// In 0.01°.
    pub roll: i16,
    /// Along x, y, z, in mg.
    pub acceleration: [i16; 3],
}

impl ImuSample {
    /// The seven numbers of a frame to the agent.
    pub(crate) fn words(&self) -> [u16; 7] {
        let [x, y, z] = self.acceleration;
        let [yaw, pitch, roll, x, y, z] = [self.yaw, self.pitch, self.roll, x, y, z].map(|n| n as u16);
        [u16::from(self.bad) << 8 | u16::from(self.index), yaw, pitch, roll, x, y, z]
    }
}

/// Finds frames in the unit's bytes.
#[derive(Debug, Clone, Default)]
pub(crate) struct Imu {
    buffer: [u8; LEN],
    len: usize,
    bad: u8,
}

impl Imu {
    /// One more byte; a sample if it ends a good frame.
    pub(crate) fn push(&mut self, byte: u8) -> Option<ImuSample> {
        self.buffer[self.len] = byte;
        self.len += 1;
        if self.len == LEN && self.sum() != self.buffer[LEN - 1] {
            self.bad = self.bad.wrapping_add(1);
            self.drop_first();
        }
        while self.len > 0 && !self.begins_well() {
            self.drop_first();
        }
        if self.len < LEN {
            return None;
        }
        self.len = 0;
        let number = |i: usize| i16::from_le_bytes([self.buffer[i], self.buffer[i + 1]]);
        Some(ImuSample {
            index: self.buffer[2],
            bad: self.bad,
            yaw: number(3),
            pitch: number(5),
            roll: number(7),
            acceleration: [number(9), number(11), number(13)],
        })
    }

    fn sum(&self) -> u8 {
        self.buffer[2..LEN - 1].iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
    }

    fn begins_well(&self) -> bool {
        self.buffer[..self.len.min(2)].iter().all(|byte| *byte == MARK)
    }

    fn drop_first(&mut self) {
        self.buffer.copy_within(1..self.len, 0);
        self.len -= 1;
    }
}
