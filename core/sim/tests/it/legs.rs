//! Rooms full of tables of which the map knows nothing: planned goals one after the other among their legs, the
//! whole robot on the whole vehicle, poses from fixes. The tests below and the example `legs` measure with this.

use crate::draw::{Draw, in_parallel};
use crate::drive::Drive;
use crate::journeys::Room;
use std::f64::consts::PI;
use xtb_control::{Stamp, VehicleConfig};
use xtb_nav::{Car, MapPose};
use xtb_protocol::messages::{GoalStatus, Outcome, TruthRobot};
use xtb_sim::{BoxSpec, World};

/// An empty room.
const EMPTY: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0\n";
/// Half of its side, without the walls' neighbourhood.
const INSIDE_M: f64 = 3.7;
/// The robot starts no nearer to a leg than this: what stands between two beams when it is switched on cannot be
/// seen by any driving.
const FAIR_M: f64 = 0.45;
/// Goals in each room.
pub(crate) const GOALS: u64 = 5;
/// Longer than any way in these rooms takes.
const PATIENCE_S: f64 = 400.0;
/// Goals that are drawn before one that can be reached.
const MOST_DRAWS: usize = 50;
/// A place of a goal is this far from the one before, in m.
const LEAST_WAY_M: f64 = 1.5;
/// Sides of a round leg.
const ROUND: usize = 8;

/// One leg of a table.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leg {
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    /// Its side, or its diameter, in m.
    pub(crate) width_m: f64,
    yaw_rad: f64,
    is_round: bool,
}

impl Leg {
    /// How far ahead and to the left of the middle of a body.
    fn from(&self, truth: &TruthRobot) -> (f64, f64) {
        let (sin, cos) = libm::sincos(truth.yaw_rad);
        let (dx, dy) = (self.x_m - truth.x_m, self.y_m - truth.y_m);
        (dx * cos + dy * sin, dy * cos - dx * sin)
    }

    fn boxes(&self) -> Vec<BoxSpec> {
        let Self { x_m, y_m, width_m, yaw_rad, .. } = *self;
        let slab = |depth_m, yaw_rad| BoxSpec { x_m, y_m, width_m, depth_m, yaw_rad };
        if !self.is_round {
            return vec![slab(width_m, yaw_rad)];
        }
        // An octagon is the union of the slabs between its opposite sides.
        let side_m = width_m * libm::tan(PI / ROUND as f64);
        (0..ROUND / 2).map(|n| slab(side_m, PI * n as f64 / (ROUND / 2) as f64)).collect()
    }
}

/// Something that was touched.
#[derive(Debug, Clone, Copy)]
#[allow(dead_code)] // shown by the example and when a test fails
pub(crate) struct Contact {
    /// Signed, just before.
    pub(crate) speed_mps: f64,
    /// The nearest leg, seen from the middle of the body.
    pub(crate) ahead_m: f64,
    pub(crate) left_m: f64,
    pub(crate) width_m: f64,
    /// When it was in a beam last, before that, in s.
    pub(crate) seen_s_ago: Option<f64>,
    /// Whether something that is not on the map was known of.
    pub(crate) met: bool,
    /// The path's curvature there; without one it backed off, or stood.
    pub(crate) path_per_m: Option<f64>,
}

/// What the beams have passed over of the legs of a room, by the truth.
#[derive(Debug, Clone)]
struct Witness {
    /// For each leg how often it was in a beam, and when last.
    seen: Vec<(u32, Option<Stamp>)>,
}

impl Witness {
    fn new(legs: &[Leg]) -> Self {
        Self { seen: vec![(0, None); legs.len()] }
    }

    fn look(&mut self, now: Stamp, truth: &TruthRobot, legs: &[Leg]) {
        for (leg, seen) in legs.iter().zip(&mut self.seen) {
            let (ahead_m, left_m) = leg.from(truth);
            let off_m = ahead_m.abs() - 0.25 - leg.width_m / 2.0;
            let half_m = (0.0075 + off_m * 0.0525 / 0.8 + leg.width_m) / 2.0;
            let in_beam = (0..6).any(|beam| (left_m - (2.5 - f64::from(beam)) * 0.07).abs() <= half_m);
            if (0.0..0.5).contains(&off_m) && in_beam {
                *seen = (seen.0 + 1, Some(now));
            }
        }
    }

    fn has_met(&self) -> bool {
        self.seen.iter().any(|(times, _)| *times >= 3)
    }
}

/// What came of one goal.
#[derive(Debug, Clone)]
#[allow(dead_code)] // shown by the example and when a test fails
pub(crate) struct LegJourney {
    pub(crate) seed: u64,
    pub(crate) number: u64,
    pub(crate) status: Option<GoalStatus>,
    pub(crate) reason: Option<String>,
    pub(crate) contacts: Vec<Contact>,
    pub(crate) took_s: f64,
    /// Of the shortest way that one who knows the legs has, in m.
    pub(crate) way_m: f64,
    pub(crate) plans: u32,
    /// It failed, and one who knows everything finds a way: at full lock, with 5 mm to spare.
    pub(crate) false_failure: bool,
}

impl LegJourney {
    pub(crate) fn stalled(&self) -> bool {
        self.reason.as_deref().is_some_and(|reason| reason.contains("stalled"))
    }
}

/// Five to ten tables anywhere.
fn tables(draw: &mut Draw) -> Vec<Leg> {
    let mut legs = Vec::new();
    for _ in 0..5 + draw.below(6) {
        let (x_m, y_m) = (draw.uniform(-INSIDE_M, INSIDE_M), draw.uniform(-INSIDE_M, INSIDE_M));
        let (half_m, other_half_m) = (draw.uniform(0.3, 0.9), draw.uniform(0.3, 0.5));
        let (yaw_rad, width_m) = (draw.uniform(-PI, PI), draw.uniform(0.02, 0.05));
        let is_round = draw.below(2) == 0;
        let (sin, cos) = libm::sincos(yaw_rad);
        for (along_m, across_m) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(along, across)| (along * half_m, across * other_half_m))
        {
            let (x_m, y_m) = (x_m + along_m * cos - across_m * sin, y_m + along_m * sin + across_m * cos);
            if x_m.abs() < INSIDE_M && y_m.abs() < INSIDE_M {
                legs.push(Leg { x_m, y_m, width_m, yaw_rad, is_round });
            }
        }
    }
    legs
}

fn clear_of(legs: &[Leg], pose: &MapPose, room_m: f64) -> bool {
    let car = Car::of(&VehicleConfig::default());
    legs.iter().all(|leg| car.distance_m(pose, [leg.x_m, leg.y_m]) > room_m + leg.width_m)
}

/// All goals of this seed's room, with its legs or without.
pub(crate) fn among_legs(seed: u64, with_legs: bool) -> Vec<LegJourney> {
    let mut draw = Draw::new(seed ^ 0x1E65);
    let empty = World::from_toml(EMPTY).unwrap();
    let legs = tables(&mut draw);
    let mut world = empty.clone();
    for (number, spec) in legs.iter().flat_map(Leg::boxes).enumerate() {
        world.put_box(&format!("leg-{number}"), spec).unwrap();
    }
    let known = Room::knowing(&world, 0.06, xtb_nav::navigator::RADIUS_FACTOR);
    let start = loop {
        let pose = known.pose(&mut draw);
        if clear_of(&legs, &pose, FAIR_M) {
            break pose;
        }
    };
    let mut drive = Drive::at(empty, &[start], seed);
    if with_legs {
        for (number, spec) in legs.iter().flat_map(Leg::boxes).enumerate() {
            drive.lockstep.simulation_mut().put_box(&format!("leg-{number}"), spec).unwrap();
        }
    }
    let mut from = start;
    let mut witness = Witness::new(&legs);
    let mut journeys = Vec::new();
    for number in 0..GOALS {
        let drawn = (0..MOST_DRAWS).find_map(|_| {
            let (goal, with_yaw) = (known.pose(&mut draw), draw.below(2) == 0);
            let way_m = known.path(&from, &goal, with_yaw)?.length_m();
            (way_m > LEAST_WAY_M).then_some((goal, with_yaw, way_m))
        });
        // It stands among legs that let nobody out.
        let Some((goal, with_yaw, way_m)) = drawn else { break };
        journeys.push(to(&mut drive, seed, number, &goal, with_yaw, way_m, &legs, &mut witness, &world));
        // Where the next one is drawn from does not depend on how this one went.
        from = goal;
    }
    journeys
}

#[allow(clippy::too_many_arguments)]
fn to(
    drive: &mut Drive,
    seed: u64,
    number: u64,
    goal: &MapPose,
    with_yaw: bool,
    way_m: f64,
    legs: &[Leg],
    witness: &mut Witness,
    world: &World,
) -> LegJourney {
    let mut made = LegJourney {
        seed,
        number,
        status: None,
        reason: None,
        contacts: Vec::new(),
        took_s: 0.0,
        way_m,
        plans: 0,
        false_failure: false,
    };
    let yaw_rad = with_yaw.then_some(goal.yaw_rad);
    if let Outcome::Error(error) = drive.goto(0, goal.x_m, goal.y_m, yaw_rad) {
        made.reason = Some(error.message);
        return made;
    }
    let begun = drive.lockstep.now();
    let mut before = drive.lockstep.simulation().trucks()[0].truth();
    let mut steps = 0;
    while made.took_s < PATIENCE_S {
        drive.lockstep.step();
        let truth = drive.lockstep.simulation().trucks()[0].truth();
        if truth.contacts > before.contacts {
            let pose = MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad };
            let car = Car::of(&VehicleConfig::default());
            let off_m = |leg: &&Leg| car.distance_m(&pose, [leg.x_m, leg.y_m]);
            if let Some(leg) = legs.iter().min_by(|a, b| off_m(a).total_cmp(&off_m(b))) {
                let (ahead_m, left_m) = leg.from(&truth);
                let at = legs.iter().position(|other| std::ptr::eq(other, leg)).unwrap();
                made.contacts.push(Contact {
                    speed_mps: before.speed_mps,
                    ahead_m,
                    left_m,
                    width_m: leg.width_m,
                    seen_s_ago: witness.seen[at].1.map(|seen| drive.lockstep.now().since_s(seen)),
                    met: witness.has_met(),
                    path_per_m: path_per_m(drive),
                });
            }
        }
        if steps % 8 == 0 {
            witness.look(drive.lockstep.now(), &truth, legs);
        }
        before = truth;
        steps += 1;
        if steps % 20 != 0 {
            continue;
        }
        made.took_s = drive.lockstep.now().since_s(begun);
        let state = drive.lockstep.state(0).unwrap();
        made.plans = state.nav.route.map_or(made.plans, |route| route.plans);
        let said = state.goal.unwrap();
        (made.status, made.reason) = (Some(said.status), said.reason);
        if said.status.is_final() {
            break;
        }
    }
    if made.status == Some(GoalStatus::Failed) {
        let now = MapPose { x_m: before.x_m, y_m: before.y_m, yaw_rad: before.yaw_rad };
        made.false_failure = Room::knowing(world, 0.005, 1.0).path(&now, goal, with_yaw).is_some();
        // What a fault shows for a second must not end the next goal.
        drive.run_s(2.0);
    }
    made
}

/// Of the path where it is, in 1/m, if it drives one.
fn path_per_m(drive: &mut Drive) -> Option<f64> {
    let route = drive.lockstep.state(0)?.nav.route?;
    let mut to_m = 0.0;
    let here = route.track?.arcs.into_iter().find(|arc| {
        to_m += arc.length_m.abs();
        route.done_m <= to_m
    });
    Some(here?.curvature_per_m)
}

/// All goals in the rooms of these seeds.
pub(crate) fn rooms_of_legs(seeds: std::ops::Range<u64>, with_legs: bool) -> Vec<LegJourney> {
    in_parallel(seeds, |seed| among_legs(seed, with_legs)).concat()
}

/// A robot at (−2, 0) that looks east, and a square leg of 2 cm so far before its bumper and to its left.
#[cfg(test)]
fn before_a_leg(ahead_m: f64, left_m: f64, seed: u64) -> Drive {
    let start = MapPose { x_m: -2.0, y_m: 0.0, yaw_rad: 0.0 };
    let mut drive = Drive::at(World::from_toml(EMPTY).unwrap(), &[start], seed);
    let x_m = start.x_m + Car::of(&VehicleConfig::default()).front_m + ahead_m + 0.01;
    let leg = BoxSpec { x_m, y_m: left_m, width_m: 0.02, depth_m: 0.02, yaw_rad: 0.0 };
    drive.lockstep.simulation_mut().put_box("leg", leg).unwrap();
    drive
}

#[test]
fn something_touched_that_no_beam_saw_is_an_obstacle_and_the_goal_is_reached() {
    for seed in 0..3 {
        let mut drive = before_a_leg(0.05, 0.0, seed);
        assert!(matches!(drive.goto(0, 2.0, 0.0, None), Outcome::Ok(_)));
        let state = drive.wait(0, 180.0);
        let truth = drive.lockstep.simulation().trucks()[0].truth();
        let goal = state.goal.unwrap();
        assert_eq!(
            (goal.status, goal.reason.as_deref()),
            (GoalStatus::Reached, None),
            "seed {seed}: {truth:?}"
        );
        assert_eq!(truth.contacts, 1, "seed {seed}: no driving could have seen it, once it is known");
    }
}

#[test]
fn a_leg_midway_between_two_beams_is_seen_on_the_way_to_it() {
    for (seed, left_m) in [0.0, 0.07, -0.07, 0.14, -0.14, 0.2, -0.2].into_iter().enumerate() {
        let mut drive = before_a_leg(1.2, left_m, seed as u64);
        assert!(matches!(drive.goto(0, 2.0, 0.0, None), Outcome::Ok(_)));
        let state = drive.wait(0, 180.0);
        let truth = drive.lockstep.simulation().trucks()[0].truth();
        assert_eq!(truth.contacts, 0, "{left_m} m to the left: {truth:?}");
        assert_eq!(state.goal.unwrap().status, GoalStatus::Reached, "{left_m} m to the left");
    }
}

/// Neutral at once, one try to back off, then a fault: never driven for a second without a pulse.
#[test]
fn wheels_that_are_held_on_a_path_are_a_fault_after_one_way_back() {
    for seed in 0..3 {
        let start = MapPose { x_m: -2.0, y_m: 0.0, yaw_rad: 0.0 };
        let mut drive = Drive::at(World::from_toml(EMPTY).unwrap(), &[start], seed);
        assert!(matches!(drive.goto(0, 2.0, 0.0, None), Outcome::Ok(_)));
        drive.run_s(4.0);
        drive.lockstep.simulation_mut().trucks_mut()[0].set_drive_fault(xtb_sim::DriveFault::Held);
        let (mut driven_s, mut longest_s, mut tries) = (0.0_f64, 0.0_f64, 0);
        for _ in 0..2000 {
            drive.lockstep.step();
            let driven = drive.lockstep.simulation().trucks()[0].truth().motor_counts.abs_diff(3750) > 100;
            tries += u32::from(driven && driven_s == 0.0);
            driven_s = if driven { driven_s + 0.005 } else { 0.0 };
            longest_s = longest_s.max(driven_s);
        }
        let goal = drive.lockstep.state(0).unwrap().goal.unwrap();
        assert_eq!(goal.status, GoalStatus::Failed, "seed {seed}");
        assert!(goal.reason.as_deref().is_some_and(|reason| reason.contains("stalled")), "{:?}", goal.reason);
        assert!(longest_s <= 1.0 && tries <= 3, "seed {seed}: {longest_s} s, {tries} tries");
    }
}

/// The table of docs/navigation.md in small.
#[test]
fn among_the_legs_of_tables_goals_are_reached_and_none_ends_as_stalled() {
    let all = rooms_of_legs(100..104, true);
    let contacts: usize = all.iter().map(|journey| journey.contacts.len()).sum();
    assert!(contacts <= 1, "{all:#?}");
    assert!(all.iter().all(|journey| !journey.stalled()), "{all:#?}");
    assert!(all.iter().filter(|journey| journey.false_failure).count() <= 2, "{all:#?}");
}
