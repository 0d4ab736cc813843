//! The scenes for several robots in lockstep, with traffic control.

use crate::drive::Drive;
use std::collections::BTreeSet;
pub(crate) use xtb_chaos::meetings::Meeting;
use xtb_chaos::meetings::{Judge, ObservedRobot, Setting};
use xtb_nav::MapPose;
use xtb_protocol::messages::{Outcome, TruthRobot};
use xtb_sim::lockstep::Traffic;
use xtb_sim::{TruckParameters, World};

/// A turn of the witness, in s.
const STEP_S: f64 = 0.2;

/// Longest meeting, in s.
const WITHIN_S: f64 = 300.0;
/// Once all that are left have arrived or have said who is in the way, that has to last for so long, in s.
const TOLD_S: f64 = 20.0;

/// Robots at the starts, and traffic control.
pub(crate) fn fleet(world: &str, starts: &[MapPose], seed: u64) -> Drive {
    fleet_of(world, starts, &TruckParameters::default(), seed)
}

/// The same with other trucks.
pub(crate) fn fleet_of(world: &str, starts: &[MapPose], truck: &TruckParameters, seed: u64) -> Drive {
    let world = World::from_toml(world).unwrap();
    let map = world.to_map(0.05).unwrap();
    let mut drive = Drive::of(world, starts, truck, seed);
    drive.lockstep.set_traffic(Some(Traffic::new(&map, seed)));
    drive
}

/// All go to their goals at once; `meddle` may do what it likes with them, each 0.2 s.
pub(crate) fn meet(
    drive: &mut Drive,
    goals: &[MapPose],
    within_s: f64,
    meddle: &mut dyn FnMut(&mut Drive, f64),
) -> Meeting {
    let robots = goals.len();
    let mut witness = Judge::new((0..robots).map(|index| truth(drive, index).contacts));
    for (index, goal) in goals.iter().enumerate() {
        let asked = drive.goto(index, goal.x_m, goal.y_m, Some(goal.yaw_rad));
        assert!(matches!(asked, Outcome::Ok(_)), "{asked:?}");
    }
    let mut told_s = 0.0;
    while witness.made().took_s < within_s && told_s < TOLD_S {
        drive.run_s(STEP_S);
        let dead: BTreeSet<usize> = (0..robots).filter(|&index| drive.lockstep.is_dead(index)).collect();
        witness.look(STEP_S, &sights(drive, robots), &dead);
        let made = witness.made();
        meddle(drive, made.took_s);
        if made.is_over() {
            break;
        }
        told_s = if made.ends.len() < robots && made.is_told() { told_s + STEP_S } else { 0.0 };
    }
    witness.into_made()
}

fn sights(drive: &mut Drive, robots: usize) -> Vec<ObservedRobot> {
    let sight = |index: usize| ObservedRobot {
        truth: truth(drive, index),
        state: drive.lockstep.state(index).unwrap(),
    };
    (0..robots).map(sight).collect()
}

fn truth(drive: &Drive, index: usize) -> TruthRobot {
    drive.lockstep.simulation().trucks()[index].truth()
}

/// All robots, a line each.
#[allow(dead_code)] // for the example
pub(crate) fn scene(drive: &mut Drive) -> String {
    let robots = drive.lockstep.simulation().trucks().len();
    sights(drive, robots).iter().map(|sight| sight.words() + "\n").collect()
}

/// Many on a circle, each to the place opposite, in 8 × 8 m.
pub(crate) fn circle(robots: usize, seed: u64, meddle: &mut dyn FnMut(&mut Drive, f64)) -> Meeting {
    let setting = Setting::circle(robots);
    meet(&mut fleet(setting.world, &setting.starts, seed), &setting.goals, WITHIN_S, meddle)
}

/// Five swap places through a door; and back.
pub(crate) struct Door {
    pub(crate) drive: Drive,
    round: usize,
}

impl Door {
    pub(crate) fn new(seed: u64) -> Self {
        let Setting { world, starts, .. } = Setting::door(1);
        Self { drive: fleet(world, &starts, seed), round: 0 }
    }

    /// All change sides once.
    pub(crate) fn round(&mut self, meddle: &mut dyn FnMut(&mut Drive, f64)) -> Meeting {
        self.round += 1;
        meet(&mut self.drive, &Setting::door(self.round).goals, WITHIN_S, meddle)
    }
}

/// Nose to nose in a narrow place: one must back out.
pub(crate) fn narrow(seed: u64, meddle: &mut dyn FnMut(&mut Drive, f64)) -> Meeting {
    let setting = Setting::narrow();
    meet(&mut fleet(setting.world, &setting.starts, seed), &setting.goals, WITHIN_S, meddle)
}

/// What goes wrong on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Trouble {
    /// Nothing.
    None,
    /// The agent of the first truck in the doorway dies.
    Death,
    /// The drive of the first truck in the doorway is latched.
    Latch,
    /// Traffic control dies after 8 s and comes back, knowing nothing, 5 s later.
    Restart,
    /// One message of ten gets lost.
    Loss,
}

impl Trouble {
    /// As [`meet`] takes it.
    pub(crate) fn meddle(self) -> impl FnMut(&mut Drive, f64) {
        let (mut done, mut back) = (false, false);
        move |drive, at_s| {
            let Some(traffic) = drive.lockstep.traffic_mut() else { return };
            match self {
                Self::Loss => traffic.lost = 0.1,
                Self::Restart if at_s > 8.0 && !done => {
                    done = true;
                    traffic.kill();
                }
                Self::Restart if at_s > 13.0 && !back => {
                    back = true;
                    traffic.restart();
                }
                Self::Death | Self::Latch if !done => {
                    let trucks = drive.lockstep.simulation().trucks().len();
                    let in_doorway = |index: &usize| {
                        let TruthRobot { x_m, y_m, .. } = truth(drive, *index);
                        Setting::is_in_doorway(x_m, y_m)
                    };
                    let Some(index) = (0..trucks).find(in_doorway) else { return };
                    done = true;
                    match self {
                        Self::Death => drive.lockstep.kill(index),
                        _ => drive.estop(index),
                    }
                }
                _ => {}
            }
        }
    }
}
