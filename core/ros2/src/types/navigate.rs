//! The action `navigate_to_pose`: its services and topics, and the forms that differ between releases of ROS.

use super::{Duration, PoseStamped, RosType, Time, cdr_structs, services};
use crate::cdr::to_bytes;

/// Nav2's code for a goal that was not reached, for no reason that has a number of its own: UNKNOWN (9000; Jazzy has
/// no name for it).
pub const ERROR_UNKNOWN: u16 = 9000;

/// The id that a client gives a goal; all zeros = none.
pub type GoalId = [u8; 16];

/// How a goal stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(i8)]
pub enum Status {
    /// There is no such goal.
    Unknown = 0,
    /// Taken, not yet begun.
    Accepted = 1,
    /// Under way.
    Executing = 2,
    /// Told to end, not yet ended.
    Canceling = 3,
    /// Reached.
    Succeeded = 4,
    /// Ended as it was told to.
    Canceled = 5,
    /// Ended otherwise.
    Aborted = 6,
}

/// What a request to cancel came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(i8)]
pub enum CancelCode {
    /// The goals that are listed will end.
    None = 0,
    /// No.
    Rejected = 1,
    /// There is no such goal.
    UnknownGoal = 2,
    /// That goal has ended already.
    Terminated = 3,
}

cdr_structs! {
    /// A goal and when it was accepted.
    GoalInfo {
        /// Which.
        goal_id: GoalId,
        /// When.
        stamp: Time,
    }

    /// How a goal stands.
    GoalStatusEntry {
        /// Which.
        goal_info: GoalInfo,
        /// See [`Status`].
        status: i8,
    }

    /// How all goals stand.
    ["action_msgs/msg/GoalStatusArray", "6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e"]
    GoalStatusArray {
        /// The goals.
        status_list: Vec<GoalStatusEntry>,
    }

    /// Which goals shall end: without id and stamp all, with a stamp those accepted up to it.
    CancelGoalRequest {
        /// Which.
        goal_info: GoalInfo,
    }

    /// Which goals will end.
    CancelGoalResponse {
        /// See [`CancelCode`].
        return_code: i8,
        /// The goals.
        goals_canceling: Vec<GoalInfo>,
    }

    /// Drive there.
    SendGoalRequest {
        /// Chosen by the client.
        goal_id: GoalId,
        /// Where to.
        pose: PoseStamped,
        /// Of Nav2; nothing of ours.
        behavior_tree: String,
    }

    /// Whether it will.
    SendGoalResponse {
        /// Whether.
        accepted: bool,
        /// When.
        stamp: Time,
    }

    /// How did it end?
    GetResultRequest {
        /// Which.
        goal_id: GoalId,
    }

    /// How it ended.
    GetResultResponse {
        /// See [`Status`].
        status: i8,
        /// 0 = none; else [`ERROR_UNKNOWN`].
        error_code: u16,
        /// In words.
        error_msg: String,
    }

    /// How it goes, as far as all releases have it.
    NavigateFeedback {
        /// Which.
        goal_id: GoalId,
        /// Where the robot is.
        current_pose: PoseStamped,
        /// Since the start.
        navigation_time: Duration,
        /// Still to come.
        estimated_time_remaining: Duration,
        /// Recoveries so far.
        number_of_recoveries: i16,
        /// Still to go, in m.
        distance_remaining: f32,
    }

    /// How it goes, from Lyrical on.
    LyricalFeedback {
        /// What all have.
        feedback: NavigateFeedback,
        /// Beside the path, in m.
        position_tracking_error: f32,
        /// Against the path's heading, in rad.
        heading_tracking_error: f32,
    }
}

services! {
    /// `<action>/_action/cancel_goal`.
    ["action_msgs/srv/CancelGoal", "573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a"]
    CancelGoal: CancelGoalRequest => CancelGoalResponse;

    /// `<action>/_action/send_goal`.
    ["nav2_msgs/action/NavigateToPose_SendGoal", "a4fcb3bee1bf32e21a0e541a943b221aa0826996e2c98f079b47022b256f48b5"]
    SendGoal: SendGoalRequest => SendGoalResponse;

    /// `<action>/_action/get_result`.
    ["nav2_msgs/action/NavigateToPose_GetResult", "c407920357d566771e8882b4ef4d1f1a84ee922d609920ccd57faa6d6e391dc5"]
    GetResult: GetResultRequest => GetResultResponse;
}

/// A release of ROS 2, as far as NavigateToPose differs between them. Humble has no hashes and other layouts: it is
/// not spoken here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Distro {
    /// 2024.
    Jazzy,
    /// 2025.
    #[default]
    Kilted,
    /// 2026, and Rolling.
    Lyrical,
}

impl Distro {
    /// What the settings call it.
    #[must_use]
    pub fn of(text: &str) -> Option<Self> {
        match text {
            "jazzy" => Some(Self::Jazzy),
            "kilted" => Some(Self::Kilted),
            "lyrical" | "rolling" => Some(Self::Lyrical),
            _ => None,
        }
    }

    /// The type of `<action>/_action/feedback`.
    #[must_use]
    pub fn feedback_type(self) -> RosType {
        let hash = match self {
            Self::Jazzy | Self::Kilted => {
                "RIHS01_9d1f6fa2eb975ce733b419ac2e97b134d8ff92b6478b6559feed9a50bdfd82b3"
            }
            Self::Lyrical => "RIHS01_2c1b4ec1a0e3a53c9aa326aabe717670eeef0ff3d4c3351ff940613b2011728a",
        };
        RosType { name: "nav2_msgs/action/NavigateToPose_FeedbackMessage", hash }
    }

    /// The feedback's bytes. `off_m` (beside the path) and `off_rad` (against its heading) are left out where the
    /// release does not know them.
    #[must_use]
    pub fn feedback(self, feedback: NavigateFeedback, off_m: f32, off_rad: f32) -> Vec<u8> {
        match self {
            Self::Jazzy | Self::Kilted => to_bytes(&feedback),
            Self::Lyrical => to_bytes(&LyricalFeedback {
                feedback,
                position_tracking_error: off_m,
                heading_tracking_error: off_rad,
            }),
        }
    }
}
