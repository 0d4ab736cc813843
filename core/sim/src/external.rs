//! A board that takes the place of the simulated one, at the truck's pins.
//!
//! ```text
//!   agent's bytes ─────────────────────────────► ┌──────────┐ ─► bytes to the agent
//!   voltages, encoder edges, receiver's pulses ► │ external │
//!   of the step that has just been made          └──────────┘ ─► ten pulses ─► the next step
//! ```
//! Whoever implements [`ExternalBoard`] may run a program elsewhere, for example a board's own firmware in an
//! emulator; here it is a step by simulated time like any other.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use xtb_control::PwmCount;
use xtb_control::controller::PwmOutputs;
use xtb_control::units::Stamp;
use xtb_control::vehicle::SLOTS;

/// What a truck has at its board's inputs: voltages as the sensors give them, before any divider.
#[derive(Debug, Clone, PartialEq)]
pub struct Pins {
    /// End of the step.
    pub now: Stamp,
    /// Range finders of the front and then of the rear bumper, eight of each, left to right, in V; 0 where none is fitted.
    pub range_finders_v: [f64; 2 * SLOTS],
    /// Tilt sensor x and y, in V.
    pub tilt_v: [f64; 2],
    /// Position sensors of the pistons FL, FR, RL, RR, in V.
    pub pistons_v: [f64; 4],
    /// Battery's terminals, in V.
    pub battery_v: f64,
    /// Bytes of the inertial unit at the board, if one is fitted.
    pub imu: Vec<u8>,
    /// The emergency stop is pressed.
    pub emergency_stop: bool,
    /// When the encoder's pulses of the step began.
    pub encoder_edges: Vec<Stamp>,
    /// The receiver's pulses of speed, steering and selector, in ms; `None` = no pulses.
    pub receiver_ms: Option<[f64; 3]>,
}

/// What a board gives its outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pulses {
    /// The latest complete pulses in counts of 0.4 µs, in the order of a PWM frame. 0 = no pulse: motor and
    /// pistons rest, the other servos stay where they are.
    pub counts: [u16; 10],
    /// When they began.
    pub begun: Stamp,
}

impl Pulses {
    /// What they make of the outputs.
    fn applied(&self, before: &PwmOutputs) -> PwmOutputs {
        let output = |i: usize, without: PwmCount| match self.counts[i] {
            0 => without,
            counts => PwmCount::saturating(counts.into()),
        };
        let rest = PwmCount::NEUTRAL;
        PwmOutputs {
            motor: output(0, rest),
            steer_front: output(1, before.steer_front),
            steer_rear: output(2, before.steer_rear),
            bumper_front: output(3, before.bumper_front),
            bumper_rear: output(4, before.bumper_rear),
            pistons: [5, 6, 7, 8].map(|i| output(i, rest)),
            spare: output(9, rest),
        }
    }
}

/// A board at the pins of a truck.
pub trait ExternalBoard: fmt::Debug + Send {
    /// One step until `pins.now`. `from_agent` goes onto the line at the step's beginning; what has arrived at
    /// the agent's end of the line by its end is put to the end of `to_agent`.
    fn step(&mut self, from_agent: &[u8], pins: &Pins, to_agent: &mut Vec<u8>) -> Pulses;
}

/// One in a truck, and what is on its way to it. Copies of the truck share it.
#[derive(Debug, Clone)]
pub(crate) struct External {
    board: Arc<Mutex<dyn ExternalBoard>>,
    from_agent: Vec<u8>,
}

impl External {
    pub(crate) fn new(board: Arc<Mutex<dyn ExternalBoard>>) -> Self {
        Self { board, from_agent: Vec::new() }
    }

    pub(crate) fn receive(&mut self, bytes: &[u8]) {
        self.from_agent.extend_from_slice(bytes);
    }

    /// The bytes to the agent, and the outputs with the moment since when they are so.
    pub(crate) fn step(&mut self, pins: &Pins, before: &PwmOutputs) -> (Vec<u8>, PwmOutputs, Stamp) {
        let mut board = self.board.lock().unwrap_or_else(PoisonError::into_inner);
        let mut to_agent = Vec::new();
        let pulses = board.step(&self.from_agent, pins, &mut to_agent);
        self.from_agent.clear();
        (to_agent, pulses.applied(before), pulses.begun)
    }
}
