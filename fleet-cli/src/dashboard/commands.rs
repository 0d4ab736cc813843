//! What a page asks for, and how it is answered.

use crate::error::Failure;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use xtb_protocol::Name;
use xtb_protocol::messages::{TaskId, TaskSpec, Via};

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
    pub(super) fn new(id: u64, result: Result<Value, Failure>) -> Self {
        let result = match result {
            Ok(value) => Outcome::Ok(value),
            Err(Failure { kind, message, hint }) => {
                Outcome::Error(Wrong { code: kind.code(), message, hint })
            }
        };
        Self { id, result }
    }
}
