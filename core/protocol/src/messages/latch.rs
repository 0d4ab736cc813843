//! Latched stops by name: what only a `reset` ends.

use super::StopReason;
use crate::text;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Who has set the latch [`Latch::Estop`], if it was the switch at the I/O board.
pub const STOP_SWITCH: &str = "emergency stop switch";

/// Why a robot stands until somebody resets it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Latch {
    /// Somebody called for it.
    Estop,
    /// The transmitter took over from the network.
    RemoteTakeover,
    /// The I/O board was lost after it had been well.
    BoardLost,
    /// The gyro was lost after it had been well.
    GyroLost,
    /// The wheels turned faster than anything that was commanded explains.
    Runaway,
    /// A sensor froze or said what cannot be.
    SensorFault,
    /// The battery is nearly empty.
    BatteryCritical,
}

impl Latch {
    /// What it is called among the reasons why a robot stands.
    #[must_use]
    pub fn reason(self) -> StopReason {
        match self {
            Self::Estop => StopReason::Estop,
            Self::RemoteTakeover => StopReason::RemoteTakeover,
            Self::BoardLost => StopReason::BoardLost,
            Self::GyroLost => StopReason::GyroLost,
            Self::Runaway => StopReason::Runaway,
            Self::SensorFault => StopReason::SensorFault,
            Self::BatteryCritical => StopReason::BatteryCritical,
        }
    }

    /// Whether the transmitter stands too. It may drive a truck that it has taken over itself, one
    /// whose gyro is lost, and one whose board was lost and is back: the hand at the stick sees it.
    #[must_use]
    pub fn holds_transmitter(self) -> bool {
        !matches!(self, Self::RemoteTakeover | Self::BoardLost | Self::GyroLost)
    }
}

impl fmt::Display for Latch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

impl FromStr for Latch {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|latch| latch.to_string() == text).ok_or_else(|| {
            format!("unknown latch; known are {}", Self::ALL.map(|l| l.to_string()).join(", "))
        })
    }
}

/// A latch that is set.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LatchState {
    /// Which.
    pub latch: Latch,
    /// Since it was set.
    pub age_ms: u64,
    /// Who or what set it: a client's name, a fault.
    #[serde(deserialize_with = "text::read")]
    pub by: String,
    /// Whether what set it is still so: then a reset is refused.
    pub present: bool,
}
