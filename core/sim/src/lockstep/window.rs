//! Some steps of a fleet in which nobody hears of anybody: a few islands at a time, on any thread.
//!
//! Trucks that cannot come near each other within a window ([`crate::islands`]) need not wait for each other.
//! They go through all steps of the window while they are in a processor's cache.

use crate::executor::Executor;
use crate::fixes::FixMaker;
use crate::geometry::OrientedBox;
use crate::scene::{Lists, Scene, StepContext};
use crate::simulation::Window;
use crate::step::STEP_NS;
use crate::vehicle::Truck;
use std::collections::VecDeque;
use xtb_control::units::Stamp;
use xtb_nav::navigator::{PlanDone, PlanJob};
use xtb_nav::planner::Planner;
use xtb_protocol::board::Frame;
use xtb_protocol::messages::Lease;
use xtb_robot::Robot;

/// A piece of work has at least so many robots, as long as there are enough; as many do the same thing in a row.
/// 4 and 16 were not faster with 100 robots.
const PIECE_ROBOTS: usize = 8;
/// What comes in on a line in a turn is not longer, as a rule.
const BYTES: usize = 256;

/// What is on one truck, and what is on its way to it.
#[derive(Debug)]
pub(super) struct Crew {
    pub(super) robot: Robot,
    /// What the one client of the robot holds, once it has asked for something.
    pub(super) lease: Option<Lease>,
    /// What measures the truck from outside.
    pub(super) fixes: Option<FixMaker>,
    /// Paths on their way back, with when.
    pub(super) plans: VecDeque<(Stamp, PlanDone)>,
    /// Paths that it has asked for in this window, with when they are back.
    jobs: Vec<(Stamp, PlanJob)>,
    /// What its turn has to say to the board.
    frame: Option<Frame>,
    /// Its agent has died.
    pub(super) dead: bool,
}

impl Crew {
    pub(super) fn new(robot: Robot) -> Self {
        let (plans, jobs) = (VecDeque::new(), Vec::new());
        Self { robot, lease: None, fixes: None, plans, jobs, frame: None, dead: false }
    }

    /// Paths that were asked for come back after their time, whatever they cost this machine.
    pub(super) fn deliver_plans(&mut self, now: Stamp) {
        while self.plans.front().is_some_and(|(at, _)| *at <= now) {
            if let Some((_, done)) = self.plans.pop_front() {
                self.robot.agent_mut().planned(now, done);
            }
        }
    }

    /// After its truck's step: what the truck has sent.
    fn listen(&mut self, truck: &mut Truck, now: Stamp, bytes: &mut Vec<u8>) {
        if !self.dead {
            super::listen(truck, &mut self.robot, now, bytes);
        }
    }

    /// The robot's turn.
    fn turn(&mut self, now: Stamp) {
        if !self.dead {
            if let Some(lease) = self.lease {
                self.robot.agent_mut().heard(now, lease);
            }
            self.frame = self.robot.turn(now);
        }
    }

    /// What it sends, and a pose fix.
    fn speak(&mut self, truck: &mut Truck, now: Stamp) {
        let robot = &mut self.robot;
        if !self.dead {
            super::speak(truck, robot, now, self.frame.take());
            while robot.agent_mut().next_event().is_some() {}
            if let Some(job) = robot.agent_mut().take_plan_job() {
                self.jobs.push((now.plus_ms(super::PLAN_MS), job));
            }
        }
        if let Some(maker) = &mut self.fixes {
            maker.step(now, &truck.truth());
            while let Some(made) = maker.take(now) {
                robot.agent_mut().fix(now, now, &made.message(now));
            }
        }
    }
}

/// What came up in a window.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct News {
    /// Somebody asks for a path.
    pub(super) jobs: bool,
    /// Paths are on their way.
    pub(super) plans: bool,
    /// Somebody has a planned goal.
    pub(super) goals: bool,
}

impl News {
    fn of(crew: &Crew) -> Self {
        // Sooner or later traffic control would be silent.
        let goals = crew.robot.agent().goes_alone(Stamp::from_ns(u64::MAX));
        Self { jobs: !crew.jobs.is_empty(), plans: !crew.plans.is_empty(), goals }
    }

    fn and(self, other: Self) -> Self {
        Self {
            jobs: self.jobs || other.jobs,
            plans: self.plans || other.plans,
            goals: self.goals || other.goals,
        }
    }
}

/// A truck and what is on it.
type Unit<'a> = (&'a mut Truck, &'a mut Crew);

/// Some islands, for one thread.
struct Piece<'a> {
    units: Vec<Unit<'a>>,
    first: usize,
    boxes: &'a mut [OrientedBox],
    touched: &'a mut [bool],
    news: News,
}

/// Moves every truck on by so many steps, and gives every robot as many turns.
pub(super) fn run(window: Window<'_>, crews: &mut [Crew], steps: u64, executor: &impl Executor) -> News {
    let Window { scene, lists, mut boxes, mut touched, trucks, start } = window;
    if boxes.len() > trucks.len() {
        // Others are among them, which may be gone after a step.
        let units = trucks.iter_mut().zip(crews).collect();
        let mut piece = Piece { units, first: 0, boxes, touched, news: News::default() };
        piece.run(scene, lists, start, 1);
        return piece.news;
    }
    let mut units: Vec<Option<Unit<'_>>> = trucks.iter_mut().zip(crews).map(Some).collect();
    let mut pieces = Vec::with_capacity(units.len() / PIECE_ROBOTS + 1);
    let mut order = lists.islands().order();
    let mut sizes = lists.islands().sizes();
    let mut first = 0;
    while first < units.len() {
        let mut count = 0;
        while count < PIECE_ROBOTS
            && let Some(size) = sizes.next()
        {
            count += size;
        }
        let (its_boxes, other_boxes) = boxes.split_at_mut(count);
        let (its_touched, other_touched) = touched.split_at_mut(count);
        let its_units = order.by_ref().take(count).filter_map(|n| units[n].take()).collect();
        pieces.push(Piece {
            units: its_units,
            first,
            boxes: its_boxes,
            touched: its_touched,
            news: News::default(),
        });
        (boxes, touched) = (other_boxes, other_touched);
        first += count;
    }
    executor.each(&mut pieces, |piece| piece.run(scene, lists, start, steps));
    pieces.iter().fold(News::default(), |news, piece| news.and(piece.news))
}

impl Piece<'_> {
    /// A few robots at a time do one thing after the other, so that its code stays in the processor's cache, and a piece
    /// goes through all steps while its robots are in it. No truck's step depends on what another robot does in its turn.
    fn run(&mut self, scene: &Scene, lists: Lists<'_>, start: Stamp, steps: u64) {
        let mut bytes = Vec::with_capacity(BYTES);
        for step in 0..steps {
            if step > 0 {
                self.look(lists);
            }
            let start = start.plus_ns(step * STEP_NS);
            let Self { units, first, boxes, touched, news } = self;
            let context = StepContext { scene, lists, first: *first, boxes, touched, start };
            let now = context.now();
            for units in units.chunks_mut(PIECE_ROBOTS) {
                units.iter_mut().for_each(|(truck, _)| truck.step(&context));
                units.iter_mut().for_each(|(truck, crew)| crew.listen(truck, now, &mut bytes));
                units.iter_mut().for_each(|(_, crew)| crew.turn(now));
                for (truck, crew) in units {
                    crew.speak(truck, now);
                    if step + 1 < steps {
                        crew.deliver_plans(now);
                    } else {
                        *news = news.and(News::of(crew));
                    }
                }
            }
        }
    }

    /// Where all are now, and who was run into.
    fn look(&mut self, lists: Lists<'_>) {
        for ((truck, _), body) in self.units.iter().zip(&mut *self.boxes) {
            *body = truck.body();
        }
        self.touched.fill(false);
        for (truck, _) in &*self.units {
            for &other in truck.ran_into() {
                self.touched[lists.islands().place(other) - self.first] = true;
            }
        }
    }
}

/// Works off what the robots have asked for, so many at the same time as there are planners.
pub(super) fn plan(crews: &mut [Crew], planners: &mut Vec<Planner>, executor: &impl Executor) {
    let mut asked: Vec<&mut Crew> = crews.iter_mut().filter(|crew| !crew.jobs.is_empty()).collect();
    if asked.is_empty() {
        return;
    }
    planners.resize_with(executor.threads().clamp(1, asked.len()).max(planners.len()), Planner::new);
    let each = asked.len().div_ceil(planners.len());
    let mut lanes: Vec<_> = planners.iter_mut().zip(asked.chunks_mut(each)).collect();
    executor.each(&mut lanes, |(planner, crews)| {
        for crew in crews.iter_mut() {
            let done = crew.jobs.drain(..).map(|(at, job)| (at, job.run(planner)));
            crew.plans.extend(done);
        }
    });
}
