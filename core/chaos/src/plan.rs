//! What a day brings, and when: all of it drawn from the seed before the day begins.

use crate::change::{Change, End, ROBOTS};
use crate::scripts::Scene;
use crate::time::{Turn, turns};
use std::f64::consts::{FRAC_PI_2, PI};
use xtb_control::frames::MapPose;
use xtb_sim::WorldError;
use xtb_sim::faults::{
    DriveFault, EncoderFault, GyroFault, InjectedLineFault, RangeFinderFault, SensorFaults,
};
use xtb_sim::receiver::Transmitter;
use xtb_sim::rng::Rng;
use xtb_sim::world::{BoxSpec, World};

/// A day before it begins.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) robots: usize,
    pub(crate) people: usize,
    pub(crate) length: Turn,
    /// In the order of their times.
    pub(crate) changes: Vec<(Turn, Change)>,
    pub(crate) scenes: Vec<Scene>,
    pub(crate) rng: Rng,
}

/// The room, and the distance between two trucks' lanes.
pub(crate) const WIDTH_M: f64 = 12.0;
pub(crate) const DEPTH_M: f64 = 6.0;
const LANE_M: f64 = 2.0;
/// Most people of a scenario.
const PEOPLE: u64 = 4;

impl Plan {
    pub(crate) fn draw(seed: u64) -> Self {
        let mut rng = Rng::new(seed, 0xDA15);
        rng.up_to(1); // the first one still knows the seed
        let robots = 1 + rng.up_to(ROBOTS - 1) as usize;
        let people = 2 + rng.up_to(PEOPLE - 2) as usize;
        let length = turns(rng.uniform(10.0, 60.0));
        let mut plan = Self { robots, people, length, changes: Vec::new(), scenes: Vec::new(), rng };
        let incidents = plan.rng.up_to(2 * robots as u64 + 6);
        for _ in 0..incidents {
            plan.incident();
        }
        plan.transmitters();
        plan.scenes = Scene::draw(&mut plan.rng, robots, people, length);
        for scene in &plan.scenes {
            plan.changes.extend(scene.changes());
        }
        plan.changes.sort_by_key(|(at, _)| *at);
        plan
    }

    fn robot(&mut self) -> u8 {
        self.rng.up_to(self.robots as u64 - 1) as u8
    }

    fn person(&mut self) -> u8 {
        self.rng.up_to(self.people as u64 - 1) as u8
    }

    fn end(&mut self) -> End {
        if self.rng.chance(0.5) { End::Robot(self.robot()) } else { End::Person(self.person()) }
    }

    /// When something may happen: not before the first second, when nothing runs yet.
    fn moment(&mut self) -> Turn {
        self.rng.uniform(200.0, f64::from(self.length)) as Turn
    }

    /// Mostly short, sometimes long, in turns.
    fn while_(&mut self, short_s: f64, long_s: f64) -> Turn {
        let longest_s = if self.rng.chance(0.6) { short_s } else { long_s };
        turns(self.rng.uniform(0.01, longest_s)).max(1)
    }

    fn line_fault(&mut self) -> InjectedLineFault {
        match self.rng.up_to(6) {
            0 | 1 => InjectedLineFault::Silent,
            2 => InjectedLineFault::Garbage,
            3 => InjectedLineFault::HalfFrames,
            4 => InjectedLineFault::WrongDevice,
            5 => InjectedLineFault::Lossy(self.rng.uniform(0.05, 0.95)),
            _ => InjectedLineFault::Frozen,
        }
    }

    fn incident(&mut self) {
        let (at, robot, person, end) = (self.moment(), self.robot(), self.person(), self.end());
        let change = match self.rng.up_to(22) {
            0 | 1 => Change::KillAgent { robot, turns: self.while_(1.0, 4.0).max(10) },
            2 => Change::HoldLoop { robot, turns: self.while_(0.2, 3.0) },
            3 => Change::FreezeAgent { robot, turns: self.while_(0.3, 4.0) },
            4 => Change::JumpClock { robot, ms: self.rng.uniform(-1000.0, 3000.0) as i64 },
            5 => Change::StickClock { robot, turns: 1 + self.rng.up_to(1) as Turn },
            6 | 7 => Change::HoldLink { end, turns: self.while_(0.8, 5.0) },
            8 => Change::CloseLink { end, turns: self.while_(0.5, 3.0) },
            9 => Change::KillRouter { turns: self.while_(0.5, 4.0) },
            10 => return self.broken_line(at, robot),
            11 => return self.unplugged(at, robot),
            12 => Change::PowerCycle { robot },
            13 => Change::KillPerson { person },
            14 => Change::FreezePerson { person, turns: self.while_(1.0, 6.0) },
            15 => {
                let a_turn = 1 + self.rng.up_to(60) as u8;
                Change::Flood { person, robot, a_turn, turns: self.while_(0.2, 1.0) }
            }
            16 => Change::Replay { person, messages: 1 + self.rng.up_to(30) as u8 },
            17 => Change::Damaged { person, robot },
            18..=20 => return self.broken_sensor(at, robot),
            21 => return self.broken_drive(at, robot),
            _ => Change::Battery { robot, left: self.rng.uniform(0.0, 1.0) * self.rng.uniform(0.0, 1.0) },
        };
        self.changes.push((at, change));
    }

    fn broken_line(&mut self, at: Turn, robot: u8) {
        let (fault, until) = (self.line_fault(), at + self.while_(0.4, 5.0));
        let board = self.rng.chance(0.5);
        let change = |fault| match board {
            true => Change::BoardLine { robot, fault },
            false => Change::GyroLine { robot, fault },
        };
        self.changes.extend([(at, change(fault)), (until, change(InjectedLineFault::None))]);
    }

    fn broken_sensor(&mut self, at: Turn, robot: u8) {
        let (kind, finder) = (self.rng.up_to(9), self.rng.up_to(11) as usize);
        let well = SensorFaults::default();
        let faults = match kind {
            0 | 1 => SensorFaults::range_finder(finder, RangeFinderFault::Frozen),
            2 => SensorFaults::range_finder(finder, RangeFinderFault::BrokenWire),
            3 => SensorFaults::all_range_finders(RangeFinderFault::Short),
            4 => SensorFaults { converter_frozen: true, ..well },
            5 => SensorFaults { gyro: GyroFault::AnglesFrozen, ..well },
            6 => SensorFaults { gyro: GyroFault::TimerFrozen, ..well },
            7 => SensorFaults { encoder: EncoderFault::BrokenWire, ..well },
            8 => SensorFaults { encoder: EncoderFault::Wild, ..well },
            _ => SensorFaults { battery_unmeasured: true, ..well },
        };
        let until = at + self.while_(2.0, 8.0);
        let change = |faults| Change::Sensors { robot, faults };
        self.changes.extend([(at, change(faults)), (until, change(well))]);
    }

    fn broken_drive(&mut self, at: Turn, robot: u8) {
        let fault = if self.rng.chance(0.5) { DriveFault::Stuck } else { DriveFault::Held };
        let until = at + self.while_(4.0, 8.0);
        let change = |fault| Change::Drive { robot, fault };
        self.changes.extend([(at, change(fault)), (until, change(DriveFault::None))]);
    }

    fn unplugged(&mut self, at: Turn, robot: u8) {
        let (board, until) = (self.rng.chance(0.5), at + self.while_(0.4, 5.0));
        let change = |plugged| Change::Plug { robot, board, plugged };
        self.changes.extend([(at, change(false)), (until, change(true))]);
    }

    /// Somebody with the transmitter takes a truck over for a while, now and then with the stick held.
    fn transmitters(&mut self) {
        for robot in 0..self.robots as u8 {
            if !self.rng.chance(0.3) {
                continue;
            }
            let mut at = self.moment();
            for _ in 0..=self.rng.up_to(2) {
                let transmitter = Transmitter {
                    on: self.rng.chance(0.9),
                    speed: if self.rng.chance(0.4) { 0.0 } else { self.rng.uniform(-0.4, 0.4) },
                    steering: self.rng.uniform(-1.0, 1.0),
                    selector_manual: self.rng.chance(0.8),
                };
                self.changes.push((at, Change::Sticks { robot, transmitter }));
                at += self.while_(1.0, 4.0);
            }
            self.changes.push((at, Change::Sticks { robot, transmitter: Transmitter::default() }));
        }
    }

    /// A small room with some boxes along its walls, and where the trucks start in it: a lane for each,
    /// all anyhow ahead or astern of the others.
    pub(crate) fn world(&mut self) -> Result<(World, Vec<MapPose>), WorldError> {
        let text = format!("[room]\nwidth_m = {WIDTH_M:?}\ndepth_m = {DEPTH_M:?}\n");
        let mut world = World::from_toml(&text)?;
        for i in 0..self.rng.up_to(3) {
            let side = if self.rng.chance(0.5) { 1.0 } else { -1.0 };
            let spec = BoxSpec {
                x_m: self.rng.uniform(-5.0, 5.0),
                y_m: side * 2.7,
                width_m: self.rng.uniform(0.1, 0.5),
                depth_m: self.rng.uniform(0.1, 0.5),
                yaw_rad: self.rng.uniform(-PI, PI),
            };
            world.put_box(&format!("box-{i}"), spec)?;
        }
        let middle = (self.robots as f64 - 1.0) / 2.0;
        let starts = (0..self.robots).map(|i| MapPose {
            x_m: (i as f64 - middle) * LANE_M,
            y_m: self.rng.uniform(-1.2, 1.2),
            yaw_rad: if self.rng.chance(0.5) { FRAC_PI_2 } else { -FRAC_PI_2 } + self.rng.uniform(-0.2, 0.2),
        });
        Ok((world, starts.collect()))
    }
}
