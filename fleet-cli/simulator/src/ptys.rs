//! `--pty`: two pseudo terminals a truck, which look like serial ports to a separate `robot-agent`.

use robot_agent::hardware::simulated::TruckLines;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::{fs, io};
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
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
        fs::create_dir_all(folder).map_err(|error| failed("cannot create", &error))?;
        let mut made = Self { links: Vec::new() };
        let lines = roster.robots.iter().map(|robot| made.truck(folder, &robot.name));
        let lines =
            lines.collect::<io::Result<_>>().map_err(|error| failed("cannot create a pty in", &error))?;
        Ok((made, lines))
    }

    /// A truck's lines, with links to the agent's ends.
    fn truck(&mut self, folder: &Path, robot: &Name) -> io::Result<TruckLines> {
        let (lines, ports) = TruckLines::over_ptys()?;
        for (line, port) in [("gyro", ports.gyro), ("board", ports.board)] {
            let link = folder.join(format!("{robot}.{line}"));
            if link.is_symlink() {
                fs::remove_file(&link)?; // left behind by a simulator that was killed
            }
            symlink(port, &link)?;
            self.links.push(link);
        }
        Ok(lines)
    }
}

impl Drop for PtyFolder {
    fn drop(&mut self) {
        for link in &self.links {
            let _ = fs::remove_file(link);
        }
    }
}
