//! What the control loop says of the robot, for those that tell others.

use xtb_protocol::messages::{RobotState, Sensors};
use xtb_robot::motion::Motion;

/// What uplink, neighbours and ROS are told.
#[derive(Debug, Clone)]
pub(crate) struct Snapshot {
    /// 20 Hz.
    pub(crate) state: RobotState,
    /// With the same stamp; `None` until the converter has been heard.
    pub(crate) sensors: Option<Sensors>,
    /// At the same moment; `None` before the first step.
    pub(crate) motion: Option<Motion>,
}
