//! What stands: obstacles sorted into squares, so that a car looks only at those near it.

use super::body::{Body, stays_clear};
use super::lattice::Lattice;
use super::motion::Spot;
use super::problem::{FloorBounds, Obstacle, Problem};
use std::sync::Arc;
use xtb_nav::Piece;
use xtb_nav::geometry::Rect;
use xtb_nav::planner::space::OneWay;

/// Moments of a step at which a reference point must be within the bounds; chosen, not measured.
const LOOKS: u32 = 12;
/// Kept from the edge, in parts of a step, for what bulges between two looks: a turn of 0.57 rad in a step
/// does by so much, one of 1 rad by 0.0009.
const EDGE: f64 = 5e-4;

/// What a car keeps from obstacles, in m.
#[derive(Debug, Clone)]
pub(crate) struct Keep {
    pub(crate) margin: f64,
    /// Obstacles that its start or goal is nearer to.
    pub(crate) exceptions: Vec<(u32, f64)>,
}

impl Keep {
    #[inline]
    fn from(&self, obstacle: u32) -> f64 {
        let own = self.exceptions.iter().filter(|(index, _)| *index == obstacle);
        own.fold(self.margin, |least, (_, margin)| least.min(*margin))
    }
}

#[derive(Debug, Clone, Copy)]
enum Solid {
    Disc { x: f64, y: f64, radius: f64 },
    Box(Rect),
}

/// Obstacles and bounds.
#[derive(Debug)]
pub(crate) struct ObstacleIndex {
    bounds: FloorBounds,
    one_way: Option<Arc<OneWay>>,
    solids: Vec<Solid>,
    lattice: Lattice,
    /// Obstacles near each square.
    near: Vec<Vec<u32>>,
}

impl ObstacleIndex {
    /// For moves whose body keeps within `reach` of where the reference point begins.
    pub(crate) fn new(problem: &Problem, reach: f64) -> Self {
        let mut bounds = problem.bounds;
        let edge = problem.step_m * EDGE;
        let poses = || problem.cars.iter().flat_map(|task| [&task.start, &task.goal]);
        let within = |side: f64, inner: f64, value: &dyn Fn(&xtb_nav::MapPose) -> f64| {
            // A car that starts on the very edge must be able to stand there.
            poses()
                .map(value)
                .filter(|v| (v - side).abs() < edge)
                .fold(inner, |inner, v| if inner > side { inner.min(v) } else { inner.max(v) })
        };
        bounds.west_m = within(bounds.west_m, bounds.west_m + edge, &|pose| pose.x_m);
        bounds.south_m = within(bounds.south_m, bounds.south_m + edge, &|pose| pose.y_m);
        bounds.east_m = within(bounds.east_m, bounds.east_m - edge, &|pose| pose.x_m);
        bounds.north_m = within(bounds.north_m, bounds.north_m - edge, &|pose| pose.y_m);
        let lattice = Lattice::new(problem, 1.0);
        let mut near = vec![Vec::new(); lattice.squares()];
        for (index, obstacle) in problem.obstacles.iter().enumerate() {
            let ([x, y], far) = (obstacle.middle_m(), obstacle.reach_m() + reach);
            for (square, near) in near.iter_mut().enumerate() {
                let [mx, my] = lattice.middle(square % lattice.columns, square / lattice.columns);
                let beyond = |v: f64, middle: f64| ((v - middle).abs() - lattice.side / 2.0).max(0.0);
                if libm::hypot(beyond(x, mx), beyond(y, my)) < far {
                    near.push(index as u32);
                }
            }
        }
        let solids = problem.obstacles.iter().map(Solid::new).collect();
        let one_way = problem.one_way.clone();
        Self { bounds, one_way, solids, lattice, near }
    }

    pub(crate) fn inside(&self, x: f64, y: f64) -> bool {
        let FloorBounds { west_m, south_m, east_m, north_m } = self.bounds;
        x >= west_m && x <= east_m && y >= south_m && y <= north_m
    }

    /// Whether no one-way zone forbids to drive this piece.
    #[inline]
    pub(crate) fn allows(&self, spot: &Spot, piece: &Piece) -> bool {
        let against = |zones: &Arc<OneWay>| zones.against(&spot.pose(), piece).is_some();
        !self.one_way.as_ref().is_some_and(against)
    }

    /// Whether a body keeps off everything while it drives this piece, in either direction.
    pub(crate) fn clear(&self, body: &Body, spot: &Spot, piece: &Piece, keep: &Keep) -> bool {
        let end = spot.after(piece, 1.0);
        if !self.inside(end.x, end.y) {
            return false;
        }
        // An arc leaves the bounds between its ends only near an edge.
        let bulge = piece.length_m.abs();
        let FloorBounds { west_m, south_m, east_m, north_m } = self.bounds;
        let deep_inside = spot.x - west_m > bulge
            && east_m - spot.x > bulge
            && spot.y - south_m > bulge
            && north_m - spot.y > bulge;
        if !deep_inside && piece.curvature_per_m != 0.0 {
            for look in 1..LOOKS {
                let there = spot.after(piece, f64::from(look) / f64::from(LOOKS));
                if !self.inside(there.x, there.y) {
                    return false;
                }
            }
        }
        let way = body.way(piece);
        let centre = body.centre(spot);
        self.around(spot).iter().all(|&index| {
            let solid = &self.solids[index as usize];
            solid.beyond(centre, body.reach + way + keep.margin)
                || stays_clear(way, keep.from(index), |fraction| {
                    solid.gap(&body.at(&spot.after(piece, fraction)))
                })
        })
    }

    /// Gaps between a standing body and the obstacles near it.
    pub(crate) fn gaps(&self, body: &Body, spot: &Spot) -> impl Iterator<Item = (f64, usize)> {
        let body = body.at(spot);
        self.around(spot).iter().map(move |&index| (self.solids[index as usize].gap(&body), index as usize))
    }

    /// The least of them.
    pub(crate) fn nearest(&self, body: &Body, spot: &Spot) -> Option<(f64, usize)> {
        self.gaps(body, spot).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    #[inline]
    fn around(&self, spot: &Spot) -> &[u32] {
        &self.near[self.lattice.square(spot.x, spot.y)]
    }
}

impl Solid {
    fn new(obstacle: &Obstacle) -> Self {
        match *obstacle {
            Obstacle::Disc { x_m, y_m, radius_m } => Self::Disc { x: x_m, y: y_m, radius: radius_m },
            Obstacle::Box { middle, half_length_m, half_width_m } => {
                let (middle_m, half_m) = ([middle.x_m, middle.y_m], [half_length_m, half_width_m]);
                let sin_cos = libm::sincos(middle.yaw_rad);
                Self::Box(Rect::from_parts(middle_m, sin_cos, half_m, obstacle.reach_m()))
            }
        }
    }

    /// Whether the whole of it is farther than this from a point.
    #[inline]
    fn beyond(&self, [x, y]: [f64; 2], distance: f64) -> bool {
        match self {
            Self::Disc { x: at_x, y: at_y, radius } => {
                let (dx, dy, far) = (at_x - x, at_y - y, distance + radius);
                dx * dx + dy * dy > far * far
            }
            Self::Box(solid) => solid.is_farther(x, y, distance),
        }
    }

    #[inline]
    fn gap(&self, body: &Rect) -> f64 {
        match self {
            Self::Disc { x, y, radius } => body.gap_to_disc_m(*x, *y, *radius),
            Self::Box(solid) => body.gap_m(solid),
        }
    }
}
