//! What happened: a hash over all of it, and the last lines for people.
//!
//! Lines are kept as small values and become text only when a violation is printed.

use crate::change::{Change, ROBOTS, Sender};
use crate::time::{MS_PER_TURN, Turn};
use std::collections::VecDeque;
use std::fmt;
use xtb_protocol::messages::{Body, EventKind, Fault, GoalStatus, Latch, Lease, RejectCode, Setpoint};

/// Lines kept of the whole fleet.
const KEPT: usize = 600;
/// Lines shown of the robot that a violation is about, and of what concerns everybody.
const SHOWN: usize = 40;

/// 64-bit FNV-1a.
#[derive(Debug, Clone)]
pub(crate) struct Hash(u64);

impl Default for Hash {
    fn default() -> Self {
        Self(0xCBF2_9CE4_8422_2325)
    }
}

impl Hash {
    pub(crate) fn add(&mut self, value: u64) {
        for byte in value.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3);
        }
    }

    pub(crate) fn get(&self) -> u64 {
        self.0
    }
}

/// How a request was answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Answer {
    Done { lease: Option<Lease>, goal: Option<u128> },
    Refused(RejectCode),
}

/// One thing that happened.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Happened {
    /// Of the day's plan.
    Changed(Change),
    /// A request reached the robot.
    Asked { by: Sender, id: u128, lease: Option<Lease>, body: Body },
    /// The robot answered.
    Answered { to: u8, id: u128, answer: Answer },
    /// A setpoint reached the robot that differs in kind from the one before.
    Setpoint { by: Sender, seq: u64, rpm: f64, fresh: bool },
    /// An emergency stop reached the robot.
    Estop { by: Sender, id: u128 },
    /// The robot told of a goal.
    Goal { id: u128, status: GoalStatus },
    /// The robot told of a latch.
    Latched { latch: Latch, set: bool },
    /// The robot told of a fault.
    Broken { fault: Fault, present: bool },
    /// The robot told of its lease: held by somebody or free.
    Held(bool),
    /// The robot told of a mode.
    Mode(xtb_control::Mode),
    /// The board began or ended to give the motor something else than neutral.
    Motor(u16),
    /// The agent runs, or has ended.
    Agent(bool),
    /// The session of a link.
    Session(bool),
}

/// What belongs to one robot (`Some`) or to everybody.
#[derive(Debug, Clone)]
struct Line {
    turn: Turn,
    robot: Option<u8>,
    what: Happened,
}

/// The day so far.
#[derive(Debug, Clone, Default)]
pub(crate) struct EventLog {
    pub(crate) hash: Hash,
    lines: VecDeque<Line>,
    /// Lines noted so far, those that were dropped too.
    noted: usize,
    last_setpoints: [Option<(Sender, bool, bool)>; ROBOTS as usize],
}

impl EventLog {
    pub(crate) fn note(&mut self, turn: Turn, robot: Option<u8>, what: Happened) {
        if self.lines.len() == KEPT {
            self.lines.pop_front();
        }
        self.lines.push_back(Line { turn, robot, what });
        self.noted += 1;
    }

    /// The lines that were noted after the first `told`, and how many there are by now.
    pub(crate) fn since(&self, told: usize) -> (Vec<String>, usize) {
        let new = (self.noted - told).min(self.lines.len());
        (self.lines.iter().skip(self.lines.len() - new).map(text).collect(), self.noted)
    }

    /// A setpoint; only kept as a line if it differs in kind from the one before.
    pub(crate) fn note_setpoint(
        &mut self,
        turn: Turn,
        robot: u8,
        by: Sender,
        setpoint: &Setpoint,
        fresh: bool,
    ) {
        let kind = Some((by, setpoint.rpm == 0.0, fresh));
        if std::mem::replace(&mut self.last_setpoints[usize::from(robot)], kind) != kind {
            let (seq, rpm) = (setpoint.seq, setpoint.rpm);
            self.note(turn, Some(robot), Happened::Setpoint { by, seq, rpm, fresh });
        }
    }

    /// A reply; those to retains are only counted into the hash.
    pub(crate) fn answered(&mut self, turn: Turn, robot: u8, to: u8, id: u128, answer: Answer, retain: bool) {
        self.hash.add(id as u64);
        self.hash.add(match answer {
            Answer::Done { lease, goal } => {
                1 + lease.map_or(0, |lease| lease.epoch ^ u64::from(lease.root) << 32)
                    + goal.map_or(0, |g| g as u64)
            }
            Answer::Refused(code) => code as u64 + 1000,
        });
        if !retain {
            self.note(turn, Some(robot), Happened::Answered { to, id, answer });
        }
    }

    /// What a robot tells of itself.
    pub(crate) fn event(&mut self, turn: Turn, robot: u8, kind: &EventKind) {
        let (number, what) = match kind {
            EventKind::Started { .. } => (1, None),
            EventKind::Mode { to, .. } => (2 + (*to as u64) * 16, Some(Happened::Mode(*to))),
            EventKind::Goal { id, status, .. } => {
                (3 + (*status as u64) * 16, Some(Happened::Goal { id: id.as_u128(), status: *status }))
            }
            EventKind::Lease { holder } => (4, Some(Happened::Held(holder.is_some()))),
            EventKind::Fault { fault, present, .. } => {
                let what = Happened::Broken { fault: *fault, present: *present };
                (5 + (*fault as u64) * 16 + u64::from(*present) * 4096, Some(what))
            }
            EventKind::Latch { latch, set, .. } => {
                let what = Happened::Latched { latch: *latch, set: *set };
                (6 + (*latch as u64) * 16 + u64::from(*set) * 4096, Some(what))
            }
        };
        self.hash.add(u64::from(turn) << 16 ^ number);
        if let Some(what) = what {
            self.note(turn, Some(robot), what);
        }
    }

    /// The last lines about a robot and about everybody, oldest first.
    pub(crate) fn last(&self, robot: u8) -> Vec<String> {
        let about = |line: &&Line| line.robot.is_none_or(|other| other == robot);
        let mut shown: Vec<String> = self.lines.iter().rev().filter(about).take(SHOWN).map(text).collect();
        shown.reverse();
        shown
    }
}

fn text(line: &Line) -> String {
    let s = f64::from(line.turn) * MS_PER_TURN as f64 / 1000.0;
    let robot = line.robot.map_or_else(|| "the fleet".to_owned(), |robot| format!("xtb-{}", robot + 1));
    format!("{s:9.3} s  {robot}: {}", line.what)
}

/// The end of an id tells it from the others of a scenario.
fn short(id: u128) -> String {
    format!("{:x}.{:x}", id >> 64, id as u64)
}

fn lease_text(lease: Option<Lease>) -> String {
    lease.map_or_else(|| "no lease".to_owned(), |lease| format!("lease {:x}/{}", lease.epoch, lease.root))
}

impl fmt::Display for Happened {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Changed(change) => write!(f, "{change:?}"),
            Self::Asked { by, id, lease, body } => {
                write!(f, "{by} requests {} ({}): {body:?}", short(*id), lease_text(*lease))
            }
            Self::Answered { to, id, answer: Answer::Refused(code) } => {
                write!(f, "refuses {} of person-{to}: {code:?}", short(*id))
            }
            Self::Answered { to, id, answer: Answer::Done { lease, .. } } => {
                let granted =
                    lease.map_or_else(String::new, |lease| format!(", {}", lease_text(Some(lease))));
                write!(f, "executes {} of person-{to}{granted}", short(*id))
            }
            Self::Setpoint { by, seq, rpm, fresh } => {
                let fresh = if *fresh { "" } else { ", outdated" };
                write!(f, "setpoint {seq} of {by}: {rpm:.1} rpm{fresh}")
            }
            Self::Estop { by, id } => write!(f, "emergency stop {} of {by}", short(*id)),
            Self::Goal { id, status } => write!(f, "goal {} is {status:?}", short(*id)),
            Self::Latched { latch, set } => {
                write!(f, "latch {latch:?} {}", if *set { "set" } else { "reset" })
            }
            Self::Broken { fault, present } => {
                write!(f, "fault {fault:?} {}", if *present { "begins" } else { "ends" })
            }
            Self::Held(held) => write!(f, "the lease is {}", if *held { "held" } else { "free" }),
            Self::Mode(mode) => write!(f, "mode {mode:?}"),
            Self::Motor(counts) => write!(f, "motor at {counts} counts"),
            Self::Agent(runs) => write!(f, "the agent {}", if *runs { "starts" } else { "is killed" }),
            Self::Session(up) => write!(f, "the session is {}", if *up { "up" } else { "lost" }),
        }
    }
}
