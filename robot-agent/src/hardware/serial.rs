//! Real lines: serial ports (or ptys, which look the same) that may come and go; two, or the board's alone.
//!
//! A port that is missing, held by another program or unplugged while in use is no reason to end:
//! its line is closed, says why at each read, and is opened again as soon as that is possible. What
//! a cable does is the robot's business only through the sensor guard and the board's watchdog.
//!
//! ```text
//!   control loop ── read, write ──▶ Line ── the broken port ──▶ opener thread
//!                                    ▲                             │ closes it, tries every 100 ms
//!                                    └── port, or why not ─────────┘
//! ```
//! To open and to close a USB port can take long (a close waits for bytes not sent yet, up to 30 s),
//! so both are done by a thread of each line's own. The loop looks for its answers, never waits.

mod line;
mod port;

use super::Hardware;
use line::Line;
pub use port::PortError;
pub(super) use port::probe;
use std::io;

/// Ends each frame of the board, so the board finds its place again at it (docs/io-board.md).
const BOARD_DELIMITER: u8 = 0x00;

/// Where a line is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortSettings {
    /// Its device, or a link to it such as those in `/dev/serial/by-id`.
    pub path: String,
    /// Its rate in baud, 8N1 without flow control; not 0, which hangs up.
    pub baud: u32,
}

/// The ports of a truck.
///
/// Reads and writes never wait for more than 2 ms. While a line is closed they return why: the
/// error's kind is [`NotFound`](io::ErrorKind::NotFound) if the device is not there,
/// [`ResourceBusy`](io::ErrorKind::ResourceBusy) if another program holds it,
/// [`PermissionDenied`](io::ErrorKind::PermissionDenied) if we may not use it, or what the system
/// says; the error inside is a [`PortError`]. An error on an open line closes it, unless its kind is
/// [`TimedOut`](io::ErrorKind::TimedOut): then the port took no bytes for 2 ms, what waited in it is
/// thrown away, and the next frame finds an empty port.
#[derive(Debug)]
pub struct SerialHardware {
    board: Line,
    /// `None` = the gyro is at the board.
    gyro: Option<Line>,
}

impl SerialHardware {
    /// Tries to open the ports, throws away what waited in them (it is old), and goes on trying
    /// every 100 ms, each time that one is closed, until it is dropped. `gyro` is `None` if there is no such line.
    ///
    /// # Errors
    /// The system cannot start a thread. A port that cannot be opened is no error.
    pub fn start(board: PortSettings, gyro: impl Into<Option<PortSettings>>) -> io::Result<Self> {
        Ok(Self {
            board: Line::start("board", board, Some(BOARD_DELIMITER))?,
            gyro: gyro.into().map(|gyro| Line::start("gyro", gyro, None)).transpose()?,
        })
    }

    /// Why lines are closed, as of the last read or write; the board's first. Empty: all are open.
    ///
    /// For commands that need the ports now rather than some time.
    pub fn closed(&self) -> impl Iterator<Item = &PortError> {
        [Some(&self.board), self.gyro.as_ref()].into_iter().flatten().filter_map(Line::closed)
    }
}

impl Hardware for SerialHardware {
    fn kind(&self) -> &'static str {
        "serial"
    }

    fn read_board(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.board.read(buffer)
    }

    fn read_gyro(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.gyro.as_mut().map_or(Ok(0), |line| line.read(buffer))
    }

    fn write_board(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.board.write(bytes)
    }

    fn write_gyro(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.gyro.as_mut().map_or(Ok(()), |line| line.write(bytes))
    }
}

#[cfg(test)]
mod tests;
