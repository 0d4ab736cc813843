//! A robot's factsheet: who it is, what it accepts, and its parameters.

use super::Message;
use crate::keys::Name;
use crate::text;
use serde::{Deserialize, Serialize};
use xtb_control::frames::MapPose;

/// The parameter in [`About::vehicle`] that says how the control loop is scheduled: [`REALTIME_OFF`],
/// [`REALTIME_ON`], or what was refused. It is none of the vehicle's: `vehicle_hash` does not cover it.
pub const REALTIME: &str = "control.realtime";
/// The parameter in [`About::vehicle`] that names the firmware of the I/O board, once it has been heard. It is none of
/// the vehicle's either.
pub const BOARD_FIRMWARE: &str = "board.firmware";
/// As any program.
pub const REALTIME_OFF: &str = "off";
/// `SCHED_FIFO`, in locked memory.
pub const REALTIME_ON: &str = "on";
/// How a person permits it.
pub const REALTIME_REMEDY: &str = "permit it on the robot's computer: `sudo setcap \
    cap_sys_nice,cap_ipc_lock+ep` with the path of robot-agent, or LimitRTPRIO=20 and \
    LimitMEMLOCK=infinity in its systemd unit";

/// The capability of a robot that takes the next leg of an assignment while the one before is under way, and passes
/// the point between without a stop, if both are driven along planned paths; any other robot would drop the leg under
/// way for it.
pub const NEXT_LEG: &str = "next_leg";

/// A parameter as the factsheet lists it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ParameterInfo {
    /// `section.field`.
    #[serde(deserialize_with = "text::read")]
    pub name: String,
    /// In TOML; of [`REALTIME`] in words.
    #[serde(deserialize_with = "text::read")]
    pub value: String,
    /// Empty for switches.
    #[serde(deserialize_with = "text::read")]
    pub unit: String,
    /// Printed, data sheet, assumed or ours.
    #[serde(deserialize_with = "text::read")]
    pub origin: String,
}

/// What the robot accepts at most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Fastest setpoint, in wheel rpm.
    pub max_rpm: f64,
    /// Fastest speed that the obstacle rule stops from, in m/s.
    pub admitted_mps: f64,
    /// How long a setpoint lives.
    pub setpoint_lifetime_ms: u32,
    /// Largest |x| or |y| of a goal.
    pub max_coordinate_m: f64,
}

/// The factsheet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct About {
    /// Who.
    pub robot: Name,
    /// Of which fleet.
    pub fleet: Name,
    /// The agent's version.
    #[serde(deserialize_with = "text::read")]
    pub version: String,
    /// Random at boot.
    pub epoch: u64,
    /// `simulated` or `serial`.
    #[serde(deserialize_with = "text::read")]
    pub hardware: String,
    /// Where it started.
    pub start_pose: MapPose,
    /// What it accepts at most.
    pub limits: Limits,
    /// Which requests it understands.
    #[serde(deserialize_with = "text::read_list")]
    pub capabilities: Vec<String>,
    /// CRC-32 of the vehicle parameters, in hexadecimal.
    #[serde(deserialize_with = "text::read")]
    pub vehicle_hash: String,
    /// The vehicle parameters, and [`REALTIME`].
    pub vehicle: Vec<ParameterInfo>,
}

impl About {
    /// What [`REALTIME`] says; `None` of an agent that does not know it.
    #[must_use]
    pub fn realtime(&self) -> Option<&str> {
        self.value(REALTIME)
    }

    /// The board's firmware, such as `1.1`; `None` before it has been heard, and of an agent that does not tell.
    #[must_use]
    pub fn board_firmware(&self) -> Option<&str> {
        self.value(BOARD_FIRMWARE)
    }

    fn value(&self, name: &str) -> Option<&str> {
        self.vehicle.iter().find(|info| info.name == name).map(|info| info.value.as_str())
    }
}

impl Message for About {
    const NAME: &'static str = "About";

    fn speaker(&self) -> Option<&Name> {
        Some(&self.robot)
    }
}
