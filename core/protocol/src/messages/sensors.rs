//! What a robot measures, raw and converted.

use super::{Message, finite};
use crate::keys::Name;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use xtb_control::units::check;
use xtb_control::vehicle::{SLOTS, USUAL_SLOTS};

/// Raw and converted samples of what is fitted, 10 times a second while somebody listens.
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
    /// The range finders that are fitted to the front bumper, none to eight, left to right seen from above, counts.
    #[cfg_attr(feature = "schema", schemars(length(max = 8)))]
    pub ir_front: Vec<u16>,
    /// Those of the rear bumper, counts.
    #[cfg_attr(feature = "schema", schemars(length(max = 8)))]
    pub ir_rear: Vec<u16>,
    /// Those of the front bumper, cm; `None` = nothing in range.
    #[cfg_attr(feature = "schema", schemars(length(max = 8)))]
    pub ir_front_cm: Vec<Option<f64>>,
    /// Those of the rear bumper, cm.
    #[cfg_attr(feature = "schema", schemars(length(max = 8)))]
    pub ir_rear_cm: Vec<Option<f64>>,
    /// Tilt sensor x and y, counts (means of 64 scans); `None` = no levelling platform.
    pub tilt: Option<[f64; 2]>,
    /// Positions of the pistons FL, FR, RL, RR, counts (means of 64 scans); `None` = no levelling platform.
    pub pistons: Option<[f64; 4]>,
    /// Heights of the pistons FL, FR, RL, RR; `None` = no levelling platform.
    pub pistons_m: Option<[f64; 4]>,
    /// Remote control: speed, steering, selector in time counts of 1.6 µs, each `None` = no pulse; `None` = the
    /// vehicle's settings have none (`remote.enabled`).
    pub remote: Option<[Option<u32>; 3]>,
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
    /// Rear steering pulse; `None` = only the front axle steers.
    pub steer_rear_counts: Option<u16>,
    /// Bumper pulses, front and rear.
    pub bumper_counts: [u16; 2],
    /// Piston pulses FL, FR, RL, RR; `None` = no levelling platform.
    pub piston_counts: Option<[u16; 4]>,
}

impl Message for Sensors {
    const NAME: &'static str = "Sensors";
    const VERSION: u32 = 3;
    /// It had six range finders a bumper, and everything was fitted.
    const PREVIOUS: Option<fn(&Self) -> bool> = Some(|sensors| sensors.in_previous().is_some());

    fn speaker(&self) -> Option<&Name> {
        Some(&self.robot)
    }

    fn read_previous(bytes: &[u8]) -> postcard::Result<(Self, &[u8])> {
        postcard::take_from_bytes::<Previous>(bytes).map(|(previous, rest)| (previous.into(), rest))
    }

    fn write_previous(&self) -> postcard::Result<Vec<u8>> {
        let previous = self.in_previous().ok_or(postcard::Error::SerializeSeqLengthUnknown)?;
        postcard::to_allocvec(&previous)
    }

    fn validate(&self) -> Result<(), CodecError> {
        finite("rpm", Some(self.rpm))?;
        let platform = [self.pistons, self.pistons_m].into_iter().flatten().flatten();
        for value in platform.chain(self.tilt.into_iter().flatten()) {
            finite("tilt or piston", Some(value))?;
        }
        for (counts, readings) in [(&self.ir_front, &self.ir_front_cm), (&self.ir_rear, &self.ir_rear_cm)] {
            check("range finders of a bumper", counts.len() as f64, 0.0, SLOTS as f64, "")?;
            let fitted = counts.len() as f64;
            check("readings of a bumper's range finders", readings.len() as f64, fitted, fitted, "")?;
            readings.iter().try_for_each(|cm| finite("reading of a range finder", *cm))?;
        }
        Ok(())
    }
}

/// The layout of version 2: six range finders a bumper, and no word for what is not fitted.
#[derive(Serialize, Deserialize)]
struct Previous {
    robot: Name,
    tick_ms: u64,
    gyro_yaw: i16,
    encoder_pulses: u16,
    ir_front: [u16; USUAL_SLOTS],
    ir_rear: [u16; USUAL_SLOTS],
    ir_front_cm: [Option<f64>; USUAL_SLOTS],
    ir_rear_cm: [Option<f64>; USUAL_SLOTS],
    tilt: [f64; 2],
    pistons: [f64; 4],
    pistons_m: [f64; 4],
    remote: [Option<u32>; 3],
    gyro_firmware: Option<u16>,
    board_firmware: Option<u16>,
    rpm: f64,
    motor_counts: u16,
    steer_front_counts: u16,
    steer_rear_counts: u16,
    bumper_counts: [u16; 2],
    piston_counts: [u16; 4],
}

impl Sensors {
    /// In the layout of before, if it has a word for all of it.
    fn in_previous(&self) -> Option<Previous> {
        Some(Previous {
            robot: self.robot.clone(),
            tick_ms: self.tick_ms,
            gyro_yaw: self.gyro_yaw,
            encoder_pulses: self.encoder_pulses,
            ir_front: self.ir_front.as_slice().try_into().ok()?,
            ir_rear: self.ir_rear.as_slice().try_into().ok()?,
            ir_front_cm: self.ir_front_cm.as_slice().try_into().ok()?,
            ir_rear_cm: self.ir_rear_cm.as_slice().try_into().ok()?,
            tilt: self.tilt?,
            pistons: self.pistons?,
            pistons_m: self.pistons_m?,
            remote: self.remote?,
            gyro_firmware: self.gyro_firmware,
            board_firmware: self.board_firmware,
            rpm: self.rpm,
            motor_counts: self.motor_counts,
            steer_front_counts: self.steer_front_counts,
            steer_rear_counts: self.steer_rear_counts?,
            bumper_counts: self.bumper_counts,
            piston_counts: self.piston_counts?,
        })
    }
}

impl From<Previous> for Sensors {
    fn from(of_before: Previous) -> Self {
        Self {
            robot: of_before.robot,
            tick_ms: of_before.tick_ms,
            gyro_yaw: of_before.gyro_yaw,
            encoder_pulses: of_before.encoder_pulses,
            ir_front: of_before.ir_front.to_vec(),
            ir_rear: of_before.ir_rear.to_vec(),
            ir_front_cm: of_before.ir_front_cm.to_vec(),
            ir_rear_cm: of_before.ir_rear_cm.to_vec(),
            tilt: Some(of_before.tilt),
            pistons: Some(of_before.pistons),
            pistons_m: Some(of_before.pistons_m),
            remote: Some(of_before.remote),
            gyro_firmware: of_before.gyro_firmware,
            board_firmware: of_before.board_firmware,
            rpm: of_before.rpm,
            motor_counts: of_before.motor_counts,
            steer_front_counts: of_before.steer_front_counts,
            steer_rear_counts: Some(of_before.steer_rear_counts),
            bumper_counts: of_before.bumper_counts,
            piston_counts: Some(of_before.piston_counts),
        }
    }
}
