//! What a step may see: everything that stands, and where every truck was when the step began.
//!
//! A [`StepContext`] never changes during a step. That is why trucks can be stepped in any order,
//! or on several threads, and still come out with the same bits.

use crate::geometry::{Beam, Bounds, OrientedBox};
use crate::grid::{Cells, StandingGrid};
use crate::islands::Islands;
use crate::step::STEP_NS;
use crate::vehicle::Truck;
use crate::world::World;
use xtb_control::units::Stamp;

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
    boxes: Vec<OrientedBox>,
    bounds: Vec<Bounds>,
    grid: StandingGrid,
    slopes: Vec<Slope>,
    cells: Cells,
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
        let bounds = boxes.iter().map(OrientedBox::bounds).collect();
        Self { grid: StandingGrid::new(cells.clone(), &boxes), boxes, bounds, slopes, cells }
    }

    /// The largest sine of a slope.
    fn steepest(&self) -> f64 {
        self.slopes.iter().map(|slope| libm::hypot(slope.rise.0, slope.rise.1)).fold(0.0, f64::max)
    }

    /// Sine of the slope at a place towards +x and +y; the first ramp listed wins.
    fn rise_at(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let slope = self.slopes.iter().find(|slope| slope.area.holds(x_m, y_m));
        slope.map_or((0.0, 0.0), |slope| slope.rise)
    }
}

/// So many steps trucks that are not near each other are moved on without looking at the others, at most.
pub(crate) const WINDOW_STEPS: u64 = 10;
/// Nearer than this to a body's edge something matters to it, beside what it sees: more than the margin of a
/// touch, and a little for what rounding adds up to.
const BESIDE_M: f64 = 0.05;

/// The trucks at the beginning of a step, and behind them those that other programs move.
#[derive(Debug, Clone)]
pub(crate) struct Traffic {
    islands: Islands,
    /// All by their numbers.
    bodies: Vec<OrientedBox>,
    /// By their places on the islands; and those that another one ran into during the step before.
    boxes: Vec<OrientedBox>,
    touched: Vec<bool>,
    /// No body reaches farther from its centre.
    radius_m: f64,
    /// The longest way of a truck in a step.
    step_m: f64,
}

impl Traffic {
    /// For these trucks and for what else moves among them.
    pub(crate) fn new(scene: &Scene, trucks: &[Truck], foreign: impl Iterator<Item = OrientedBox>) -> Self {
        let most = |of: &dyn Fn(&Truck) -> f64| trucks.iter().map(of).fold(0.0, f64::max);
        let steepest = scene.steepest();
        let step_m = most(&|truck| truck.farthest_step_m(steepest));
        let bodies = trucks.iter().map(Truck::body).chain(foreign).collect();
        Self::of(scene, bodies, most(&Truck::sight_m), step_m)
    }

    fn of(scene: &Scene, bodies: Vec<OrientedBox>, sight_m: f64, step_m: f64) -> Self {
        let radius_m = bodies.iter().map(OrientedBox::radius_m).fold(0.0, f64::max);
        let reach_m = sight_m.max(radius_m) + BESIDE_M + radius_m;
        let islands = Islands::new(scene.cells.clone(), reach_m, WINDOW_STEPS as f64 * step_m, &bodies);
        let (boxes, touched) = (islands.order().map(|n| bodies[n]).collect(), vec![false; bodies.len()]);
        Self { islands, bodies, boxes, touched, radius_m, step_m }
    }

    /// Takes over where all are now, for so many steps; allocates nothing while there are no more than before.
    pub(crate) fn update(&mut self, bodies: impl Iterator<Item = OrientedBox>, steps: u64) {
        self.bodies.clear();
        self.bodies.extend(bodies);
        self.islands.update(&self.bodies, steps as f64 * self.step_m);
        self.boxes.clear();
        self.boxes.extend(self.islands.order().map(|n| self.bodies[n]));
        self.touched.clear();
        self.touched.resize(self.boxes.len(), false);
    }

    /// A body of this size comes.
    pub(crate) fn admit(&mut self, body: &OrientedBox) {
        let more_m = body.radius_m() - self.radius_m;
        if more_m > 0.0 {
            self.radius_m += more_m;
            self.islands.reach_farther(2.0 * more_m);
        }
    }

    /// Another program's may be gone by now; who moves it counts its contacts.
    pub(crate) fn mark_touched(&mut self, truck: usize) {
        if truck < self.touched.len() {
            self.touched[self.islands.place(truck)] = true;
        }
    }

    /// Who is near whom, and what changes from step to step, by places.
    pub(crate) fn split(&mut self) -> (Lists<'_>, &mut [OrientedBox], &mut [bool]) {
        (Lists { islands: &self.islands, radius_m: self.radius_m }, &mut self.boxes, &mut self.touched)
    }
}

/// Who is near whom.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lists<'a> {
    islands: &'a Islands,
    /// No body reaches farther from its centre.
    radius_m: f64,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;
    use crate::world::BoxSpec;

    /// A crowded world: 40 boxes and 40 bodies anywhere, some beyond the walls.
    fn crowd(noise: &mut Rng) -> (Scene, Traffic) {
        let mut world = World::default();
        for i in 0..40 {
            let spec = BoxSpec {
                x_m: noise.uniform(-9.0, 9.0),
                y_m: noise.uniform(-9.0, 9.0),
                width_m: noise.uniform(0.01, 3.0),
                depth_m: noise.uniform(0.01, 1.0),
                yaw_rad: noise.uniform(-3.0, 3.0),
            };
            world.put_box(&format!("box-{i}"), spec).unwrap();
        }
        let scene = Scene::new(&world);
        let bodies = (0..40).map(|_| near(noise, 0.0, 0.0, 11.0)).collect();
        let traffic = Traffic::of(&scene, bodies, 1.5, 0.02);
        (scene, traffic)
    }

    /// A truck's body no farther from there than this, east or west and north or south.
    fn near(noise: &mut Rng, x_m: f64, y_m: f64, within_m: f64) -> OrientedBox {
        let (dx_m, dy_m) = (noise.uniform(-within_m, within_m), noise.uniform(-within_m, within_m));
        OrientedBox::new(x_m + dx_m, y_m + dy_m, noise.uniform(-3.0, 3.0), 0.5, 0.4)
    }

    fn context<'a>(scene: &'a Scene, traffic: &'a mut Traffic) -> StepContext<'a> {
        let (lists, boxes, touched) = traffic.split();
        StepContext { scene, lists, first: 0, boxes, touched, start: Stamp::ZERO }
    }

    #[test]
    fn the_broad_phase_finds_what_asking_every_box_finds() {
        let mut noise = Rng::new(11, 0);
        let (mut hits, mut blocks, mut free) = (0, 0, 0);
        for _ in 0..50 {
            let (scene, mut traffic) = crowd(&mut noise);
            let bodies = traffic.bodies.clone();
            // Nobody has gone farther than the margin since the lists were made.
            let bodies: Vec<_> = bodies
                .iter()
                .map(|body| near(&mut noise, body.centre_m().0, body.centre_m().1, 0.1))
                .collect();
            traffic.update(bodies.iter().copied(), 1);
            let context = context(&scene, &mut traffic);
            for (me, body) in bodies.iter().enumerate() {
                let others = bodies.iter().enumerate().filter(|(i, _)| *i != me);
                let all: Vec<_> = scene.boxes.iter().chain(others.map(|(_, b)| b)).collect();

                let (sin, cos) = libm::sincos(noise.uniform(-3.2, 3.2));
                let (x_m, y_m) = body.centre_m();
                let (x_m, y_m) = (x_m + 0.3 * cos, y_m + 0.3 * sin);
                let beam = Beam::new(x_m, y_m, cos, sin, 1.2);
                let expected = all.iter().filter_map(|b| b.hit_m(&beam)).reduce(f64::min);
                assert_eq!(context.nearest_m(me, [beam]), [expected]);
                let aside = Beam::new(x_m, y_m, sin, cos, 1.2);
                let alone = [beam, aside].map(|beam| context.nearest_m(me, [beam])[0]);
                if context.is_free(me, &beam, 0.01) {
                    assert_eq!(expected, None);
                    free += 1;
                }
                assert_eq!(context.nearest_m(me, [beam, aside]), alone);
                hits += usize::from(expected.is_some());

                let far = OrientedBox::new(500.0, 0.0, 0.0, 0.5, 0.4);
                let here = near(&mut noise, body.centre_m().0, body.centre_m().1, 0.014);
                let expected = all.iter().any(|b| b.separation_m(&here) <= 0.0);
                assert_eq!(context.blocks(me, &far, &here, &mut Vec::new()), expected);
                let expected = all.iter().all(|b| b.separation_m(&here) > 0.01);
                assert_eq!(context.is_clear(me, &here, 0.01), expected);
                blocks += usize::from(!expected);
            }
        }
        assert!(hits > 200 && hits < 1800 && blocks > 200 && blocks < 1800, "{hits} {blocks}");
        assert!(free > 100, "{free}");
    }

    #[test]
    fn what_is_already_penetrated_blocks_only_the_way_deeper() {
        let mut world = World::default();
        let spec = BoxSpec { x_m: 0.0, y_m: 0.0, width_m: 1.0, depth_m: 1.0, yaw_rad: 0.0 };
        world.put_box("crate", spec).unwrap();
        let scene = Scene::new(&world);
        let at = |x_m: f64| OrientedBox::new(x_m, 0.0, 0.0, 0.5, 0.4);
        let mut traffic = Traffic::of(&scene, vec![at(0.7)], 1.5, 0.02);
        let context = context(&scene, &mut traffic);
        assert!(context.blocks(0, &at(0.7), &at(0.69), &mut Vec::new()));
        assert!(!context.blocks(0, &at(0.7), &at(0.71), &mut Vec::new()));
    }
}
