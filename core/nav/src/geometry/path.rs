//! A path is a start and arcs: exact everywhere, without points to interpolate between.

use crate::MapPose;
use serde::{Deserialize, Serialize};
use xtb_protocol::messages::{Arc, Track};

/// Arcs flatter than this are straight (a radius of 1000 km).
pub(crate) const STRAIGHT_PER_M: f64 = 1e-6;

/// One arc or straight, driven in one gear.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Piece {
    /// Way of the reference point, in m; negative = astern.
    pub length_m: f64,
    /// + = to the left when driven ahead: the yaw grows by curvature · signed way. In 1/m.
    pub curvature_per_m: f64,
}

impl Piece {
    /// Where a car that stood at `from` is after `way_m` of this arc (signed like its length).
    #[must_use]
    pub fn after(&self, from: &MapPose, way_m: f64) -> MapPose {
        let turned = self.curvature_per_m * way_m;
        let (sin, cos) = libm::sincos(from.yaw_rad);
        let (ahead, left) = if self.curvature_per_m.abs() < STRAIGHT_PER_M {
            (way_m, 0.0)
        } else {
            let (s, c) = libm::sincos(turned);
            (s / self.curvature_per_m, (1.0 - c) / self.curvature_per_m)
        };
        MapPose {
            x_m: from.x_m + ahead * cos - left * sin,
            y_m: from.y_m + ahead * sin + left * cos,
            yaw_rad: wrap_rad(from.yaw_rad + turned),
        }
    }

    /// Where it ends.
    #[must_use]
    pub fn end(&self, from: &MapPose) -> MapPose {
        self.after(from, self.length_m)
    }

    /// +1 ahead, −1 astern.
    #[must_use]
    pub fn gear(&self) -> f64 {
        if self.length_m < 0.0 { -1.0 } else { 1.0 }
    }
}

/// Shorter arcs are none, only what rounding has left, in m: f64 leaves 1e-13 at a kilometre.
const NOTHING_M: f64 = 1e-12;

/// From a pose along arcs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Path {
    /// Where it begins.
    pub start: MapPose,
    /// In the order in which they are driven.
    pub pieces: Vec<Piece>,
}

impl Path {
    /// A path that stays where it is.
    #[must_use]
    pub fn standing(start: MapPose) -> Self {
        Self { start, pieces: Vec::new() }
    }

    /// Way to drive, in m, whichever gear.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.length_m.abs()).sum()
    }

    /// How often the gear changes.
    #[must_use]
    pub fn cusps(&self) -> usize {
        self.pieces.windows(2).filter(|pair| pair[0].gear() != pair[1].gear()).count()
    }

    /// Where it ends.
    #[must_use]
    pub fn end(&self) -> MapPose {
        self.pieces.iter().fold(self.start, |pose, piece| piece.end(&pose))
    }

    /// Pose after `way_m` of the path, and the piece that is driven there; the end beyond it.
    #[must_use]
    pub fn at(&self, way_m: f64) -> (MapPose, Option<Piece>) {
        let (mut pose, mut left) = (self.start, way_m.max(0.0));
        for piece in &self.pieces {
            let length = piece.length_m.abs();
            if left < length {
                return (piece.after(&pose, left * piece.gear()), Some(*piece));
            }
            left -= length;
            pose = piece.end(&pose);
        }
        (pose, None)
    }

    /// As far as `way_m`.
    #[must_use]
    pub fn head(&self, way_m: f64) -> Self {
        let mut part = Self::standing(self.start);
        let mut left_m = way_m.max(0.0);
        for piece in &self.pieces {
            let length_m = piece.length_m.abs().min(left_m);
            part.push(Piece { length_m: length_m * piece.gear(), ..*piece });
            left_m -= length_m;
        }
        part
    }

    /// From `way_m` on.
    #[must_use]
    pub fn tail(&self, way_m: f64) -> Self {
        let mut part = Self::standing(self.at(way_m).0);
        let mut skip_m = way_m.max(0.0);
        for piece in &self.pieces {
            let length_m = (piece.length_m.abs() - skip_m).max(0.0);
            part.push(Piece { length_m: length_m * piece.gear(), ..*piece });
            skip_m = (skip_m - piece.length_m.abs()).max(0.0);
        }
        part
    }

    /// With another one behind it, which begins where this one ends.
    #[must_use]
    pub fn and(mut self, next: &Self) -> Self {
        next.pieces.iter().for_each(|piece| self.push(*piece));
        self
    }

    /// From its end to its start, on the same floor.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let mut back = Self::standing(self.end());
        let pieces = self.pieces.iter().rev();
        pieces.for_each(|piece| back.push(Piece { length_m: -piece.length_m, ..*piece }));
        back
    }

    /// Appends an arc; one with the same gear and curvature as the last one lengthens it.
    pub fn push(&mut self, piece: Piece) {
        if piece.length_m.abs() < NOTHING_M {
            return;
        }
        match self.pieces.last_mut() {
            Some(last) if last.gear() == piece.gear() && last.curvature_per_m == piece.curvature_per_m => {
                last.length_m += piece.length_m;
            }
            _ => self.pieces.push(piece),
        }
    }
}

/// The angle in (−π, π]. Not to the bit what [`xtb_control::frames::wrap_rad`] says of −2π and of angles beyond
/// 8.5 turns, and plans and replays are compared to the bit: so there are both.
#[must_use]
pub fn wrap_rad(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let wrapped = angle - TAU * libm::floor((angle + PI) / TAU);
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}

impl From<&Track> for Path {
    fn from(track: &Track) -> Self {
        let piece = |arc: &Arc| Piece { length_m: arc.length_m, curvature_per_m: arc.curvature_per_m };
        Self { start: track.start, pieces: track.arcs.iter().map(piece).collect() }
    }
}

impl From<&Path> for Track {
    /// A path that is longer than a message may be is cut.
    fn from(path: &Path) -> Self {
        let arc = |piece: &Piece| Arc { length_m: piece.length_m, curvature_per_m: piece.curvature_per_m };
        Self { start: path.start, arcs: path.pieces.iter().take(Self::MOST_ARCS).map(arc).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn a_quarter_circle_to_the_left_ends_up_left_ahead() {
        let end = Piece { length_m: FRAC_PI_2, curvature_per_m: 1.0 }.end(&MapPose {
            x_m: 0.0,
            y_m: 0.0,
            yaw_rad: 0.0,
        });
        assert!(
            (end.x_m - 1.0).abs() < 1e-12
                && (end.y_m - 1.0).abs() < 1e-12
                && (end.yaw_rad - FRAC_PI_2).abs() < 1e-12
        );
    }

    #[test]
    fn astern_on_the_same_arc_comes_back() {
        let start = MapPose { x_m: 0.3, y_m: -2.0, yaw_rad: 2.5 };
        let there = Piece { length_m: 0.7, curvature_per_m: -2.0 }.end(&start);
        let back = Piece { length_m: -0.7, curvature_per_m: -2.0 }.end(&there);
        assert!((back.x_m - start.x_m).abs() < 1e-12 && (back.y_m - start.y_m).abs() < 1e-12);
        assert!((back.yaw_rad - start.yaw_rad).abs() < 1e-12);
    }

    #[test]
    fn poses_lie_on_the_piece_that_is_driven_there() {
        let mut path = Path::standing(MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 });
        path.push(Piece { length_m: 1.0, curvature_per_m: 0.0 });
        path.push(Piece { length_m: 0.5, curvature_per_m: 0.0 });
        path.push(Piece { length_m: -0.5, curvature_per_m: 1.0 });
        assert_eq!((path.pieces.len(), path.cusps(), path.length_m()), (2, 1, 2.0));
        let (pose, piece) = path.at(1.5);
        assert_eq!((pose.x_m, piece.unwrap().gear()), (1.5, -1.0));
        assert_eq!(path.at(9.0), (path.end(), None));
    }

    #[test]
    fn a_path_in_two_parts_is_the_path() {
        let mut path = Path::standing(MapPose { x_m: 0.3, y_m: -1.0, yaw_rad: 0.4 });
        path.push(Piece { length_m: 1.0, curvature_per_m: 0.5 });
        path.push(Piece { length_m: -0.5, curvature_per_m: -1.0 });
        for way_m in [-1.0, 0.0, 0.4, 1.0, 1.2, 1.5, 9.0] {
            let (part, rest) = (path.head(way_m), path.tail(way_m));
            let (there, end) = (part.end(), rest.start);
            assert!((there.x_m - end.x_m).hypot(there.y_m - end.y_m) < 1e-12, "{way_m}");
            let whole = part.and(&rest);
            assert_eq!(whole.pieces.len(), 2, "{way_m}");
            assert!(
                (whole.length_m() - 1.5).abs() < 1e-12 && (whole.end().x_m - path.end().x_m).abs() < 1e-12
            );
        }
    }

    #[test]
    fn angles_wrap_into_one_turn() {
        assert!((wrap_rad(3.0 * PI) - PI).abs() < 1e-12);
        assert!((wrap_rad(-PI) - PI).abs() < 1e-12);
        assert!((wrap_rad(-0.1) + 0.1).abs() < 1e-15);
    }
}
