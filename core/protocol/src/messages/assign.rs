//! What binds a robot to a task of the dispatcher, over leases, lost messages and restarts.
//!
//! Each assignment has a number of its own, and each drive within it another one; together they are
//! the order that a robot goes by: lower is refused, equal acknowledged again, higher replaces.

use super::{TaskId, Via, angle, bounded, coordinate};
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Largest ledger number: 48 bits.
pub const MAX_LEDGER: u64 = (1 << 48) - 1;
/// Largest number of an assignment: 40 bits.
pub const MAX_ASSIGN_SEQ: u64 = (1 << 40) - 1;
/// Largest number of a leg: 22 bits.
pub const MAX_LEG: u32 = (1 << 22) - 1;

/// One drive of a task on a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Assignment {
    /// The ledger that the task stands in, random at its making, at most 48 bits.
    pub ledger: u64,
    /// The task.
    pub task: TaskId,
    /// Number of the assignment; of two of a ledger the later has the higher one.
    pub assign_seq: u64,
    /// Which of the task's drives, counted from 0 over all its rounds.
    pub leg: u32,
}

impl Assignment {
    /// The id of its goal, the same whoever asks: the state shows by it which assignment runs.
    #[must_use]
    pub fn goal_id(&self) -> Uuid {
        let ledger = self.ledger & MAX_LEDGER;
        let number = ((self.assign_seq & MAX_ASSIGN_SEQ) << 22) | u64::from(self.leg & MAX_LEG);
        Uuid::from_u64_pair((ledger << 16) | 0x8000, (0b10 << 62) | number)
    }

    /// Number of assignment and leg of a goal, if it is one of this ledger.
    #[must_use]
    pub fn of_goal(ledger: u64, goal: Uuid) -> Option<(u64, u32)> {
        let (high, low) = goal.as_u64_pair();
        let ours = high == (((ledger & MAX_LEDGER) << 16) | 0x8000) && low >> 62 == 0b10;
        let number = low & ((1 << 62) - 1);
        ours.then(|| (number >> 22, u32::try_from(number & u64::from(MAX_LEG)).unwrap_or(MAX_LEG)))
    }

    pub(super) fn validate(&self) -> Result<(), CodecError> {
        bounded("ledger", self.ledger as f64, 0.0, MAX_LEDGER as f64, "")?;
        bounded("assign_seq", self.assign_seq as f64, 0.0, MAX_ASSIGN_SEQ as f64, "")?;
        bounded("leg", f64::from(self.leg), 0.0, f64::from(MAX_LEG), "")
    }
}

/// What an assigned robot does.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename = "Errand", rename_all = "snake_case", deny_unknown_fields)] // its name in schemas
pub enum TaskAction {
    /// As the request `goto`.
    Goto {
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
        /// Yaw on arrival, counter-clockwise from +x.
        #[serde(default)]
        yaw_rad: Option<f64>,
        /// How; `None` = planned as soon as the robot has a map, else direct.
        #[serde(default)]
        via: Option<Via>,
    },
    /// As the request `wander`.
    Wander {
        /// How long, in s.
        for_s: f64,
    },
}

impl TaskAction {
    pub(super) fn validate(&self) -> Result<(), CodecError> {
        match self {
            Self::Goto { x_m, y_m, yaw_rad, .. } => {
                coordinate("x_m", *x_m)?;
                coordinate("y_m", *y_m)?;
                yaw_rad.map_or(Ok(()), |yaw_rad| angle("yaw_rad", yaw_rad))
            }
            Self::Wander { for_s } => bounded("for_s", *for_s, 0.0, 86_400.0, "s"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_goal_says_which_assignment_it_is_of() {
        for (assign_seq, leg) in [(0, 0), (1, 2), (MAX_ASSIGN_SEQ, MAX_LEG)] {
            let assignment = Assignment { ledger: 0x1234_5678_9abc, task: TaskId::new(7), assign_seq, leg };
            let goal = assignment.goal_id();
            assert_eq!((goal.get_version_num(), goal.get_variant()), (8, uuid::Variant::RFC4122));
            assert_eq!(Assignment::of_goal(assignment.ledger, goal), Some((assign_seq, leg)));
            assert_eq!(Assignment::of_goal(assignment.ledger + 1, goal), None);
        }
        assert_eq!(Assignment::of_goal(0, Uuid::nil()), None);
    }
}
