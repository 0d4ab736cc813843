//! What a robot measures, raw and converted.

use super::Message;
use crate::keys::Name;
use serde::{Deserialize, Serialize};

/// Raw and converted samples, 10 times a second while somebody listens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Sensors {
    /// Whose.
    pub robot: Name,
    /// The robot's monotonic clock.
    pub tick_ms: u64,
    /// Raw yaw counts, 360/65536 deg.
    pub gyro_yaw: i16,
    /// Pulses of the last encoder window.
    pub encoder_pulses: u16,
    /// Front range finders, counts: the six leftmost, as those below; a car may have eight.
    pub ir_front: [u16; 6],
    /// Rear range finders, counts.
    pub ir_rear: [u16; 6],
    /// Front range finders, cm; `None` = nothing in range.
    pub ir_front_cm: [Option<f64>; 6],
    /// Rear range finders, cm.
    pub ir_rear_cm: [Option<f64>; 6],
    /// Tilt sensor x and y, counts (means of 64 scans).
    pub tilt: [f64; 2],
    /// Positions of the pistons FL, FR, RL, RR, counts (means of 64 scans).
    pub pistons: [f64; 4],
    /// Heights of the pistons FL, FR, RL, RR.
    pub pistons_m: [f64; 4],
    /// Remote control: speed, steering, selector in time counts of 1.6 µs; `None` = no pulse.
    pub remote: [Option<u32>; 3],
    /// The gyro's firmware (1300 = 1.3.00); `None` = it has not answered.
    pub gyro_firmware: Option<u16>,
    /// The board's firmware, major in the high byte; `None` = no status has come.
    pub board_firmware: Option<u16>,
    /// Signed wheel speed.
    pub rpm: f64,
    /// Motor pulse in counts of 0.4 µs, as commanded.
    pub motor_counts: u16,
    /// Front steering pulse.
    pub steer_front_counts: u16,
    /// Rear steering pulse.
    pub steer_rear_counts: u16,
    /// Bumper pulses, front and rear.
    pub bumper_counts: [u16; 2],
    /// Piston pulses FL, FR, RL, RR.
    pub piston_counts: [u16; 4],
}

impl Message for Sensors {
    const NAME: &'static str = "Sensors";
    const VERSION: u32 = 2;

    fn speaker(&self) -> Option<&Name> {
        Some(&self.robot)
    }
}
