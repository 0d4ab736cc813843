//! What a page asks for, and how it is answered.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use xtb_client::Error;
use xtb_identity::Action;
use xtb_protocol::Name;
use xtb_protocol::messages::{Latch, MapContent, MapPlace, MapZone, TaskId, TaskSpec, Via};

/// A message from the page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum FromPage {
    /// It has this frame.
    Seen(u64),
    /// Whose details it shows.
    Watch(Option<Name>),
    /// A command.
    Do(Order),
    /// The hand on the wheel.
    Setpoint(super::teleop::Hand),
}

/// A command and the page's number for it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Order {
    /// The answer bears it too.
    pub(super) id: u64,
    /// What.
    pub(super) command: Command,
}

/// What a page may ask for.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Command {
    /// Drive to a point, without staying with it.
    Goto {
        /// Who.
        robot: Name,
        /// East.
        x_m: f64,
        /// North.
        y_m: f64,
        /// On arrival.
        #[serde(default)]
        yaw_rad: Option<f64>,
        /// How; `None` = as the robot likes.
        #[serde(default)]
        via: Option<Via>,
        /// Take control from whoever has it.
        #[serde(default)]
        take: bool,
    },
    /// Tell a robot that stands where it is.
    SetPose {
        /// Whom.
        robot: Name,
        /// East.
        x_m: f64,
        /// North.
        y_m: f64,
        /// Counter-clockwise from +x.
        yaw_rad: f64,
        /// Take control from whoever has it.
        #[serde(default)]
        take: bool,
    },
    /// Drop goals and stand.
    Stop {
        /// `None` = all.
        robot: Option<Name>,
    },
    /// Stand, latched.
    Estop {
        /// `None` = all.
        robot: Option<Name>,
    },
    /// End latched stops.
    Reset {
        /// Whose.
        robot: Name,
        /// Take control from whoever has it.
        #[serde(default)]
        take: bool,
    },
    /// End the latched stops of every robot that has any.
    ResetAll {
        /// The latches that the person was shown, robot by robot: what was latched since stays so; `None` = all.
        #[serde(default)]
        shown: Option<BTreeMap<Name, Vec<Latch>>>,
    },
    /// No robot drives faster from now on.
    SpeedLimit {
        /// In m/s.
        mps: f64,
    },
    /// A task for the dispatcher.
    Submit {
        /// What.
        spec: Box<TaskSpec>,
    },
    /// End a task.
    Cancel {
        /// Which.
        task: TaskId,
    },
    /// Put a task aside.
    Pause {
        /// Which.
        task: TaskId,
    },
    /// Let a task go on that is paused or held.
    Resume {
        /// Which.
        task: TaskId,
    },
    /// Queue a task again that has failed or was cancelled.
    Retry {
        /// Which.
        task: TaskId,
    },
    /// Save other zones and places as a new version of the map.
    EditMap {
        /// What was edited.
        base: MapContent,
        /// All zones.
        zones: Vec<MapZone>,
        /// All places.
        places: Vec<MapPlace>,
        /// The reason.
        why: String,
    },
    /// Who changed the map, when and why.
    MapHistory {},
    /// Let the dispatcher assign tasks again after an emergency stop of all robots.
    Activate {},
    /// Take the tasks of other maps over to the fleet's.
    Adopt {},
    /// Say that alerts were seen.
    Acknowledge {
        /// Which.
        ids: Vec<u64>,
    },
    /// The newest events of the history with this in their words.
    Events {
        /// What.
        search: String,
    },
    /// Begin to drive by hand.
    Teleop {
        /// Whom.
        robot: Name,
        /// Take control from whoever has it.
        #[serde(default)]
        take: bool,
    },
    /// Let go of the wheel.
    TeleopEnd {},
}

impl Command {
    /// What it is called.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Goto { .. } => "goto",
            Self::SetPose { .. } => "set_pose",
            Self::Stop { .. } => "stop",
            Self::Estop { .. } => "estop",
            Self::Reset { .. } => "reset",
            Self::ResetAll { .. } => "reset_all",
            Self::SpeedLimit { .. } => "speed_limit",
            Self::Submit { .. } => "submit",
            Self::Cancel { .. } => "cancel",
            Self::Pause { .. } => "pause",
            Self::Resume { .. } => "resume",
            Self::Retry { .. } => "retry",
            Self::EditMap { .. } => "edit_map",
            Self::MapHistory {} => "map_history",
            Self::Activate {} => "activate",
            Self::Adopt {} => "adopt",
            Self::Acknowledge { .. } => "acknowledge",
            Self::Events { .. } => "events",
            Self::Teleop { .. } => "teleop",
            Self::TeleopEnd {} => "teleop_end",
        }
    }

    /// What whoever asks for it has to be allowed to do.
    pub(super) fn action(&self) -> Action {
        match self {
            Self::Estop { .. } => Action::EmergencyStop,
            Self::MapHistory {} => Action::Look,
            Self::EditMap { .. } => Action::ChangeMap,
            Self::Goto { .. }
            | Self::SetPose { .. }
            | Self::Stop { .. }
            | Self::Reset { .. }
            | Self::ResetAll { .. }
            | Self::SpeedLimit { .. }
            | Self::Teleop { .. }
            | Self::TeleopEnd {} => Action::Drive,
            Self::Submit { .. }
            | Self::Cancel { .. }
            | Self::Pause { .. }
            | Self::Resume { .. }
            | Self::Retry { .. }
            | Self::Activate {}
            | Self::Adopt {}
            | Self::Acknowledge { .. } => Action::ChangeTasks,
            Self::Events { .. } => Action::Look,
        }
    }

    /// Which robot it is for; `None` = all, or it is for the dispatcher.
    pub(super) fn robot(&self) -> Option<&Name> {
        match self {
            Self::Goto { robot, .. }
            | Self::SetPose { robot, .. }
            | Self::Reset { robot, .. }
            | Self::Teleop { robot, .. } => Some(robot),
            Self::Stop { robot } | Self::Estop { robot } => robot.as_ref(),
            Self::ResetAll { .. }
            | Self::SpeedLimit { .. }
            | Self::Submit { .. }
            | Self::Cancel { .. }
            | Self::Pause { .. }
            | Self::Resume { .. }
            | Self::Retry { .. }
            | Self::EditMap { .. }
            | Self::MapHistory {}
            | Self::Activate {}
            | Self::Adopt {}
            | Self::Acknowledge { .. }
            | Self::Events { .. }
            | Self::TeleopEnd {} => None,
        }
    }
}

/// What came of a command.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Answer {
    id: u64,
    #[serde(flatten)]
    result: Outcome,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Outcome {
    Ok(Value),
    Error(Wrong),
}

/// Why it was not done.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Wrong {
    code: String,
    message: String,
    hint: String,
}

impl Answer {
    /// How it went.
    pub(super) fn new(id: u64, result: Result<Value, Error>) -> Self {
        let result = match result {
            Ok(value) => Outcome::Ok(value),
            Err(Error { kind, message, hint }) => Outcome::Error(Wrong { code: kind.code(), message, hint }),
        };
        Self { id, result }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use xtb_client::ErrorKind;

    fn read(text: &str) -> Option<FromPage> {
        serde_json::from_str(text).ok()
    }

    #[test]
    fn a_page_says_what_the_document_says() {
        for text in [
            r#"{"seen": 7}"#,
            r#"{"watch": "xtb-1"}"#,
            r#"{"watch": null}"#,
            r#"{"do": {"id": 1, "command": {"goto": {"robot": "xtb-1", "x_m": 1, "y_m": -2, "yaw_rad": null}}}}"#,
            r#"{"do": {"id": 1, "command": {"goto": {"robot": "xtb-1", "x_m": 1, "y_m": 2, "take": true}}}}"#,
            r#"{"do": {"id": 2, "command": {"stop": {"robot": null}}}}"#,
            r#"{"do": {"id": 3, "command": {"estop": {"robot": "xtb-2"}}}}"#,
            r#"{"do": {"id": 4, "command": {"reset": {"robot": "xtb-2"}}}}"#,
            r#"{"do": {"id": 4, "command": {"speed_limit": {"mps": 0.2}}}}"#,
            r#"{"do": {"id": 4, "command": {"reset": {"robot": "xtb-2", "take": true}}}}"#,
            r#"{"do": {"id": 5, "command": {"submit": {"spec": {"kind": {"wander": {"for_s": 5}}}}}}}"#,
            r#"{"do": {"id": 6, "command": {"cancel": {"task": "t17"}}}}"#,
            r#"{"do": {"id": 7, "command": {"teleop": {"robot": "xtb-1", "take": false}}}}"#,
            r#"{"do": {"id": 8, "command": {"teleop_end": {}}}}"#,
            r#"{"do": {"id": 9, "command": {"acknowledge": {"ids": [3, 5]}}}}"#,
            r#"{"do": {"id": 10, "command": {"events": {"search": "xtb-1"}}}}"#,
            r#"{"do": {"id": 9, "command": {"set_pose": {"robot": "xtb-1", "x_m": 1, "y_m": 2, "yaw_rad": 0.5}}}}"#,
            r#"{"do": {"id": 9, "command": {"retry": {"task": "t17"}}}}"#,
            r#"{"do": {"id": 9, "command": {"map_history": {}}}}"#,
            r#"{"do": {"id": 9, "command": {"edit_map": {"base": {"map": "17ac03f87e077be9", "places": "00ac03f87e077be9"}, "why": "a crane",
               "zones": [{"name": "crane", "kind": "keep_out", "points": [[0, 0], [1, 0], [1, 1]]}],
               "places": [{"name": "dock-1", "x_m": 1, "y_m": 2}]}}}}"#,
            r#"{"setpoint": {"seq": 1, "seen": 7, "throttle": 0.5, "steering": -1}}"#,
        ] {
            assert!(read(text).is_some(), "{text}");
        }
    }

    #[test]
    fn what_is_not_whole_or_not_ours_is_not_read() {
        for text in [
            "",
            "7",
            "null",
            r#"{"seen": -1}"#,
            r#"{"seen": 1, "watch": null}"#,
            r#"{"watch": "../x"}"#,
            r#"{"do": {"command": {"stop": {"robot": null}}}}"#,
            r#"{"do": {"id": 1, "command": {"set_pose": {}}}}"#,
            r#"{"do": {"id": 1, "command": {"goto": {"robot": "xtb-1", "x_m": null, "y_m": 1}}}}"#,
            r#"{"do": {"id": 1, "command": {"goto": {"robot": "xtb-1", "x_m": 1, "y_m": 1, "fast": true}}}}"#,
            r#"{"setpoint": {"seq": 1, "throttle": 1, "steering": 0}}"#,
        ] {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn an_answer_bears_the_commands_number() {
        let answer = |result| serde_json::to_value(Answer::new(7, result)).unwrap();
        assert_eq!(answer(Ok(json!({ "a": 1 }))), json!({ "id": 7, "ok": { "a": 1 } }));
        let failure = Error::new(ErrorKind::Failed, "no").hint("wait");
        let error = json!({ "code": "failed", "message": "no", "hint": "wait" });
        assert_eq!(answer(Err(failure)), json!({ "id": 7, "error": error }));
    }
}
