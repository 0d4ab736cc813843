//! What the I/O board does, without the board: time, bytes and readings come in, pulses and frames go out.
//!
//! `docs/io-board.md` is the contract. Nothing here reads a clock or touches a pin: [`Board`] gets both
//! as values, so that a computer tests it as it runs on the microcontroller (`pico/`).
//!
//! ```text
//!            bytes ─► Reader ─► obey ─┬─► set-up ───► periods, windows
//!                                     ├─► PWM ──────► Outputs ──► latch ─► ten pulses at a period's end
//!                                     └─► ask, reset
//!   counters, levels, voltages ─► Encoder, Receiver, Scan, Imu ─► Outbox ─► frames
//!
//!   power-on ─► waiting ── set-up ──► ready ── another set-up ──┐
//!                  │ only its status,   │ ▲                      │
//!                  │ outputs at rest    │ └──────────────────────┘
//!                  ▼                    ▼
//!               held ── neutral frame ─► driven ── 100 ms without a frame, or emergency stop ─► held
//! ```
//!
//! * **tick**: 25 ns, the 40 MHz clock of the memorandum (§4.2), of which every time here is a whole
//!   number ([`Ticks`]).
//! * **count**: 0.4 µs, the unit of a pulse length: 16 ticks.
//! * **time count**: the unit of the receiver and of the encoder's window: as many ticks as the set-up says, 64.
//! * **wrap**: the end of a PWM period, when all ten pulses change together.
//! * **held**: motor and pistons at 3750, whatever frames say.
#![no_std]

mod board;
mod encoder;
mod imu;
mod outbox;
mod outputs;
mod receiver;
mod scan;
mod setup;
mod time;

pub use board::{Board, Inputs, Latch};
pub use imu::ImuSample;
pub use outbox::{Hardware, Identity};
pub use outputs::AT_REST;
pub use receiver::{Channel, Gate};
pub use scan::Visit;
pub use setup::WIRING;
pub use time::{TICKS_A_COUNT, Ticks};

#[cfg(test)]
mod tests;
