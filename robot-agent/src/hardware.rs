//! The two lines of a truck: I/O board and gyro, as bytes.
//!
//! First stop of the path of a sample (docs/paths.md). Nothing here knows what the bytes mean: the same decoders
//! stand behind real serial ports, ptys and the simulator's pipes; [`lines`] hands the bytes on.

pub mod instruments;
pub mod lines;
pub mod ports;
pub mod serial;
#[cfg(feature = "sim")]
pub mod simulated;

use std::io;

/// Non-blocking access to a truck's lines.
pub trait Hardware: Send {
    /// What the factsheet says of it.
    fn kind(&self) -> &'static str;

    /// Bytes that have arrived from the board; 0 = none now.
    ///
    /// # Errors
    /// The line is broken.
    fn read_board(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Bytes that have arrived from the gyro; 0 = none now.
    ///
    /// # Errors
    /// The line is broken.
    fn read_gyro(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Sends a frame to the board.
    ///
    /// # Errors
    /// The line is broken or full; the frame is lost, the next one follows.
    fn write_board(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Sends a command to the gyro.
    ///
    /// # Errors
    /// The line is broken or full.
    fn write_gyro(&mut self, bytes: &[u8]) -> io::Result<()>;
}
