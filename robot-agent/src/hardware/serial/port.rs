//! One open serial port: opened for us alone, never blocking, with the system's own error codes.
//!
//! The `serialport` crate is not used for this. Its descriptor blocks, so a write that finds room for
//! a part of a frame waits for the rest without a bound; its errors have lost the code that tells
//! "unplugged" from anything else; and as root an attempt to open a port that somebody holds takes
//! the holder's TIOCEXCL away (it sets the mark before it asks for the lock, and clears it when that
//! fails).
//!
//! **For us alone**, in two ways. An advisory lock (`flock`) on the descriptor itself, which holds
//! against root too, but only against programs that ask for it: other agents, `serialport`, recent
//! terminal programs. And TIOCEXCL, which makes the kernel refuse everybody but root. The lock comes
//! first, so nobody's TIOCEXCL is touched. There is one descriptor, so nothing else reads our
//! bytes or keeps a dead port from being noticed, and closing it ends both. A pty gets the lock
//! only: it keeps TIOCEXCL as long as its master lives, even after its holder was killed.
//!
//! **Modem lines**: opening a port raises DTR and RTS, closing it lowers them if the port has HUPCL
//! (Linux's default). We leave HUPCL as we find it (`stty -F PORT -hupcl` keeps a board that resets
//! at DTR from doing so when the agent restarts). CLOCAL is set: no carrier is needed.
//!
//! **Unplugged** (found on Linux 6.18; a USB device that goes and a pty whose master closes are both
//! a hang-up): `read` returns 0 bytes at once, also if bytes were waiting; `write` and each `ioctl`
//! give EIO; `poll` shows everything, POLLHUP among it; opening the path again gives ENOENT.

use super::PortSettings;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, major};
use rustix::io::{Errno, ioctl_fionread};
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, Termios, ioctl_tiocexcl, ioctl_tiocnxcl, tcflush,
    tcgetattr, tcsetattr,
};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Longest that a write may hold the control loop up.
const WRITE_WITHIN: Duration = Duration::from_millis(2);

/// A port cannot be used, or not any more.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{path}: {reason}")]
pub struct PortError {
    /// Its path.
    pub path: String,
    /// `NotFound`: not there, or no longer. `ResourceBusy`: in use by another program.
    /// `PermissionDenied`. `TimedOut`: it accepts no data. Anything else as the system has it.
    pub kind: ErrorKind,
    /// The same in words.
    pub reason: String,
}

impl PortError {
    fn new(path: &str, error: &io::Error) -> Self {
        let errno = Errno::from_io_error(error);
        let (kind, reason) = match (error.kind(), errno) {
            (ErrorKind::NotFound, _) | (_, Some(Errno::NXIO | Errno::NODEV | Errno::IO)) => {
                (ErrorKind::NotFound, "no such device".to_owned())
            }
            (_, Some(Errno::NOTTY)) => (ErrorKind::InvalidInput, "not a serial port".to_owned()),
            (ErrorKind::ResourceBusy, _) => (ErrorKind::ResourceBusy, "in use by another program".to_owned()),
            (ErrorKind::PermissionDenied, _) => (ErrorKind::PermissionDenied, "permission denied".to_owned()),
            (ErrorKind::TimedOut, None) => (ErrorKind::TimedOut, "accepts no data".to_owned()),
            (kind, _) => (kind, error.to_string()),
        };
        Self { path: path.to_owned(), kind, reason }
    }
}

impl From<PortError> for io::Error {
    fn from(error: PortError) -> Self {
        Self::new(error.kind, error)
    }
}

/// An open port; closed and given free when dropped, which can take long: not in the control loop.
#[derive(Debug)]
pub(super) struct Port {
    file: File,
    path: String,
    /// What was sent last may have lost its end.
    cut_off: bool,
}

impl Port {
    /// Opens a port and throws away what waited in it.
    pub(super) fn open(settings: &PortSettings) -> Result<Self, PortError> {
        let failed = |error: io::Error| PortError::new(&settings.path, &error);
        let (file, modes) = open_locked(&settings.path).map_err(failed)?;
        let port = Self { file, path: settings.path.clone(), cut_off: false };
        port.prepare(modes, settings.baud).map_err(failed)?;
        Ok(port)
    }

    /// Raw bytes, 8N1, no flow control, empty.
    fn prepare(&self, mut modes: Termios, baud: u32) -> io::Result<()> {
        if baud == 0 {
            return Err(io::Error::new(ErrorKind::InvalidInput, "0 baud would close the line"));
        }
        if !is_pty(&self.file)? {
            ioctl_tiocexcl(&self.file)?;
        }
        modes.make_raw(); // eight bits, no parity, a byte is there as soon as it comes
        modes.control_modes.remove(ControlModes::CSTOPB | ControlModes::CRTSCTS);
        modes.control_modes.insert(ControlModes::CREAD | ControlModes::CLOCAL);
        modes.set_speed(baud)?;
        tcsetattr(&self.file, OptionalActions::Now, &modes)?;
        tcflush(&self.file, QueueSelector::IOFlush)?;
        Ok(())
    }

    /// Bytes that have arrived; 0 = none now. Any error means that the port is broken.
    pub(super) fn read(&mut self, buffer: &mut [u8]) -> Result<usize, PortError> {
        if buffer.is_empty() {
            return Ok(0);
        }
        // Asked first, for a read that finds nothing waits all the same: for the kernel's worker to bring
        // what is on its way. That was 200 ms on a busy machine.
        match ioctl_fionread(&self.file) {
            Ok(0) => return Ok(0),
            Ok(_) => {}
            Err(error) => return Err(self.error(&error.into())),
        }
        match self.file.read(buffer) {
            // Nothing now would be WouldBlock: an end is a hang-up.
            Ok(0) => Err(self.error(&Errno::NODEV.into())),
            Ok(n) => Ok(n),
            Err(error) if is_only_late(error.kind()) => Ok(0),
            Err(error) => Err(self.error(&error)),
        }
    }

    /// Sends all bytes within 2 ms or gives them up with `TimedOut`; any other error means that the
    /// port is broken.
    ///
    /// Giving up throws away all that still waits in the port, since old setpoints are worse than
    /// none. That may cut a frame off, so a `delimiter` goes before the next one: else the receiver
    /// would take the two for one and drop both.
    pub(super) fn write(&mut self, bytes: &[u8], delimiter: Option<u8>) -> Result<(), PortError> {
        let until = Instant::now() + WRITE_WITHIN;
        let lead = delimiter.filter(|_| self.cut_off);
        let sent = self.send(lead.as_slice(), until).and_then(|()| self.send(bytes, until));
        self.cut_off = sent.is_err();
        sent.map_err(|error| {
            if error.kind() == ErrorKind::TimedOut {
                // Not every driver can; then the old bytes go first.
                let _ = tcflush(&self.file, QueueSelector::OFlush);
            }
            self.error(&error)
        })
    }

    fn send(&mut self, mut rest: &[u8], until: Instant) -> io::Result<()> {
        while !rest.is_empty() {
            match self.file.write(rest) {
                Ok(n) if n > 0 => rest = &rest[n..],
                Err(error) if !is_only_late(error.kind()) => return Err(error),
                _ => self.wait_for_room(until)?,
            }
        }
        Ok(())
    }

    fn wait_for_room(&self, until: Instant) -> io::Result<()> {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(ErrorKind::TimedOut.into());
        }
        let left = Timespec { tv_sec: 0, tv_nsec: left.subsec_nanos().into() };
        match poll(&mut [PollFd::new(&self.file, PollFlags::OUT)], Some(&left)) {
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    fn error(&self, error: &io::Error) -> PortError {
        PortError::new(&self.path, error)
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        // The kernel forgets it at the last close, but ours need not be the last.
        let _ = ioctl_tiocnxcl(&self.file);
    }
}

/// Whether a port could be opened now. It is opened, locked and asked for its modes, nothing more;
/// so a port that nobody holds has its modem lines raised for a moment, see above.
pub(in crate::hardware) fn probe(path: &str) -> Result<(), PortError> {
    open_locked(path).map(drop).map_err(|error| PortError::new(path, &error))
}

/// Opens a port and locks it. Asks for its modes too: what gives none is not a serial port (ENOTTY),
/// or a number of the kernel's without a port behind it (EIO).
fn open_locked(path: &str) -> io::Result<(File, Termios)> {
    let flags = OFlags::NOCTTY | OFlags::NONBLOCK; // the library adds O_CLOEXEC
    let file =
        OpenOptions::new().read(true).write(true).custom_flags(flags.bits().cast_signed()).open(path)?;
    file.try_lock().map_err(|error| match error {
        TryLockError::WouldBlock => Errno::BUSY.into(),
        TryLockError::Error(error) => error,
    })?;
    let modes = tcgetattr(&file)?;
    Ok((file, modes))
}

/// The device numbers that Linux gives to the slave ends of ptys.
fn is_pty(file: &File) -> io::Result<bool> {
    Ok((136..=143).contains(&major(file.metadata()?.rdev())))
}

/// No error: there is nothing to read, or no room to write, for now.
fn is_only_late(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(error: &io::Error) -> (ErrorKind, String) {
        let error = io::Error::from(PortError::new("/dev/ttyUSB0", error));
        (error.kind(), error.to_string())
    }

    #[test]
    fn the_kind_says_why_and_the_text_names_the_path() {
        for gone in [Errno::NOENT, Errno::NXIO, Errno::NODEV, Errno::IO] {
            let expected = (ErrorKind::NotFound, "/dev/ttyUSB0: no such device".to_owned());
            assert_eq!(told(&gone.into()), expected, "{gone:?}");
        }
        let busy = (ErrorKind::ResourceBusy, "/dev/ttyUSB0: in use by another program".to_owned());
        assert_eq!(told(&Errno::BUSY.into()), busy);
        for denied in [Errno::ACCESS, Errno::PERM] {
            let expected = (ErrorKind::PermissionDenied, "/dev/ttyUSB0: permission denied".to_owned());
            assert_eq!(told(&denied.into()), expected, "{denied:?}");
        }
        let other = io::Error::from(Errno::MFILE);
        assert_eq!(told(&other), (other.kind(), format!("/dev/ttyUSB0: {other}")));
    }

    #[test]
    fn a_file_is_not_a_serial_port() {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let path = file.path().display().to_string();
        let error = Port::open(&PortSettings { path, baud: 115_200 }).expect_err("a file");
        assert_eq!((error.kind, error.reason.as_str()), (ErrorKind::InvalidInput, "not a serial port"));
    }
}
