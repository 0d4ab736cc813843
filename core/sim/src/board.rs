//! The I/O board: set-up, PWM and reset frames in; status, encoder, converter and remote-control
//! frames out; a watchdog in between.
//!
//! ```text
//!   power-on ─► waiting ── set-up (Fig. 8) ──► ready ─── another set-up ───┐
//!               │  ▲  only status frames,       │  ▲    the same: nothing   │
//!               └──┘  everything neutral        │  └───────────────────────┘
//!                  ▲─────── power cycle ────────┘
//! ```
//! New pulses take effect when a PWM period ends. Without a good PWM frame for the watchdog's time
//! (100 ms) the motor goes neutral and the pistons hold, while the steering keeps its angle: a truck
//! that coasts should not swerve. Only a frame with a neutral motor ends that: what a dead agent has
//! left in a buffer on the way drives nobody. Periods and windows are those of the set-up; where their phase
//! lies is chance.

use crate::faults::EncoderFault;
use crate::line::Outbox;
use crate::parameters::{SteeringTruth, TruckParameters};
use crate::receiver::{Receiver, Transmitter};
use crate::rng::Rng;
use xtb_control::PwmCount;
use xtb_control::controller::{AdcSample, PwmOutputs};
use xtb_control::tpu::{PinChannel, SYSTEM_CLOCK_HZ, TpuSetup};
use xtb_control::units::{PWM_COUNT_US, Stamp};
use xtb_protocol::bno085::Bno085Sample;
use xtb_protocol::board::{
    Ask, BoardIdentity, BoardStatus, Firmware, FrameReader, FrameWriter, LineCounters, MAX_PULSES, ToBoard,
};

/// What the simulated board calls its firmware, without and with answers to asks, and with wide scans among them.
pub(crate) const FIRMWARE: Firmware = Firmware(0x0100);
const WITH_ANSWERS: Firmware = Firmware(0x0101);
const WITH_WIDE_SCANS: Firmware = Firmware(0x0102);
/// Between two status frames.
const STATUS_S: f64 = 0.1;
/// Shortest period and window that the board takes: less would be no time to do anything in.
const SHORTEST_S: f64 = 0.005;

/// A counter that comes due again and again.
#[derive(Debug, Clone)]
struct Timer {
    period_ns: u64,
    next_ns: u64,
}

impl Timer {
    /// Comes due for the first time somewhere within its first period.
    fn new(period_s: f64, now: Stamp, noise: &mut Rng) -> Self {
        let period_ns = libm::round(period_s * 1e9) as u64;
        Self { period_ns, next_ns: now.ns() + noise.up_to(period_ns) }
    }

    /// The moment that came due until `now`, one a call.
    fn due(&mut self, now: Stamp) -> Option<Stamp> {
        if self.next_ns > now.ns() {
            return None;
        }
        let due = Stamp::from_ns(self.next_ns);
        self.next_ns += self.period_ns;
        Some(due)
    }
}

/// How far the motor shaft had turned at both ends of a step, in pulses since the start.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShaftTravel {
    pub(crate) start: Stamp,
    pub(crate) end: Stamp,
    pub(crate) from_pulses: f64,
    pub(crate) to_pulses: f64,
}

impl ShaftTravel {
    /// Whole pulses at a moment of the step; the speed is constant within it.
    fn whole_pulses_at(&self, t: Stamp) -> u64 {
        let part = t.since_s(self.start) / self.end.since_s(self.start);
        (self.from_pulses + (self.to_pulses - self.from_pulses) * part.clamp(0.0, 1.0)) as u64
    }

    /// When each whole pulse began during the step.
    pub(crate) fn edges(&self) -> impl Iterator<Item = Stamp> {
        let step_ns = (self.end.ns() - self.start.ns()) as f64;
        let turned = self.to_pulses - self.from_pulses;
        (self.from_pulses as u64 + 1..=self.to_pulses as u64).map(move |whole| {
            let part = (whole as f64 - self.from_pulses) / turned;
            self.start.plus_ns((part * step_ns) as u64)
        })
    }
}

/// What the board does once it is set up.
#[derive(Debug, Clone)]
struct Running {
    setup: TpuSetup,
    pwm: Timer,
    encoder: Timer,
}

impl Running {
    /// Starts periods and windows; `None` if the set-up is impossible.
    fn start(setup: TpuSetup, now: Stamp, noise: &mut Rng) -> Option<Self> {
        let pwm_s = f64::from(setup.pwm_period_counts) * PWM_COUNT_US * 1e-6;
        let ticks = f64::from(setup.fqm_window) * f64::from(setup.tcr_prescaler);
        let window_s = ticks / SYSTEM_CLOCK_HZ;
        let known = setup.channels.iter().all(|&code| PinChannel::from_code(code).is_some());
        if pwm_s < SHORTEST_S || window_s < SHORTEST_S || setup.watchdog_ms == 0 || !known {
            return None;
        }
        let timer = |period_s: f64, noise: &mut Rng| Timer::new(period_s, now, noise);
        Some(Self { setup, pwm: timer(pwm_s, noise), encoder: timer(window_s, noise) })
    }

    fn watchdog_s(&self) -> f64 {
        f64::from(self.setup.watchdog_ms) / 1000.0
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Board {
    reader: FrameReader,
    writer: FrameWriter,
    outbox: Outbox,
    running: Option<Running>,
    /// Impossible set-ups.
    refused: u64,
    /// A set-up wants its answer.
    answer_due: bool,
    firmware: Firmware,
    /// Whether samples of the inertial unit are wanted.
    imu_asked: bool,
    /// Whether wide scans are.
    wide_asked: bool,
    /// Whether the emergency stop is pressed.
    stop: bool,

    /// Neutral and centred, as after power-on.
    at_rest: PwmOutputs,
    requested: PwmOutputs,
    heard: Option<Stamp>,
    watchdog: bool,
    outputs: PwmOutputs,
    neutral_since: Option<Stamp>,

    status: Timer,
    adc: Timer,
    remote: Timer,
    /// `None` if not fitted.
    receiver: Option<Receiver>,
    /// Pulses of the shaft at the end of the last step, and whole ones when the last window closed.
    turned: f64,
    counted: u64,
    encoder_fault: EncoderFault,
}

impl Board {
    pub(crate) fn new(truth: &TruckParameters, noise: &mut Rng) -> Self {
        let outputs = at_rest(&truth.steering);
        Self {
            reader: FrameReader::default(),
            writer: FrameWriter::default(),
            outbox: Outbox::new(noise.fork()),
            running: None,
            refused: 0,
            answer_due: false,
            firmware: match truth.board.answers_asks {
                true if truth.range_finders.need_wide_scan() => WITH_WIDE_SCANS,
                true => WITH_ANSWERS,
                false => FIRMWARE,
            },
            imu_asked: false,
            wide_asked: false,
            stop: false,
            at_rest: outputs,
            requested: outputs,
            heard: None,
            watchdog: true,
            outputs,
            neutral_since: Some(Stamp::ZERO),
            status: Timer::new(STATUS_S, Stamp::ZERO, noise),
            adc: Timer::new(truth.board.adc_period_s, Stamp::ZERO, noise),
            remote: Timer::new(truth.receiver.period_s, Stamp::ZERO, noise),
            receiver: truth.receiver.fitted.then(|| Receiver::new(&truth.receiver)),
            turned: 0.0,
            counted: 0,
            encoder_fault: EncoderFault::None,
        }
    }

    /// Off and on again: nothing is set up, every output at rest at once.
    pub(crate) fn power_cycle(&mut self, now: Stamp) {
        self.reader = FrameReader::default();
        self.writer = FrameWriter::default();
        self.running = None;
        self.refused = 0;
        self.heard = None;
        (self.imu_asked, self.wide_asked) = (false, false);
        self.watchdog = true;
        self.outputs = self.at_rest;
        self.neutral_since.get_or_insert(now);
    }

    /// Breaks or mends the encoder.
    pub(crate) fn set_encoder_fault(&mut self, fault: EncoderFault) {
        self.encoder_fault = fault;
    }

    pub(crate) fn set_transmitter(&mut self, transmitter: Transmitter) {
        if let Some(receiver) = &mut self.receiver {
            receiver.set_transmitter(transmitter);
        }
    }

    /// The emergency stop is pressed, or released. Motor and pistons are held meanwhile, and until a frame with a
    /// neutral motor has come after it.
    pub(crate) fn set_emergency_stop(&mut self, pressed: bool) {
        if std::mem::replace(&mut self.stop, pressed) != pressed {
            self.heard = None;
            self.send_status();
        }
    }

    /// Bytes from the agent.
    pub(crate) fn rx(&mut self, bytes: &[u8], now: Stamp, noise: &mut Rng) {
        let mut reader = std::mem::take(&mut self.reader);
        reader.to_board(bytes, |frame| {
            // The reader counts what it rejects; the board itself has nothing else to do about it.
            if let Ok(frame) = frame {
                self.obey(frame, now, noise);
            }
        });
        self.reader = reader;
        if std::mem::take(&mut self.answer_due) {
            self.send_status();
        }
    }

    fn obey(&mut self, frame: ToBoard, now: Stamp, noise: &mut Rng) {
        match frame {
            ToBoard::Setup(setup) => {
                self.answer_due = true;
                if self.running.as_ref().is_none_or(|running| running.setup != setup) {
                    self.set_up(setup, now, noise);
                }
            }
            // Before the set-up there is nothing that a pulse or a reset could act on.
            ToBoard::Pwm(_) | ToBoard::Reset(_) if self.running.is_none() => {}
            ToBoard::Pwm(pwm) if pwm.motor != PwmCount::NEUTRAL && self.is_starved(now) => {}
            ToBoard::Pwm(_) if self.stop => {}
            ToBoard::Pwm(pwm) => (self.requested, self.heard) = (pwm, Some(now)),
            ToBoard::Ask(_) if !self.firmware.answers_asks() => self.refused += 1,
            ToBoard::Ask(Ask { identity, imu, wide_scan }) => {
                self.imu_asked = imu;
                self.wide_asked = wide_scan && self.firmware.sends_wide_scans();
                if identity {
                    self.send_identity();
                }
            }
            ToBoard::Reset(mask) => {
                if let Some(receiver) = &mut self.receiver {
                    receiver.reset(mask, noise);
                }
            }
        }
    }

    /// Whether the watchdog has its reason: then only a frame with a neutral motor is heard.
    fn is_starved(&self, now: Stamp) -> bool {
        let Some(running) = &self.running else { return true };
        self.heard.is_none_or(|heard| now.since_s(heard) >= running.watchdog_s())
    }

    fn set_up(&mut self, setup: TpuSetup, now: Stamp, noise: &mut Rng) {
        let Some(running) = Running::start(setup, now, noise) else {
            self.refused += 1;
            return;
        };
        if self.running.is_none() {
            self.requested = self.at_rest;
        }
        self.running = Some(running);
        self.counted = self.turned as u64;
        if let Some(receiver) = &mut self.receiver {
            receiver.set_up(setup.tcr_prescaler, noise);
        }
    }

    /// Applies the pulses of every PWM period that ended until `now`.
    pub(crate) fn latch(&mut self, now: Stamp) {
        let Some(running) = &mut self.running else { return };
        let before = self.watchdog;
        while let Some(t) = running.pwm.due(now) {
            let watchdog_s = running.watchdog_s();
            self.watchdog = self.heard.is_none_or(|heard| t.since_s(heard) >= watchdog_s);
            self.outputs = if self.watchdog {
                let neutral = PwmCount::NEUTRAL;
                PwmOutputs { motor: neutral, pistons: [neutral; 4], ..self.outputs }
            } else {
                self.requested
            };
            self.neutral_since =
                (self.outputs.motor == PwmCount::NEUTRAL).then(|| self.neutral_since.unwrap_or(t));
        }
        if self.watchdog != before {
            self.send_status(); // the agent has to know at once
        }
    }

    /// Its outputs have what another board gives since `t`.
    pub(crate) fn stand_in(&mut self, outputs: PwmOutputs, t: Stamp) {
        self.outputs = outputs;
        let neutral = outputs.motor == PwmCount::NEUTRAL;
        self.neutral_since = neutral.then(|| self.neutral_since.unwrap_or(t));
    }

    /// The receiver's pulses, if one is fitted and hears the transmitter.
    pub(crate) fn receiver_ms(&self) -> Option<[f64; 3]> {
        self.receiver.as_ref().and_then(Receiver::at_pins_ms)
    }

    /// Sends the encoder windows that closed during a step.
    pub(crate) fn count(&mut self, travel: &ShaftTravel) {
        self.turned = travel.to_pulses;
        let Some(running) = &mut self.running else { return };
        while let Some(t) = running.encoder.due(travel.end) {
            let whole = travel.whole_pulses_at(t);
            let pulses = (whole.saturating_sub(self.counted)).min(u64::from(MAX_PULSES)) as u16;
            self.counted = whole;
            let pulses = match self.encoder_fault {
                EncoderFault::None => pulses,
                EncoderFault::BrokenWire => 0,
                EncoderFault::Wild => wild_pulses(t),
            };
            self.outbox.send(self.writer.encoder(pulses).as_bytes());
        }
    }

    /// Sends what the receiver gave and how the board is, when either is due.
    pub(crate) fn report(&mut self, now: Stamp, noise: &mut Rng) {
        if let Some(receiver) = &mut self.receiver
            && self.remote.due(now).is_some()
            && self.running.is_some()
        {
            self.outbox.send(self.writer.remote(&receiver.read(noise)).as_bytes());
        }
        if self.status.due(now).is_some() {
            self.send_status();
        }
    }

    fn send_status(&mut self) {
        let status = BoardStatus {
            firmware: self.firmware,
            ready: self.running.is_some(),
            watchdog: self.watchdog || self.stop,
            emergency_stop: Some(self.stop),
            setup_checksum: self.running.as_ref().map_or(0, |running| running.setup.checksum()),
            rejected: (self.reader.counters().rejected + self.refused) as u16,
        };
        self.outbox.send(self.writer.status(&status).as_bytes());
    }

    fn send_identity(&mut self) {
        let identity = BoardIdentity {
            firmware: self.firmware,
            hash: 0,
            model: BoardIdentity::SIMULATED,
            after_hang: false,
            late_periods: 0,
            replaced_samples: 0,
        };
        self.outbox.send(self.writer.identity(&identity).as_bytes());
    }

    /// A sample of the inertial unit goes on to the agent, if that has asked.
    pub(crate) fn pass_on(&mut self, sample: &Bno085Sample) {
        if self.imu_asked && self.running.is_some() {
            self.outbox.send(self.writer.bno085(sample).as_bytes());
        }
    }

    /// Whether the converter has completed a scan; then [`Self::send_scan`] is due.
    pub(crate) fn scan_due(&mut self, now: Stamp) -> bool {
        self.adc.due(now).is_some() && self.is_set_up()
    }

    pub(crate) fn is_set_up(&self) -> bool {
        self.running.is_some()
    }

    pub(crate) fn send_scan(&mut self, sample: &AdcSample, battery_mv: Option<u16>) {
        let frame = match self.wide_asked {
            true => self.writer.wide_adc(sample, battery_mv),
            false => self.writer.adc(sample, battery_mv),
        };
        self.outbox.send(frame.as_bytes());
    }

    pub(crate) fn outputs(&self) -> &PwmOutputs {
        &self.outputs
    }

    pub(crate) fn neutral_since(&self) -> Option<Stamp> {
        self.neutral_since
    }

    pub(crate) fn counters(&self) -> LineCounters {
        self.reader.counters()
    }

    pub(crate) fn outbox(&mut self) -> &mut Outbox {
        &mut self.outbox
    }

    pub(crate) fn dropped(&self) -> u64 {
        self.outbox.dropped()
    }
}

/// What interference makes of a window: any number, each window another; nothing is drawn for it.
fn wild_pulses(t: Stamp) -> u16 {
    (t.ns().wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 48) as u16
}

/// Outputs of a board that nobody has set up.
fn at_rest(steering: &SteeringTruth) -> PwmOutputs {
    let neutral = PwmCount::NEUTRAL;
    PwmOutputs {
        motor: neutral,
        steer_front: PwmCount::saturating(steering.front_centre),
        steer_rear: PwmCount::saturating(steering.rear_centre),
        bumper_front: neutral,
        bumper_rear: neutral,
        pistons: [neutral; 4],
        spare: neutral,
    }
}

#[cfg(test)]
mod tests;
