//! The truck on its lines: watched by a robot without a session as in `check-hardware`, moved by the bench of
//! `calibrate`. Never both at once: they share the lines.

use super::detect::View;
use super::dialogue::{Motion, Verdict, Wrong};
use super::motions;
use super::plan::Place;
use crate::commands::Failure;
use crate::commands::calibrate::bench::{Bench, Trouble};
use crate::commands::check_hardware;
use crate::commands::run::Lines as Opened;
use robot_agent::clock::Clock;
use robot_agent::config::ConfigFile;
use robot_agent::hardware::Hardware;
use robot_agent::hardware::instruments::Instruments;
use robot_agent::hardware::lines::Lines;
use std::io;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use xtb_control::remote::{TickReading, reading};
use xtb_control::units::PWM_PERIOD_COUNTS;
use xtb_control::vehicle::SLOTS;
use xtb_control::{AdcCount, Stamp, VehicleConfig};
use xtb_protocol::board::{BoardIdentity, BoardStatus};
use xtb_robot::Robot;
use xtb_robot::robot::TURN_NS;

/// After a delay of more than this the missed turns are given up.
const GIVE_UP_NS: u64 = 100_000_000;
/// `check-hardware` waits so long for a sensor, in s.
const CHECK_S: f64 = 5.0;
/// Lines that several can use, one after the other.
#[derive(Clone)]
struct SharedLines(Arc<Mutex<Box<dyn Hardware>>>);

impl SharedLines {
    fn with<T>(&self, act: impl FnOnce(&mut dyn Hardware) -> T) -> T {
        act(&mut **self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Hardware for SharedLines {
    fn kind(&self) -> &'static str {
        self.with(|hardware| hardware.kind())
    }

    fn read_board(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.with(|hardware| hardware.read_board(buffer))
    }

    fn read_gyro(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.with(|hardware| hardware.read_gyro(buffer))
    }

    fn write_board(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.with(|hardware| hardware.write_board(bytes))
    }

    fn write_gyro(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.with(|hardware| hardware.write_gyro(bytes))
    }
}

/// A robot that watches, and its lines.
struct Watching {
    robot: Robot,
    lines: Lines,
    next: Stamp,
}

/// The truck that is brought up.
pub(super) struct Truck<'a> {
    file: &'a ConfigFile,
    // Before the lines, so that a simulated world waits for nobody while it ends.
    clock: Clock,
    watching: Option<Watching>,
    lines: SharedLines,
    interrupted: Arc<AtomicBool>,
}

impl<'a> Truck<'a> {
    pub(super) fn new(file: &'a ConfigFile, (hardware, clock): Opened, interrupted: Arc<AtomicBool>) -> Self {
        Self { file, clock, watching: None, lines: SharedLines(Arc::new(Mutex::new(hardware))), interrupted }
    }

    fn vehicle(&self) -> &'a VehicleConfig {
        &self.file.vehicle
    }

    fn opened(&self) -> Opened {
        (Box::new(self.lines.clone()), self.clock.clone())
    }

    /// One turn, and what it has shown.
    pub(super) fn look(&mut self) -> Result<View, Failure> {
        if self.watching.is_none() {
            let robot = check_hardware::watcher(self.file)?;
            let lines = Lines::new(Box::new(self.lines.clone()));
            self.watching = Some(Watching { robot, lines, next: self.clock.now() });
        }
        let Some(Watching { robot, lines, next }) = &mut self.watching else { return Ok(View::default()) };
        *next = next.plus_ns(TURN_NS);
        self.clock.wait_until(*next);
        let now = self.clock.now();
        if now.ns() > next.ns() + GIVE_UP_NS {
            *next = now;
        }
        lines.read(robot, now, &mut |_, _| {});
        lines.write(robot, now, &mut |_, _| {});
        Ok(view(&self.file.vehicle, robot, now))
    }

    /// Everything at rest, as `check-hardware` finds it.
    pub(super) fn check(&mut self) -> Result<Verdict, Failure> {
        self.watching = None;
        let found = check_hardware::check(self.file, self.opened(), CHECK_S, &self.interrupted)?;
        let (well, wrong) = found.summary();
        Ok(match wrong.is_empty() {
            true => Ok(format!("{well} rows of check-hardware are ok")),
            false => Err(Wrong::new(wrong.join("\n  "), "robot-agent check-hardware shows all rows")),
        })
    }

    /// A bench that nothing moves on yet.
    pub(super) fn bench(&mut self, instruments: Option<Instruments>) -> Result<Bench, Failure> {
        self.watching = None;
        let mut bench = Bench::new(self.opened(), instruments, self.vehicle(), self.interrupted.clone())
            .map_err(|error| Failure::new(error, "").code(2))?;
        bench.set_up()?;
        Ok(bench)
    }

    /// Moves it; `eyes` look at it before and while it goes its first way.
    pub(super) fn run(
        &mut self,
        motion: Motion,
        eyes: &mut dyn FnMut(&mut Bench),
    ) -> Result<Verdict, Failure> {
        let mut bench = match self.bench(None) {
            Ok(bench) => bench,
            Err(failure) => return Ok(Err(Wrong::new(failure.message, failure.hint))),
        };
        let moved = match motion {
            Motion::Servo(actuator) => motions::wiggle(&mut bench, actuator, self.vehicle(), eyes),
            Motion::Motor { astern } => motions::turn_wheels(&mut bench, astern, self.vehicle(), eyes),
        };
        match moved {
            Err(trouble @ (Trouble::Interrupted | Trouble::Quit | Trouble::NoAnswer)) => Err(trouble.into()),
            Err(trouble) => Ok(Err(Wrong::new(trouble.to_string(), trouble.hint()))),
            Ok(verdict) => Ok(verdict),
        }
    }

    /// The last frame before the end.
    pub(super) fn stand(&mut self) {
        if let Some(Watching { robot, lines, .. }) = &mut self.watching {
            lines.stand(robot, self.clock.now(), &mut |_, _| {});
        }
    }
}

/// What the robot knows, for the detectors.
fn view(vehicle: &VehicleConfig, robot: &Robot, now: Stamp) -> View {
    let readings = robot.readings(now);
    let faults = robot.agent().faults().states(now);
    let of = |place: &str| {
        let state = faults.iter().find(|state| state.fault.place() == place)?;
        let detail = state.detail.as_ref().map(|detail| format!(": {detail}")).unwrap_or_default();
        Some(Wrong::new(format!("{}{detail}", state.fault), state.fault.remedy()))
    };
    let range_cm = |is_rear, slot, count: AdcCount| {
        let finder = Place { is_rear, slot }.finders(vehicle).get(slot)?;
        finder.curve.hypotenuse_cm(&vehicle.infrared, count)
    };
    let ranges_cm = readings.adc.map(|adc| {
        let side = |is_rear, counts: [AdcCount; SLOTS]| {
            std::array::from_fn(|slot| range_cm(is_rear, slot, counts[slot]))
        };
        [side(false, adc.ir_front), side(true, adc.ir_rear)]
    });
    let duty = |ticks| match reading(&vehicle.remote, ticks) {
        TickReading::Usable(duty) => Some(duty),
        TickReading::Rejected | TickReading::Impossible => None,
    };
    let tilt = robot.outputs().tilt.both().filter(|_| readings.adc.is_some());
    View {
        now_s: now.s(),
        is_up: readings.set_up && readings.status.is_some(),
        fault: of("board"),
        gyro_fault: of("gyro"),
        firmware: readings.status.map(|status| firmware(&status, readings.identity.as_ref())),
        stop_pressed: readings.status.and_then(|status| status.emergency_stop),
        ranges_cm,
        pulses: readings.pulses,
        tilt_deg: tilt.map(|(x, y)| [x, y]),
        yaw_deg: readings.gyro.map(|gyro| f64::from(gyro.yaw) * xtb_control::odometry::GYRO_DEG_PER_COUNT),
        sticks_ms: readings.remote.map(|remote| {
            [remote.speed, remote.steering]
                .map(|ticks| duty(ticks).map(|duty| duty * vehicle.remote.period_ms))
        }),
        manual: readings.remote.and_then(|remote| duty(remote.selector)).map(|duty| {
            let below = duty * PWM_PERIOD_COUNTS < vehicle.remote.selector_counts;
            below == (vehicle.remote.manual == "below")
        }),
        battery_v: readings.battery_mv.map(|mv| f64::from(mv) / 1000.0),
    }
}

/// Version, and what the board says of itself if it is asked.
fn firmware(status: &BoardStatus, identity: Option<&BoardIdentity>) -> String {
    let version = status.firmware;
    let Some(identity) = identity else { return version.to_string() };
    let hang = if identity.after_hang { ", restarted after a hang" } else { "" };
    format!("{version} ({}, hash {:#010x}{hang})", identity.model_name(), identity.hash)
}
