//! A goal as the verbs ask for it, and how to speak of it.

use std::time::Duration;
use xtb_client::goal::{GoalRequest, GoalTarget};
use xtb_protocol::Name;
use xtb_protocol::messages::LinkLoss;

/// What to drive.
pub(in crate::commands) struct Task {
    /// Which robot.
    pub(in crate::commands) robot: Name,
    /// What for.
    pub(in crate::commands) target: GoalTarget,
    /// How long it may take.
    pub(in crate::commands) within: Option<Duration>,
    /// Follow it to its end.
    pub(in crate::commands) wait: bool,
    /// What the robot does when this client falls silent; `None` = halt while it is waited for, else finish.
    pub(in crate::commands) on_link_loss: Option<LinkLoss>,
    /// Take control from whoever has it.
    pub(in crate::commands) take: bool,
}

impl Task {
    /// The request. A goal that has a limit, or that outlives this client, is bounded by the robot's own clock too.
    pub(super) fn request(&self) -> GoalRequest {
        let usual = if self.wait && self.within.is_none() { LinkLoss::Halt } else { LinkLoss::Finish };
        let on_link_loss = self.on_link_loss.unwrap_or(usual);
        GoalRequest { target: self.target, within: self.within, on_link_loss }
    }

    /// What the robot does once nobody is with it.
    pub(super) fn alone(&self) -> String {
        let (robot, request) = (&self.robot, self.request());
        match (request.on_link_loss, self.target) {
            (LinkLoss::Halt, _) => format!("{robot} stops by itself within 0.7 s"),
            (LinkLoss::Finish, GoalTarget::Point { .. }) => {
                format!("{robot} continues to its goal (finish, at most {} s)", request.finish_s())
            }
            (LinkLoss::Finish, GoalTarget::Wander { lasting }) => {
                let seconds = lasting.map_or(request.finish_s(), |lasting| lasting.as_secs_f64());
                format!("{robot} continues wandering (finish, at most {seconds} s)")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::messages::Body;

    fn task(wait: bool, within_s: Option<u64>) -> Task {
        let target = GoalTarget::Point { x_m: 1.0, y_m: 2.0, yaw_rad: None, via: None };
        let robot = Name::new("xtb-1").unwrap();
        let within = within_s.map(Duration::from_secs);
        Task { robot, target, within, wait, on_link_loss: None, take: false }
    }

    #[test]
    fn a_goal_is_bounded_by_the_robot_unless_its_client_waits_without_a_limit() {
        for (wait, within, policy, seconds, alone) in [
            (false, None, LinkLoss::Finish, 300.0, "continues to its goal (finish, at most 300 s)"),
            (false, Some(7), LinkLoss::Finish, 7.0, "at most 7 s"),
            (true, Some(7), LinkLoss::Finish, 7.0, "at most 7 s"),
            (true, None, LinkLoss::Halt, 300.0, "stops by itself"),
        ] {
            let task = task(wait, within);
            let Body::Goto { on_link_loss, finish_s, .. } = task.request().body() else { panic!() };
            assert_eq!((on_link_loss, finish_s), (policy, seconds), "wait {wait}, within {within:?}");
            assert!(task.alone().contains(alone), "{}", task.alone());
        }
    }

    #[test]
    fn what_is_said_of_a_lost_link_counts() {
        for policy in [LinkLoss::Halt, LinkLoss::Finish] {
            for wait in [false, true] {
                let task = Task { on_link_loss: Some(policy), ..task(wait, None) };
                let Body::Goto { on_link_loss, .. } = task.request().body() else { panic!() };
                assert_eq!(on_link_loss, policy, "wait {wait}");
            }
        }
    }
}
