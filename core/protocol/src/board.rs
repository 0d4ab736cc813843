//! Frames on the line between the I/O board and the agent, both directions: typed, over the numbers of
//! [`xtb_board_codec`], which the board's firmware uses too.
//!
//! ```text
//!   frame := COBS( type u8 · seq u8 · payload · CRC-32 ) · 0x00
//! ```
//! All numbers little-endian; the CRC is CRC-32/ISO-HDLC over type, sequence and payload; the
//! sequence counts each direction's frames modulo 256, so that gaps can be counted. The high nibble
//! of the type is the layout's version (1). `docs/io-board.md` is the same for firmware writers.
//! A frame of the board with the number of the one before is a repeat and counts for nothing.
//! The decoder never panics, resynchronises at the next 0x00 and counts what it drops.

pub mod firmware;
mod frames;
pub mod rates;
mod reader;
mod writer;

pub use firmware::{BoardIdentity, Firmware, UnknownFirmware};
pub use frames::{ADC_SCANS, Ask, BoardError, BoardStatus, Frame, FromBoard, MAX_FRAME, MAX_PULSES, ToBoard};
pub use reader::{FrameReader, LineCounters};
pub use writer::FrameWriter;
