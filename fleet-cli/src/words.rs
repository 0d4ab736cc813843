//! The protocol's names in words for people.

use serde::Serialize;
use xtb_protocol::messages::StopReason;

/// The name of a unit variant as it travels in JSON, such as `goal_reached`.
pub(crate) fn name(value: &impl Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(name)) => name,
        Ok(other) => other.to_string(),
        Err(error) => error.to_string(),
    }
}

/// Why a robot stands.
pub(crate) fn reason(reason: StopReason) -> &'static str {
    match reason {
        StopReason::NoCommand => "nothing was asked of it",
        StopReason::GoalReached => "the goal is reached",
        StopReason::Stop => "it was told to stop",
        StopReason::Cancelled => "the goal was cancelled",
        StopReason::TimeUp => "the goal's time was up",
        StopReason::SetpointExpired => "no setpoint arrived in time",
        StopReason::LinkLost => "the link to the router was lost",
        StopReason::SetpointZero => "the setpoint is zero",
        StopReason::ObstacleFront => "obstacle ahead",
        StopReason::ObstacleRear => "obstacle behind",
        StopReason::WanderPause => "wander's pause",
        StopReason::BoardLost => "the I/O board is lost",
        StopReason::GyroLost => "the gyro is lost",
        StopReason::RemoteNeutral => "the remote control drives, its stick is neutral",
        StopReason::RemoteLost => "the remote control is lost",
        StopReason::Estop => "somebody called an emergency stop",
        StopReason::RemoteTakeover => "the remote control took over",
        StopReason::Runaway => "the wheels ran away",
        StopReason::SensorFault => "a sensor failed",
        StopReason::BatteryCritical => "the battery is nearly empty",
        StopReason::LeaseExpired => "whoever drove it fell silent",
        StopReason::LeaseTaken => "somebody else took control",
        StopReason::LeaseReleased => "control was given back",
        StopReason::LoopStalled => "its control loop was held up",
        StopReason::Stalled => "the motor was driven and the wheels did not turn",
        StopReason::OverSpeed => "the remote control drives too fast for the obstacle rule",
        StopReason::ChangingDirection => "the wheels have yet to stand before it drives the other way",
        StopReason::Starting => "it has only just been told to drive",
        StopReason::Coasting => "it rolls as fast as it should by itself",
        StopReason::Planning => "a path is being planned",
        StopReason::WaitingForTraffic => "traffic control has released its way only as far as here",
        StopReason::GivingWay => "another robot goes first",
        StopReason::WayBlocked => "something that is not on the map is in its way",
        StopReason::PoseUncertain => "it does not know well enough where it is",
        StopReason::InKeepOut => "it stands in a keep-out zone",
        StopReason::AtCusp => "it changes gear",
    }
}

/// All reasons in one line.
pub(crate) fn reasons(all: &[StopReason]) -> String {
    all.iter().copied().map(reason).collect::<Vec<_>>().join(", ")
}
