//! The one table of what a robot offers and takes, with types and QoS. Names without a slash in front are in the
//! robot's namespace.

use crate::qos::Qos;
use crate::token::Kind;
use crate::types::{
    BatteryState, CancelGoal, Clock, DiagnosticArray, Distro, GetResult, GoalStatusArray, Imu, Message,
    OccupancyGrid, Odometry, Path, PoseStamped, PoseWithCovarianceStamped, Range, RosType, SendGoal, Service,
    Text, TfMessage, Trigger, Twist, TwistStamped,
};
use xtb_control::vehicle::SLOTS;

/// The name of a robot's node, in its namespace.
pub const NODE: &str = "xtb_agent";

/// A topic or a service, and which end of it is ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Channel {
    /// Our end.
    pub kind: Kind,
    /// Its name; resolved in the robot's namespace ([`crate::RosName::resolve`]).
    pub name: &'static str,
    /// Its type.
    pub ros_type: RosType,
    /// Its QoS.
    pub qos: Qos,
}

const fn published<M: Message>(name: &'static str, qos: Qos) -> Channel {
    Channel { kind: Kind::Publisher, name, ros_type: M::TYPE, qos }
}

const fn heard<M: Message>(name: &'static str) -> Channel {
    Channel { kind: Kind::Subscription, name, ros_type: M::TYPE, qos: Qos::DEFAULT }
}

const fn served<S: Service>(name: &'static str) -> Channel {
    Channel { kind: Kind::Server, name, ros_type: S::TYPE, qos: Qos::DEFAULT }
}

/// Where the odometry has it, 20 Hz.
pub const ODOM: Channel = published::<Odometry>("odom", Qos::DEFAULT);
/// Its moving frames, 20 Hz.
pub const TF: Channel = published::<TfMessage>("/tf", Qos::TF);
/// Its fixed frames.
pub const TF_STATIC: Channel = published::<TfMessage>("/tf_static", Qos::LATCHED);
/// Its URDF.
pub const ROBOT_DESCRIPTION: Channel = published::<Text>("robot_description", Qos::LATCHED);
/// Its gyro.
pub const IMU: Channel = published::<Imu>("imu", Qos::SENSOR);
/// Its range finders, on the front and on the rear bumper, left to right seen from above with the truck pointing up; a
/// robot offers those that are fitted.
pub const RANGES: [[Channel; SLOTS]; 2] = [
    [
        published::<Range>("range/front_0", Qos::SENSOR),
        published::<Range>("range/front_1", Qos::SENSOR),
        published::<Range>("range/front_2", Qos::SENSOR),
        published::<Range>("range/front_3", Qos::SENSOR),
        published::<Range>("range/front_4", Qos::SENSOR),
        published::<Range>("range/front_5", Qos::SENSOR),
        published::<Range>("range/front_6", Qos::SENSOR),
        published::<Range>("range/front_7", Qos::SENSOR),
    ],
    [
        published::<Range>("range/rear_0", Qos::SENSOR),
        published::<Range>("range/rear_1", Qos::SENSOR),
        published::<Range>("range/rear_2", Qos::SENSOR),
        published::<Range>("range/rear_3", Qos::SENSOR),
        published::<Range>("range/rear_4", Qos::SENSOR),
        published::<Range>("range/rear_5", Qos::SENSOR),
        published::<Range>("range/rear_6", Qos::SENSOR),
        published::<Range>("range/rear_7", Qos::SENSOR),
    ],
];
/// Its battery, 1 Hz.
pub const BATTERY_STATE: Channel = published::<BatteryState>("battery_state", Qos::DEFAULT);
/// How it is, 1 Hz and with each change.
pub const DIAGNOSTICS: Channel = published::<DiagnosticArray>("/diagnostics", Qos::DEFAULT);
/// The path that it drives along.
pub const PLAN: Channel = published::<Path>("plan", Qos::LATCHED);
/// Velocity commands with a time.
pub const CMD_VEL_STAMPED: Channel = heard::<TwistStamped>("cmd_vel");
/// The same without one; the name is the same, the key is not.
pub const CMD_VEL: Channel = heard::<Twist>("cmd_vel");
/// RViz's tool "2D Goal Pose".
pub const GOAL_POSE: Channel = heard::<PoseStamped>("goal_pose");
/// RViz's tool "2D Pose Estimate".
pub const INITIAL_POSE: Channel = heard::<PoseWithCovarianceStamped>("initialpose");
/// Send a goal of `navigate_to_pose`.
pub const SEND_GOAL: Channel = served::<SendGoal>("navigate_to_pose/_action/send_goal");
/// Wait for how it ends.
pub const GET_RESULT: Channel = served::<GetResult>("navigate_to_pose/_action/get_result");
/// End it.
pub const CANCEL_GOAL: Channel = served::<CancelGoal>("navigate_to_pose/_action/cancel_goal");
/// How all goals stand.
pub const GOAL_STATUS: Channel =
    published::<GoalStatusArray>("navigate_to_pose/_action/status", Qos::LATCHED);
/// Stand.
pub const STOP: Channel = served::<Trigger>("stop");
/// Emergency stop.
pub const ESTOP: Channel = served::<Trigger>("estop");
/// End latched stops.
pub const RESET: Channel = served::<Trigger>("reset");
/// Take the lease from whoever holds it.
pub const TAKE_CONTROL: Channel = served::<Trigger>("take_control");
/// Give it back.
pub const RELEASE_CONTROL: Channel = served::<Trigger>("release_control");

/// The fleet's map; one publisher for all.
pub const MAP: Channel = published::<OccupancyGrid>("/map", Qos::LATCHED);
/// Emergency stop of all robots; one server for all.
pub const FLEET_ESTOP: Channel = served::<Trigger>("/estop");
/// The simulator's time, where that is not the wall clock.
pub const CLOCK: Channel = published::<Clock>("/clock", Qos::CLOCK);

/// How a goal of `navigate_to_pose` goes; its type differs between releases.
#[must_use]
pub fn feedback(distro: Distro) -> Channel {
    let ros_type = distro.feedback_type();
    Channel { kind: Kind::Publisher, name: "navigate_to_pose/_action/feedback", ros_type, qos: Qos::DEFAULT }
}

/// Everything that a robot offers and takes.
pub fn robot(distro: Distro) -> impl Iterator<Item = Channel> {
    let published =
        [ODOM, TF, TF_STATIC, ROBOT_DESCRIPTION, IMU, BATTERY_STATE, DIAGNOSTICS, PLAN, GOAL_STATUS];
    let heard = [CMD_VEL_STAMPED, CMD_VEL, GOAL_POSE, INITIAL_POSE];
    let served = [SEND_GOAL, GET_RESULT, CANCEL_GOAL, STOP, ESTOP, RESET, TAKE_CONTROL, RELEASE_CONTROL];
    published
        .into_iter()
        .chain([feedback(distro)])
        .chain(RANGES.into_iter().flatten())
        .chain(heard)
        .chain(served)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Key, RosName};
    use std::collections::BTreeSet;

    #[test]
    fn every_channel_has_a_key_of_its_own_that_ros_accepts() {
        let namespace = RosName::new("/xtb_1").unwrap();
        let all = || robot(Distro::Lyrical).chain([MAP, FLEET_ESTOP, CLOCK]);
        let keys: BTreeSet<Key> =
            all().map(|it| Key::new(0, namespace.resolve(it.name).unwrap(), it.ros_type)).collect();
        assert_eq!((keys.len(), all().count()), (41, 41));
        assert!(keys.iter().all(|key| key.to_string().parse::<Key>().as_ref() == Ok(key)));
    }

    #[test]
    fn only_the_feedback_differs_between_releases() {
        let of = |distro| robot(distro).collect::<Vec<_>>();
        assert_eq!(of(Distro::Jazzy), of(Distro::Kilted));
        let pairs = of(Distro::Kilted).into_iter().zip(of(Distro::Lyrical));
        assert_eq!(
            pairs.filter(|(a, b)| a != b).map(|(a, _)| a).collect::<Vec<_>>(),
            [feedback(Distro::Kilted)]
        );
    }
}
