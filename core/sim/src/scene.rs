//! What a step may see: everything that stands, and where every truck was when the step began.
//!
//! A [`StepContext`] never changes during a step. That is why trucks can be stepped in any order,
//! or on several threads, and still come out with the same bits.

use crate::geometry::{Beam, Bounds, OrientedBox};
use crate::grid::{Cells, StandingGrid};
use crate::islands::Islands;
use crate::step::STEP_NS;
use crate::world::World;
use xtb_control::units::Stamp;
use xtb_protocol::messages::PlaceKind;

/// A truck that stands so near to a dock's point is charged, in m: planned goals end within a few cm of their point, and
/// a pose may be wrong by as much again.
const DOCK_M: f64 = 0.3;

/// A sloping rectangle of floor.
#[derive(Debug, Clone)]
struct Slope {
    area: OrientedBox,
    /// Sine of the slope towards +x and +y.
    rise: (f64, f64),
}

/// Everything that does not move by itself.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub(crate) boxes: Vec<OrientedBox>,
    bounds: Vec<Bounds>,
    grid: StandingGrid,
    slopes: Vec<Slope>,
    /// Where trucks are charged.
    docks: Vec<(f64, f64)>,
    pub(crate) cells: Cells,
}

impl Scene {
    pub(crate) fn new(world: &World) -> Self {
        let boxes: Vec<_> = world.solids().map(|solid| solid.shape).collect();
        let cells = Cells::covering(world.extent().grown(1.0));
        let slopes = world.ramps().iter().map(|ramp| {
            let (sin, cos) = libm::sincos(ramp.uphill_rad);
            let rise = libm::sin(ramp.slope_deg.to_radians());
            let area = OrientedBox::turned(ramp.x_m, ramp.y_m, (cos, sin), ramp.length_m, ramp.width_m);
            Slope { area, rise: (cos * rise, sin * rise) }
        });
        let slopes = slopes.collect();
        let docks = world.places().iter().filter(|place| place.kind == PlaceKind::Dock);
        let docks = docks.map(|dock| (dock.x_m, dock.y_m)).collect();
        let bounds = boxes.iter().map(OrientedBox::bounds).collect();
        Self { grid: StandingGrid::new(cells.clone(), &boxes), boxes, bounds, slopes, docks, cells }
    }

    /// The largest sine of a slope.
    pub(crate) fn steepest(&self) -> f64 {
        self.slopes.iter().map(|slope| libm::hypot(slope.rise.0, slope.rise.1)).fold(0.0, f64::max)
    }

    /// Sine of the slope at a place towards +x and +y; the first ramp listed wins.
    fn rise_at(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let slope = self.slopes.iter().find(|slope| slope.area.holds(x_m, y_m));
        slope.map_or((0.0, 0.0), |slope| slope.rise)
    }
}

/// Who is near whom.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lists<'a> {
    pub(crate) islands: &'a Islands,
    /// No body reaches farther from its centre.
    pub(crate) radius_m: f64,
}

impl<'a> Lists<'a> {
    pub(crate) fn islands(self) -> &'a Islands {
        self.islands
    }
}

/// The world as one step of one truck sees it; shared by all trucks of the step.
#[derive(Debug, Clone, Copy)]
pub struct StepContext<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) lists: Lists<'a>,
    /// The bodies of an island, or of all, from this place on: where they were when the step began, and whether
    /// another one ran into them during the step before.
    pub(crate) first: usize,
    pub(crate) boxes: &'a [OrientedBox],
    pub(crate) touched: &'a [bool],
    pub(crate) start: Stamp,
}

impl StepContext<'_> {
    /// When the step begins.
    #[must_use]
    pub fn start(&self) -> Stamp {
        self.start
    }

    /// When the step ends.
    #[must_use]
    pub fn now(&self) -> Stamp {
        self.start.plus_ns(STEP_NS)
    }

    pub(crate) fn rise_at(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        self.scene.rise_at(x_m, y_m)
    }

    /// Whether a truck is charged that stands there; it is asked where only if there are docks.
    pub(crate) fn is_dock(&self, at_m: impl FnOnce() -> (f64, f64)) -> bool {
        let docks = &self.scene.docks;
        if docks.is_empty() {
            return false;
        }
        let (x_m, y_m) = at_m();
        docks.iter().any(|dock| libm::hypot(dock.0 - x_m, dock.1 - y_m) <= DOCK_M)
    }

    pub(crate) fn was_touched(&self, me: usize) -> bool {
        self.touched[self.lists.islands.place(me) - self.first]
    }

    fn body(&self, n: usize) -> &OrientedBox {
        &self.boxes[self.lists.islands.place(n) - self.first]
    }

    /// Those that could matter to a truck, with their numbers.
    fn near(&self, me: usize) -> impl Iterator<Item = (usize, &OrientedBox)> {
        self.lists.islands.near(me).map(|n| (n, self.body(n)))
    }

    /// Whether no other one could matter to a truck.
    pub(crate) fn is_alone(&self, me: usize) -> bool {
        self.lists.islands.near(me).next().is_none()
    }

    /// Whether two bodies are as near to each other as bodies reach.
    fn may_meet(&self, a: &OrientedBox, b: &OrientedBox) -> bool {
        let ((ax, ay), (bx, by)) = (a.centre_m(), b.centre_m());
        let reach_m = 2.0 * self.lists.radius_m;
        (ax - bx) * (ax - bx) + (ay - by) * (ay - by) <= reach_m * reach_m
    }

    /// Whether nothing is nearer than `beside_m` to a beam. False says nothing: it is cheaper than to look closely.
    pub(crate) fn is_free(&self, me: usize, beam: &Beam, beside_m: f64) -> bool {
        let reach_m = self.lists.radius_m + beside_m;
        self.scene.grid.is_free(beam.bounds().grown(beside_m))
            && self.near(me).all(|(_, other)| beam.passes(other.centre_m(), reach_m))
    }

    /// Distances along these beams, which start near each other, to whatever is nearest on each; `None` if
    /// nothing is in reach.
    pub(crate) fn nearest_m<const N: usize>(&self, me: usize, mut beams: [Beam; N]) -> [Option<f64>; N] {
        let bounds = beams.iter().map(Beam::bounds).reduce(Bounds::union);
        let Some(bounds) = bounds else { return [None; N] };
        let reach_m = beams.map(|beam| beam.length_m());
        let mut look = |body: &OrientedBox| {
            for beam in &mut beams {
                if let Some(hit_m) = body.hit_m(beam) {
                    beam.shorten(hit_m);
                }
            }
        };
        let mut last = usize::MAX;
        self.scene.grid.near(bounds, |i| {
            // A wall comes once for each of its cells.
            if std::mem::replace(&mut last, i) != i && self.scene.bounds[i].meets(bounds) {
                look(&self.scene.boxes[i]);
            }
        });
        let reach = bounds.grown(self.lists.radius_m);
        for (_, other) in self.near(me) {
            let (x_m, y_m) = other.centre_m();
            if reach.holds(x_m, y_m) {
                look(other);
            }
        }
        std::array::from_fn(|n| (beams[n].length_m() < reach_m[n]).then_some(beams[n].length_m()))
    }

    /// Whether something is in the way from one position to the next. Trucks in the way go into
    /// `touched`. What is already penetrated blocks only the way deeper into it, so that a truck
    /// can always get free.
    pub(crate) fn blocks(
        &self,
        me: usize,
        from: &OrientedBox,
        to: &OrientedBox,
        touched: &mut Vec<usize>,
    ) -> bool {
        let in_the_way = |other: &OrientedBox| {
            let there_m = to.separation_m(other);
            there_m <= 0.0 && there_m < from.separation_m(other)
        };
        let bounds = to.bounds();
        let mut blocked = false;
        self.scene.grid.near(bounds, |i| {
            blocked |= self.scene.bounds[i].meets(bounds) && in_the_way(&self.scene.boxes[i]);
        });
        for (n, other) in self.near(me) {
            if self.may_meet(other, to) && in_the_way(other) {
                touched.push(n);
                blocked = true;
            }
        }
        blocked
    }

    /// Whether nothing is nearer to a truck than `margin_m`.
    pub(crate) fn is_clear(&self, me: usize, body: &OrientedBox, margin_m: f64) -> bool {
        let bounds = body.bounds().grown(margin_m);
        let near = |other: &OrientedBox| body.separation_m(other) <= margin_m;
        let mut clear = true;
        self.scene.grid.near(bounds, |i| clear &= !near(&self.scene.boxes[i]));
        clear && self.near(me).all(|(_, other)| !near(other))
    }
}
