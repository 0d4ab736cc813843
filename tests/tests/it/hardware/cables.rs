//! Cables that a test can pull out: ptys behind links, as udev makes them.

use robot_agent::hardware::serial::PortSettings;
use robot_agent::hardware::simulated::TruckLine;
use serialport::{SerialPort, TTYPort};
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// The truck's end of a cable that can be pulled out; what is sent into the air is lost.
#[derive(Clone, Default)]
pub(super) struct Cable {
    far_end: Arc<Mutex<Option<TTYPort>>>,
    /// The wire from the agent to the truck is cut.
    pub(super) cut: Arc<AtomicBool>,
}

impl TruckLine for Cable {
    fn receive(&mut self, into: &mut Vec<u8>) {
        let before = into.len();
        let mut buffer = [0; 1024];
        if let Some(port) = self.far_end.lock().unwrap().as_mut() {
            while let Ok(n @ 1..) = port.read(&mut buffer) {
                into.extend(&buffer[..n]);
            }
        }
        if self.cut.load(Ordering::Relaxed) {
            into.truncate(before);
        }
    }

    fn send(&mut self, bytes: &[u8]) {
        if let Some(port) = self.far_end.lock().unwrap().as_mut().filter(|_| !bytes.is_empty()) {
            let _ = port.write(bytes);
        }
    }
}

/// A place in `/dev`, so to speak, and the cable that hangs there or does not.
pub(super) struct Socket {
    link: PathBuf,
    pub(super) cable: Cable,
}

impl Socket {
    pub(super) fn empty(folder: &Path, name: &str) -> Self {
        Self { link: folder.join(name), cable: Cable::default() }
    }

    pub(super) fn settings(&self) -> PortSettings {
        PortSettings { path: self.link.display().to_string(), baud: 115_200 }
    }

    /// As a USB device goes: its path first (another test may be given the same pty again).
    pub(super) fn unplug(&self) {
        std::fs::remove_file(&self.link).unwrap();
        self.cable.far_end.lock().unwrap().take();
    }

    pub(super) fn plug(&self) {
        drop(self.plug_locked());
    }

    /// Plugs it in, or out and in at once, where another program holds the port until the file is
    /// dropped.
    pub(super) fn plug_locked(&self) -> File {
        let (mut far_end, slave) = TTYPort::pair().unwrap();
        far_end.set_timeout(Duration::ZERO).unwrap();
        let path = slave.name().unwrap();
        let holder = File::options().read(true).write(true).open(&path).unwrap();
        holder.try_lock().unwrap();
        drop(slave);
        let new = self.link.with_extension("new");
        symlink(path, &new).unwrap();
        std::fs::rename(new, &self.link).unwrap();
        self.cable.far_end.lock().unwrap().replace(far_end);
        holder
    }
}
