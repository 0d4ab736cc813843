//! The whole robots on the whole vehicles in lockstep, with their world's map and pose fixes: what the tests
//! of planned goals, journeys and meetings drive.

use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{Body, LinkLoss, Outcome, Request, RobotState, Via};
use xtb_protocol::{Name, Uuid};
use xtb_sim::fixes::FixTruth;
use xtb_sim::lockstep::Lockstep;
use xtb_sim::{Simulation, TruckParameters, VehicleFile, World};

/// Trucks, and what they are asked.
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
        Self::with(simulation, &VehicleConfig::default(), seed)
    }

    /// The car of a file, alone.
    #[allow(dead_code)] // core/chaos drives XTBs alone
    pub(crate) fn by_file(world: World, start: MapPose, file: &VehicleFile, seed: u64) -> Self {
        let simulation = Simulation::with_starts(world, &file.truth, &[("xtb-1", start)], seed).unwrap();
        Self::with(simulation, &file.vehicle, seed)
    }

    /// The cars of these files, that start here.
    #[allow(dead_code)] // for meetings of several
    pub(crate) fn by_files(world: World, starts: &[MapPose], files: &[VehicleFile], seed: u64) -> Self {
        let names: Vec<String> = (1..=starts.len()).map(|n| format!("xtb-{n}")).collect();
        let starts: Vec<_> = names.iter().map(String::as_str).zip(starts.iter().copied()).collect();
        let kinds: Vec<TruckParameters> = files.iter().map(|file| file.truth.clone()).collect();
        let simulation = Simulation::of_kinds_at(world, &kinds, &starts, seed).unwrap();
        let vehicles: Vec<VehicleConfig> = files.iter().map(|file| file.vehicle.clone()).collect();
        Self::of_kinds(simulation, &vehicles, seed)
    }

    /// Trucks that start here.
    pub(crate) fn at(world: World, starts: &[MapPose], seed: u64) -> Self {
        Self::of(world, starts, &TruckParameters::default(), seed)
    }

    /// Other trucks than their settings say.
    pub(crate) fn of(world: World, starts: &[MapPose], truck: &TruckParameters, seed: u64) -> Self {
        let names: Vec<String> = (1..=starts.len()).map(|n| format!("xtb-{n}")).collect();
        let starts: Vec<_> = names.iter().map(String::as_str).zip(starts.iter().copied()).collect();
        let simulation = Simulation::with_starts(world, truck, &starts, seed).unwrap();
        Self::with(simulation, &VehicleConfig::default(), seed)
    }

    fn with(simulation: Simulation, vehicle: &VehicleConfig, seed: u64) -> Self {
        let vehicles = vec![vehicle.clone(); simulation.trucks().len()];
        Self::of_kinds(simulation, &vehicles, seed)
    }

    fn of_kinds(simulation: Simulation, vehicles: &[VehicleConfig], seed: u64) -> Self {
        let map = simulation.world().to_map(0.05).unwrap();
        let mut lockstep = Lockstep::of_kinds(simulation, &Name::new("lab").unwrap(), vehicles).unwrap();
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

    /// From now on it wanders.
    pub(crate) fn wander(&mut self, index: usize) {
        self.asked += 1;
        let body = Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 };
        let request = Request { id: Uuid::from_u128(self.asked), lease: None, body };
        let reply = self.lockstep.request(index, &Name::new("tester").unwrap(), &request).unwrap();
        assert!(matches!(reply.result, Outcome::Ok(_)), "{reply:?}");
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
