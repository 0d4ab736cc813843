//! Faults by name: what a technician has to see to.

use crate::text;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Something that is broken now. The first part of a name says where.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// The board's port does not exist.
    BoardUnplugged,
    /// Another program holds the board's port.
    BoardBusy,
    /// This user may not open the board's port.
    BoardNoPermission,
    /// The board's port cannot be used for another reason.
    BoardPortBroken,
    /// Nothing comes from the board.
    BoardSilent,
    /// Bytes without sense come from the board.
    BoardGarbage,
    /// Frames from the board begin and do not end.
    BoardHalfFrames,
    /// Something else is at the board's port.
    BoardWrongDevice,
    /// The board speaks, but has not confirmed its set-up.
    BoardNotSetUp,
    /// The gyro's port does not exist.
    GyroUnplugged,
    /// Another program holds the gyro's port.
    GyroBusy,
    /// This user may not open the gyro's port.
    GyroNoPermission,
    /// The gyro's port cannot be used for another reason.
    GyroPortBroken,
    /// Nothing comes from the gyro.
    GyroSilent,
    /// Bytes without sense come from the gyro.
    GyroGarbage,
    /// Frames from the gyro begin and do not end.
    GyroHalfFrames,
    /// Something else is at the gyro's port.
    GyroWrongDevice,
    /// The board speaks, but sends no encoder windows.
    EncoderSilent,
    /// The board speaks, but sends no converter scans.
    ConverterSilent,
    /// The remote control's selector is lost: mode `fault`.
    RemoteLost,
    /// A tilt sensor's voltage has no angle.
    TiltOutOfRange,
    /// The recorder cannot write any more.
    RecordingFailed,
    /// The board repeats one frame.
    BoardFrozen,
    /// The gyro's clock or its angles stand still.
    GyroFrozen,
    /// More pulses than the motor can turn.
    EncoderOutOfRange,
    /// All of the converter's channels stand still.
    ConverterFrozen,
    /// A range finder's reading stands still while the truck drives.
    InfraredFrozen,
    /// A range finder reads what it cannot: broken wire or short circuit.
    InfraredOutOfRange,
    /// The wheels turn faster than anything that was commanded explains.
    Runaway,
    /// The motor is driven and the wheels do not turn.
    Stalled,
    /// The battery is low: finish and charge.
    BatteryLow,
    /// The battery is nearly empty.
    BatteryCritical,
    /// Pose fixes show that the truck goes 15 % farther or less far than its encoder says.
    OdometryScale,
    /// Pose fixes repeat one pose while the wheels turn.
    FixesFrozen,
    /// Pose fixes say another pose than the odometry, and neither can be believed.
    FixesContradict,
}

impl Fault {
    /// Where it is, as events and sentences call it.
    #[must_use]
    pub fn place(self) -> &'static str {
        match self {
            Self::BoardUnplugged
            | Self::BoardBusy
            | Self::BoardNoPermission
            | Self::BoardPortBroken
            | Self::BoardSilent
            | Self::BoardGarbage
            | Self::BoardHalfFrames
            | Self::BoardWrongDevice
            | Self::BoardNotSetUp
            | Self::BoardFrozen => "board",
            Self::GyroUnplugged
            | Self::GyroBusy
            | Self::GyroNoPermission
            | Self::GyroPortBroken
            | Self::GyroSilent
            | Self::GyroGarbage
            | Self::GyroHalfFrames
            | Self::GyroWrongDevice
            | Self::GyroFrozen => "gyro",
            Self::EncoderSilent | Self::EncoderOutOfRange => "encoder",
            Self::ConverterSilent | Self::ConverterFrozen => "converter",
            Self::InfraredFrozen | Self::InfraredOutOfRange => "range finder",
            Self::Runaway | Self::Stalled => "drive",
            Self::BatteryLow | Self::BatteryCritical => "battery",
            Self::RemoteLost => "remote control",
            Self::TiltOutOfRange => "tilt sensor",
            Self::RecordingFailed => "recorder",
            Self::OdometryScale => "odometry",
            Self::FixesFrozen | Self::FixesContradict => "pose fixes",
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// A fault with its age.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FaultState {
    /// Which.
    pub fault: Fault,
    /// Since it was noticed.
    pub age_ms: u64,
    /// The system's words, where there are any.
    #[serde(default, deserialize_with = "text::read_option")]
    pub detail: Option<String>,
}
