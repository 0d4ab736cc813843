//! Real lines: two serial ports (or ptys, which look the same).

use super::Hardware;
use serialport::{ClearBuffer, SerialPort};
use std::io;
use std::time::Duration;
use thiserror::Error;

/// Longest that a write may hold the control loop up.
const WRITE_WITHIN: Duration = Duration::from_millis(2);

/// A port cannot be used.
#[derive(Debug, Error)]
#[error("cannot open the {line} port {path:?}: {reason}")]
pub struct PortError {
    /// `board` or `gyro`.
    pub line: &'static str,
    /// Its path.
    pub path: String,
    /// The system's words.
    pub reason: String,
}

/// The two ports of a truck.
pub struct SerialHardware {
    board: Box<dyn SerialPort>,
    gyro: Box<dyn SerialPort>,
}

impl SerialHardware {
    /// Opens both ports, 8N1, and throws away what waited in them: it is old.
    ///
    /// # Errors
    /// The port that cannot be opened.
    pub fn open(board: &str, board_baud: u32, gyro: &str, gyro_baud: u32) -> Result<Self, PortError> {
        Ok(Self { board: open("board", board, board_baud)?, gyro: open("gyro", gyro, gyro_baud)? })
    }
}

fn open(line: &'static str, path: &str, baud: u32) -> Result<Box<dyn SerialPort>, PortError> {
    let failed =
        |error: serialport::Error| PortError { line, path: path.to_owned(), reason: error.to_string() };
    let port = serialport::new(path, baud).timeout(WRITE_WITHIN).open().map_err(failed)?;
    port.clear(ClearBuffer::All).map_err(failed)?;
    Ok(port)
}

fn read(port: &mut dyn SerialPort, buffer: &mut [u8]) -> io::Result<usize> {
    match port.bytes_to_read()? {
        0 => Ok(0),
        waiting => {
            let most = buffer.len().min(waiting as usize);
            port.read(&mut buffer[..most])
        }
    }
}

impl Hardware for SerialHardware {
    fn kind(&self) -> &'static str {
        "serial"
    }

    fn read_board(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        read(&mut *self.board, buffer)
    }

    fn read_gyro(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        read(&mut *self.gyro, buffer)
    }

    fn write_board(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.board.write_all(bytes)
    }

    fn write_gyro(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.gyro.write_all(bytes)
    }
}
