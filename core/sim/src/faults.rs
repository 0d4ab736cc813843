//! What a test can break on a truck: the two lines to its agent, its sensors and its drive.
//!
//! A line's fault acts on each frame that a device sends from then on; what was already under way still
//! arrives. The devices themselves go on unharmed: take the fault away and the next frame is good.
//! A fault of a sensor or of the drive changes what is measured or done, never how frames are sent.

use xtb_control::vehicle::{SLOTS, USUAL_SLOTS};

/// What is wrong with one line.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum InjectedLineFault {
    /// Nothing.
    #[default]
    None,
    /// Nothing arrives: cable cut, device dead.
    Silent,
    /// Each frame arrives as as many random bytes: wrong baud rate.
    Garbage,
    /// The middle half of each frame is missing: bytes overrun.
    HalfFrames,
    /// The other device hangs on this line, as it behaves when nobody talks to it: a gyro that was
    /// left in continuous mode, or a board that waits for its set-up.
    WrongDevice,
    /// Each frame is lost with this probability, 0..=1.
    Lossy(f64),
    /// The same frame again and again, with an unchanged sequence or timer: the device hangs.
    Frozen,
}

/// Faults of both lines.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LineFaults {
    /// From the I/O board.
    pub board: InjectedLineFault,
    /// From the gyro.
    pub gyro: InjectedLineFault,
}

/// What is wrong with one range finder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RangeFinderFault {
    /// Nothing.
    #[default]
    None,
    /// It shows its last reading for ever.
    Frozen,
    /// Its wire is broken: 0 V.
    BrokenWire,
    /// Its wire touches the supply: 5 V.
    Short,
}

/// What is wrong with the gyro.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GyroFault {
    /// Nothing.
    #[default]
    None,
    /// Its angles stand still, its timer runs.
    AnglesFrozen,
    /// Its timer stands still, its angles are good.
    TimerFrozen,
    /// Both stand still.
    Frozen,
}

/// What is wrong with the encoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EncoderFault {
    /// Nothing.
    #[default]
    None,
    /// Its wire is broken: no pulses.
    BrokenWire,
    /// Interference: any number of pulses.
    Wild,
}

/// Faults of a truck's sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SensorFaults {
    /// Front, then rear range finders, eight of each, left to right.
    pub range_finders: [RangeFinderFault; 2 * SLOTS],
    /// Every channel of the converter shows its last reading for ever.
    pub converter_frozen: bool,
    /// The gyro.
    pub gyro: GyroFault,
    /// The encoder.
    pub encoder: EncoderFault,
    /// The board does not measure the battery.
    pub battery_unmeasured: bool,
}

impl SensorFaults {
    /// The same fault of all range finders.
    #[must_use]
    pub fn all_range_finders(fault: RangeFinderFault) -> Self {
        Self { range_finders: [fault; 2 * SLOTS], ..Self::default() }
    }

    /// A fault of one of an XTB's range finders, 0..12: front, then rear, left to right.
    #[must_use]
    pub fn range_finder(index: usize, fault: RangeFinderFault) -> Self {
        let mut faults = Self::default();
        if let Some(one) = faults.range_finders.get_mut(index / USUAL_SLOTS * SLOTS + index % USUAL_SLOTS) {
            *one = fault;
        }
        faults
    }
}

/// What is wrong with the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DriveFault {
    /// Nothing.
    #[default]
    None,
    /// The ESC goes on as it drives at this moment, whatever pulse it gets.
    Stuck,
    /// Something holds the wheels.
    Held,
}
