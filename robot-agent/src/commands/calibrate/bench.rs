//! The truck on its stand: keeps the board's frames going while a calibration decides on pulses.
//!
//! ```text
//!   set-up (Fig. 8) ─► turns of 5 ms: read, decode ── a PWM frame every 20 ms ─► dropped: one frame
//!                                  │                                             with all at rest
//!                                  └─► newest scan of the converter
//! ```
//! Only the actuator being calibrated moves; the rest stand as an idle robot has them. The motor is
//! neutral but for [`Bench::turn_motor`], which a calibration never calls: its pulses are low, and end by
//! themselves. No controller runs here: its platform stage would fight the sweep.

use robot_agent::clock::Clock;
use robot_agent::hardware::Hardware;
use robot_agent::hardware::instruments::Instruments;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::TryRecvError;
use thiserror::Error;
use xtb_control::calibration::Actuator;
use xtb_control::calibration::Measured;
use xtb_control::config::ConfigError;
use xtb_control::controller::{AdcSample, PwmOutputs};
use xtb_control::tpu::{SetupTask, TpuSetup};
use xtb_control::{Controller, PwmCount, Stamp, VehicleConfig};
use xtb_protocol::board::{FrameReader, FrameWriter, FromBoard};
use xtb_robot::robot::{PWM_FRAME_NS, TURN_NS};

/// Bytes read from the board in one turn at most.
const READ_BUFFER: usize = 1024;
/// A board has this long to come up and to confirm its set-up.
const SET_UP_MS: u64 = 3000;
/// One that has been set up sends something this often, or it is lost.
const SILENT_MS: u64 = 500;
/// No pulse of the motor is farther from neutral, in counts …
const MOTOR_MOST: f64 = 350.0;
/// … or lasts longer, whatever the caller does.
const MOTOR_MOST_MS: u64 = 2000;
/// After this delay the missed turns are given up rather than made up for.
const GIVE_UP_NS: u64 = 100_000_000;

/// Why a calibration ends before its last reading.
#[derive(Debug, Clone, PartialEq, Error)]
pub(crate) enum Trouble {
    #[error("interrupted")]
    Interrupted,
    #[error("cancelled")]
    Quit,
    #[error("the input ended before the last reading")]
    NoAnswer,
    #[error("no data from the I/O board{0}")]
    Silent(String),
    #[error("the I/O board does not confirm the set-up")]
    NotSetUp,
    #[error("the I/O board has restarted")]
    Restarted,
    #[error("the I/O board sends no converter scans")]
    NoScan,
    #[error("the simulation has ended")]
    WorldEnded,
    #[error("the piston does not reach the middle: it stays at {height_mm:.1} mm of {travel_mm:.1} mm")]
    Stuck { height_mm: f64, travel_mm: f64 },
    #[error("at pulse {count} the piston reaches its end stop too fast to be timed")]
    TooFast { count: u16 },
}

impl Trouble {
    /// How the truck is now, as far as we know.
    pub(crate) fn aftermath(&self) -> &'static str {
        match self {
            Self::Silent(_) | Self::NotSetUp | Self::Restarted => {
                "nothing was written; without frames the board stops motor and pistons by itself"
            }
            _ => "all actuators are at rest, nothing was written",
        }
    }

    /// What to do about it.
    pub(crate) fn hint(&self) -> &'static str {
        match self {
            Self::Interrupted | Self::Quit | Self::NoAnswer | Self::WorldEnded => "",
            Self::Silent(_) | Self::NotSetUp | Self::NoScan => {
                "robot-agent check-hardware shows the fault; first end any other agent on these ports"
            }
            Self::Restarted => "check the power supply of board and servos, then start again",
            Self::Stuck { .. } => "check its servo, its position sensor and their connectors",
            Self::TooFast { .. } => "use pulses closer to zero movement: --from and --to",
        }
    }
}

/// A truck's I/O board, set up and kept awake.
pub(crate) struct Bench {
    // Before the hardware, so that a simulated world waits for nobody while it ends.
    clock: Clock,
    hardware: Box<dyn Hardware>,
    instruments: Option<Instruments>,
    interrupted: Arc<AtomicBool>,
    reader: FrameReader,
    writer: FrameWriter,
    setup: SetupTask,
    at_rest: PwmOutputs,
    pulses: PwmOutputs,
    next_turn: Stamp,
    next_frame: Stamp,
    heard: Stamp,
    scan: Option<(Stamp, AdcSample)>,
    /// Encoder pulses since they were last taken.
    encoder_pulses: u32,
    /// Since when the motor has had another pulse than neutral.
    motor_since: Option<Stamp>,
    /// What the system said when the line was last broken.
    broken: String,
}

impl Bench {
    /// Nothing has been sent yet. `interrupted` ends every wait.
    pub(crate) fn new(
        (hardware, clock): (Box<dyn Hardware>, Clock),
        instruments: Option<Instruments>,
        vehicle: &VehicleConfig,
        interrupted: Arc<AtomicBool>,
    ) -> Result<Self, ConfigError> {
        let setup = SetupTask::new(TpuSetup::of(vehicle)?);
        let at_rest = Controller::new(vehicle.clone()).outputs(Stamp::ZERO).pwm;
        let now = clock.now();
        Ok(Self {
            clock,
            hardware,
            instruments,
            interrupted,
            reader: FrameReader::default(),
            writer: FrameWriter::default(),
            setup,
            at_rest,
            pulses: at_rest,
            next_turn: now,
            next_frame: now,
            heard: now,
            scan: None,
            encoder_pulses: 0,
            motor_since: None,
            broken: String::new(),
        })
    }

    /// Sets the board up (Fig. 8).
    pub(crate) fn set_up(&mut self) -> Result<(), Trouble> {
        let began = self.clock.now();
        while !self.setup.is_done() {
            self.take_turn()?;
            let now = self.clock.now();
            if now.since_ms(began) > SET_UP_MS {
                return Err(if self.heard > began { Trouble::NotSetUp } else { self.silent() });
            }
        }
        self.heard = self.clock.now();
        Ok(())
    }

    /// Gives the actuator a pulse and all others theirs at rest, from the next turn on.
    pub(crate) fn drive(&mut self, actuator: Actuator, count: PwmCount) {
        let mut pulses = self.at_rest;
        actuator.set(&mut pulses, count);
        self.give(pulses);
    }

    /// All outputs at rest, from the next turn on.
    pub(crate) fn rest(&mut self) {
        self.give(self.at_rest);
    }

    /// Gives the motor a pulse so many counts from neutral, + = ahead, and all others theirs at rest. It is a low
    /// one whatever is asked for, and neutral again after two seconds in all.
    pub(crate) fn turn_motor(&mut self, offset_counts: f64) {
        let offset = offset_counts.clamp(-MOTOR_MOST, MOTOR_MOST);
        self.motor_since.get_or_insert(self.clock.now());
        let motor = PwmCount::saturating(PwmCount::NEUTRAL.as_f64() + offset);
        self.give(PwmOutputs { motor, ..self.at_rest });
    }

    /// Encoder pulses since the last call, of whole windows.
    pub(crate) fn take_pulses(&mut self) -> u32 {
        std::mem::take(&mut self.encoder_pulses)
    }

    fn give(&mut self, pulses: PwmOutputs) {
        if pulses.motor == PwmCount::NEUTRAL {
            self.motor_since = None;
        }
        if pulses != self.pulses {
            self.pulses = pulses;
            self.next_frame = Stamp::ZERO;
        }
    }

    /// One turn of a board that has been set up.
    pub(crate) fn turn(&mut self) -> Result<(), Trouble> {
        self.take_turn()?;
        if !self.setup.is_done() {
            return Err(Trouble::Restarted);
        }
        if self.clock.now().since_ms(self.heard) > SILENT_MS {
            return Err(self.silent());
        }
        Ok(())
    }

    /// Turns for this long.
    pub(crate) fn hold(&mut self, seconds: f64) -> Result<(), Trouble> {
        let began = self.clock.now();
        while self.clock.now().since_s(began) < seconds {
            self.turn()?;
        }
        Ok(())
    }

    /// Turns until the converter's next scan, and when it came.
    pub(crate) fn next_scan(&mut self) -> Result<(Stamp, AdcSample), Trouble> {
        self.scan = None;
        let began = self.clock.now();
        loop {
            self.turn()?;
            if let Some(scan) = self.scan {
                return Ok(scan);
            }
            if self.clock.now().since_ms(began) > SILENT_MS {
                return Err(Trouble::NoScan);
            }
        }
    }

    /// Turns until a simulated truck's instruments have been read; `None` on a real truck.
    pub(crate) fn measured(&mut self) -> Result<Option<Measured>, Trouble> {
        let Some(instruments) = &self.instruments else { return Ok(None) };
        let answer = instruments.read();
        loop {
            self.turn()?;
            match answer.try_recv() {
                Ok(measured) => return Ok(Some(measured)),
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => return Err(Trouble::WorldEnded),
            }
        }
    }

    fn take_turn(&mut self) -> Result<(), Trouble> {
        self.next_turn = self.next_turn.plus_ns(TURN_NS);
        self.clock.wait_until(self.next_turn);
        if self.interrupted.load(Ordering::Relaxed) {
            return Err(Trouble::Interrupted);
        }
        let now = self.clock.now();
        if now.ns() > self.next_turn.ns() + GIVE_UP_NS {
            self.next_turn = now;
        }
        if self.motor_since.is_some_and(|since| now.since_ms(since) > MOTOR_MOST_MS) {
            self.rest();
        }
        self.read(now);
        self.write(now);
        Ok(())
    }

    fn read(&mut self, now: Stamp) {
        let mut buffer = [0; READ_BUFFER];
        let bytes = match self.hardware.read_board(&mut buffer) {
            Ok(n) => &buffer[..n],
            Err(error) => {
                self.broken = format!(": {error}");
                return;
            }
        };
        let Self { reader, setup, heard, scan, encoder_pulses, broken, .. } = self;
        // What is no frame says nothing of the board; a line of nothing else is found silent.
        reader.from_board(bytes, |frame| {
            let Ok(frame) = frame else { return };
            *heard = now;
            broken.clear();
            match frame {
                FromBoard::Status(status) => {
                    let known = status.firmware.check().is_ok();
                    setup.confirm(status.ready && known, status.setup_checksum);
                }
                FromBoard::Encoder { pulses } => *encoder_pulses += u32::from(pulses),
                FromBoard::Adc { sample, .. } if setup.is_done() => *scan = Some((now, sample)),
                _ => {}
            }
        });
    }

    fn write(&mut self, now: Stamp) {
        if now >= self.next_frame {
            self.next_frame = now.plus_ns(PWM_FRAME_NS);
            self.send_pulses();
        }
        if let Some(setup) = self.setup.request(now) {
            let frame = self.writer.setup(&setup);
            // What is lost is asked for again.
            let _ = self.hardware.write_board(frame.as_bytes());
        }
    }

    fn send_pulses(&mut self) {
        let frame = self.writer.pwm(&self.pulses);
        if let Err(error) = self.hardware.write_board(frame.as_bytes()) {
            self.broken = format!(": {error}");
        }
    }

    fn silent(&self) -> Trouble {
        Trouble::Silent(self.broken.clone())
    }
}

impl Drop for Bench {
    /// However it ends, the last frame is one with everything at rest; should it be lost, the board's
    /// watchdog stops motor and pistons.
    fn drop(&mut self) {
        self.pulses = self.at_rest;
        self.send_pulses();
    }
}

#[cfg(test)]
#[cfg(feature = "sim")]
mod tests {
    use super::*;
    use robot_agent::hardware::simulated::{SimulatedHardware, TruckLine, TruckLines};
    use xtb_protocol::board::ToBoard;

    fn bench() -> (Bench, TruckLines) {
        let (hardware, lines) = SimulatedHardware::connect();
        let line = (Box::new(hardware) as Box<dyn Hardware>, Clock::real());
        (Bench::new(line, None, &VehicleConfig::default(), Arc::default()).unwrap(), lines)
    }

    fn pulses(line: &mut dyn TruckLine) -> Vec<PwmOutputs> {
        let (mut bytes, mut pulses) = (Vec::new(), Vec::new());
        line.receive(&mut bytes);
        FrameReader::default().to_board(&bytes, |frame| {
            if let Ok(ToBoard::Pwm(pwm)) = frame {
                pulses.push(pwm);
            }
        });
        pulses
    }

    #[test]
    fn the_last_frame_has_everything_at_rest_and_the_motor_never_moves() {
        let (mut bench, mut lines) = bench();
        let at_rest = bench.at_rest;
        for actuator in Actuator::ALL {
            bench.drive(actuator, PwmCount::MAX);
            bench.take_turn().unwrap();
        }
        drop(bench);
        let sent = pulses(&mut *lines.board);
        assert_eq!(sent.len(), 9, "each new pulse goes out at once");
        assert!(sent.iter().all(|pwm| pwm.motor == PwmCount::NEUTRAL));
        assert!(sent[..8].iter().all(|pwm| *pwm != at_rest));
        assert_eq!(sent[8], at_rest);
    }

    #[test]
    fn a_motor_pulse_is_low_and_ends_with_neutral_when_it_is_interrupted() {
        let (mut bench, mut lines) = bench();
        for offset in [100.0, -5000.0, 5000.0] {
            bench.turn_motor(offset);
            bench.take_turn().unwrap();
        }
        bench.interrupted.store(true, Ordering::Relaxed);
        assert_eq!(bench.take_turn(), Err(Trouble::Interrupted));
        drop(bench);
        let motor: Vec<_> = pulses(&mut *lines.board).iter().map(|pwm| pwm.motor.get()).collect();
        assert_eq!(motor, [3850, 3400, 4100, 3750]);
    }

    #[test]
    fn a_motor_pulse_that_nobody_ends_ends_by_itself() {
        let (mut bench, mut lines) = bench();
        bench.turn_motor(100.0);
        bench.take_turn().unwrap();
        bench.motor_since = Some(Stamp::ZERO);
        bench.next_turn = bench.next_turn.plus_ms(MOTOR_MOST_MS + 5);
        bench.take_turn().unwrap();
        let motor: Vec<_> = pulses(&mut *lines.board).iter().map(|pwm| pwm.motor.get()).collect();
        assert_eq!(motor, [3850, 3750]);
    }

    #[test]
    fn an_interruption_ends_every_wait_and_a_dead_line_is_named() {
        let (mut bench, _lines) = bench();
        bench.interrupted.store(true, Ordering::Relaxed);
        assert_eq!(bench.set_up(), Err(Trouble::Interrupted));
        assert_eq!(bench.hold(1e9), Err(Trouble::Interrupted));
        bench.broken = ": /dev/ttyUSB0: no such device".into();
        let said = bench.silent().to_string();
        assert_eq!(said, "no data from the I/O board: /dev/ttyUSB0: no such device");
    }
}
