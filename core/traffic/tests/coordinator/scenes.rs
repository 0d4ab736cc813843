//! Rooms and starts that are hard for several trucks.

use crate::toy::{Draw, Trouble, World, floor, room};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use xtb_control::VehicleConfig;
use xtb_nav::geometry::rect::Rect;
use xtb_nav::{Car, Map, MapPose, Zone, ZoneKind};
use xtb_traffic::coordinator::{GridRoom, RoomGeometry as _};

pub(crate) fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad }
}

/// Two rooms of 5 m × 6 m with a door between them; three trucks in the one, two in the other.
pub(crate) fn door(seed: u64, door_m: f64, trouble: Trouble, clock_ms: fn() -> f64) -> (World, Vec<MapPose>) {
    let walls = [[4.9, 0.0, 0.2, 3.0 - door_m / 2.0], [4.9, 3.0 + door_m / 2.0, 0.2, 3.0]];
    let starts = vec![
        pose(1.2, 1.0, 0.0),
        pose(1.2, 3.0, 0.0),
        pose(1.2, 5.0, 0.0),
        pose(8.8, 2.0, PI),
        pose(8.8, 4.0, PI),
    ];
    (World::new(room(10.0, 6.0, &walls), &starts, seed, trouble, clock_ms), starts)
}

/// Ten trucks on a circle in 8 m × 8 m, nose inwards, and where each has to go: opposite.
pub(crate) fn circle(seed: u64, clock_ms: fn() -> f64) -> (World, Vec<MapPose>) {
    let place = |index: usize, turn: f64| {
        let angle = index as f64 * TAU / 10.0 + turn;
        pose(4.0 + 3.1 * angle.cos(), 4.0 + 3.1 * angle.sin(), angle + PI)
    };
    let starts: Vec<MapPose> = (0..10).map(|index| place(index, 0.0)).collect();
    // They arrive as they go: nose outwards.
    let goals = (0..10).map(|index| place(index, PI)).map(|goal| pose(goal.x_m, goal.y_m, goal.yaw_rad + PI));
    let world = World::new(room(8.0, 8.0, &[]), &starts, seed, Trouble::SOME, clock_ms);
    (world, goals.collect())
}

/// The corridor of the worlds: 2.4 m wide, 20 m long, a side arm, and a narrow place of 1.2 m; two
/// trucks that want past each other, and one in the arm.
pub(crate) fn corridor(seed: u64, clock_ms: fn() -> f64) -> (World, Vec<MapPose>) {
    // Shifted by (1.2, 8.0) against worlds/corridor.toml.
    let boxes = [[2.4, 0.0, 4.8, 12.0], [2.4, 14.4, 4.8, 5.6], [0.0, 15.7, 1.2, 0.6]];
    let starts = vec![pose(1.2, 8.0, FRAC_PI_2), pose(1.2, 4.0, FRAC_PI_2), pose(1.2, 18.8, -FRAC_PI_2)];
    let goals = vec![pose(1.2, 18.6, FRAC_PI_2), pose(5.5, 13.2, 0.0), pose(1.2, 1.5, -FRAC_PI_2)];
    (World::new(room(7.2, 20.0, &boxes), &starts, seed, Trouble::SOME, clock_ms), goals)
}

/// A lane of 0.9 m with one bay: two trucks meet, and one has to back out.
pub(crate) fn lane(seed: u64, clock_ms: fn() -> f64) -> (World, Vec<MapPose>) {
    let boxes = [[0.0, 0.0, 8.0, 1.5], [0.0, 2.5, 3.0, 1.9], [5.4, 2.5, 2.6, 1.9]];
    let starts = vec![pose(0.8, 2.0, 0.0), pose(7.2, 2.0, PI)];
    let goals = vec![pose(7.0, 2.0, 0.0), pose(1.0, 2.0, PI)];
    (World::new(room(8.0, 4.4, &boxes), &starts, seed, Trouble::SOME, clock_ms), goals)
}

/// Two rooms of 4 m × 6 m with two doors, the northern one to the west only, the southern one to the
/// east; each of two trucks stands before the door that it may not take.
pub(crate) fn one_way(seed: u64, clock_ms: fn() -> f64) -> (World, Vec<MapPose>) {
    let walls = [[3.9, 0.0, 0.2, 0.8], [3.9, 2.2, 0.2, 1.6], [3.9, 5.2, 0.2, 0.8]];
    let zone = |name: &str, south: f64, heading_rad: f64| {
        let corners = vec![[3.4, south], [4.6, south], [4.6, south + 1.4], [3.4, south + 1.4]];
        Zone::new(name, ZoneKind::OneWay { heading_rad }, corners).unwrap()
    };
    let zones = vec![zone("in", 3.8, PI), zone("out", 0.8, 0.0)];
    let map = Map::new("doors", floor(8.0, 6.0, &walls), zones).unwrap();
    let starts = vec![pose(1.2, 4.5, 0.0), pose(6.8, 1.5, PI)];
    let goals = vec![pose(6.8, 4.5, 0.0), pose(1.2, 1.5, PI)];
    (World::new(GridRoom::of(&map), &starts, seed, Trouble::SOME, clock_ms), goals)
}

/// A lane with dead ends and one bay in its middle, for one truck: whoever goes first in an order would be
/// there before the other one could make room.
pub(crate) fn bay(seed: u64, clock_ms: fn() -> f64) -> (World, Vec<MapPose>) {
    let boxes = [[0.0, 0.0, 8.0, 1.5], [0.0, 2.4, 3.4, 1.6], [4.6, 2.4, 3.4, 1.6], [0.0, 3.4, 8.0, 0.6]];
    let starts = vec![pose(0.8, 1.95, 0.0), pose(7.2, 1.95, PI)];
    let goals = vec![pose(7.0, 1.95, 0.0), pose(1.0, 1.95, PI)];
    (World::new(room(8.0, 4.0, &boxes), &starts, seed, Trouble::SOME, clock_ms), goals)
}

/// The two rooms with a door, and eight places where trucks may be sent one at a time.
pub(crate) fn life(seed: u64, trouble: Trouble, clock_ms: fn() -> f64) -> (World, Vec<MapPose>) {
    let (world, mut places) = door(seed, 1.4, trouble, clock_ms);
    places.extend([pose(3.2, 0.8, 0.0), pose(3.2, 5.2, PI), pose(6.6, 0.8, 0.0)]);
    (world, places)
}

/// Sends whoever has arrived to a place that nobody else stands at or is sent to.
pub(crate) fn send_on(world: &mut World, places: &[MapPose], draw: &mut Draw) {
    for index in 0..world.toys.len() {
        if world.toys[index].goal.is_some() || world.toys[index].taken_over || !draw.chance(0.02) {
            continue;
        }
        let near = |x_m: f64, y_m: f64, place: &MapPose| (x_m - place.x_m).hypot(y_m - place.y_m) < 1.0;
        let taken = |place: &&MapPose| {
            world.toys.iter().any(|toy| match toy.goal {
                Some(goal) => near(goal.x_m, goal.y_m, place),
                None => near(toy.pose.x_m, toy.pose.y_m, place),
            })
        };
        let free: Vec<MapPose> = places.iter().filter(|place| !taken(place)).copied().collect();
        if !free.is_empty() {
            let place = free[draw.uniform(0.0, free.len() as f64) as usize];
            world.send(index, place);
        }
    }
}

/// A lane of 0.9 m with a dead end; the truck at its end wants out, and the one in it wants there: it
/// has to back out first.
pub(crate) fn pocket(seed: u64, clock_ms: fn() -> f64) -> (World, Vec<MapPose>) {
    let boxes = [[0.0, 0.0, 4.0, 1.0], [0.0, 1.9, 4.0, 1.6]];
    let starts = vec![pose(0.8, 1.45, 0.0), pose(2.4, 1.45, PI)];
    let goals = vec![pose(6.0, 0.8, 0.0), pose(0.8, 1.45, PI)];
    (World::new(room(7.0, 3.5, &boxes), &starts, seed, Trouble::SOME, clock_ms), goals)
}

/// The same lane; the truck in it wants where a third one stands that nobody has sent anywhere.
pub(crate) fn no_place(seed: u64, clock_ms: fn() -> f64) -> World {
    let boxes = [[0.0, 0.0, 4.0, 1.0], [0.0, 1.9, 4.0, 1.6]];
    let starts = [pose(0.8, 1.45, 0.0), pose(2.4, 1.45, PI), pose(6.3, 2.8, 0.0)];
    let mut world = World::new(room(7.0, 3.5, &boxes), &starts, seed, Trouble::SOME, clock_ms);
    world.send(0, pose(6.0, 0.8, 0.0));
    world.send(1, pose(6.3, 2.8, 0.0));
    world
}

/// Everybody in the two rooms on the way; one dies in the doorway.
pub(crate) fn dead(seed: u64, door_m: f64, clock_ms: fn() -> f64) -> (World, usize) {
    let (mut world, places) = door(seed, door_m, Trouble::SOME, clock_ms);
    for index in 0..5 {
        world.send(index, places[(index + 2) % 5]);
    }
    loop {
        world.turn();
        if let Some(dead) = world.toys.iter().position(|toy| (toy.pose.x_m - 5.0).abs() < 0.15) {
            world.toys[dead].alive = false;
            return (world, dead);
        }
    }
}

/// An L-shaped corridor of 1.5 m; two want from the one arm into the other, two the other way.
pub(crate) fn l_corridor(seed: u64, clock_ms: fn() -> f64) -> (World, Vec<[f64; 2]>) {
    let starts = [
        pose(0.75, 3.0, FRAC_PI_2),
        pose(0.75, 10.0, -FRAC_PI_2),
        pose(6.0, 0.75, 0.0),
        pose(14.0, 0.75, PI),
    ];
    let goals = vec![[1.72, 0.66], [7.03, 0.66], [0.51, 6.39], [0.88, 8.04]];
    let room = room(16.0, 12.0, &[[1.5, 1.5, 14.5, 10.5]]);
    (World::new(room, &starts, seed, Trouble::SOME, clock_ms), goals)
}

/// An L, a U or aisles with corridors of 1.2 to 1.8 m, and three to six trucks somewhere in it.
#[allow(dead_code)] // for the example
pub(crate) fn narrow(seed: u64, clock_ms: fn() -> f64) -> World {
    let mut draw = Draw::new(seed + 500);
    let wide_m = (draw.uniform(1.2, 1.8) / 0.05).round() * 0.05;
    let (x_m, y_m) = (draw.uniform(7.0, 12.0), draw.uniform(5.0, 9.0));
    let boxes = match seed % 3 {
        0 => vec![[wide_m, wide_m, x_m, y_m]],
        1 => vec![[wide_m, wide_m, x_m - 2.0 * wide_m, y_m]],
        _ => (0..3)
            .map(|rack| [wide_m + f64::from(rack) * (wide_m + 0.8), wide_m, 0.8, y_m - 2.0 * wide_m])
            .collect(),
    };
    let x_m = if seed % 3 == 2 { 4.0 * wide_m + 2.4 } else { x_m };
    let room = room(x_m, y_m, &boxes);
    let mut starts: Vec<MapPose> = Vec::new();
    let count = 3 + draw.uniform(0.0, 4.0) as usize;
    while starts.len() < count {
        let [x_m, y_m] = free_place(&room, &mut draw);
        let yaw_rad = draw.uniform(0.0, 4.0).floor() * FRAC_PI_2 - FRAC_PI_2;
        let here = pose(x_m, y_m, yaw_rad);
        let apart = starts.iter().all(|other| (other.x_m - x_m).hypot(other.y_m - y_m) > 1.0);
        let car = Car::of(&VehicleConfig::default());
        if apart && room.is_free(&Rect::body(&car, &here), 0.1) {
            starts.push(here);
        }
    }
    World::new(room, &starts, seed, Trouble { pause: 0.0, ..Trouble::SOME }, clock_ms)
}

/// A place in which a truck can stand somehow.
#[allow(dead_code)] // for the example
pub(crate) fn free_place(room: &GridRoom, draw: &mut Draw) -> [f64; 2] {
    loop {
        let [_, [x_m, y_m]] = room.corners_m();
        let place = [draw.uniform(0.0, x_m), draw.uniform(0.0, y_m)];
        if room.clearance_m(place[0], place[1]) >= 0.5 {
            return place;
        }
    }
}
