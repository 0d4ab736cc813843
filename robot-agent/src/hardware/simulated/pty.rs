//! Ptys as a truck's lines: to a `robot-agent` in another process their other ends look like serial ports.

use super::{TruckLine, TruckLines};
use serialport::{SerialPort, TTYPort};
use std::io::{self, Read, Write};
use std::path::PathBuf;
use std::time::Duration;

/// The ports that an agent opens to reach a truck on ptys.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TruckPorts {
    /// Of its I/O board.
    pub board: PathBuf,
    /// Of its gyro.
    pub gyro: PathBuf,
}

impl TruckLines {
    /// A truck's lines over two new ptys, and where their other ends are.
    ///
    /// # Errors
    /// The system gives no ptys.
    pub fn over_ptys() -> io::Result<(Self, TruckPorts)> {
        let ((board_line, board), (gyro_line, gyro)) = (Pty::open()?, Pty::open()?);
        let lines = Self { board: Box::new(board_line), gyro: Box::new(gyro_line) };
        Ok((lines, TruckPorts { board, gyro }))
    }
}

/// The truck's end. Nobody at the other end is no error: the bytes are lost, as on a wire.
struct Pty(TTYPort);

impl Pty {
    fn open() -> io::Result<(Self, PathBuf)> {
        let (mut master, slave) = TTYPort::pair()?;
        let port = slave.name().ok_or_else(|| io::Error::other("the pty has no name"))?;
        // The slave is not kept open: what an agent locked would stay locked after its death.
        drop(slave);
        master.set_timeout(Duration::ZERO)?;
        Ok((Self(master), port.into()))
    }
}

impl TruckLine for Pty {
    fn receive(&mut self, into: &mut Vec<u8>) {
        let mut buffer = [0; 1024];
        while self.0.bytes_to_read().is_ok_and(|waiting| waiting > 0) {
            match self.0.read(&mut buffer) {
                Ok(n) if n > 0 => into.extend(&buffer[..n]),
                _ => return,
            }
        }
    }

    fn send(&mut self, bytes: &[u8]) {
        if !bytes.is_empty() {
            let _ = self.0.write(bytes);
        }
    }
}
