//! The whole board: what it hears, what it does in a turn, what it says.
//!
//! A turn comes every 500 µs, and every 50 µs while a frame is coming in, so that the watchdog counts
//! from the frame's true end; the caller asks [`Board::next_turn`] when. Shortly before each wrap it calls
//! [`Board::latch`] and writes all ten pulses before the wrap, so that hardware takes them over together.

use crate::encoder::Encoder;
use crate::imu::Imu;
use crate::outbox::{Identity, Outbox};
use crate::outputs::{self, Outputs};
use crate::receiver::{Gate, Receiver};
use crate::scan::{Scan, Visit};
use crate::setup::{POWER_ON_PERIOD, Running};
use crate::time::{Every, Ticks};
use xtb_board_codec::{Content, Frame, OUTPUTS, Reader, Setup, ask, flags, kind, words};

/// Between two status frames.
const STATUS: Ticks = Ticks::from_ms(100);
/// A regular status waits for the end of a frame that is coming in, so that it is not in the way of an
/// answer; for so long at most.
const STATUS_WAITS: Ticks = Ticks::from_ms(5);
/// Between two turns while the line is idle, and while a frame is coming in.
const IDLE_TURN: Ticks = Ticks::from_us(500);
const BUSY_TURN: Ticks = Ticks::from_us(50);

/// What the pins say in a turn.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs {
    /// Rising edges of the encoder since power-on, modulo 65,536.
    pub encoder: u16,
    /// The receiver's speed, steering and selector.
    pub gates: [Gate; 3],
    /// A receiver is fitted.
    pub receiver: bool,
    /// The emergency stop is pressed, or its wire is broken.
    pub stop: bool,
}

/// What the outputs get at a wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Latch {
    /// Pulse lengths in counts of 0.4 µs, in the order of a PWM frame.
    pub pulses: [u16; OUTPUTS],
    /// Period from this wrap on, in counts of 0.4 µs.
    pub period_counts: u16,
}

/// The I/O board.
#[derive(Debug, Clone)]
pub struct Board {
    identity: Identity,
    reader: Reader,
    outbox: Outbox,
    running: Option<Running>,
    /// Frames and set-ups refused since power-on, modulo 65,536.
    refused: u16,
    /// Periods whose pulses came too late for their wrap.
    late: u16,
    outputs: Outputs,
    encoder: Encoder,
    receiver: Receiver,
    scan: Scan,
    imu: Imu,
    imu_asked: bool,
    stop: bool,
    status: Every,
    inputs: Inputs,
}

impl Board {
    /// A board at power-on.
    #[must_use]
    pub fn new(identity: Identity, now: Ticks) -> Self {
        Self {
            identity,
            reader: Reader::default(),
            outbox: Outbox::default(),
            running: None,
            refused: 0,
            late: 0,
            outputs: Outputs::new(),
            encoder: Encoder::begin(STATUS, 0, now),
            receiver: Receiver::new(now),
            scan: Scan::begin(now),
            imu: Imu::default(),
            imu_asked: false,
            stop: false,
            status: Every::after(now, STATUS),
            inputs: Inputs::default(),
        }
    }

    /// Bytes from the agent, as they have come in until `now`.
    pub fn receive(&mut self, bytes: &[u8], now: Ticks) {
        let mut reader = core::mem::take(&mut self.reader);
        reader.read(bytes, |content| {
            let obeyed = content.ok().and_then(|content| self.obey(&content, now));
            self.refused = self.refused.wrapping_add(u16::from(obeyed.is_none()));
        });
        self.reader = reader;
    }

    /// `None` if the frame is refused.
    fn obey(&mut self, content: &Content, now: Ticks) -> Option<()> {
        let payload = content.payload();
        match content.kind {
            kind::SETUP => {
                let setup = Setup::from_payload(payload)?;
                self.outbox.status = true;
                self.set_up(setup, now)
            }
            kind::PWM => {
                let pulses = words(payload).filter(outputs::in_range)?;
                // Before the set-up there is nothing that a pulse could act on.
                if let Some(running) = &self.running {
                    self.outputs.request(pulses, running.watchdog, now);
                }
                Some(())
            }
            kind::RESET => {
                let [bits] = words(payload)?;
                self.receiver.reset(bits);
                Some(())
            }
            kind::ASK => {
                let [bits] = words(payload)?;
                self.outbox.identity |= bits & ask::IDENTITY != 0;
                self.imu_asked = bits & ask::IMU != 0;
                self.outbox.wide_scans = bits & ask::WIDE_SCAN != 0;
                Some(())
            }
            _ => None,
        }
    }

    fn set_up(&mut self, setup: Setup, now: Ticks) -> Option<()> {
        if self.running.is_some_and(|running| running.setup == setup) {
            return Some(());
        }
        let running = Running::of(setup)?;
        if self.running.is_none() {
            self.outputs.begin();
            self.scan = Scan::begin(now);
            self.receiver = Receiver::new(now);
        }
        self.encoder = Encoder::begin(running.window, self.inputs.encoder, now);
        self.running = Some(running);
        Some(())
    }

    /// A byte of the inertial unit.
    pub fn receive_imu(&mut self, byte: u8) {
        if let Some(sample) = self.imu.push(byte)
            && self.imu_asked
            && self.running.is_some()
        {
            self.outbox.imu(sample.words());
        }
    }

    /// Looks at the pins, and makes the frames that are due.
    pub fn turn(&mut self, inputs: Inputs, now: Ticks) {
        if let Some(running) = &self.running {
            if let Some(pulses) = self.encoder.turn(inputs.encoder, now) {
                self.outbox.encoder(pulses);
            }
            let readings = self.receiver.turn(inputs.gates, running.setup.tcr_prescaler, now);
            if let Some(readings) = readings.filter(|_| inputs.receiver) {
                self.outbox.remote(readings);
            }
        }
        self.outbox.status |= inputs.stop != self.stop;
        self.stop = inputs.stop;
        let waits = self.reader.is_inside_frame() && now.since(self.status.next) < STATUS_WAITS;
        if !waits && self.status.is_due(now) {
            self.outbox.status = true;
        }
        self.inputs = inputs;
    }

    /// The multiplexers' channel whose voltage has to settle, 0..=15.
    #[must_use]
    pub fn selected(&self) -> u8 {
        self.scan.selected()
    }

    /// What to convert now, if anything; [`Self::converted`] has to follow.
    #[must_use]
    pub fn visit(&self, now: Ticks) -> Option<Visit> {
        self.running.and_then(|_| self.scan.visit(now))
    }

    /// What was converted, as sums of 12-bit codes of 3.3 V; then [`Self::selected`] is another channel.
    pub fn converted(&mut self, first: u32, second: u32, now: Ticks) {
        if let Some(numbers) = self.scan.put(first, second, now) {
            self.outbox.adc(numbers);
        }
    }

    /// What the outputs get at the wrap that comes next.
    pub fn latch(&mut self, wrap: Ticks) -> Latch {
        let Some(running) = &self.running else {
            return Latch { pulses: self.outputs.rest(), period_counts: POWER_ON_PERIOD };
        };
        let before = self.outputs.is_held();
        let pulses = self.outputs.latch(running.watchdog, wrap, self.stop);
        self.outbox.status |= self.outputs.is_held() != before; // the agent has to know at once
        Latch { pulses, period_counts: running.setup.pwm_period_counts }
    }

    /// The wrap came before its pulses were written: they wait for the next one.
    pub fn latch_was_late(&mut self) {
        self.late = self.late.saturating_add(1);
    }

    /// The next frame for the line to the agent; to be asked when the one before has left.
    pub fn transmit(&mut self) -> Option<Frame> {
        let running = self.running.as_ref();
        let bit = |set: bool, bit: u16| if set { bit } else { 0 };
        let state = bit(running.is_some(), flags::READY)
            | bit(self.outputs.is_held() || self.stop, flags::WATCHDOG)
            | bit(self.stop, flags::EMERGENCY_STOP);
        let checksum = running.map_or(0, |running| running.setup.checksum());
        let Identity { version, hash, hardware, after_hang } = self.identity;
        let hardware = hardware as u16 | bit(after_hang, 0x100);
        self.outbox.take(
            [version, state, checksum, self.refused],
            [version, hash as u16, (hash >> 16) as u16, hardware, self.late, self.outbox.dropped()],
        )
    }

    /// When the next turn is due, at the latest.
    #[must_use]
    pub fn next_turn(&self, now: Ticks) -> Ticks {
        let turn = if self.reader.is_inside_frame() { BUSY_TURN } else { IDLE_TURN };
        let next = now.plus(turn);
        if self.running.is_some() { next.min(self.encoder.next().max(now)) } else { next }
    }

    /// Whether the status LED is on: slow blinking until the set-up, fast while motor and pistons are
    /// held, steady when the agent drives.
    #[must_use]
    pub fn led(&self, now: Ticks) -> bool {
        let half = match (&self.running, self.outputs.is_held()) {
            (None, _) => 500_000,
            (Some(_), true) => 100_000,
            (Some(_), false) => return true,
        };
        (now.as_us() / half).is_multiple_of(2)
    }
}
