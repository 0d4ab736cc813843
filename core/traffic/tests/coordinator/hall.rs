//! A hall with shelves and pillars in which everybody who arrives is sent on to a place drawn at random.

use crate::toy::{Draw, Trouble, World, room};
use std::collections::BTreeMap;
use xtb_control::{Stamp, VehicleConfig};
use xtb_nav::geometry::rect::Rect;
use xtb_nav::navigator::NO_WAY_MS;
use xtb_nav::{Car, MapPose};
use xtb_traffic::coordinator::{GridRoom, RoomGeometry as _};

/// Side of the square in which one shelf or pillar may stand, in m.
const BAY_M: f64 = 6.0;
/// What each keeps from the sides of its square, in m: aisles are twice as wide at least.
const AISLE_M: f64 = 1.2;
/// Places and goals are so far apart at least, in m.
const APART_M: f64 = 1.0;
/// And so far from walls and shelves, in m.
const WALL_M: f64 = 0.6;
/// A turn in which a robot moves less than this is one in which it stands, in m.
const STANDS_M: f64 = 1e-4;
/// Whom a robot waits for that stands is kept this often, in ms, and so many links of it.
const STORY_MS: u64 = 5000;
const MOST_LINKS: usize = 8;
/// Messages arrive, nobody pauses, and a joint plan takes 0.05 to 0.2 s, 15 ms for each robot that it is for and
/// 0.1 ms for each node.
const CALM: Trouble =
    Trouble { loss: 0.0, pause: 0.0, pause_s: 1.0, planning_s: 0.1, expansion_s: 1e-4, truck_s: 0.015 };

/// Where a robot stands, since when, and whom it has waited for.
struct Still {
    pose: MapPose,
    since: Stamp,
    story: Vec<String>,
}

/// A fleet in a hall.
pub(crate) struct Hall {
    pub(crate) world: World,
    draw: Draw,
    reached: u32,
    /// Goals that ended without being reached, by reason.
    pub(crate) failed: BTreeMap<String, u32>,
    /// Longest time for which any robot has stood, in s.
    pub(crate) longest_still_s: f64,
    /// Whom that one waited for meanwhile, and those for whom, every 5 s.
    pub(crate) longest_story: Vec<String>,
    stands: Vec<Still>,
    /// Since when each has been told that there is no way.
    refused: Vec<Option<Stamp>>,
}

impl Hall {
    /// So many robots in a square hall with this side.
    pub(crate) fn new(robots: usize, side_m: f64, seed: u64, clock_ms: fn() -> f64) -> Self {
        let mut draw = Draw::new(seed ^ 0x4A11);
        let room = room(side_m, side_m, &shelves(side_m, &mut draw));
        let car = Car::of(&VehicleConfig::default());
        let mut starts: Vec<MapPose> = Vec::new();
        while starts.len() < robots {
            let [x_m, y_m] = free_place(&room, &mut draw);
            let here = MapPose { x_m, y_m, yaw_rad: draw.uniform(-3.0, 3.0) };
            let apart = starts.iter().all(|other| (other.x_m - x_m).hypot(other.y_m - y_m) > APART_M);
            if apart && room.is_free(&Rect::body(&car, &here), 0.1) {
                starts.push(here);
            }
        }
        let mut world = World::new(room, &starts, seed, CALM, clock_ms);
        (world.looks_back, world.counts_contacts) = (false, true);
        let still = |pose: &MapPose| Still { pose: *pose, since: world.now, story: Vec::new() };
        let stands = starts.iter().map(still).collect();
        let (failed, refused) = (BTreeMap::new(), vec![None; robots]);
        let (longest_still_s, longest_story) = (0.0, Vec::new());
        Self { world, draw, reached: 0, failed, longest_still_s, longest_story, stands, refused }
    }

    /// Goals that were reached.
    pub(crate) fn reached(&self) -> u32 {
        self.reached
    }

    /// So many minutes of virtual time.
    pub(crate) fn run(&mut self, minutes: f64) {
        let end = self.world.now.plus_ms((minutes * 60_000.0) as u64);
        while self.world.now < end {
            self.send_on();
            self.world.turn();
            self.reached = self.world.toys.iter().map(|toy| toy.arrived).sum();
            self.watch();
        }
    }

    fn send_on(&mut self) {
        for index in 0..self.world.toys.len() {
            if self.world.toys[index].goal.is_some() {
                continue;
            }
            let place = loop {
                let place = free_place(&self.world.room, &mut self.draw);
                let is_near = |[x_m, y_m]: [f64; 2]| (x_m - place[0]).hypot(y_m - place[1]) < APART_M;
                let taken = self.world.toys.iter().any(|toy| match toy.goal {
                    Some(goal) => is_near([goal.x_m, goal.y_m]),
                    None => is_near([toy.pose.x_m, toy.pose.y_m]),
                });
                if !taken {
                    break place;
                }
            };
            self.world.send_to(index, place, None);
        }
    }

    /// A robot, the one for which it waits, the one for which that one waits …
    fn chain(&self, index: usize) -> String {
        let toys = &self.world.toys;
        let led = self.world.coordinator.as_ref().map_or_else(Vec::new, |coordinator| coordinator.names().0);
        let (mut line, mut next) = (String::new(), Some(index));
        for _ in 0..MOST_LINKS {
            let Some(toy) = next.map(|index| &toys[index]) else { break };
            let says = toy.says.as_ref();
            let state = match (&toy.goal, &toy.guide) {
                (None, _) => "no goal".to_owned(),
                (_, None) => "no path".to_owned(),
                (_, Some(guide)) => {
                    let all_m = guide.path.as_ref().map_or(0.0, xtb_nav::Path::length_m);
                    let (done_m, release_m) = (toy.done_m, guide.release_m);
                    format!("{done_m:.2} m driven, {release_m:.2} of {all_m:.2} m released")
                }
            };
            let reason = says.and_then(|guide| guide.reason.as_deref()).unwrap_or("no reason told");
            let MapPose { x_m, y_m, yaw_rad } = toy.pose;
            let at = format!("at {x_m:.2} {y_m:.2}, {:.0}°", yaw_rad.to_degrees());
            let led = if led.contains(&toy.name) { "led" } else { "not led" };
            line.push_str(&format!(" > {} {at} ({led}, {state}, {reason})", toy.name));
            let waits_for = says.and_then(|guide| guide.waits_for.as_deref());
            next = waits_for.and_then(|name| toys.iter().position(|toy| toy.name == name));
        }
        line
    }

    /// Who stands for how long, and whose goal fails because there is no way to it.
    fn watch(&mut self) {
        let now = self.world.now;
        for index in 0..self.stands.len() {
            let pose = self.world.toys[index].pose;
            let still = &mut self.stands[index];
            if (pose.x_m - still.pose.x_m).hypot(pose.y_m - still.pose.y_m) > STANDS_M {
                *still = Still { pose, since: now, story: Vec::new() };
            }
            let still_s = now.since_s(still.since);
            if still_s > 0.0 && now.since_ms(still.since).is_multiple_of(STORY_MS) {
                let line = format!("{:.0} s, standing for {still_s:.0} s: {}", now.s(), self.chain(index));
                self.stands[index].story.push(line);
            }
            if still_s > self.longest_still_s {
                self.longest_still_s = still_s;
                if now.since_ms(self.stands[index].since).is_multiple_of(STORY_MS) {
                    self.longest_story.clone_from(&self.stands[index].story);
                }
            }
        }
        for (index, toy) in self.world.toys.iter_mut().enumerate() {
            let reason = toy.says.as_ref().and_then(|guide| guide.reason.clone());
            let refused = &mut self.refused[index];
            *refused = reason.as_ref().filter(|_| toy.goal.is_some()).map(|_| refused.unwrap_or(now));
            if let (Some(reason), Some(since)) = (reason, *refused)
                && now.since_ms(since) >= NO_WAY_MS
            {
                let kind = if reason.starts_with("blocked by") { "blocked".to_owned() } else { reason };
                *self.failed.entry(kind).or_default() += 1;
                (toy.goal, toy.guide, *refused) = (None, None, None);
            }
        }
    }
}

/// In about two of three squares a shelf along x or along y, or a pillar.
fn shelves(side_m: f64, draw: &mut Draw) -> Vec<[f64; 4]> {
    let squares = (side_m / BAY_M) as usize;
    let mut boxes = Vec::new();
    for (row, column) in (0..squares).flat_map(|row| (0..squares).map(move |column| (row, column))) {
        let (long_m, wide_m) = (draw.uniform(2.0, BAY_M - 2.0 * AISLE_M), draw.uniform(0.6, 1.2));
        let size_m = match draw.uniform(0.0, 3.0) as u32 {
            0 => [long_m, wide_m],
            1 => [wide_m, long_m],
            _ => [0.5, 0.5],
        };
        let at = |cell: usize, size_m: f64, draw: &mut Draw| {
            cell as f64 * BAY_M + draw.uniform(AISLE_M, BAY_M - AISLE_M - size_m)
        };
        let (x_m, y_m) = (at(column, size_m[0], draw), at(row, size_m[1], draw));
        if draw.chance(0.67) {
            boxes.push([x_m, y_m, size_m[0], size_m[1]]);
        }
    }
    boxes
}

fn free_place(room: &GridRoom, draw: &mut Draw) -> [f64; 2] {
    loop {
        let [_, [x_m, y_m]] = room.corners_m();
        let place = [draw.uniform(0.0, x_m), draw.uniform(0.0, y_m)];
        if room.clearance_m(place[0], place[1]) >= WALL_M {
            return place;
        }
    }
}
