//! The bodies of a world that move: where they are when steps begin, and who is near whom meanwhile.

use crate::geometry::OrientedBox;
use crate::islands::{Islands, Ways};
use crate::scene::{Lists, Scene};
use crate::vehicle::Truck;

/// So many steps, 200 ms, trucks that are not near each other are moved on without looking at the others, at most. With
/// 1,000 robots each comes into the processor's cache once for as many; farther ahead more of them could meet.
pub(crate) const WINDOW_STEPS: u64 = 40;
/// Lists of those nearby hold for so many steps at least, if nobody goes farther than it can in these.
const LIST_STEPS: u64 = 10;
/// Nearer than this to a body's edge something matters to it, beside what it sees: more than the margin of a
/// touch.
const BESIDE_M: f64 = 0.05;
/// More than rounding adds up to.
const ROUNDING_M: f64 = 0.001;

/// The trucks at the beginning of a step, and behind them those that other programs move.
#[derive(Debug, Clone)]
pub(crate) struct Bodies {
    islands: Islands,
    /// All by their numbers.
    bodies: Vec<OrientedBox>,
    /// By their places on the islands; and those that another one ran into during the step before.
    boxes: Vec<OrientedBox>,
    touched: Vec<bool>,
    /// No body reaches farther from its centre.
    radius_m: f64,
    /// How far each can go.
    ways: Vec<Ways>,
    /// The largest sine of a slope.
    steepest: f64,
}

impl Bodies {
    /// For these trucks and for what else moves among them.
    pub(crate) fn new(scene: &Scene, trucks: &[Truck], foreign: impl Iterator<Item = OrientedBox>) -> Self {
        let sight_m = trucks.iter().map(Truck::sight_m).fold(0.0, f64::max);
        let bodies: Vec<_> = trucks.iter().map(Truck::body).chain(foreign).collect();
        let ways = vec![Ways::default(); bodies.len()];
        Self::of(scene, bodies, sight_m, ways)
    }

    fn of(scene: &Scene, bodies: Vec<OrientedBox>, sight_m: f64, ways: Vec<Ways>) -> Self {
        let radius_m = bodies.iter().map(OrientedBox::radius_m).fold(0.0, f64::max);
        let reach_m = (sight_m + ROUNDING_M).max(radius_m + BESIDE_M) + radius_m;
        let islands = Islands::new(scene.cells.clone(), reach_m, &bodies, &ways);
        let (boxes, touched) = (islands.order().map(|n| bodies[n]).collect(), vec![false; bodies.len()]);
        Self { islands, bodies, boxes, touched, radius_m, ways, steepest: scene.steepest() }
    }

    /// Takes over where all are now, for so many steps; allocates nothing while there are no more than before.
    pub(crate) fn update(
        &mut self,
        trucks: &[Truck],
        foreign: impl Iterator<Item = OrientedBox>,
        steps: u64,
    ) {
        self.bodies.clear();
        self.bodies.extend(trucks.iter().map(Truck::body).chain(foreign));
        let steepest = self.steepest;
        self.ways.clear();
        self.ways.extend(trucks.iter().map(|truck| Ways {
            now_m: truck.farthest_m(steps, steepest),
            later_m: truck.farthest_m(LIST_STEPS, steepest),
        }));
        // Another program's is put elsewhere, or not at all.
        self.ways.resize(self.bodies.len(), Ways::default());
        self.place();
    }

    fn place(&mut self) {
        self.islands.update(&self.bodies, &self.ways);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Beam;
    use crate::rng::Rng;
    use crate::scene::StepContext;
    use crate::world::{BoxSpec, World};
    use xtb_control::Stamp;

    const WAYS: Ways = Ways { now_m: 0.02, later_m: 0.2 };

    /// A crowded world: 40 boxes and 40 bodies anywhere, some beyond the walls.
    fn crowd(noise: &mut Rng) -> (Scene, Bodies) {
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
        let traffic = Bodies::of(&scene, bodies, 1.5, vec![WAYS; 40]);
        (scene, traffic)
    }

    /// A truck's body no farther from there than this, east or west and north or south.
    fn near(noise: &mut Rng, x_m: f64, y_m: f64, within_m: f64) -> OrientedBox {
        let (dx_m, dy_m) = (noise.uniform(-within_m, within_m), noise.uniform(-within_m, within_m));
        OrientedBox::new(x_m + dx_m, y_m + dy_m, noise.uniform(-3.0, 3.0), 0.5, 0.4)
    }

    fn context<'a>(scene: &'a Scene, traffic: &'a mut Bodies) -> StepContext<'a> {
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
            traffic.bodies.clone_from(&bodies);
            traffic.place();
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
        let mut traffic = Bodies::of(&scene, vec![at(0.7)], 1.5, vec![WAYS]);
        let context = context(&scene, &mut traffic);
        assert!(context.blocks(0, &at(0.7), &at(0.69), &mut Vec::new()));
        assert!(!context.blocks(0, &at(0.7), &at(0.71), &mut Vec::new()));
    }
}
