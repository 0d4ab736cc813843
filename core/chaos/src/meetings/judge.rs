//! Who touched what, who stood for how long and what for: by ground truth, and by what the robots said.

use std::collections::BTreeSet;
use xtb_control::frames::MapPose;
use xtb_control::speed::STANDS_MPS;
use xtb_protocol::messages::{GoalStatus, RobotState, TruthRobot};

/// A truck that has moved so lately is a moving truck, in s.
const MOVING_S: f64 = 3.0;
/// Longest standstill that is not for a named moving truck, in s.
const STOOD_MAX_S: f64 = 15.0;
/// Longest standstill, in s.
const WAITED_MAX_S: f64 = 60.0;

/// What came of a meeting.
#[derive(Debug, Clone, Default)]
pub struct Meeting {
    /// How many have reached their goals.
    pub reached: usize,
    /// Touches of whatever.
    pub contacts: u64,
    /// How long it took, in s of the world.
    pub took_s: f64,
    /// Longest standstill of one with an open goal that does not wait for a named moving truck.
    pub stood_s: f64,
    /// What it said at the end of it.
    pub stood_for: String,
    /// Longest standstill of one with an open goal, whatever for.
    pub waited_s: f64,
    /// Of those that neither died nor were latched: goal's status and reason.
    pub ends: Vec<(GoalStatus, Option<String>)>,
    /// Who touched what, and what they were doing.
    pub touched: Vec<String>,
    /// Where each truck truly was, at each look.
    pub tracks: Vec<Vec<MapPose>>,
}

impl Meeting {
    /// Whether all goals have ended.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.ends.iter().all(|(status, _)| status.is_final())
    }

    /// Whether everybody has arrived or says who is in the way.
    #[must_use]
    pub fn is_told(&self) -> bool {
        let told =
            |(status, reason): &(GoalStatus, Option<String>)| *status == GoalStatus::Reached || names(reason);
        self.ends.iter().all(told)
    }

    /// Nobody stood too long: 15 s, or 60 s for a named moving truck.
    #[must_use]
    pub fn is_brisk(&self) -> bool {
        self.stood_s <= STOOD_MAX_S && self.waited_s < WAITED_MAX_S
    }
}

/// Whether a goal's reason names a robot that is in the way.
fn names(reason: &Option<String>) -> bool {
    reason.as_ref().is_some_and(|words| words.contains("blocked by xtb-"))
}

/// A robot as it truly is, and what it says.
#[derive(Debug, Clone)]
pub struct ObservedRobot {
    /// The truck.
    pub truth: TruthRobot,
    /// Its robot.
    pub state: RobotState,
}

impl ObservedRobot {
    fn is_open(&self) -> bool {
        self.state.goal.as_ref().is_some_and(|goal| !goal.status.is_final())
    }

    /// What a robot is at, in a line.
    #[must_use]
    pub fn words(&self) -> String {
        let Self { truth, state } = self;
        let off_m = libm::hypot(state.pose.x_m - truth.x_m, state.pose.y_m - truth.y_m);
        let goal = state.goal.as_ref().map(|goal| (goal.status, goal.reason.clone()));
        let route = state.nav.route.as_ref().map_or_else(String::new, |route| {
            let arcs = route.track.iter().flat_map(|track| &track.arcs);
            let length_m: f64 = arcs.map(|arc| arc.length_m.abs()).sum();
            format!(
                "plan {} {:?} at {:.2} of {:.2} of {length_m:.2} m, {:.2} off, waits for {:?}, blocked at {:?}",
                route.plan,
                route.phase,
                route.done_m,
                route.release_m,
                route.off_m,
                route.waits_for,
                route.blocked_at_m
            )
        });
        format!(
            "{} ({:.2}, {:.2}, {:.2}) {:.2} m/s pose {off_m:.3} off, {:?} {goal:?} {route}",
            state.robot,
            truth.x_m,
            truth.y_m,
            truth.yaw_rad,
            state.speed_mps.unwrap_or(0.0),
            state.stopped_because,
        )
    }
}

/// A robot as the judge remembers it.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    stood_s: f64,
    /// Of this standstill, without waiting for a moving truck.
    idle_s: f64,
    contacts: u64,
}

/// Watches a meeting of robots with goals.
#[derive(Debug, Clone)]
pub struct Judge {
    seen: Vec<Seen>,
    made: Meeting,
}

impl Judge {
    /// A judge of robots that have touched something so often before.
    #[must_use]
    pub fn new(contacts: impl Iterator<Item = u64>) -> Self {
        let seen: Vec<Seen> = contacts.map(|contacts| Seen { contacts, ..Seen::default() }).collect();
        let made = Meeting { tracks: vec![Vec::new(); seen.len()], ..Meeting::default() };
        Self { seen, made }
    }

    /// What has come of it so far.
    #[must_use]
    pub fn made(&self) -> &Meeting {
        &self.made
    }

    /// What came of it.
    #[must_use]
    pub fn into_made(self) -> Meeting {
        self.made
    }

    /// Looks at all robots, `passed_s` after the last look. Those whose agents have died are in `dead`.
    pub fn look(&mut self, passed_s: f64, sights: &[ObservedRobot], dead: &BTreeSet<usize>) {
        let made = &mut self.made;
        made.took_s += passed_s;
        made.ends.clear();
        let is_out = |index: usize| dead.contains(&index) || !sights[index].state.latches.is_empty();
        let out: Vec<bool> = (0..sights.len()).map(is_out).collect();
        let stood: Vec<f64> = self.seen.iter().map(|one| one.stood_s).collect();
        for (index, (sight, one)) in sights.iter().zip(&mut self.seen).enumerate() {
            let ObservedRobot { truth, state } = sight;
            if truth.contacts > one.contacts {
                made.contacts += truth.contacts - one.contacts;
                one.contacts = truth.contacts;
                made.touched.push(format!("{:.1} s {}", made.took_s, sight.words()));
            }
            if out[index] {
                continue;
            }
            made.tracks[index].push(MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad });
            let Some(goal) = &state.goal else { continue };
            made.ends.push((goal.status, goal.reason.clone()));
            let blocked = out.contains(&true) && names(&goal.reason);
            if goal.status.is_final() || truth.speed_mps.abs() > STANDS_MPS || blocked {
                (one.stood_s, one.idle_s) = (0.0, 0.0);
                continue;
            }
            one.stood_s += passed_s;
            one.idle_s += if waits_for_moving(sights, &stood, &out, index) { 0.0 } else { passed_s };
            made.waited_s = made.waited_s.max(one.stood_s);
            if one.idle_s > made.stood_s {
                (made.stood_s, made.stood_for) = (one.idle_s, sight.words());
            }
        }
        made.reached = made.ends.iter().filter(|(status, _)| *status == GoalStatus::Reached).count();
    }
}

/// Whether it waits for somebody who moves, or who waits for somebody who moves.
fn waits_for_moving(sights: &[ObservedRobot], stood: &[f64], out: &[bool], index: usize) -> bool {
    let mut at = index;
    for _ in 0..sights.len() {
        let waits_for = sights[at].state.nav.route.as_ref().and_then(|route| route.waits_for.as_ref());
        let Some(name) = waits_for else { return false };
        let Some(next) = sights.iter().position(|sight| sight.state.robot == *name) else { return false };
        if !out[next] && sights[next].is_open() && stood[next] < MOVING_S {
            return true;
        }
        at = next;
    }
    false
}
