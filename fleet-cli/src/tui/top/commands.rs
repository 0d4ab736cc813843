//! What was asked of robots: under way, and what came of it.
//!
//! Bounded: one command of a kind for each robot, and [`MOST_UNDER_WAY`] altogether; one more is refused
//! with a word. Stops are never refused: one that is asked again while it is under way begins anew.

use crate::output::Tone;
use std::collections::VecDeque;
use xtb_client::scene::AtMs;
use xtb_protocol::messages::TaskId;
use xtb_protocol::{Name, Uuid};

/// Under way at once, stops not counted.
pub(super) const MOST_UNDER_WAY: usize = 16;
/// Outcomes that stay readable; the oldest go first.
const NOTICES: usize = 50;

/// Target a stop is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Target {
    /// One robot.
    One(Name),
    /// All of the fleet, shown or not.
    All,
}

impl Target {
    /// The one, if it is one.
    pub(crate) fn robot(&self) -> Option<&Name> {
        match self {
            Self::One(robot) => Some(robot),
            Self::All => None,
        }
    }
}

/// Something that a robot is asked for.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Command {
    /// An emergency stop.
    Estop(Target),
    /// A stop.
    Stop(Target),
    /// Drive there.
    Goto {
        /// Who.
        robot: Name,
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
        /// On arrival; `None` = any.
        yaw_rad: Option<f64>,
        /// Take control from whoever has it.
        take: bool,
    },
    /// It stands there.
    SetPose {
        /// Who.
        robot: Name,
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
        /// Counter-clockwise from +x.
        yaw_rad: f64,
        /// Take control from whoever has it.
        take: bool,
    },
    /// End latches whose cause is gone.
    Reset {
        /// Whose.
        robot: Name,
        /// Take control from whoever has it.
        take: bool,
    },
    /// End latches of several robots.
    ResetAll {
        /// Whose.
        robots: Vec<Name>,
    },
    /// Let the dispatcher assign tasks again.
    Activate,
    /// Say that alerts were seen.
    Acknowledge {
        /// Which.
        ids: Vec<u64>,
    },
    /// End a goal.
    Cancel {
        /// Whose.
        robot: Name,
        /// Which.
        goal: Uuid,
        /// Take control from whoever has it.
        take: bool,
    },
    /// End the dispatcher's task.
    CancelTask {
        /// On which robot.
        robot: Name,
        /// Which.
        task: TaskId,
    },
}

impl Command {
    /// Whether it only stops.
    pub(crate) fn is_stop(&self) -> bool {
        matches!(self, Self::Estop(_) | Self::Stop(_))
    }

    /// Whether a stop that is called meanwhile comes first: it would end what the stop has set.
    pub(crate) fn loosens(&self) -> bool {
        matches!(self, Self::Reset { .. } | Self::ResetAll { .. } | Self::Activate)
    }

    /// The same, taking control; `None` = it needs none, or takes it already.
    pub(crate) fn taking(&self) -> Option<Self> {
        let mut command = self.clone();
        match &mut command {
            Self::Goto { take, .. }
            | Self::SetPose { take, .. }
            | Self::Reset { take, .. }
            | Self::Cancel { take, .. }
                if !*take =>
            {
                *take = true;
            }
            _ => return None,
        }
        Some(command)
    }

    /// What it is, in words.
    pub(crate) fn words(&self) -> String {
        match self {
            Self::Estop(Target::All) => "E-STOP ALL".to_owned(),
            Self::Estop(Target::One(robot)) => format!("e-stop {robot}"),
            Self::Stop(Target::All) => "stop all".to_owned(),
            Self::Stop(Target::One(robot)) => format!("stop {robot}"),
            Self::Goto { robot, x_m, y_m, yaw_rad, .. } => {
                let yaw = yaw_rad.map(|yaw| format!(" {:.0}°", yaw.to_degrees())).unwrap_or_default();
                format!("goto {robot} ({x_m:.2}, {y_m:.2}){yaw}")
            }
            Self::SetPose { robot, x_m, y_m, yaw_rad, .. } => {
                format!("set-pose {robot} ({x_m:.2}, {y_m:.2}) {:.0}°", yaw_rad.to_degrees())
            }
            Self::Reset { robot, .. } => format!("reset {robot}"),
            Self::ResetAll { robots } => format!("reset {} robots", robots.len()),
            Self::Activate => "activate the dispatcher".to_owned(),
            Self::Acknowledge { .. } => "acknowledge".to_owned(),
            Self::Cancel { robot, .. } => format!("cancel {robot}'s goal"),
            Self::CancelTask { robot, task } => format!("cancel {task} on {robot}"),
        }
    }

    /// Whether another one is for the same robot, and of the same kind if it is a stop.
    fn collides(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Estop(whom), Self::Estop(other)) | (Self::Stop(whom), Self::Stop(other)) => whom == other,
            _ => self.one() == other.one() && !self.is_stop() && !other.is_stop(),
        }
    }

    fn one(&self) -> Option<&Name> {
        match self {
            Self::Estop(whom) | Self::Stop(whom) => whom.robot(),
            Self::ResetAll { .. } | Self::Activate | Self::Acknowledge { .. } => None,
            Self::Goto { robot, .. }
            | Self::SetPose { robot, .. }
            | Self::Reset { robot, .. }
            | Self::Cancel { robot, .. }
            | Self::CancelTask { robot, .. } => Some(robot),
        }
    }
}

/// What came of a command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Outcome {
    /// How good that is.
    pub(crate) tone: Tone,
    /// In a sentence.
    pub(crate) text: String,
    /// Who has control, if the robot refused for that.
    pub(crate) held: bool,
}

/// A command under way.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct UnderWay {
    number: u64,
    pub(super) command: Command,
    pub(super) since_ms: AtMs,
}

/// A line for the person.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Notice {
    pub(super) at_ms: AtMs,
    pub(super) tone: Tone,
    pub(super) text: String,
}

/// What becomes of a wish.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Begun {
    /// It is to be carried out under this number, instead of the other one if there is one.
    As(u64, Option<u64>),
    /// It is not.
    No,
}

/// All of it.
#[derive(Debug, Clone, Default)]
pub(super) struct Commands {
    under_way: Vec<UnderWay>,
    notices: VecDeque<Notice>,
    begun: u64,
}

impl Commands {
    /// A wish. Whether it is to be carried out is said in a notice if it is not.
    pub(super) fn begin(&mut self, now_ms: AtMs, command: &Command) -> Begun {
        let same = self.under_way.iter().position(|other| other.command.collides(command));
        let instead = match same {
            Some(at) if command.is_stop() => Some(self.under_way.remove(at).number),
            Some(at) => {
                let busy = self.under_way[at].command.words();
                self.tell(now_ms, Tone::Warning, format!("wait: {busy} is not answered yet"));
                return Begun::No;
            }
            None => None,
        };
        let others = self.under_way.iter().filter(|other| !other.command.is_stop()).count();
        if !command.is_stop() && others == MOST_UNDER_WAY {
            self.tell(now_ms, Tone::Warning, format!("wait: {others} requests are not answered yet"));
            return Begun::No;
        }
        self.begun += 1;
        self.under_way.push(UnderWay { number: self.begun, command: command.clone(), since_ms: now_ms });
        Begun::As(self.begun, instead)
    }

    /// It has ended. What it was, unless it was begun anew meanwhile.
    pub(super) fn end(&mut self, now_ms: AtMs, number: u64, outcome: &Outcome) -> Option<Command> {
        let at = self.under_way.iter().position(|other| other.number == number)?;
        let ended = self.under_way.remove(at);
        self.tell(now_ms, outcome.tone, format!("{}: {}", ended.command.words(), outcome.text));
        Some(ended.command)
    }

    /// Something that the person should read.
    pub(super) fn tell(&mut self, now_ms: AtMs, tone: Tone, text: impl Into<String>) {
        if self.notices.len() == NOTICES {
            self.notices.pop_front();
        }
        self.notices.push_back(Notice { at_ms: now_ms, tone, text: text.into() });
    }

    /// What is not answered yet, the oldest first.
    pub(super) fn under_way(&self) -> &[UnderWay] {
        &self.under_way
    }

    /// What was told, the newest first.
    pub(super) fn notices(&self) -> impl Iterator<Item = &Notice> {
        self.notices.iter().rev()
    }
}
