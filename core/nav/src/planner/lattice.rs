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

/// A heading that a tree counts from its root.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heading {
    pub(super) yaw_rad: f64,
    /// Sine and cosine of the yaw.
    pub(super) direction: (f64, f64),
    /// The same from those of the root, to go on by: the poses of a lattice meet each other to the bit.
    course: (f64, f64),
}

/// A lattice with its moves.
#[derive(Debug, Default)]
pub(super) struct Moves {
    pub(super) all: Vec<Move>,
    headings: Vec<Heading>,
    root_rad: f64,
    step_rad: f64,
}

impl Moves {
    /// Begins anew, with headings from that of a root on.
    pub(super) fn begin(&mut self, lattice: &Lattice, radius_m: f64, root_rad: f64) {
        self.step_rad = TAU / f64::from(lattice.headings);
        self.root_rad = root_rad;
        let (root_sin, root_cos) = libm::sincos(root_rad);
        let step_rad = self.step_rad;
        let heading = |number: u16| {
            let turned_rad = f64::from(number) * step_rad;
            let yaw_rad = wrap_rad(root_rad + turned_rad);
            let (sin, cos) = libm::sincos(turned_rad);
            let course = (sin * root_cos + cos * root_sin, cos * root_cos - sin * root_sin);
            Heading { yaw_rad, direction: libm::sincos(yaw_rad), course }
        };
        self.headings.clear();
        self.headings.extend((0..lattice.headings).map(heading));
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
    pub(super) fn next(&self, step: &Move, at: ([f64; 2], u16), backward: bool) -> ([f64; 2], u16) {
        let ([x, y], heading) = at;
        let (sin, cos) = self.headings[usize::from(heading)].course;
        let ([ahead, left], turn) =
            if backward { (step.back_m, -step.turn) } else { (step.there_m, step.turn) };
        // A move turns by a quarter at most.
        let (count, turned) = (self.headings.len() as i32, i32::from(heading) + turn);
        let heading = (if turned < 0 { turned + count } else { turned % count }) as u16;
        ([x + ahead * cos - left * sin, y + ahead * sin + left * cos], heading)
    }

    /// The heading with this number.
    pub(super) fn numbered(&self, heading: u16) -> &Heading {
        &self.headings[usize::from(heading)]
    }

    /// The number of the heading that is nearest to a yaw.
    pub(super) fn nearest(&self, yaw_rad: f64) -> u16 {
        let steps = libm::floor((yaw_rad - self.root_rad) / self.step_rad + 0.5) as i32;
        steps.rem_euclid(self.headings.len() as i32) as u16
    }
}
