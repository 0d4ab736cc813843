//! `--pty`: two pseudo terminals a truck, which look like serial ports to a separate `robot-agent`.

use robot_agent::hardware::simulated::{TruckLine, TruckLines};
use serialport::{SerialPort, TTYPort};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::messages::Roster;

/// Links to the ptys in a folder; removed again when dropped.
pub(super) struct PtyFolder {
    links: Vec<PathBuf>,
}

impl PtyFolder {
    /// Makes `DIR/<robot>.gyro` and `DIR/<robot>.board` for each robot, in this order.
    pub(super) fn create(folder: &Path, roster: &Roster) -> Result<(Self, Vec<TruckLines>)> {
        let failed = |what: &str, reason: &dyn std::fmt::Display| {
            Error::new(ErrorKind::Failed, format!("{what} {}: {reason}", folder.display()))
                .hint("--pty needs a folder with write permission")
        };
        std::fs::create_dir_all(folder).map_err(|error| failed("cannot create", &error))?;
        let mut made = Self { links: Vec::new() };
        let mut lines = Vec::new();
        for robot in &roster.robots {
            let gyro = made
                .line(folder.join(format!("{}.gyro", robot.name)))
                .map_err(|error| failed("cannot create a pty in", &error))?;
            let board = made
                .line(folder.join(format!("{}.board", robot.name)))
                .map_err(|error| failed("cannot create a pty in", &error))?;
            lines.push(TruckLines { board: Box::new(board), gyro: Box::new(gyro) });
        }
        Ok((made, lines))
    }

    fn line(&mut self, link: PathBuf) -> std::io::Result<PtyLine> {
        let (mut master, slave) = TTYPort::pair()?;
        let path = slave.name().ok_or_else(|| std::io::Error::other("the pty has no name"))?;
        // The slave is not kept open: what an agent locked would stay locked after its death.
        drop(slave);
        master.set_timeout(Duration::ZERO)?;
        if link.is_symlink() {
            std::fs::remove_file(&link)?; // left behind by a simulator that was killed
        }
        std::os::unix::fs::symlink(path, &link)?;
        self.links.push(link);
        Ok(PtyLine(master))
    }
}

impl Drop for PtyFolder {
    fn drop(&mut self) {
        for link in &self.links {
            let _ = std::fs::remove_file(link);
        }
    }
}

/// The truck's end. Nobody at the other end is no error: the bytes are lost, as on a wire.
struct PtyLine(TTYPort);

impl TruckLine for PtyLine {
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
