//! Who goes first where nobody coordinates: a rule that each robot keeps for itself, from what the others
//! say of themselves.
//!
//! 1. Nobody drives into a body, nor to where a moving one comes to a stop.
//! 2. Who is driven by hand, straight, or by traffic control gives way to nobody.
//! 3. Of two that go alone the smaller name goes first (`xtb-2` before `xtb-10`). The other one stops before
//!    the stretch on which they meet, unless it is through before the first one comes; within that stretch
//!    it drives on where it leads out, and else stands.
//! 4. A first one that has stood for [`LOST_TURN_MS`] has lost its turn: only its body counts.
//!
//! Words: a *place* is a body somewhere along a way; a robot that is *alone* keeps to this rule.

use super::{MARGIN_M, ROBOT_MARGIN_M};
use crate::MapPose;
use crate::geometry::{Car, Path, Piece, Rect, distance_m};
use crate::settings::MEETING_MPS;
use std::sync::Arc;
use xtb_control::speed::STANDS_MPS;
use xtb_control::{Mode, Stamp};
pub use xtb_protocol::messages::NearRole;
use xtb_protocol::messages::{RobotState, RouteSource, Via};

/// A robot that has not been heard for this long is unknown: five of the states that robots take of each
/// other (one each 200 ms) are missing.
pub const HEARD_MS: u64 = 1_000;
/// Robots that are kept in mind: more than a lab's fifty.
pub const MOST_NEIGHBOURS: usize = 64;
/// Who goes first and has stood for this long has lost its turn; chosen, not measured.
pub const LOST_TURN_MS: u64 = 5_000;

/// My way is looked at so far, in m: half a minute at 0.2 m/s; chosen, not measured.
pub(super) const MINE_M: f64 = 6.0;
/// And the other's; chosen, not measured.
pub(super) const THEIRS_M: f64 = 8.0;
/// In steps of this, in m, less than a third of an XTB's length; chosen, not measured.
const STEP_M: f64 = 0.15;
/// Slower than it will be, for what takes long, in m/s: three quarters of [`MEETING_MPS`]; chosen, not
/// measured.
const SLOW_MPS: f64 = 0.15;
/// At least so fast whoever comes is taken to be, in m/s: as robots drive alone.
const FAST_MPS: f64 = MEETING_MPS;
/// It takes so long to leave a place, in s, or what the body needs for its own length: an XTB 3.3 s for 0.50
/// m.
const LEAVES_S: f64 = 3.5;
/// A moving body comes to a stop within its speed times this, in s: more than the obstacle rule's 0.36
/// (`obstacle.reaction_s`), as what is known of it is old; chosen, not measured.
pub const STOPS_S: f64 = 0.8;
/// Nobody knows where one goes that says no way: along its heading for this long, in s; chosen, not measured.
const GUESSED_S: f64 = 3.0;
/// Between a body and a place that is driven through, in m: what a path keeps free.
const BODY_M: f64 = MARGIN_M;
/// Between the ways of two, in m: what a path keeps free beside a robot that stands.
pub(super) const WAYS_M: f64 = MARGIN_M + ROBOT_MARGIN_M;
/// It stops so far before a body, so that there is room to turn, in m: for an XTB, which turns on 0.45 m as
/// it is planned; a larger circle is not allowed for. Chosen, not measured.
const ROOM_M: f64 = 0.6;
/// And before a way, in m; chosen, not measured.
const BEFORE_M: f64 = 0.15;
/// Who is nearer to a body already keeps that room but for this, in m; chosen, not measured.
const NEARER_M: f64 = 0.01;
/// Middles that near to each other are no way out, in m, nor any as near as two bodies reach: 0.64 m for an
/// XTB. Chosen, not measured.
const NEAR_M: f64 = 0.9;

/// What a robot says of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Neighbour {
    /// Its name.
    pub name: String,
    /// Where it is.
    pub pose: MapPose,
    /// Signed, in m/s.
    pub speed_mps: f64,
    /// Who tells it where to go.
    pub role: NearRole,
    /// Its way from here, as far as it is released; `None` while there is none.
    pub way: Option<RemainingPath>,
    /// For whom it waits.
    pub waits_for: Option<String>,
}

/// The part of a path that is still to be driven.
#[derive(Debug, Clone, PartialEq)]
pub struct RemainingPath {
    /// All of it.
    pub path: Path,
    /// Driven, in m.
    pub done_m: f64,
    /// Released, in m.
    pub release_m: f64,
}

impl Neighbour {
    /// Of its state; `None` if that says nothing that could be true.
    #[must_use]
    pub fn of(state: &RobotState) -> Option<Self> {
        let MapPose { x_m, y_m, yaw_rad } =
            MapPose { x_m: state.pose.x_m, y_m: state.pose.y_m, yaw_rad: state.pose.yaw_rad };
        let speed_mps = state.speed_mps.unwrap_or(0.0);
        let route = state.nav.route.as_ref();
        let way = route.and_then(|route| {
            let (done_m, release_m) = (route.done_m, route.release_m);
            Some(RemainingPath { path: Path::from(route.track.as_ref()?), done_m, release_m })
        });
        let finite = way.iter().all(|way| way.done_m.is_finite() && !way.release_m.is_nan());
        if !finite || ![x_m, y_m, yaw_rad, speed_mps].iter().all(|value| value.is_finite()) {
            return None;
        }
        let led = state.nav.traffic || route.is_some_and(|route| route.source == RouteSource::Traffic);
        let goal = state.goal.as_ref().filter(|goal| !goal.status.is_final());
        let by_hand = matches!(state.mode, Mode::Manual | Mode::Teleop);
        let role = match goal {
            _ if by_hand => NearRole::Driven,
            _ if !state.latches.is_empty() => NearRole::Parked,
            Some(goal) if goal.via != Some(Via::Planned) || led => NearRole::Driven,
            Some(_) => NearRole::Alone,
            None => NearRole::Parked,
        };
        Some(Self {
            name: state.robot.to_string(),
            pose: MapPose { x_m, y_m, yaw_rad },
            speed_mps,
            role,
            way: way.filter(|_| role != NearRole::Parked),
            waits_for: route.and_then(|route| route.waits_for.as_ref()).map(ToString::to_string),
        })
    }
}

/// Another robot as it is by now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeighbourNow<'a> {
    /// What it said.
    pub said: &'a Neighbour,
    /// Where it is by now.
    pub pose: MapPose,
    /// For how long it has stood, in ms.
    pub still_ms: u64,
    /// The same, since it got this role.
    pub stood_ms: u64,
}

impl NeighbourNow<'_> {
    /// Whether I give way to it.
    #[must_use]
    pub fn goes_before(&self, me: &str) -> bool {
        match self.said.role {
            NearRole::Driven => true,
            NearRole::Alone => goes_before(&self.said.name, me),
            NearRole::Parked => false,
        }
    }

    /// Where its body is and can come to a stop.
    fn bodies(&self) -> Vec<MapPose> {
        let to_m = self.said.speed_mps.abs() * STOPS_S;
        let steps = if to_m > 0.01 { 3 } else { 1 };
        let along = |step: u32| to_m * f64::from(step) / 2.0;
        (0..steps).map(|step| self.ahead(along(step))).collect()
    }

    /// Where it will be after so much way.
    pub(super) fn ahead(&self, way_m: f64) -> MapPose {
        match &self.said.way {
            Some(way) if way_m > 0.0 => way.path.at(way.done_m + way_m).0,
            _ => {
                let gear = if self.said.speed_mps < 0.0 { -1.0 } else { 1.0 };
                Piece { length_m: way_m * gear, curvature_per_m: 0.0 }.end(&self.pose)
            }
        }
    }

    /// How far its way counts, in m.
    pub(super) fn reaches_m(&self) -> f64 {
        match &self.said.way {
            Some(way) => (way.release_m.min(way.path.length_m()) - way.done_m).clamp(0.0, THEIRS_M),
            None => (self.said.speed_mps.abs() * GUESSED_S).min(THEIRS_M),
        }
    }

    /// Its way, place by place, and when it is there at the earliest, in s.
    fn places(&self, car: &Car) -> Vec<(f64, Rect)> {
        let mps = self.said.speed_mps.abs();
        let to_m = self.reaches_m();
        let steps = libm::ceil(to_m / STEP_M) as u32;
        let way_m = (0..=steps).map(|step| (f64::from(step) * STEP_M).min(to_m));
        way_m.map(|m| (m / mps.max(FAST_MPS), Rect::body(car, &self.ahead(m)))).collect()
    }

    /// All that it still has to drive through, with what its range finders need to be free.
    #[must_use]
    pub fn sweep(&self, car: &Car) -> Vec<Rect> {
        let mut sweep: Vec<Rect> = self.bodies().iter().map(|pose| Rect::body(car, pose)).collect();
        if let Some(way) = &self.said.way {
            let to_m = (way.path.length_m() - way.done_m).max(0.0);
            for step in 0..=libm::ceil((to_m / STEP_M).min(200.0)) as u32 {
                let (pose, piece) = way.path.at(way.done_m + f64::from(step) * STEP_M);
                sweep.push(Rect::looking(car, &pose, piece.map_or(1.0, |piece| piece.gear())));
            }
        }
        sweep
    }
}

/// Whether the first of two names goes first.
#[must_use]
pub fn goes_before(first: &str, second: &str) -> bool {
    (first.len(), first) < (second.len(), second)
}

/// What of another robot is in the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InTheWay {
    /// Its body.
    Body,
    /// Only its way.
    Path,
}

/// Why to drive no farther than this.
#[derive(Debug, Clone, PartialEq)]
pub struct Hold {
    /// Along the path, in m.
    pub way_m: f64,
    /// Because of whom.
    pub name: String,
    /// What of it.
    pub what: InTheWay,
}

/// How far a path may be driven, and who keeps me from more.
#[must_use]
pub fn hold(me: &str, car: &Car, path: &Path, from_m: f64, others: &[NeighbourNow<'_>]) -> Option<Hold> {
    let to_m = (path.length_m() - from_m).clamp(0.0, MINE_M);
    let (here, _) = path.at(from_m);
    let near = |other: &&NeighbourNow<'_>| {
        distance_m(&here, &other.pose) < to_m + THEIRS_M + 2.0 * car.reach_m() // else nothing can meet
    };
    let near: Vec<&NeighbourNow<'_>> = others.iter().filter(near).collect();
    if near.is_empty() {
        return None;
    }
    let steps = libm::ceil(to_m / STEP_M) as u32;
    let mine: Vec<Place> = (0..=steps)
        .map(|step| {
            let ahead_m = (f64::from(step) * STEP_M).min(to_m);
            let (pose, _) = path.at(from_m + ahead_m);
            Place { ahead_m, pose, body: Rect::body(car, &pose) }
        })
        .collect();
    let holds = near.into_iter().flat_map(|other| {
        let at = |what, (at, room_m): (usize, f64)| Hold {
            way_m: from_m + (mine[at].ahead_m - room_m).max(0.0),
            name: other.said.name.clone(),
            what,
        };
        let way = || {
            let counts = other.goes_before(me) && other.stood_ms < LOST_TURN_MS;
            counts.then(|| before_its_way(car, &mine, other)).flatten()
        };
        [
            before_its_body(car, &mine, other).map(|place| at(InTheWay::Body, (place, ROOM_M))),
            way().map(|place| at(InTheWay::Path, (place, BEFORE_M))),
        ]
    });
    holds.flatten().min_by(|a, b| a.way_m.total_cmp(&b.way_m))
}

/// A body of mine along my way.
struct Place {
    /// From where I am, in m.
    ahead_m: f64,
    pose: MapPose,
    body: Rect,
}

/// The first place that is too near to its body. Where I am near it already, every place is free that is not
/// nearer.
fn before_its_body(car: &Car, mine: &[Place], other: &NeighbourNow<'_>) -> Option<usize> {
    let bodies = other.bodies();
    let gap_m =
        |place: &Place| bodies.iter().map(|body| gap_m(car, &place.pose, body)).fold(BODY_M, f64::min);
    let here_m = gap_m(mine.first()?);
    if here_m > 0.0 {
        let least_m = if here_m < BODY_M { (here_m - NEARER_M).max(here_m / 2.0) } else { BODY_M };
        return mine.iter().position(|place| gap_m(place) < least_m);
    }
    // One of the two poses is wrong: away from it.
    let mut far_m = 0.0;
    mine.iter().position(|place| {
        let before_m = std::mem::replace(&mut far_m, distance_m(&place.pose, &other.pose));
        gap_m(place) == 0.0 && far_m < before_m
    })
}

/// Between two bodies, in m, as far as it is less than [`BODY_M`]; 0 = they overlap.
fn gap_m(car: &Car, a: &MapPose, b: &MapPose) -> f64 {
    if distance_m(a, b) >= 2.0 * car.reach_m() + BODY_M {
        return BODY_M;
    }
    if car.overlaps(a, car, b) {
        return 0.0;
    }
    let to_b = car.corners(a).map(|corner| car.distance_m(b, corner));
    let to_a = car.corners(b).map(|corner| car.distance_m(a, corner));
    to_b.into_iter().chain(to_a).fold(BODY_M, f64::min)
}

/// The first place of the stretch on which the two of us would meet; 0 where I stand in it already and it
/// does not lead out.
fn before_its_way(car: &Car, mine: &[Place], other: &NeighbourNow<'_>) -> Option<usize> {
    let theirs = other.places(car);
    // When it is in one of my places at the earliest.
    let comes = |place: &Place| {
        theirs.iter().find(|(_, body)| body.overlaps(&place.body, WAYS_M / 2.0)).map(|(at_s, _)| *at_s)
    };
    let comes: Vec<Option<f64>> = mine.iter().map(comes).collect();
    let leaves_s = LEAVES_S.max((car.front_m + car.rear_m) / SLOW_MPS);
    let meets =
        |place: usize| comes[place].is_some_and(|at_s| mine[place].ahead_m / SLOW_MPS + leaves_s >= at_s);
    let met = (0..mine.len()).find(|place| meets(*place))?;
    let begins = (0..=met).rev().take_while(|place| comes[*place].is_some()).last().unwrap_or(met);
    if begins > 0 {
        return Some(begins);
    }
    let near_m = NEAR_M.max(2.0 * car.reach_m() + WAYS_M);
    let from_m = distance_m(&mine[0].pose, &other.pose);
    let last_m = mine.last().map_or(0.0, |place| distance_m(&place.pose, &other.pose));
    for (place, comes) in mine.iter().zip(&comes) {
        let now_m = distance_m(&place.pose, &other.pose);
        if now_m < near_m && now_m < from_m - 0.05 {
            return Some(0);
        }
        if comes.is_none() {
            return None;
        }
    }
    (last_m <= from_m).then_some(0)
}

/// A robot that was heard.
#[derive(Debug, Clone)]
struct Heard {
    at: Stamp,
    stands_since: Option<Stamp>,
    role_since: Stamp,
    said: Arc<Neighbour>,
}

/// Those that were heard lately, by name.
#[derive(Debug, Clone, Default)]
pub(super) struct Neighbours {
    pub(super) me: String,
    heard: Vec<Heard>,
}

impl Neighbours {
    /// A robot said this, `at`.
    pub(super) fn hear(&mut self, at: Stamp, said: Arc<Neighbour>) {
        if said.name == self.me {
            return;
        }
        let fresh = |known: &Heard| at.since_ms(known.at) <= HEARD_MS;
        let stands = said.speed_mps.abs() < STANDS_MPS;
        match self.heard.binary_search_by(|known| known.said.name.cmp(&said.name)) {
            Ok(known) => {
                let known = &mut self.heard[known];
                let before = Some(&*known).filter(|known| fresh(known));
                let stands_since =
                    before.and_then(|known| known.stands_since).or(Some(at)).filter(|_| stands);
                let same = before.filter(|known| known.said.role == said.role);
                let role_since = same.map_or(at, |known| known.role_since);
                *known = Heard { at, stands_since, role_since, said };
            }
            Err(place) => {
                let place = if self.heard.len() < MOST_NEIGHBOURS {
                    place
                } else {
                    self.heard.retain(fresh);
                    self.heard.partition_point(|known| known.said.name < said.name)
                };
                if self.heard.len() < MOST_NEIGHBOURS {
                    let stands_since = stands.then_some(at);
                    self.heard.insert(place, Heard { at, stands_since, role_since: at, said });
                }
            }
        }
    }

    /// Where they are by now.
    pub(super) fn others(&self, now: Stamp) -> impl Iterator<Item = NeighbourNow<'_>> {
        self.heard.iter().filter(move |known| now.since_ms(known.at) <= HEARD_MS).map(move |known| {
            let rolled_m = known.said.speed_mps * now.since_s(known.at);
            NeighbourNow {
                said: &known.said,
                pose: Piece { length_m: rolled_m, curvature_per_m: 0.0 }.end(&known.said.pose),
                still_ms: known.stands_since.map_or(0, |since| now.since_ms(since)),
                stood_ms: known.stands_since.map_or(0, |since| now.since_ms(since.max(known.role_since))),
            }
        })
    }

    /// One of them.
    pub(super) fn find(&self, now: Stamp, name: &str) -> Option<NeighbourNow<'_>> {
        self.others(now).find(|other| other.said.name == name)
    }
}

#[cfg(test)]
mod tests;
