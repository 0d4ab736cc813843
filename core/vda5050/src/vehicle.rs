//! One robot towards a master control: what comes in, what is asked of the dispatcher, what is published.

mod asking;
mod publishing;
mod receiving;

use crate::factsheet::Body;
use crate::header::Serial;
use crate::problem::Problem;
use crate::record::OrderRecord;
use publishing::Published;
use serde_json::Value;
use std::collections::VecDeque;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{DispatchCode, RobotState, TaskId, TaskSpec, TaskState, Waypoint};

/// Refusals that are kept; of more, the oldest are forgotten.
const MAX_PROBLEMS: usize = 16;

/// Where a message is published.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Topic {
    /// `connection`: QoS 1, retained.
    Connection,
    /// `state`.
    State,
    /// `factsheet`: retained, so that a master that comes later has it.
    Factsheet,
}

impl Topic {
    /// The last level of its topic.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Connection => "connection",
            Self::State => "state",
            Self::Factsheet => "factsheet",
        }
    }
}

/// What is asked of the dispatcher, or of the robot.
#[derive(Debug, Clone, PartialEq)]
pub enum Ask {
    /// Take this task; the same id again is the same task.
    Submit {
        /// Of the submission.
        id: Uuid,
        /// The task.
        spec: Box<TaskSpec>,
    },
    /// More points for a task; the same again changes nothing.
    Extend {
        /// Which.
        task: TaskId,
        /// Points that it has without these.
        after: u32,
        /// What follows them.
        points: Vec<Waypoint>,
    },
    /// End a task.
    Cancel(TaskId),
    /// Put a task aside.
    Pause(TaskId),
    /// Let a task go on.
    Resume(TaskId),
    /// How a task stands, which is told through [`Vehicle::task`] before the answer. One of another ledger does not
    /// exist: [`DispatchCode::UnknownTask`].
    Show(TaskId),
    /// Set the robot's pose.
    SetPose {
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
        /// Counter-clockwise from +x.
        yaw_rad: f64,
    },
}

/// What came of an [`Ask`].
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// Taken as this task.
    Submitted(TaskId),
    /// Done.
    Done,
    /// Refused by the dispatcher.
    Refused(DispatchCode, String),
    /// Refused by the robot.
    Failed(String),
    /// Nobody answers: it is asked again.
    Unreachable(String),
}

/// What the caller has to do, in this order.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Keep this in the place of what was kept before, before anything that follows.
    Save(String),
    /// Ask; the answer goes to [`Vehicle::answered`]. There is one at a time.
    Ask(Ask),
    /// Publish it.
    Publish(Topic, Value),
}

/// How a task stands.
#[derive(Debug, Clone, PartialEq)]
struct Seen {
    state: TaskState,
    legs_done: u32,
    reason: Option<String>,
}

/// One robot towards a master control.
#[derive(Debug, Clone)]
pub struct Vehicle {
    serial: Serial,
    record: OrderRecord,
    saved: Option<OrderRecord>,
    robot: Option<RobotState>,
    present: bool,
    body: Option<Body>,
    version: String,
    /// How the part's task stands, as far as is known.
    seen: Option<Seen>,
    asked: Option<Ask>,
    /// Not before this the next one, in ms since 1970.
    next_ask_ms: u64,
    /// When the dispatcher was last asked how the task stands, in ms since 1970.
    shown_ms: u64,
    /// The last time that was told, in ms since 1970.
    now_ms: u64,
    /// The pending order may be in the ledger.
    may_be_taken: bool,
    /// Why the dispatcher cannot be asked.
    unreachable: Option<String>,
    problems: VecDeque<Problem>,
    published: Published,
}

impl Vehicle {
    /// A robot that goes on from what was kept of it.
    #[must_use]
    pub fn new(serial: Serial, record: OrderRecord) -> Self {
        Self {
            serial,
            may_be_taken: record.pending.is_some(),
            saved: Some(record.clone()),
            record,
            robot: None,
            present: false,
            body: None,
            version: String::new(),
            seen: None,
            asked: None,
            next_ask_ms: 0,
            shown_ms: 0,
            now_ms: 0,
            unreachable: None,
            problems: VecDeque::new(),
            published: Published::default(),
        }
    }

    /// Who it is.
    #[must_use]
    pub fn serial(&self) -> &Serial {
        &self.serial
    }

    /// What a restart needs.
    #[must_use]
    pub fn record(&self) -> &OrderRecord {
        &self.record
    }

    /// The task that drives its order.
    #[must_use]
    pub fn part_task(&self) -> Option<TaskId> {
        self.record.part.as_ref().map(|part| part.task)
    }

    /// The robot's last state, and whether it is there.
    pub fn robot(&mut self, state: Option<&RobotState>, present: bool) {
        if let Some(state) = state {
            self.robot = Some(state.clone());
        }
        self.present = present && self.robot.is_some();
    }

    /// What the robot's own factsheet says.
    pub fn about(&mut self, version: &str, body: Option<Body>) {
        (self.version, self.body) = (version.to_owned(), body);
    }

    /// How a task of a ledger stands. `false` = it is not the order's: others are ignored.
    pub fn task(
        &mut self,
        of: (u64, TaskId),
        state: TaskState,
        legs_done: u32,
        reason: Option<&str>,
    ) -> bool {
        let (ledger, id) = of;
        let Some(part) = self.record.part.as_mut().filter(|part| part.task == id) else { return false };
        if *part.ledger.get_or_insert(ledger) != ledger {
            return false;
        }
        // Lists may be older than events.
        let is_older = self.seen.as_ref().is_some_and(|seen| {
            seen.legs_done > legs_done || (seen.state == TaskState::Done && state != TaskState::Done)
        });
        if is_older {
            return true;
        }
        self.seen = Some(Seen { state, legs_done, reason: reason.map(str::to_owned) });
        while part.traversed < legs_done.min(part.points) {
            part.traversed += 1;
            self.record.order.traverse();
        }
        true
    }

    /// The dispatcher has no such task any more: nobody knows what became of it.
    fn task_is_lost(&mut self, id: TaskId) {
        if self.part_task() == Some(id) {
            let reason = Some("the dispatcher does not know the task any more".to_owned());
            let legs_done = self.seen.as_ref().map_or(0, |seen| seen.legs_done);
            self.seen = Some(Seen { state: TaskState::Failed, legs_done, reason });
            if let Some(part) = &mut self.record.part {
                part.closed = true;
            }
        }
    }

    /// Whether a task of the order has not ended, as far as is known.
    fn has_live_part(&self) -> bool {
        self.record.part.is_some() && !self.seen.as_ref().is_some_and(|seen| seen.state.is_final())
    }

    fn stands(&self) -> bool {
        !self.robot.as_ref().is_some_and(crate::operating::drives)
    }

    fn refuse(&mut self, problem: Problem) {
        self.problems.retain(|known| *known != problem);
        if self.problems.len() == MAX_PROBLEMS {
            self.problems.pop_front();
        }
        self.problems.push_back(problem);
    }

    /// What was to be kept could not be kept: what follows from it must not happen, and it is tried again.
    pub fn not_saved(&mut self, now_ms: u64, why: String) {
        self.saved = None;
        self.answered(now_ms, Answer::Unreachable(why));
    }

    /// Decides. To be called some 20 times a second, and after anything that should not wait.
    #[must_use]
    pub fn step(&mut self, now_ms: u64) -> Vec<Effect> {
        if now_ms < self.now_ms {
            // Somebody has set the clock back: what was to be done later is due.
            (self.next_ask_ms, self.shown_ms) = (now_ms, now_ms);
            self.published.set_back();
        }
        self.now_ms = now_ms;
        self.settle();
        let ask = self.next_ask(now_ms);
        let mut effects = Vec::new();
        if self.saved.as_ref() != Some(&self.record) {
            self.saved = Some(self.record.clone());
            effects.push(Effect::Save(self.record.to_json()));
        }
        if let Some(ask) = ask {
            if matches!(ask, Ask::Show(_)) {
                self.shown_ms = now_ms;
            }
            self.asked = Some(ask.clone());
            effects.push(Effect::Ask(ask));
        }
        effects.extend(self.publish(now_ms));
        effects
    }
}
