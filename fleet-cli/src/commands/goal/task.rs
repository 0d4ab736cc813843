//! What a goal asks of a robot, and how to speak of it.

use crate::describe;
use std::time::Duration;
use xtb_protocol::Name;
use xtb_protocol::messages::{Body, LinkLoss, Via};

/// A goal that outlives this client may take this long (the robot's own default too).
const FINISH_WITHIN: Duration = Duration::from_secs(300);

/// What a goal is for.
pub(in crate::commands) enum Aim {
    /// Drive to a point of the map.
    Point {
        /// East.
        x_m: f64,
        /// North.
        y_m: f64,
        /// On arrival.
        yaw_rad: Option<f64>,
        /// How; `None` = as the robot likes.
        via: Option<Via>,
    },
    /// Wander.
    Wander {
        /// `None` = until it is stopped.
        lasting: Option<Duration>,
    },
}

/// What to drive.
pub(in crate::commands) struct Task {
    /// Which robot.
    pub(in crate::commands) robot: Name,
    /// What for.
    pub(in crate::commands) aim: Aim,
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
    /// A goal that has a limit, or that outlives this client, is bounded by the robot's own clock too.
    pub(super) fn on_link_loss(&self) -> LinkLoss {
        let usual = if self.wait && self.within.is_none() { LinkLoss::Halt } else { LinkLoss::Finish };
        self.on_link_loss.unwrap_or(usual)
    }

    fn finish_s(&self) -> f64 {
        self.within.unwrap_or(FINISH_WITHIN).as_secs_f64()
    }

    /// The request.
    pub(super) fn body(&self) -> Body {
        let (on_link_loss, finish_s) = (self.on_link_loss(), self.finish_s());
        match self.aim {
            Aim::Point { x_m, y_m, yaw_rad, via } => {
                Body::Goto { x_m, y_m, yaw_rad, via, on_link_loss, finish_s }
            }
            Aim::Wander { lasting } => {
                let for_s = lasting.map(|lasting| lasting.as_secs_f64());
                // The shorter of the two ends it.
                Body::Wander { for_s, on_link_loss, finish_s: for_s.map_or(finish_s, |s| s.max(finish_s)) }
            }
        }
    }

    /// The goal in a word or two.
    pub(in crate::commands) fn words(&self) -> String {
        match self.aim {
            Aim::Point { x_m, y_m, .. } => {
                format!("({}, {})", describe::fixed(x_m, 2), describe::fixed(y_m, 2))
            }
            Aim::Wander { .. } => "wander".to_owned(),
        }
    }

    /// What the robot does once nobody is with it.
    pub(in crate::commands) fn alone(&self) -> String {
        let robot = &self.robot;
        match (self.on_link_loss(), &self.aim) {
            (LinkLoss::Halt, _) => format!("{robot} stops by itself within 0.7 s"),
            (LinkLoss::Finish, Aim::Point { .. }) => {
                format!("{robot} goes on to its goal (finish, at most {} s)", self.finish_s())
            }
            (LinkLoss::Finish, Aim::Wander { lasting }) => {
                let seconds = lasting.map_or(self.finish_s(), |lasting| lasting.as_secs_f64());
                format!("{robot} goes on wandering (finish, at most {seconds} s)")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn task(wait: bool, within_s: Option<u64>) -> Task {
        let aim = Aim::Point { x_m: 1.0, y_m: 2.0, yaw_rad: None, via: None };
        let robot = Name::new("xtb-1").unwrap();
        let within = within_s.map(Duration::from_secs);
        Task { robot, aim, within, wait, on_link_loss: None, take: false }
    }

    #[test]
    fn a_goal_is_bounded_by_the_robot_unless_its_client_waits_without_a_limit() {
        for (wait, within, policy, seconds, alone) in [
            (false, None, LinkLoss::Finish, 300.0, "goes on to its goal (finish, at most 300 s)"),
            (false, Some(7), LinkLoss::Finish, 7.0, "at most 7 s"),
            (true, Some(7), LinkLoss::Finish, 7.0, "at most 7 s"),
            (true, None, LinkLoss::Halt, 300.0, "stops by itself"),
        ] {
            let task = task(wait, within);
            let Body::Goto { on_link_loss, finish_s, .. } = task.body() else { panic!() };
            assert_eq!((on_link_loss, finish_s), (policy, seconds), "wait {wait}, within {within:?}");
            assert!(task.alone().contains(alone), "{}", task.alone());
        }
    }

    #[test]
    fn what_is_said_of_a_lost_link_counts() {
        for policy in [LinkLoss::Halt, LinkLoss::Finish] {
            for wait in [false, true] {
                let task = Task { on_link_loss: Some(policy), ..task(wait, None) };
                let Body::Goto { on_link_loss, .. } = task.body() else { panic!() };
                assert_eq!(on_link_loss, policy, "wait {wait}");
            }
        }
    }
}
