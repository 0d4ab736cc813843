//! Planned goals with the full vehicle: around what the map knows of, through doors, to a yaw.

use crate::journeys::{Hinder, journeys, journeys_in_clutter};
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{Body, GoalStatus, LinkLoss, Outcome, Request, RobotState, Via};
use xtb_protocol::{Name, Uuid};
use xtb_sim::fixes::FixTruth;
use xtb_sim::lockstep::Lockstep;
use xtb_sim::{Simulation, TruckParameters, World};

const LAB: &str = include_str!("../../../../worlds/lab.toml");

pub(crate) struct Drive {
    pub(crate) lockstep: Lockstep,
    asked: u128,
}

impl Drive {
    /// Trucks in a world, with its map and fixes at 2 Hz.
    pub(crate) fn new(world: &str, trucks: usize, seed: u64) -> Self {
        let world = World::from_toml(world).unwrap();
        let names: Vec<String> = (1..=trucks).map(|n| format!("xtb-{n}")).collect();
        let simulation = Simulation::new(world, &TruckParameters::default(), &names, seed).unwrap();
        Self::with(simulation, seed)
    }

    /// Trucks that start here.
    pub(crate) fn at(world: World, starts: &[MapPose], seed: u64) -> Self {
        let names: Vec<String> = (1..=starts.len()).map(|n| format!("xtb-{n}")).collect();
        let starts: Vec<_> = names.iter().map(String::as_str).zip(starts.iter().copied()).collect();
        Self::with(Simulation::with_starts(world, &TruckParameters::default(), &starts, seed).unwrap(), seed)
    }

    fn with(simulation: Simulation, seed: u64) -> Self {
        let map = simulation.world().chart(0.05).unwrap();
        let mut lockstep =
            Lockstep::new(simulation, &Name::new("lab").unwrap(), &VehicleConfig::default()).unwrap();
        lockstep.set_map(&map);
        lockstep.set_fixes(FixTruth { rate_hz: 2.0, ..FixTruth::default() }, seed);
        let mut drive = Self { lockstep, asked: 0 };
        drive.run_s(2.0);
        drive
    }

    pub(crate) fn run_s(&mut self, seconds: f64) {
        for _ in 0..(seconds / 0.005) as u32 {
            self.lockstep.step();
        }
    }

    pub(crate) fn goto(&mut self, index: usize, x_m: f64, y_m: f64, yaw_rad: Option<f64>) -> Outcome {
        self.asked += 1;
        let body = Body::Goto {
            x_m,
            y_m,
            yaw_rad,
            via: Some(Via::Planned),
            on_link_loss: LinkLoss::Halt,
            finish_s: 300.0,
        };
        let request = Request { id: Uuid::from_u128(self.asked), lease: None, body };
        self.lockstep.request(index, &Name::new("tester").unwrap(), &request).unwrap().result
    }

    /// Somebody hits this robot's emergency stop.
    pub(crate) fn estop(&mut self, index: usize) {
        let (now, id) = (self.lockstep.now(), Uuid::from_u128(u128::MAX / 2));
        let by = Name::new("tester").unwrap();
        self.lockstep.robot_mut(index).unwrap().agent_mut().estop(now, u64::MAX, &by, id);
    }

    /// Runs until the goal has ended, at most so long.
    pub(crate) fn wait(&mut self, index: usize, seconds: f64) -> RobotState {
        for _ in 0..(seconds / 0.5) as u32 {
            self.run_s(0.5);
            let state = self.lockstep.state(index).unwrap();
            if state.goal.as_ref().is_none_or(|goal| goal.status.is_final()) {
                return state;
            }
        }
        self.lockstep.state(index).unwrap()
    }
}

#[test]
fn a_goal_behind_a_wall_is_reached_through_the_door() {
    let mut drive = Drive::new(LAB, 1, 3);
    assert!(matches!(drive.goto(0, 4.0, 5.0, Some(0.0)), Outcome::Ok(_)));
    let state = drive.wait(0, 120.0);
    let truth = drive.lockstep.simulation().trucks()[0].truth();
    assert_eq!(state.goal.as_ref().unwrap().status, GoalStatus::Reached, "{state:#?}\n{truth:?}");
    assert_eq!(truth.contacts, 0);
    assert!((truth.x_m - 4.0).abs() < 0.3 && (truth.y_m - 5.0).abs() < 0.3, "{truth:?}");
}

#[test]
fn goals_anywhere_in_the_lab_are_reached_without_touching_anything() {
    for journey in journeys(LAB, 0..6, Hinder::Nothing) {
        assert_eq!((journey.status, journey.contacts), (Some(GoalStatus::Reached), 0), "{journey:?}");
        assert!(journey.off_m < 0.25, "{journey:?}");
    }
}

#[test]
fn around_a_box_that_nobody_knew_of_or_an_honest_answer() {
    for journey in journeys(LAB, 20..26, Hinder::Box) {
        assert!(journey.is_honest(), "{journey:?}");
        assert_eq!(journey.contacts, 0, "{journey:?}");
    }
}

/// In one it had looked at the box half a minute before, in the other it had seen one corner of it.
#[test]
fn a_box_beside_a_tight_bend_is_not_touched() {
    for journey in [journeys(LAB, 138..139, Hinder::Box), journeys(LAB, 143..144, Hinder::Box)].concat() {
        assert!(journey.is_honest(), "{journey:?}");
        assert_eq!((journey.contacts, journey.hindered.len()), (0, 1), "{journey:?}");
    }
}

#[test]
fn somebody_who_steps_into_the_way_and_goes_again_keeps_it_from_nothing() {
    for journey in journeys(LAB, 40..44, Hinder::Person) {
        assert_eq!((journey.status, journey.contacts), (Some(GoalStatus::Reached), 0), "{journey:?}");
    }
}

#[test]
fn among_boxes_known_and_unknown_nothing_is_touched() {
    for journey in journeys_in_clutter(0..4, Hinder::TwoBoxes) {
        assert!(journey.is_honest(), "{journey:?}");
        assert_eq!(journey.contacts, 0, "{journey:?}");
    }
}

/// A fleet's map is published again every half minute.
#[test]
fn the_same_map_again_changes_nothing() {
    let mut drive = Drive::new(LAB, 1, 3);
    let map = drive.lockstep.simulation().world().chart(0.05).unwrap();
    assert!(matches!(drive.goto(0, 4.0, 5.0, Some(0.0)), Outcome::Ok(_)));
    drive.run_s(5.0);
    let route = |drive: &mut Drive| drive.lockstep.state(0).unwrap().nav.route.unwrap();
    let before = route(&mut drive);
    drive.lockstep.set_map(&map);
    drive.run_s(1.0);
    let after = route(&mut drive);
    assert_eq!((after.plans, after.track), (before.plans, before.track));
    assert!(after.done_m > before.done_m + 0.1, "it drives on: {} m, {} m", before.done_m, after.done_m);
}
