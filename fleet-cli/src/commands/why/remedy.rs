//! What to do about each reason for a standstill.

use xtb_protocol::Name;
use xtb_protocol::messages::{Fault, Latch, LatchState, RobotState, StopReason};

/// What to do when nothing stands in the way any more.
pub(super) fn anew(robot: &Name) -> String {
    format!("give a new command, such as `fleet-cli goto {robot} X Y`")
}

/// What to do about a standstill for this reason; `None` = nothing, it ends by itself.
pub(super) fn of_reason(robot: &Name, reason: StopReason) -> Option<String> {
    use StopReason as R;
    let anew = || anew(robot);
    Some(match reason {
        R::NoCommand | R::GoalReached | R::Stop | R::Cancelled | R::TimeUp | R::LeaseReleased => anew(),
        // Their latches have been reset, or they would be shown instead.
        R::Estop | R::RemoteTakeover | R::Runaway | R::SensorFault | R::BatteryCritical => anew(),
        R::SetpointExpired => "hold the key or the joystick; if it was held, look at the link".to_owned(),
        R::LinkLost => "look at the network between robot and router: `fleet-cli doctor`".to_owned(),
        R::SetpointZero => "press a key or move the joystick".to_owned(),
        R::ObstacleFront => "clear the way ahead; if nothing is there any more, drive 5 cm astern".to_owned(),
        R::ObstacleRear => "clear the way behind; if nothing is there any more, drive 5 cm ahead".to_owned(),
        R::WanderPause | R::ChangingDirection | R::Starting | R::Coasting | R::Planning | R::AtCusp => {
            return None;
        }
        R::WaitingForTraffic => {
            "nothing, if the others move: `fleet-cli status` shows whom it waits for".to_owned()
        }
        R::GivingWay => {
            "nothing: it goes on when the other robot has passed, or round it if that one stands; \
                         `fleet-cli traffic serve` leads both"
                .to_owned()
        }
        R::WayBlocked => "clear its way; it looks for another one by itself".to_owned(),
        R::PoseUncertain => format!(
            "bring it pose fixes, or `fleet-cli stop {robot}`, then tell it where it is: \
             `fleet-cli set-pose {robot} X Y --yaw DEGREES`"
        ),
        R::InKeepOut => format!("drive it out by hand: `fleet-cli teleop {robot}`"),
        R::BoardLost => Fault::BoardSilent.remedy().to_owned(),
        R::GyroLost => Fault::GyroSilent.remedy().to_owned(),
        R::RemoteNeutral => {
            "drive it with the transmitter, or switch its selector to the computer".to_owned()
        }
        R::RemoteLost => Fault::RemoteLost.remedy().to_owned(),
        R::LeaseExpired => format!("its client died or lost its link: {}", anew()),
        R::LeaseTaken => format!("agree with whoever has control, or take it with --take; then {}", anew()),
        R::LoopStalled => format!("see what holds up the robot's computer; then {}", anew()),
        R::Stalled => Fault::Stalled.remedy().to_owned(),
        R::OverSpeed => "drive slower, or away from the obstacle".to_owned(),
    })
}

/// What to do about a latch.
pub(super) fn of_latch(robot: &Name, latch: &LatchState, state: &RobotState) -> String {
    let reset = format!(
        "`fleet-cli reset {robot} --latch {}`, then give a new command (a dispatcher needs none)",
        latch.latch
    );
    if !latch.present {
        return reset;
    }
    let fault =
        state.faults.iter().map(|state| state.fault).find(|fault| latch.by.contains(&fault.to_string()));
    let first = fault.map_or_else(|| of_cause(latch.latch), Fault::remedy);
    format!("first {first}; then {reset}")
}

/// What ends the cause of a latch, where no fault says more.
fn of_cause(latch: Latch) -> &'static str {
    match latch {
        Latch::Estop => "end whatever still calls for it",
        Latch::RemoteTakeover => "switch the transmitter's selector back to the computer",
        Latch::BoardLost => Fault::BoardSilent.remedy(),
        Latch::GyroLost => Fault::GyroSilent.remedy(),
        Latch::Runaway => Fault::Runaway.remedy(),
        Latch::SensorFault => "see to the sensor: `robot-agent check-hardware` shows each reading",
        Latch::BatteryCritical => Fault::BatteryCritical.remedy(),
    }
}
