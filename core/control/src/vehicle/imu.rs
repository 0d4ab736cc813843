//! Which inertial unit tells the yaw (§2.2, §4.9).
//!
//! The controller knows one kind of reading, that of the 3DM-G: counts of 360/65536°, clockwise. What another unit
//! sends becomes that before the controller sees it, so that recordings and traces do not depend on the unit.

use crate::config::{Allowed, Value};
use serde::{Deserialize, Serialize};

/// The inertial unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Imu {
    /// A MicroStrain 3DM-G on a line of its own (§2.2).
    #[default]
    #[serde(rename = "3dm-g")]
    ThreeDmG,
    /// A BNO085 in UART-RVC mode at the I/O board, whose line carries its frames.
    #[serde(rename = "bno085-rvc")]
    Bno085Rvc,
}

impl Imu {
    /// What stands in TOML.
    pub const WORDS: [&'static str; 2] = ["3dm-g", "bno085-rvc"];
}

impl Value for Imu {
    fn to_toml(&self) -> String {
        format!("{:?}", Self::WORDS[*self as usize])
    }
    fn is_allowed(&self, _: &Allowed) -> bool {
        true
    }
}

/// Which way the yaw of a BNO085 grows, seen from above. Its data sheet calls counter-clockwise turns positive (§4);
/// others who use its RVC mode report the opposite. It has to be seen on hardware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ImuYaw {
    /// Its z axis points up.
    #[default]
    CounterClockwise,
    /// Its z axis points down, as that of the 3DM-G.
    Clockwise,
}

impl ImuYaw {
    /// What stands in TOML.
    pub const WORDS: [&'static str; 2] = ["counter_clockwise", "clockwise"];
}

impl Value for ImuYaw {
    fn to_toml(&self) -> String {
        format!("{:?}", Self::WORDS[*self as usize])
    }
    fn is_allowed(&self, _: &Allowed) -> bool {
        true
    }
}
