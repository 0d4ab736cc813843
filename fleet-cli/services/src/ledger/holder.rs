//! Who holds a ledger, and what was acknowledged last: the file `LEDGER-lock` beside it.
//!
//! The lock is the system's (`flock`): it goes with the process, however that ends. The file stays; it is
//! two lines of fixed length, the holder's process and the number of the last record that was
//! acknowledged. That number is written after the commit and before the acknowledgement, without waiting
//! for the disk: it is never ahead of what the disk has, it outlives a kill, and only a power cut can put
//! it behind. So a ledger that ends before it has lost its end.

use super::error::LedgerFault;
use super::schema::check_sum;
use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};
use xtb_recording::files;

/// Of the file beside a ledger: its process and its mark.
const MOST_BYTES: usize = 128;

/// Where the second line begins: after `pid 4294967295\n`.
const MARK_AT: u64 = 15;

/// The system may take this long to give back the lock of a process that is gone.
const RELEASED_WITHIN: Duration = Duration::from_millis(200);
const LOOK_AGAIN: Duration = Duration::from_millis(5);

/// The right to write a ledger, until it is dropped.
#[derive(Debug)]
pub(super) struct Holder {
    file: File,
}

/// `LEDGER-lock`.
pub(super) fn lock_path(ledger: &Path) -> PathBuf {
    beside(ledger, "-lock")
}

/// The ledger's path with something at its end.
pub(super) fn beside(ledger: &Path, end: &str) -> PathBuf {
    let mut path = ledger.as_os_str().to_owned();
    path.push(end);
    path.into()
}

impl Drop for Holder {
    /// A process that is just being started beside this one has the same file open until it is itself: closing
    /// the file would not give the lock back before that.
    fn drop(&mut self) {
        if let Err(error) = self.file.unlock() {
            tracing::warn!("the ledger's lock: {error}");
        }
    }
}

impl Holder {
    /// Takes the ledger, and says what was acknowledged last, if that is known.
    pub(super) fn take(ledger: &Path) -> Result<(Self, Option<u64>), LedgerFault> {
        let path = lock_path(ledger);
        let open = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        let file = open.map_err(|error| LedgerFault::io("opening the lock file", error))?;
        let asked = Instant::now();
        loop {
            match file.try_lock() {
                Ok(()) => break,
                Err(TryLockError::WouldBlock) if asked.elapsed() < RELEASED_WITHIN => {
                    thread::sleep(LOOK_AGAIN)
                }
                Err(TryLockError::WouldBlock) => return Err(LedgerFault::Held { pid: pid(&text(&file)) }),
                Err(TryLockError::Error(error)) => return Err(LedgerFault::io("locking", error)),
            }
        }
        let mark = mark(&text(&file));
        let line = format!("pid {:<10}\n", std::process::id());
        file.write_all_at(line.as_bytes(), 0)
            .map_err(|error| LedgerFault::io("writing the lock file", error))?;
        Ok((Self { file }, mark))
    }

    /// Notes the last record that is acknowledged; does not wait for the disk.
    pub(super) fn note(&self, seq: u64) -> io::Result<()> {
        let number = format!("{seq:020}");
        let line = format!("acknowledged {number} {:08x}\n", check_sum(number.as_bytes()));
        self.file.write_all_at(line.as_bytes(), MARK_AT)
    }

    /// The same, and waits for the disk.
    pub(super) fn note_and_sync(&self, seq: u64) -> io::Result<()> {
        self.note(seq)?;
        self.file.sync_data()
    }
}

/// What was acknowledged last according to the file beside a ledger.
pub(super) fn acknowledged(ledger: &Path) -> Option<u64> {
    files::text(&lock_path(ledger), MOST_BYTES).ok().and_then(|text| mark(&text))
}

fn text(file: &File) -> String {
    let mut bytes = [0; MOST_BYTES];
    let length = file.read_at(&mut bytes, 0).unwrap_or(0);
    String::from_utf8_lossy(&bytes[..length]).into_owned()
}

fn pid(text: &str) -> Option<u32> {
    text.lines().next()?.strip_prefix("pid ")?.trim().parse().ok()
}

fn mark(text: &str) -> Option<u64> {
    let (number, sum) = text.lines().nth(1)?.strip_prefix("acknowledged ")?.split_once(' ')?;
    let right = u32::from_str_radix(sum, 16) == Ok(check_sum(number.as_bytes()));
    if right { number.parse().ok() } else { None }
}
