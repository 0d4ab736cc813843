//! A sample of the BNO085 at the I/O board, in UART-RVC mode: 100 a second, in frame 0x16 of the board.
//!
//! It is mounted flat with its x axis ahead. Angles are hundredths of a degree about its own axes; which way its z
//! axis points, and so which way yaw and pitch grow, is a setting ([`ImuYaw`]).

use xtb_control::controller::GyroSample;
use xtb_control::units::{OutOfRange, check};
use xtb_control::vehicle::ImuYaw;

/// Between two samples, in ms.
pub const PERIOD_MS: f64 = 10.0;
/// Length of a frame on the unit's own line to the board.
pub const RVC_LEN: usize = 19;
/// Largest |yaw| and |roll|, in 0.01°; |pitch| has half of it.
const MOST_CDEG: i16 = 18_000;

/// A sample as the unit gives it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Bno085Sample {
    /// Counts the unit's frames modulo 256.
    pub index: u8,
    /// Frames with a wrong check sum that the board has seen since power-on, modulo 256.
    pub bad: u8,
    /// Since the unit's power-on, −18,000..=18,000, in 0.01°.
    pub yaw_cdeg: i16,
    /// −9,000..=9,000, in 0.01°.
    pub pitch_cdeg: i16,
    /// −18,000..=18,000, in 0.01°.
    pub roll_cdeg: i16,
    /// Along x, y, z, in mg; 1,000 along the vertical at rest.
    pub acceleration_mg: [i16; 3],
}

impl Bno085Sample {
    /// From the seven numbers of the board's frame.
    ///
    /// # Errors
    /// An angle that the unit cannot give.
    pub fn from_words(words: [u16; 7]) -> Result<Self, OutOfRange> {
        let [counters, yaw, pitch, roll, x, y, z] = words;
        let [index, bad] = counters.to_le_bytes();
        let within = |quantity, word: u16, most: i16| {
            let value = word as i16;
            check(quantity, value.into(), -f64::from(most), most.into(), "0.01°").map(|_| value)
        };
        Ok(Self {
            index,
            bad,
            yaw_cdeg: within("yaw", yaw, MOST_CDEG)?,
            pitch_cdeg: within("pitch", pitch, MOST_CDEG / 2)?,
            roll_cdeg: within("roll", roll, MOST_CDEG)?,
            acceleration_mg: [x, y, z].map(|word| word as i16),
        })
    }

    /// The seven numbers of the board's frame.
    #[must_use]
    pub fn to_words(&self) -> [u16; 7] {
        let [x, y, z] = self.acceleration_mg;
        let [yaw, pitch, roll, x, y, z] =
            [self.yaw_cdeg, self.pitch_cdeg, self.roll_cdeg, x, y, z].map(|number| number as u16);
        [u16::from_le_bytes([self.index, self.bad]), yaw, pitch, roll, x, y, z]
    }

    /// The frame on the unit's own line to the board.
    #[must_use]
    pub fn to_rvc(&self) -> [u8; RVC_LEN] {
        let mut frame = [0; RVC_LEN];
        (frame[0], frame[1], frame[2]) = (0xAA, 0xAA, self.index);
        for (place, word) in frame[3..15].chunks_exact_mut(2).zip(&self.to_words()[1..]) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        frame[RVC_LEN - 1] = frame[2..RVC_LEN - 1].iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
        frame
    }

    /// The same angles as a 3DM-G gives them: x ahead, y to the right, z down, in counts of 360/65536°.
    #[must_use]
    pub fn angles(&self, yaw: ImuYaw) -> GyroSample {
        let turned = match yaw {
            ImuYaw::CounterClockwise => -1,
            ImuYaw::Clockwise => 1,
        };
        GyroSample {
            roll: counts(self.roll_cdeg.into()),
            pitch: counts(turned * i32::from(self.pitch_cdeg)),
            yaw: counts(turned * i32::from(self.yaw_cdeg)),
        }
    }
}

/// The nearest count: 65,536 / 36,000 = 2048 / 1125, so nothing lies between two. Half a turn wraps, as the angle does.
fn counts(cdeg: i32) -> i16 {
    (cdeg * 2048 + 562).div_euclid(1125) as i16
}

/// What the counters of the samples say is missing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Bno085Counter {
    last: Option<(u8, u8)>,
    /// Samples so far.
    pub frames: u64,
    /// Samples that are missing by the unit's index.
    pub lost: u64,
    /// Frames with a wrong check sum.
    pub bad: u64,
}

impl Bno085Counter {
    /// A sample came.
    pub fn count(&mut self, sample: &Bno085Sample) {
        self.frames += 1;
        if let Some((index, bad)) = self.last.replace((sample.index, sample.bad)) {
            self.lost += u64::from(sample.index.wrapping_sub(index).saturating_sub(1));
            self.bad += u64::from(sample.bad.wrapping_sub(bad));
        }
    }

    /// The board was lost: what comes next has nothing to do with what came before.
    pub fn forget(&mut self) {
        self.last = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the data sheet (BNO080, §1.3.5.2).
    const SAMPLE: Bno085Sample = Bno085Sample {
        index: 0xDE,
        bad: 0,
        yaw_cdeg: 1,
        pitch_cdeg: -110,
        roll_cdeg: 2085,
        acceleration_mg: [-371, -20, 977],
    };

    #[test]
    fn the_frame_is_that_of_the_data_sheet() {
        let printed = [
            0xAA, 0xAA, 0xDE, 0x01, 0x00, 0x92, 0xFF, 0x25, 0x08, 0x8D, 0xFE, 0xEC, 0xFF, 0xD1, 0x03, 0x00,
            0x00, 0x00, 0xE7,
        ];
        assert_eq!(SAMPLE.to_rvc(), printed);
        assert_eq!(Bno085Sample::from_words(SAMPLE.to_words()), Ok(SAMPLE));
    }

    #[test]
    fn an_angle_that_the_unit_cannot_give_is_refused_by_name() {
        for (place, word, name) in [(1, 18_001_u16, "yaw"), (2, 9_001, "pitch"), (3, 0x8000, "roll")] {
            let mut words = SAMPLE.to_words();
            words[place] = word;
            let error = Bno085Sample::from_words(words).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }

    #[test]
    fn every_angle_becomes_the_nearest_count_and_half_a_turn_wraps() {
        for cdeg in -18_000..=18_000_i32 {
            let exact = f64::from(cdeg) * 65_536.0 / 36_000.0;
            assert_eq!(counts(cdeg), libm::round(exact) as i32 as i16, "{cdeg}");
        }
        assert_eq!((counts(9_000), counts(18_000), counts(-18_000)), (16_384, i16::MIN, i16::MIN));
    }

    #[test]
    fn the_setting_turns_yaw_and_pitch_and_leaves_roll() {
        let sample = Bno085Sample { yaw_cdeg: 9_000, pitch_cdeg: 4_500, roll_cdeg: -4_500, ..SAMPLE };
        let up = sample.angles(ImuYaw::CounterClockwise);
        assert_eq!(up, GyroSample { roll: -8_192, pitch: -8_192, yaw: -16_384 });
        assert_eq!(sample.angles(ImuYaw::Clockwise), GyroSample { roll: -8_192, pitch: 8_192, yaw: 16_384 });
    }

    #[test]
    fn gaps_and_bad_frames_are_counted_over_the_wrap_and_not_over_a_cut() {
        let mut counter = Bno085Counter::default();
        for (index, bad) in [(250, 255), (251, 255), (254, 1), (0, 1)] {
            counter.count(&Bno085Sample { index, bad, ..SAMPLE });
        }
        assert_eq!((counter.frames, counter.lost, counter.bad), (4, 3, 2));
        counter.forget();
        for _ in 0..2 {
            counter.count(&Bno085Sample { index: 90, bad: 9, ..SAMPLE });
        }
        assert_eq!((counter.lost, counter.bad), (3, 2), "after the cut, and the same one again");
    }
}
