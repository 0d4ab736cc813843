//! Rooms to try planners in: open, cluttered, doors and dead ends; the same seed gives the same room.

use crate::MapPose;
use crate::geometry::{Cell, Grid};
use crate::planner::space::Space;
use rand_core::Rng;
use rand_pcg::Pcg32;
use std::f64::consts::PI;

/// Cells to a side: rooms of 10 m, as in the table of docs/navigation.md.
const CELLS: i64 = 200;
/// Side of a cell, in m: the usual one of a map.
const RESOLUTION_M: f64 = 0.05;

/// What stands in a room of 10 m × 10 m.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RoomKind {
    /// A dozen boxes.
    Open,
    /// Boxes everywhere, many gaps just wide enough.
    Cluttered,
    /// Chambers with doors a little wider than the car, stubs of walls, some chambers without a door.
    Doors,
}

impl RoomKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Open, Self::Cluttered, Self::Doors];

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Cluttered => "cluttered",
            Self::Doors => "doors and dead ends",
        }
    }

    /// The room that a seed makes.
    #[must_use]
    pub fn grid(self, seed: u64) -> Grid {
        let mut draw = Draw::new(seed);
        let cells = vec![Cell::Free; (CELLS * CELLS) as usize];
        let Ok(grid) = Grid::new(RESOLUTION_M, [0.0, 0.0], CELLS as usize, CELLS as usize, cells) else {
            unreachable!("the size is within the limits of a grid")
        };
        let mut builder = Builder { grid, draw: &mut draw };
        for wall in [[0, 0, CELLS, 1], [0, CELLS - 1, CELLS, 1], [0, 0, 1, CELLS], [CELLS - 1, 0, 1, CELLS]] {
            builder.fill(wall);
        }
        match self {
            Self::Open => builder.boxes(12, 6..=20),
            Self::Cluttered => builder.boxes(130, 2..=12),
            Self::Doors => builder.chambers([1, 1, CELLS - 2, CELLS - 2]),
        }
        builder.grid
    }
}

/// Numbers from a seed.
#[derive(Debug)]
pub struct Draw(Pcg32);

impl Draw {
    /// The numbers of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut draw = Self(Pcg32::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15), seed));
        draw.uniform(0.0, 1.0); // the first one still knows the seed
        draw
    }

    /// Uniform in [min, max).
    pub fn uniform(&mut self, min: f64, max: f64) -> f64 {
        min + (max - min) * f64::from(self.0.next_u32()) / 4_294_967_296.0
    }

    /// A whole number from `min` up to `max`.
    pub fn whole(&mut self, min: i64, max: i64) -> i64 {
        libm::floor(self.uniform(min as f64, max as f64 + 1.0)) as i64
    }

    /// A pose at which the car can stand, or `None` after a thousand tries.
    pub fn free_pose(&mut self, space: &impl Space) -> Option<MapPose> {
        let bounds = space.bounds();
        let poses = (0..1000).map(|_| MapPose {
            x_m: self.uniform(bounds.low_m[0], bounds.high_m[0]),
            y_m: self.uniform(bounds.low_m[1], bounds.high_m[1]),
            yaw_rad: self.uniform(-PI, PI),
        });
        poses.into_iter().find(|pose| space.standing(pose).is_none())
    }
}

struct Builder<'a> {
    grid: Grid,
    draw: &'a mut Draw,
}

impl Builder<'_> {
    /// Fills column, row, width and height.
    fn fill(&mut self, [column, row, width, height]: [i64; 4]) {
        for (c, r) in (column..column + width).flat_map(|c| (row..row + height).map(move |r| (c, r))) {
            self.grid.set(c, r, Cell::Occupied);
        }
    }

    fn boxes(&mut self, count: usize, sides: std::ops::RangeInclusive<i64>) {
        for _ in 0..count {
            let (width, height) = (
                self.draw.whole(*sides.start(), *sides.end()),
                self.draw.whole(*sides.start(), *sides.end()),
            );
            let (column, row) = (self.draw.whole(0, CELLS - width), self.draw.whole(0, CELLS - height));
            self.fill([column, row, width, height]);
        }
    }

    /// Divides a part of the room by a wall with a door until the chambers are small, then puts a
    /// stub of a wall into most.
    fn chambers(&mut self, [column, row, width, height]: [i64; 4]) {
        let wide = width >= height;
        let (length, other) = if wide { (width, height) } else { (height, width) };
        if length < 56 || other < 24 {
            self.stub([column, row, width, height]);
            return;
        }
        let at = self.draw.whole(length / 3, 2 * length / 3);
        let door = self.draw.whole(12, 20);
        let door_at = self.draw.whole(2, (other - door - 2).max(2));
        // One small chamber in ten has no door.
        let door = if self.draw.whole(1, 10) == 1 && length < 80 { 0 } else { door };
        for (from, to) in [(0, door_at), (door_at + door, other)] {
            let wall = if wide {
                [column + at, row + from, 1, to - from]
            } else {
                [column + from, row + at, to - from, 1]
            };
            self.fill(wall);
        }
        let (first, second) = if wide {
            ([column, row, at, height], [column + at + 1, row, width - at - 1, height])
        } else {
            ([column, row, width, at], [column, row + at + 1, width, height - at - 1])
        };
        self.chambers(first);
        self.chambers(second);
    }

    fn stub(&mut self, [column, row, width, height]: [i64; 4]) {
        let (across, along) =
            (self.draw.whole(width / 3, 2 * width / 3), self.draw.whole(height / 3, 2 * height / 3));
        match self.draw.whole(0, 4) {
            0 => self.fill([column + across, row, 1, height / 2]),
            1 => self.fill([column + across, row + height / 2, 1, height - height / 2]),
            2 => self.fill([column, row + along, width / 2, 1]),
            3 => self.fill([column + width / 2, row + along, width - width / 2, 1]),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_makes_the_same_room_again_and_another_seed_another_one() {
        for room in RoomKind::ALL {
            assert_eq!(room.grid(3), room.grid(3));
            assert_ne!(room.grid(3), room.grid(4));
            let occupied = room.grid(3).cells().iter().filter(|cell| **cell == Cell::Occupied).count();
            assert!((1000..20_000).contains(&occupied), "{room:?}: {occupied}");
        }
    }
}
