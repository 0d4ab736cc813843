//! Narrow rooms at random: L, T and U corridors of 1.2 to 1.8 m, mazes, aisles between racks.

use crate::draw::Draw;
use std::fmt::Write as _;

/// Walls of mazes are so thick, in m.
const WALL_M: f64 = 0.1;

/// What a room looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    L,
    T,
    U,
    Maze,
    Aisles,
}

impl Kind {
    pub(crate) const ALL: [Self; 5] = [Self::L, Self::T, Self::U, Self::Maze, Self::Aisles];
}

/// A room and how many robots live in it.
#[derive(Debug, Clone)]
#[allow(dead_code)] // for the example
pub(crate) struct Room {
    pub(crate) kind: Kind,
    /// Of its corridors, in m.
    pub(crate) width_m: f64,
    pub(crate) robots: usize,
    /// The world's file. The south-west corner is (0, 0).
    pub(crate) world: String,
}

impl Room {
    /// The room of this seed.
    pub(crate) fn of(seed: u64) -> Self {
        let mut draw = Draw::new(seed);
        let kind = Kind::ALL[(seed % 5) as usize];
        let width_m = (draw.uniform(1.2, 1.8) / 0.05).round() * 0.05;
        let robots = 3 + draw.below(6);
        let world = match kind {
            Kind::L => l(width_m, draw.uniform(8.0, 16.0), draw.uniform(6.0, 12.0)),
            Kind::T => {
                let (wide_m, stem_m) = (draw.uniform(8.0, 16.0), draw.uniform(4.0, 8.0));
                let at_m = draw.uniform(1.0, wide_m - width_m - 1.0);
                let east_m = wide_m - at_m - width_m;
                let beside = [[0.0, 0.0, at_m, stem_m], [at_m + width_m, 0.0, east_m, stem_m]];
                world(wide_m, stem_m + width_m, &beside, "")
            }
            Kind::U => {
                let (wide_m, deep_m) = (draw.uniform(6.0, 12.0), draw.uniform(5.0, 9.0));
                let inner = [width_m, width_m, wide_m - 2.0 * width_m, deep_m - width_m];
                world(wide_m, deep_m, &[inner], "")
            }
            Kind::Maze => maze(width_m, [4 + draw.below(3), 3 + draw.below(3)], &mut draw),
            Kind::Aisles => aisles(width_m, 2 + draw.below(3), &mut draw),
        };
        Self { kind, width_m, robots, world }
    }
}

/// A room of this size with boxes in it (x, y, width, depth from the south-west corner, in m), and walls.
fn world(wide_m: f64, deep_m: f64, boxes: &[[f64; 4]], walls: &str) -> String {
    let (x_m, y_m) = (wide_m / 2.0, deep_m / 2.0);
    let mut world =
        format!("[room]\nx_m = {x_m:?}\ny_m = {y_m:?}\nwidth_m = {wide_m:?}\ndepth_m = {deep_m:?}\n");
    for (number, [x_m, y_m, wide_m, deep_m]) in boxes.iter().enumerate() {
        let (x_m, y_m) = (x_m + wide_m / 2.0, y_m + deep_m / 2.0);
        let _ = write!(
            world,
            "[[boxes]]\nname = \"b{number}\"\nx_m = {x_m:?}\ny_m = {y_m:?}\nwidth_m = {wide_m:?}\ndepth_m = {deep_m:?}\n"
        );
    }
    world + walls
}

/// Along x and along y from one corner.
pub(crate) fn l(width_m: f64, along_x_m: f64, along_y_m: f64) -> String {
    let inner = [width_m, width_m, along_x_m - width_m, along_y_m - width_m];
    world(along_x_m, along_y_m, &[inner], "")
}

/// Racks side by side, an aisle between each two and along the walls, and one across at either end.
fn aisles(width_m: f64, racks: usize, draw: &mut Draw) -> String {
    let (rack_m, long_m) = (draw.uniform(0.6, 1.0), draw.uniform(4.0, 7.0));
    let pitch_m = width_m + rack_m;
    let rack = |n: usize| [width_m + n as f64 * pitch_m, width_m, rack_m, long_m];
    let boxes: Vec<[f64; 4]> = (0..racks).map(rack).collect();
    world(racks as f64 * pitch_m + width_m, long_m + 2.0 * width_m, &boxes, "")
}

/// Cells side by side with a way from each to each, and a few more openings.
fn maze(width_m: f64, [columns, rows]: [usize; 2], draw: &mut Draw) -> String {
    let pitch_m = width_m + WALL_M;
    let cells = columns * rows;
    let mut edges: Vec<(usize, usize)> = (0..cells)
        .flat_map(|cell| {
            let east = (cell % columns + 1 < columns).then_some((cell, cell + 1));
            let north = (cell + columns < cells).then_some((cell, cell + columns));
            [east, north].into_iter().flatten()
        })
        .collect();
    for last in (1..edges.len()).rev() {
        edges.swap(last, draw.below(last + 1));
    }
    // A wall falls if it parts cells that are not joined yet.
    let mut part: Vec<usize> = (0..cells).collect();
    let mut walls = String::new();
    for (one, other) in edges {
        let (from, to) = (part[one], part[other]);
        if from != to {
            part.iter_mut().filter(|part| **part == from).for_each(|part| *part = to);
        } else if draw.below(5) > 0 {
            let [x, y] = [(other % columns) as f64 * pitch_m, (other / columns) as f64 * pitch_m];
            let end = if other == one + 1 { [x, y + pitch_m] } else { [x + pitch_m, y] };
            let _ = write!(
                walls,
                "[[walls]]\npoints = [[{x:?}, {y:?}], [{:?}, {:?}]]\nthickness_m = {WALL_M:?}\n",
                end[0], end[1]
            );
        }
    }
    world(columns as f64 * pitch_m, rows as f64 * pitch_m, &[], &walls)
}
