//! Instant actions and how they stand.

use crate::incoming::Action;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// States that are kept; of more, the oldest that have ended are forgotten.
pub const MAX_STATES: usize = 64;

/// How an action stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum Status {
    /// Not begun.
    Waiting,
    /// Under way.
    Running,
    /// Done.
    Finished,
    /// Could not be done.
    Failed,
}

impl Status {
    /// Whether it has ended.
    #[must_use]
    pub fn is_final(self) -> bool {
        matches!(self, Self::Finished | Self::Failed)
    }
}

/// What is asked for, of what is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wish {
    /// End the order.
    Cancel,
    /// Stop until `stopPause`.
    Pause,
    /// Go on.
    Unpause,
    /// Send a state.
    State,
    /// Send the factsheet.
    Factsheet,
    /// Forget the instant actions that have ended.
    Clear,
    /// Set the pose.
    Pose {
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
        /// Counter-clockwise from +x.
        yaw_rad: f64,
        /// On which map.
        map_id: String,
        /// The node there, if it is one.
        last_node_id: Option<String>,
    },
}

impl Wish {
    /// What an action asks for.
    ///
    /// # Errors
    /// It is not known, or lacks a parameter.
    pub fn of(action: &Action) -> Result<Self, String> {
        let number = |key: &str| {
            let value = action.parameter(key).and_then(Value::as_f64).filter(|value| value.is_finite());
            value.ok_or_else(|| format!("{} needs the number {key}", action.action_type))
        };
        let text = |key: &str| action.parameter(key).and_then(Value::as_str).map(str::to_owned);
        Ok(match action.action_type.as_str() {
            "cancelOrder" => Self::Cancel,
            "startPause" => Self::Pause,
            "stopPause" => Self::Unpause,
            "stateRequest" => Self::State,
            "factsheetRequest" => Self::Factsheet,
            "clearInstantActions" => Self::Clear,
            "initPosition" | "initializePosition" => Self::Pose {
                x_m: number("x")?,
                y_m: number("y")?,
                yaw_rad: number("theta")?,
                map_id: text("mapId").ok_or_else(|| "the parameter mapId is missing".to_owned())?,
                last_node_id: text("lastNodeId").filter(|id| !id.is_empty()),
            },
            _ => return Err("unknown instant action".to_owned()),
        })
    }
}

/// An instant action that was received.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActionState {
    /// Its name.
    pub id: String,
    /// Which.
    pub kind: String,
    /// How it stands.
    pub status: Status,
    /// Why it has failed.
    pub result: Option<String>,
    /// What is still to be done for it.
    pub wish: Option<Wish>,
}

impl ActionState {
    /// It has ended so.
    pub fn end(&mut self, result: Result<(), String>) {
        self.wish = None;
        self.status = if result.is_ok() { Status::Finished } else { Status::Failed };
        self.result = result.err();
    }

    /// As it stands in a state.
    #[must_use]
    pub fn view(&self, is_v3: bool) -> Value {
        let mut view = json!({"actionId": self.id, "actionType": self.kind, "actionStatus": self.status});
        if let Some(result) = &self.result {
            view[if is_v3 { "actionResult" } else { "resultDescription" }] = json!(result);
        }
        view
    }
}

/// Forgets the oldest that have ended, so that there is room for one more. `false` = all are under way.
pub fn make_room(states: &mut Vec<ActionState>) -> bool {
    if states.len() < MAX_STATES {
        return true;
    }
    let oldest = states.iter().position(|state| state.status.is_final());
    oldest.map(|oldest| states.remove(oldest)).is_some()
}
