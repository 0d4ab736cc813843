//! What a day was like, for people and for tests.

use crate::time::MS_PER_TURN;
use std::fmt;
use std::ops::AddAssign;

/// The rules, as the issue numbers them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Invariant {
    /// The motor is driven and nothing allows it.
    Authority,
    /// Two clients own one robot.
    OneOwner,
    /// The motor is driven, or a command begins, through a latched stop.
    Latched,
    /// An acknowledged request was lost or done twice.
    Requests,
    /// A pulse or a number of the state that cannot be.
    Range,
    /// It stands and does not say why.
    Reasons,
    /// It drove against a wall.
    Contact,
    /// Something of the truck is broken, and it was driven on.
    Devices,
}

impl fmt::Display for Invariant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Authority => "nothing moves without authority",
            Self::OneOwner => "a robot has one owner",
            Self::Latched => "a latched robot does not move",
            Self::Requests => "no acknowledged request is lost or executed twice",
            Self::Range => "numbers are in range",
            Self::Reasons => "a stopped robot gives the reason",
            Self::Contact => "no truck drives into a wall",
            Self::Devices => "a faulty truck does not move",
        })
    }
}

/// A rule that was broken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// Which.
    pub invariant: Invariant,
    /// By which robot.
    pub robot: String,
    /// Since the day began.
    pub at_ms: u64,
    /// What was seen.
    pub detail: String,
    /// What happened last to this robot and to everybody, oldest first.
    pub last: Vec<String>,
}

/// What a day was like.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DayReport {
    /// Its seed.
    pub seed: u64,
    /// Robots in it.
    pub robots: usize,
    /// How long it lasted; shorter than planned if a rule was broken.
    pub lasted_ms: u64,
    /// Over every decision of every robot.
    pub hash: u64,
    /// Requests that reached a robot, goals that began, stops and emergency stops that arrived, agents that
    /// were killed.
    pub counts: DayCounts,
    /// The first rule that was broken.
    pub violation: Option<Violation>,
}

/// How much happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DayCounts {
    /// Requests at the robots.
    pub requests: u64,
    /// Setpoints at the robots.
    pub setpoints: u64,
    /// Setpoints that had to be obeyed or could be.
    pub obeyed: u64,
    /// Goals that were accepted.
    pub goals: u64,
    /// Emergency stops at the robots.
    pub estops: u64,
    /// Boots of agents.
    pub boots: u64,
    /// Robot-turns in which a motor was driven.
    pub driven: u64,
    /// Messages that the network lost.
    pub lost: u64,
}

impl AddAssign for DayCounts {
    fn add_assign(&mut self, other: Self) {
        self.requests += other.requests;
        self.setpoints += other.setpoints;
        self.obeyed += other.obeyed;
        self.goals += other.goals;
        self.estops += other.estops;
        self.boots += other.boots;
        self.driven += other.driven;
        self.lost += other.lost;
    }
}

impl fmt::Display for DayCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { requests, setpoints, obeyed, goals, estops, boots, driven, lost } = self;
        let driven_s = *driven as f64 * MS_PER_TURN as f64 / 1000.0;
        write!(
            f,
            "{requests} requests, {setpoints} setpoints ({obeyed} fresh), {goals} goals, {estops} emergency \
             stops, {boots} boots, {lost} messages lost, motors driven for {driven_s:.1} s"
        )
    }
}

impl fmt::Display for DayReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = self.lasted_ms as f64 / 1000.0;
        writeln!(f, "seed {}: {} robots, {s:.1} s, event_log {:016x}", self.seed, self.robots, self.hash)?;
        writeln!(f, "{}", self.counts)?;
        let Some(violation) = &self.violation else { return write!(f, "no rule was broken") };
        for line in &violation.last {
            writeln!(f, "{line}")?;
        }
        writeln!(
            f,
            "BROKEN at {:.3} s by {}: {}",
            violation.at_ms as f64 / 1000.0,
            violation.robot,
            violation.invariant
        )?;
        writeln!(f, "  {}", violation.detail)?;
        write!(f, "to repeat: fleet-cli sim --virtual --seed {}", self.seed)
    }
}
