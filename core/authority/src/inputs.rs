//! The inputs without which nothing may move, and when one counts as lost.

use xtb_protocol::messages::{InputAges, StopReason};

/// An input that was not heard for this long is lost.
pub const INPUT_LOST_MS: u64 = 200;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Input {
    /// Encoder and converter.
    Board,
    /// Yaw.
    Gyro,
}

impl Input {
    pub(crate) const ALL: [Self; 2] = [Self::Board, Self::Gyro];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Board => "board",
            Self::Gyro => "gyro",
        }
    }

    pub(crate) fn reason(self) -> StopReason {
        match self {
            Self::Board => StopReason::BoardLost,
            Self::Gyro => StopReason::GyroLost,
        }
    }

    pub(crate) fn is_lost(self, ages: &InputAges) -> bool {
        let silent = |age: Option<u64>| age.is_none_or(|ms| ms > INPUT_LOST_MS);
        match self {
            Self::Board => silent(ages.encoder) || silent(ages.adc),
            Self::Gyro => silent(ages.gyro),
        }
    }

    /// The first input that is lost, if any.
    pub(crate) fn first_lost(ages: &InputAges) -> Option<Self> {
        Self::ALL.into_iter().find(|input| input.is_lost(ages))
    }
}
