//! What a step may see: everything that stands, and where every truck was when the step began.
//!
//! A [`StepContext`] never changes during a step. That is why trucks can be stepped in any order,
//! or on several threads, and still come out with the same bits.

use crate::geometry::{Beam, Bounds, OrientedBox};
use crate::grid::{Cells, MovingGrid, StandingGrid};
use crate::step::STEP_NS;
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

    pub(crate) fn cells(&self) -> Cells {
        self.cells.clone()
    }

    /// Sine of the slope at a place towards +x and +y; the first ramp listed wins.
    fn rise_at(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let slope = self.slopes.iter().find(|slope| slope.area.holds(x_m, y_m));
        slope.map_or((0.0, 0.0), |slope| slope.rise)
    }
}

/// The trucks at the beginning of a step, and behind them those that other programs move.
#[derive(Debug, Clone)]
pub(crate) struct Traffic {
    boxes: Vec<OrientedBox>,
    /// Trucks that another one ran into during the step before.
    touched: Vec<bool>,
    grid: MovingGrid,
}

impl Traffic {
    pub(crate) fn new(cells: Cells, bodies: &[OrientedBox]) -> Self {
        let reach_m = bodies.iter().map(OrientedBox::radius_m).fold(0.0, f64::max);
        let mut grid = MovingGrid::new(cells, bodies.len(), reach_m);
        grid.rebuild(bodies);
        Self { boxes: bodies.to_vec(), touched: vec![false; bodies.len()], grid }
    }

    /// Takes over where all are now; allocates nothing while there are no more than before.
    pub(crate) fn update(&mut self, bodies: impl Iterator<Item = OrientedBox>) {
        self.boxes.clear();
        self.boxes.extend(bodies);
        self.grid.rebuild(&self.boxes);
        self.touched.clear();
        self.touched.resize(self.boxes.len(), false);
    }

    /// Whether a truck is as near to another body as trucks reach.
    fn may_meet(&self, truck: usize, body: &OrientedBox) -> bool {
        let ((ax, ay), (bx, by)) = (self.boxes[truck].centre_m(), body.centre_m());
        let reach_m = 2.0 * self.grid.reach_m();
        (ax - bx) * (ax - bx) + (ay - by) * (ay - by) <= reach_m * reach_m
    }

    /// A body of this size comes.
    pub(crate) fn admit(&mut self, body: &OrientedBox) {
        self.grid.reach_at_least(body.radius_m());
    }

    /// Another program's may be gone by now; who moves it counts its contacts.
    pub(crate) fn mark_touched(&mut self, truck: usize) {
        if let Some(touched) = self.touched.get_mut(truck) {
            *touched = true;
        }
    }
}

/// The world as one step of one truck sees it; shared by all trucks of the step.
#[derive(Debug, Clone, Copy)]
pub struct StepContext<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) traffic: &'a Traffic,
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
        self.traffic.touched[me]
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
        let reach = bounds.grown(self.traffic.grid.reach_m());
        self.traffic.grid.near(bounds, |i| {
            let (x_m, y_m) = self.traffic.boxes[i].centre_m();
            if i != me && reach.holds(x_m, y_m) {
                look(&self.traffic.boxes[i]);
            }
        });
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
        self.traffic.grid.near(bounds, |i| {
            if i != me && self.traffic.may_meet(i, to) && in_the_way(&self.traffic.boxes[i]) {
                touched.push(i);
                blocked = true;
            }
        });
        blocked
    }

    /// Whether nothing is nearer to a truck than `margin_m`.
    pub(crate) fn is_clear(&self, me: usize, body: &OrientedBox, margin_m: f64) -> bool {
        let bounds = body.bounds().grown(margin_m);
        let near = |other: &OrientedBox| body.separation_m(other) <= margin_m;
        let mut clear = true;
        self.scene.grid.near(bounds, |i| clear &= !near(&self.scene.boxes[i]));
        self.traffic.grid.near(bounds, |i| clear &= i == me || !near(&self.traffic.boxes[i]));
        clear
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;
    use crate::world::BoxSpec;

    /// A crowded world: 40 boxes and 40 trucks anywhere, some beyond the walls.
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
        let bodies: Vec<_> = (0..40).map(|_| anywhere(noise)).collect();
        let traffic = Traffic::new(scene.cells(), &bodies);
        (scene, traffic)
    }

    fn anywhere(noise: &mut Rng) -> OrientedBox {
        let (x_m, y_m) = (noise.uniform(-11.0, 11.0), noise.uniform(-11.0, 11.0));
        OrientedBox::new(x_m, y_m, noise.uniform(-3.0, 3.0), 0.5, 0.4)
    }

    #[test]
    fn the_broad_phase_finds_what_asking_every_box_finds() {
        let mut noise = Rng::new(11, 0);
        let (scene, traffic) = crowd(&mut noise);
        let context = StepContext { scene: &scene, traffic: &traffic, start: Stamp::ZERO };
        let (mut hits, mut blocks) = (0, 0);
        for round in 0..2000 {
            let me = round % 40;
            let others = traffic.boxes.iter().enumerate().filter(|(i, _)| *i != me);
            let all: Vec<_> = scene.boxes.iter().chain(others.map(|(_, b)| b)).collect();

            let (sin, cos) = libm::sincos(noise.uniform(-3.2, 3.2));
            let (x_m, y_m) = (noise.uniform(-11.0, 11.0), noise.uniform(-11.0, 11.0));
            let beam = Beam::new(x_m, y_m, cos, sin, 1.2);
            let expected = all.iter().filter_map(|b| b.hit_m(&beam)).reduce(f64::min);
            assert_eq!(context.nearest_m(me, [beam]), [expected]);
            let aside = Beam::new(x_m, y_m, sin, cos, 1.2);
            let alone = [beam, aside].map(|beam| context.nearest_m(me, [beam])[0]);
            assert_eq!(context.nearest_m(me, [beam, aside]), alone);
            hits += usize::from(expected.is_some());

            let (far, here) = (OrientedBox::new(500.0, 0.0, 0.0, 0.5, 0.4), anywhere(&mut noise));
            let expected = all.iter().any(|b| b.separation_m(&here) <= 0.0);
            assert_eq!(context.blocks(me, &far, &here, &mut Vec::new()), expected);
            let expected = all.iter().all(|b| b.separation_m(&here) > 0.01);
            assert_eq!(context.is_clear(me, &here, 0.01), expected);
            blocks += usize::from(!expected);
        }
        assert!(hits > 200 && hits < 1800 && blocks > 200 && blocks < 1800, "{hits} {blocks}");
    }

    #[test]
    fn what_is_already_penetrated_blocks_only_the_way_deeper() {
        let mut world = World::default();
        let spec = BoxSpec { x_m: 0.0, y_m: 0.0, width_m: 1.0, depth_m: 1.0, yaw_rad: 0.0 };
        world.put_box("crate", spec).unwrap();
        let scene = Scene::new(&world);
        let traffic = Traffic::new(scene.cells(), &[]);
        let context = StepContext { scene: &scene, traffic: &traffic, start: Stamp::ZERO };
        let at = |x_m: f64| OrientedBox::new(x_m, 0.0, 0.0, 0.5, 0.4);
        assert!(context.blocks(0, &at(0.7), &at(0.69), &mut Vec::new()));
        assert!(!context.blocks(0, &at(0.7), &at(0.71), &mut Vec::new()));
    }
}
