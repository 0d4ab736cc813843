//! A whole robot on a truck, with the simulated board or with the firmware.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use xtb_board_emulator::Emulator;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_control::units::Stamp;
use xtb_protocol::board::{FrameReader, FromBoard};
use xtb_protocol::messages::{Body, GoalStatus, LinkLoss, Outcome, Request, RobotState, TruthRobot, Via};
use xtb_protocol::{Name, Uuid};
use xtb_robot::robot::Readings;
use xtb_sim::{ExternalBoard, Lockstep, Pins, Pulses, STEP_NS, Simulation, TruckParameters, World};

/// Where the emulator is.
pub(crate) fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../firmware/emulator")
}

/// What must not happen on a line without faults.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Trouble {
    /// Frames of the board that the agent has dropped.
    dropped: u64,
    /// Gaps in the board's sequence, in frames, and repeats.
    lost: u64,
    /// Frames of the agent that the board has refused.
    refused: u64,
    /// Resets by the chip's watchdog.
    resets: u64,
}

/// The emulated board, and what passes its line.
#[derive(Debug)]
struct Watched {
    emulator: Emulator,
    reader: FrameReader,
    refused: u16,
    /// When the agent's last bytes began on the line.
    heard: Stamp,
    bits: DefaultHasher,
}

impl ExternalBoard for Watched {
    fn step(&mut self, from_agent: &[u8], pins: &Pins, to_agent: &mut Vec<u8>) -> Pulses {
        if !from_agent.is_empty() {
            self.heard = Stamp::from_ns(pins.now.ns() - STEP_NS);
        }
        let before = to_agent.len();
        let pulses = self.emulator.step(from_agent, pins, to_agent);
        assert_eq!(self.emulator.failure(), None);
        let sent = &to_agent[before..];
        self.reader.from_board(sent, |frame| {
            if let Ok(FromBoard::Status(status)) = frame {
                self.refused = status.rejected;
            }
        });
        (from_agent, sent, pulses.counts, pulses.begun.ns()).hash(&mut self.bits);
        pulses
    }
}

/// Robot and truck.
pub(crate) struct Rig {
    lockstep: Lockstep,
    board: Option<Arc<Mutex<Watched>>>,
    asked: u128,
}

impl Rig {
    /// At power-on, with the firmware if there is one.
    fn new(firmware: Option<&Path>, world: &str, seed: u64, vehicle: &VehicleConfig) -> Self {
        let world = World::from_toml(world).unwrap();
        let parameters = TruckParameters::of(vehicle);
        let mut simulation =
            Simulation::with_starts(world, &parameters, &[("xtb-1", MapPose::default())], seed).unwrap();
        let board = firmware.map(|firmware| {
            let emulator = Emulator::start(firmware, &folder(), parameters.receiver.fitted)
                .unwrap_or_else(|error| panic!("{error}: {}", error.hint()));
            let (reader, bits) = (FrameReader::default(), DefaultHasher::new());
            Arc::new(Mutex::new(Watched { emulator, reader, refused: 0, heard: Stamp::ZERO, bits }))
        });
        if let Some(board) = &board {
            simulation.trucks_mut()[0].set_external_board(board.clone());
        }
        let lockstep = Lockstep::new(simulation, &Name::new("lab").unwrap(), vehicle).unwrap();
        Self { lockstep, board, asked: 0 }
    }

    /// The same when it is ready to drive.
    pub(crate) fn ready(firmware: Option<&Path>, world: &str, seed: u64) -> Self {
        Self::ready_with(firmware, world, seed, &VehicleConfig::default())
    }

    /// The same with a vehicle of another kind.
    pub(crate) fn ready_with(
        firmware: Option<&Path>,
        world: &str,
        seed: u64,
        vehicle: &VehicleConfig,
    ) -> Self {
        let mut rig = Self::new(firmware, world, seed, vehicle);
        rig.run_s(0.5);
        rig
    }

    /// What the robot reads on its lines.
    pub(crate) fn readings(&mut self) -> Readings {
        let now = self.lockstep.now();
        self.lockstep.robot_mut(0).unwrap().readings(now)
    }

    /// Its latches and faults.
    pub(crate) fn state(&mut self) -> RobotState {
        self.lockstep.state(0).unwrap()
    }

    /// Presses or releases the truck's emergency stop.
    pub(crate) fn press(&mut self, pressed: bool) {
        self.lockstep.simulation_mut().trucks_mut()[0].set_emergency_stop(pressed);
    }

    /// Asks for a reset: whether it was done.
    pub(crate) fn reset(&mut self) -> bool {
        self.asked += 1;
        let (id, body) = (Uuid::from_u128(self.asked), Body::Reset { latch: None });
        let request = Request { id, lease: None, body };
        let reply = self.lockstep.request(0, &Name::new("tester").unwrap(), &request).unwrap();
        matches!(reply.result, Outcome::Ok(_))
    }

    pub(crate) fn step(&mut self) {
        self.lockstep.step();
    }

    pub(crate) fn run_s(&mut self, seconds: f64) {
        (0..Stamp::from_s(seconds).ns() / STEP_NS).for_each(|_| self.step());
    }

    pub(crate) fn now_s(&self) -> f64 {
        self.lockstep.now().s()
    }

    pub(crate) fn truth(&self) -> TruthRobot {
        self.lockstep.simulation().trucks()[0].truth()
    }

    /// Begins a drive to a point.
    pub(crate) fn goto(&mut self, x_m: f64, y_m: f64) {
        self.asked += 1;
        let (via, on_link_loss) = (Some(Via::Direct), LinkLoss::Halt);
        let body = Body::Goto { x_m, y_m, yaw_rad: None, via, on_link_loss, finish_s: 300.0 };
        let request = Request { id: Uuid::from_u128(self.asked), lease: None, body };
        let reply = self.lockstep.request(0, &Name::new("tester").unwrap(), &request).unwrap();
        assert!(matches!(reply.result, Outcome::Ok(_)), "{reply:?}");
    }

    /// How the goal is.
    pub(crate) fn goal(&mut self) -> GoalStatus {
        self.lockstep.robot_mut(0).unwrap().agent().goal().unwrap().status
    }

    /// Puts the truck elsewhere.
    pub(crate) fn put(&mut self, x_m: f64, y_m: f64) {
        let pose = MapPose { x_m, y_m, ..MapPose::default() };
        self.lockstep.simulation_mut().place(0, pose).unwrap();
    }

    /// The platform's tilt x and y in degrees, as the robot has measured it.
    pub(crate) fn tilt_deg(&mut self) -> (f64, f64) {
        let tilt = self.lockstep.state(0).unwrap().tilt_deg;
        tilt.x.zip(tilt.y).unwrap()
    }

    /// The agent is dead from now on.
    pub(crate) fn kill(&mut self) {
        self.lockstep.kill(0);
    }

    /// When the agent's last frame began on the line to the emulated board, in s.
    pub(crate) fn heard_s(&self) -> f64 {
        self.board.as_ref().unwrap().lock().unwrap().heard.s()
    }

    /// Frames that the emulated board has sent, and what went wrong on the line.
    pub(crate) fn frames(&mut self) -> (u64, Trouble) {
        let agent = self.lockstep.state(0).unwrap().rejected;
        let board = self.board.as_ref().unwrap().lock().unwrap();
        let line = board.reader.counters();
        let trouble = Trouble {
            dropped: agent.board_frames + line.rejected,
            lost: agent.board_lost + agent.board_repeated + line.lost + line.repeated,
            refused: board.refused.into(),
            resets: board.emulator.resets(),
        };
        (line.frames, trouble)
    }

    /// A number for all that passed the line and the pins, and for where the truck is.
    pub(crate) fn bits(&self) -> u64 {
        let mut bits = self.board.as_ref().unwrap().lock().unwrap().bits.clone();
        let truth = self.truth();
        [truth.x_m, truth.y_m, truth.yaw_rad, truth.speed_mps].map(f64::to_bits).hash(&mut bits);
        bits.finish()
    }
}
