//! A hall of 60 × 60 m with shelves and pillars in which whole robots on whole trucks drive to one random goal after
//! the other under traffic control: beside it stands what `xtb-traffic`'s example `hall` says of robots that follow
//! their paths exactly.
//!
//! `cargo run --release -p xtb-sim --example hall_trucks -- ROBOTS MINUTES SEED`, in virtual time, on all cores. Pose fixes at
//! 2 Hz; a joint plan takes 0.5 s, whatever it costs.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[path = "scale/threads.rs"]
mod threads;

use rand_core::Rng;
use rand_pcg::Pcg32;
use std::collections::BTreeMap;
use std::num::NonZero;
use std::time::Instant;
use threads::Threads;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_nav::Car;
use xtb_nav::geometry::rect::Rect;
use xtb_protocol::messages::{Body, GoalStatus, LinkLoss, Outcome, Request, Via};
use xtb_protocol::{Name, Uuid};
use xtb_sim::fixes::FixTruth;
use xtb_sim::lockstep::Traffic;
use xtb_sim::{BoxSpec, Executor, Lockstep, Sequential, Simulation, TruckParameters, World};
use xtb_traffic::coordinator::{GridRoom, RoomGeometry as _};

/// Side of the hall, and of the square in which one shelf or pillar may stand, in m.
const SIDE_M: f64 = 60.0;
const BAY_M: f64 = 6.0;
/// What each keeps from the sides of its square, in m: aisles are twice as wide at least.
const AISLE_M: f64 = 1.2;
/// Places and goals are so far apart at least, and so far from walls and shelves, in m.
const APART_M: f64 = 1.0;
const WALL_M: f64 = 0.6;
/// Looks at everybody are so many steps apart: 0.1 s.
const STEPS: u64 = 20;
/// Who moves less than this from one look to the next stands, in m.
const STANDS_M: f64 = 1e-3;
/// Everybody gets a fresh pack after so many looks, half an hour: one lasts for an hour of driving.
const FRESH_PACKS: u64 = 18_000;
/// One robot alone drives for so long: what all others are compared with.
const ALONE_MIN: u64 = 120;

fn main() {
    let number = |n| std::env::args().nth(n).and_then(|text| text.parse::<u64>().ok());
    let (Some(robots), Some(minutes), Some(seed)) = (number(1), number(2), number(3)) else {
        panic!("hall_trucks ROBOTS MINUTES SEED");
    };
    let cores = Threads(std::thread::available_parallelism().map_or(1, NonZero::get));
    let mut alone = Hall::new(1, seed);
    alone.run(ALONE_MIN, &Sequential);
    let began = Instant::now();
    let mut hall = Hall::new(robots as usize, seed);
    hall.run(minutes, &cores);
    println!(
        "| robots | min | seed | goals per robot-hour | alone | longest standstill, s | contacts | failed |"
    );
    println!("|{}", " ---: |".repeat(8));
    println!(
        "| {robots} | {minutes} | {seed} | {:.1} | {:.1} | {:.1} | {} | {} |",
        f64::from(hall.reached) / robots as f64 * 60.0 / minutes as f64,
        f64::from(alone.reached) * 60.0 / ALONE_MIN as f64,
        hall.longest_still_s,
        hall.contacts(),
        hall.failed.values().sum::<u32>(),
    );
    hall.failed.iter().for_each(|(why, count)| println!("{count} goals ended otherwise: {why}"));
    println!("{} of one robot alone; it took {:.0} s", alone.contacts(), began.elapsed().as_secs_f64());
}

/// A fleet in the hall.
struct Hall {
    fleet: Lockstep,
    room: GridRoom,
    dice: Pcg32,
    client: Name,
    goals: Vec<Option<[f64; 2]>>,
    asked: u128,
    reached: u32,
    /// Goals that ended without being reached, by reason.
    failed: BTreeMap<String, u32>,
    longest_still_s: f64,
    /// Where each was last seen to move, and when, in s.
    still: Vec<(MapPose, f64)>,
}

impl Hall {
    fn new(robots: usize, seed: u64) -> Self {
        let mut dice = Pcg32::new(seed, 0x4A11);
        let mut world =
            World::from_toml(&format!("[room]\nwidth_m = {SIDE_M}\ndepth_m = {SIDE_M}\n")).unwrap();
        for (n, shelf) in shelves(&mut dice).into_iter().enumerate() {
            world.put_box(&format!("shelf-{n}"), shelf).unwrap();
        }
        let map = world.to_map(0.05).unwrap();
        let room = GridRoom::of(&map);
        let car = Car::of(&VehicleConfig::default());
        let mut starts: Vec<MapPose> = Vec::new();
        while starts.len() < robots {
            let [x_m, y_m] = free_place(&room, &mut dice);
            let here = MapPose { x_m, y_m, yaw_rad: between(&mut dice, -3.0, 3.0) };
            let apart = starts.iter().all(|other| (other.x_m - x_m).hypot(other.y_m - y_m) > APART_M);
            if apart && room.is_free(&Rect::body(&car, &here), 0.1) {
                starts.push(here);
            }
        }
        let names: Vec<String> = (1..=robots).map(|n| format!("xtb-{n}")).collect();
        let placed: Vec<(&str, MapPose)> =
            names.iter().map(String::as_str).zip(starts.iter().copied()).collect();
        let simulation = Simulation::with_starts(world, &TruckParameters::default(), &placed, seed).unwrap();
        let lab = Name::new("lab").unwrap();
        let mut fleet = Lockstep::new(simulation, &lab, &VehicleConfig::default()).unwrap();
        fleet.set_map(&map);
        fleet.set_fixes(FixTruth { rate_hz: 2.0, ..FixTruth::default() }, seed);
        fleet.set_traffic(Some(Traffic::new(&map, seed)));
        let still = starts.iter().map(|start| (*start, 0.0)).collect();
        Self {
            fleet,
            room,
            dice,
            client: Name::new("hall").unwrap(),
            goals: vec![None; robots],
            asked: 0,
            reached: 0,
            failed: BTreeMap::new(),
            longest_still_s: 0.0,
            still,
        }
    }

    fn contacts(&self) -> u64 {
        self.fleet.simulation().truths().map(|truth| truth.contacts).sum()
    }

    /// So many minutes of virtual time, after half a second in which everybody starts.
    fn run(&mut self, minutes: u64, executor: &impl Executor) {
        self.fleet.run(100, executor);
        for look in 0..minutes * 600 {
            if look % FRESH_PACKS == 0 {
                let trucks = self.fleet.simulation_mut().trucks_mut();
                trucks.iter_mut().for_each(|truck| truck.set_battery_left(1.0));
            }
            for robot in 0..self.goals.len() {
                self.look_after(robot);
            }
            self.fleet.run(STEPS, executor);
            self.watch();
        }
    }

    /// Whoever has no goal any more gets the next one.
    fn look_after(&mut self, robot: usize) {
        let state = self.fleet.state(robot).unwrap();
        if let Some(goal) = state.goal.filter(|_| self.goals[robot].is_some()) {
            match goal.status {
                GoalStatus::Reached => self.reached += 1,
                status if status.is_final() => {
                    let why = goal.reason.unwrap_or_else(|| format!("{status:?}"));
                    *self.failed.entry(why).or_default() += 1;
                }
                _ => return,
            }
            self.goals[robot] = None;
        }
        let place = loop {
            let place = free_place(&self.room, &mut self.dice);
            let is_near = |[x_m, y_m]: [f64; 2]| (x_m - place[0]).hypot(y_m - place[1]) < APART_M;
            let stands = |other: usize| [self.still[other].0.x_m, self.still[other].0.y_m];
            let taken = (0..self.goals.len())
                .any(|other| other != robot && is_near(self.goals[other].unwrap_or_else(|| stands(other))));
            if !taken {
                break place;
            }
        };
        let ([x_m, y_m], via, on_link_loss) = (place, Some(Via::Planned), LinkLoss::Finish);
        let body = Body::Goto { x_m, y_m, yaw_rad: None, via, on_link_loss, finish_s: 300.0 };
        self.asked += 1;
        let request = Request { id: Uuid::from_u128(self.asked), lease: None, body };
        let reply = self.fleet.request(robot, &self.client, &request).unwrap();
        // Before its first pose a robot takes none.
        self.goals[robot] = matches!(reply.result, Outcome::Ok(_)).then_some(place);
    }

    fn watch(&mut self) {
        let now_s = self.fleet.now().s();
        for (still, truth) in self.still.iter_mut().zip(self.fleet.simulation().truths()) {
            let (seen, since_s) = still;
            if (truth.x_m - seen.x_m).hypot(truth.y_m - seen.y_m) >= STANDS_M {
                (*seen, *since_s) =
                    (MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad }, now_s);
            }
            self.longest_still_s = self.longest_still_s.max(now_s - *since_s);
        }
    }
}

/// In about two of three squares a shelf along x or along y, or a pillar.
fn shelves(dice: &mut Pcg32) -> Vec<BoxSpec> {
    let squares = (SIDE_M / BAY_M) as usize;
    let mut boxes = Vec::new();
    for (row, column) in (0..squares).flat_map(|row| (0..squares).map(move |column| (row, column))) {
        let (long_m, wide_m) = (between(dice, 2.0, BAY_M - 2.0 * AISLE_M), between(dice, 0.6, 1.2));
        let [width_m, depth_m] = match between(dice, 0.0, 3.0) as u32 {
            0 => [long_m, wide_m],
            1 => [wide_m, long_m],
            _ => [0.5, 0.5],
        };
        let mut centre_m = |cell: usize, size_m: f64| {
            let from_m = cell as f64 * BAY_M - SIDE_M / 2.0 + size_m / 2.0;
            from_m + between(dice, AISLE_M, BAY_M - AISLE_M - size_m)
        };
        let (x_m, y_m) = (centre_m(column, width_m), centre_m(row, depth_m));
        if between(dice, 0.0, 1.0) < 0.67 {
            boxes.push(BoxSpec { x_m, y_m, width_m, depth_m, yaw_rad: 0.0 });
        }
    }
    boxes
}

fn free_place(room: &GridRoom, dice: &mut Pcg32) -> [f64; 2] {
    loop {
        let [from_m, to_m] = room.corners_m();
        let place = [0, 1].map(|axis| between(dice, from_m[axis], to_m[axis]));
        if room.clearance_m(place[0], place[1]) >= WALL_M {
            return place;
        }
    }
}

fn between(dice: &mut Pcg32, from: f64, to: f64) -> f64 {
    from + (to - from) * f64::from(dice.next_u32()) / f64::from(u32::MAX)
}
