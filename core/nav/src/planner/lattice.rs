//! Which moves a search makes, and which poses it takes for one.

use crate::MapPose;
use crate::geometry::Piece;
use crate::geometry::path::wrap_rad;
use std::f64::consts::TAU;

/// How finely a search looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Side of the squares in which poses count as the same, in m.
    pub cell_m: f64,
    /// Headings of a full turn that count as different.
    pub headings: u16,
    /// Headings by which one move at full lock turns.
    pub turn: u16,
    /// Whether there are moves at half lock too.
    pub half_lock: bool,
    /// After how many expansions of one tree the next finer lattice takes over.
    pub most_expansions: usize,
    /// Only for pockets: taken when the coarser lattice has found no more poses than this.
    pub pocket: usize,
}

/// One move and what it does to a pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct Move {
    pub(super) piece: Piece,
    /// Headings to the left.
    turn: i32,
    /// Ahead and left, driven and driven back.
    there_m: [f64; 2],
    back_m: [f64; 2],
}

/// A lattice with its moves.
#[derive(Debug, Default)]
pub(super) struct Moves {
    pub(super) all: Vec<Move>,
    /// Sine and cosine of each heading, from that of the root.
    directions: Vec<(f64, f64)>,
    headings: i32,
    step_rad: f64,
}

impl Moves {
    pub(super) fn begin(&mut self, lattice: &Lattice, radius_m: f64) {
        self.headings = i32::from(lattice.headings);
        self.step_rad = TAU / f64::from(lattice.headings);
        self.directions.clear();
        self.directions.extend((0..self.headings).map(|n| libm::sincos(f64::from(n) * self.step_rad)));
        self.all.clear();
        let turn = i32::from(lattice.turn);
        let arc_m = f64::from(turn) * self.step_rad * radius_m;
        // A straight has to leave its square, whichever way it crosses it.
        let straight_m = arc_m.max(1.45 * lattice.cell_m);
        for gear in [1.0, -1.0] {
            self.add(gear * straight_m, 0.0, 0);
            for side in [1, -1] {
                let turn = side * turn * if gear > 0.0 { 1 } else { -1 };
                self.add(gear * arc_m, f64::from(side) / radius_m, turn);
                if lattice.half_lock {
                    self.add(gear * 2.0 * arc_m, 0.5 * f64::from(side) / radius_m, turn);
                }
            }
        }
    }

    fn add(&mut self, length_m: f64, curvature_per_m: f64, turn: i32) {
        let piece = Piece { length_m, curvature_per_m };
        let origin = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
        let [there_m, back_m] = [length_m, -length_m].map(|way| {
            let end = piece.after(&origin, way);
            [end.x_m, end.y_m]
        });
        self.all.push(Move { piece, turn, there_m, back_m });
    }

    /// Where the move leads from a point and heading, or where it must have begun to lead there.
    pub(super) fn next(
        &self,
        step: &Move,
        at: ([f64; 2], u16),
        root: Root,
        backward: bool,
    ) -> ([f64; 2], u16) {
        let ([x, y], heading) = at;
        let (sin, cos) = self.directions[usize::from(heading)];
        let (sin, cos) = (sin * root.cos + cos * root.sin, cos * root.cos - sin * root.sin);
        let ([ahead, left], turn) =
            if backward { (step.back_m, -step.turn) } else { (step.there_m, step.turn) };
        let heading = (i32::from(heading) + turn).rem_euclid(self.headings) as u16;
        ([x + ahead * cos - left * sin, y + ahead * sin + left * cos], heading)
    }

    pub(super) fn yaw_rad(&self, heading: u16, root: Root) -> f64 {
        wrap_rad(root.yaw_rad + f64::from(heading) * self.step_rad)
    }

    /// The heading that is nearest to a yaw.
    pub(super) fn heading(&self, yaw_rad: f64, root: Root) -> u16 {
        let steps = libm::floor((yaw_rad - root.yaw_rad) / self.step_rad + 0.5) as i32;
        steps.rem_euclid(self.headings) as u16
    }
}

/// The heading from which a tree counts.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Root {
    pub(super) yaw_rad: f64,
    sin: f64,
    cos: f64,
}

impl Root {
    pub(super) fn new(yaw_rad: f64) -> Self {
        let (sin, cos) = libm::sincos(yaw_rad);
        Self { yaw_rad, sin, cos }
    }
}
