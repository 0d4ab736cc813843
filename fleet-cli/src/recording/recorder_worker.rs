//! The shell around [`Recorder`] and [`McapWriter`]: a bounded queue that Zenoh's threads never wait for, and
//! a thread that writes.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};
use xtb_client::subscription::{Inlet, Item};
use xtb_client::{Error, ErrorKind, Result};
use xtb_recording::fleet::mcap_writer::{McapSettings, McapWriter};
use xtb_recording::fleet::recorder::{Recorder, RecordingCounts};

/// Items that wait for the disk.
const QUEUE: usize = 16_384;
/// And their payloads together, in bytes: a map may be 4 MiB.
const QUEUE_BYTES: usize = 128 << 20;
/// What still waits this long after the wish to end is dropped, and counted.
const DRAIN: Duration = Duration::from_secs(3);
/// Between two looks at the clock when nothing comes.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// An item and when it came, in ns since 1970.
type Timed = (u64, Item);

/// The wall clock at the start, and from there on a clock that nobody sets: log times never go back.
#[derive(Debug, Clone, Copy)]
struct Clock {
    wall_ns: u64,
    began: Instant,
}

impl Clock {
    fn start() -> Self {
        let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        Self { wall_ns: ns(wall), began: Instant::now() }
    }

    fn now_ns(self) -> u64 {
        self.wall_ns.saturating_add(ns(self.began.elapsed()))
    }
}

fn ns(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// How a recording stands.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RecordingProgress {
    /// What was and was not kept.
    pub counts: RecordingCounts,
    /// On the disk, of all files.
    pub bytes: u64,
    /// The files so far.
    pub files: Vec<PathBuf>,
}

#[derive(Debug, Default)]
struct Shared {
    waiting_bytes: AtomicUsize,
    dropped: AtomicU64,
    stop: AtomicBool,
    ended: AtomicBool,
    progress: Mutex<RecordingProgress>,
}

impl Shared {
    fn set(&self, progress: RecordingProgress) {
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner) = progress;
    }
}

/// Where items go in.
#[derive(Debug, Clone)]
struct Door {
    queue: SyncSender<Timed>,
    shared: Arc<Shared>,
    clock: Clock,
}

impl Door {
    /// Never waits: what finds no room is dropped and counted.
    fn put(&self, item: Item) {
        let bytes = weight(&item);
        let before = self.shared.waiting_bytes.fetch_add(bytes, Ordering::AcqRel);
        let room = before + bytes <= QUEUE_BYTES;
        if !room || self.queue.try_send((self.clock.now_ns(), item)).is_err() {
            self.shared.waiting_bytes.fetch_sub(bytes, Ordering::AcqRel);
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// A recording that is being written.
pub struct RecorderWorker {
    door: Door,
    thread: JoinHandle<Result<()>>,
}

impl RecorderWorker {
    /// Makes the first file. A chunk is closed after `chunk` at the latest.
    ///
    /// # Errors
    /// As [`McapWriter::create`], or there is no thread.
    pub fn start(settings: McapSettings, chunk: Duration) -> Result<Self> {
        let clock = Clock::start();
        let tape = McapWriter::create(settings, clock.now_ns())?;
        let (queue, items) = mpsc::sync_channel(QUEUE);
        let shared = Arc::<Shared>::default();
        shared.set(RecordingProgress {
            files: tape.paths().to_vec(),
            bytes: tape.bytes()?,
            ..Default::default()
        });
        let mut writer =
            Writer { tape, recorder: Recorder::default(), shared: Arc::clone(&shared), clock, chunk };
        let thread = std::thread::Builder::new().name("record".into()).spawn(move || {
            let ended = writer.run(&items);
            writer.shared.ended.store(true, Ordering::Release);
            ended
        })?;
        Ok(Self { door: Door { queue, shared, clock }, thread })
    }

    /// Where items go in, from any thread; what finds no room is dropped and counted.
    #[must_use]
    pub fn inlet(&self) -> Inlet {
        let door = self.door.clone();
        Arc::new(move |item| door.put(item))
    }

    /// How it stands.
    #[must_use]
    pub fn progress(&self) -> RecordingProgress {
        let mut progress = self.door.shared.progress.lock().unwrap_or_else(PoisonError::into_inner).clone();
        progress.counts.dropped = self.door.shared.dropped.load(Ordering::Relaxed);
        progress
    }

    /// Whether it has ended by itself: the disk is full or gone.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.door.shared.ended.load(Ordering::Acquire)
    }

    /// Writes what waits, and the end of the file. It may take a few seconds: not for an async task.
    ///
    /// # Errors
    /// Why the recording ended before, or cannot be ended.
    pub fn finish(self) -> Result<RecordingProgress> {
        let shared = self.door.shared;
        shared.stop.store(true, Ordering::Release);
        let ended = self.thread.join();
        ended.map_err(|_| Error::new(ErrorKind::Failed, "the recorder thread failed"))??;
        Ok(shared.progress.lock().unwrap_or_else(PoisonError::into_inner).clone())
    }
}

/// The thread's own.
struct Writer {
    tape: McapWriter,
    recorder: Recorder,
    shared: Arc<Shared>,
    clock: Clock,
    chunk: Duration,
}

impl Writer {
    fn run(&mut self, items: &Receiver<Timed>) -> Result<()> {
        let mut flushed = Instant::now();
        while !self.shared.stop.load(Ordering::Acquire) {
            match items.recv_timeout(LOOK_EVERY.min(self.chunk)) {
                Ok(item) => self.take(&item)?,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if flushed.elapsed() >= self.chunk {
                let (counts, now_ns) = (self.counts(), self.clock.now_ns());
                self.tape.flush(&mut self.recorder, counts, now_ns)?;
                self.tell(self.tape.bytes()?);
                flushed = Instant::now();
            }
        }
        let stopped = Instant::now();
        while let Ok(item) = items.try_recv() {
            if stopped.elapsed() < DRAIN {
                self.take(&item)?;
            } else {
                self.shared.dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
        self.tape.finish(self.counts())?;
        self.tell(self.tape.finished_bytes());
        Ok(())
    }

    fn take(&mut self, (at_ns, item): &Timed) -> Result<()> {
        self.shared.waiting_bytes.fetch_sub(weight(item), Ordering::AcqRel);
        self.tape.write(self.recorder.take(*at_ns, item)).map_err(Error::from)
    }

    fn counts(&self) -> RecordingCounts {
        RecordingCounts { dropped: self.shared.dropped.load(Ordering::Relaxed), ..self.recorder.counts() }
    }

    fn tell(&self, bytes: u64) {
        self.shared.set(RecordingProgress {
            counts: self.counts(),
            bytes,
            files: self.tape.paths().to_vec(),
        });
    }
}

fn weight(item: &Item) -> usize {
    match item {
        Item::Message(incoming) => incoming.payload.len() + incoming.key.len(),
        Item::Presence(key, _) => key.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_bus::Incoming;

    fn door(items: usize) -> (Door, Receiver<Timed>) {
        let (queue, waiting) = mpsc::sync_channel(items);
        (Door { queue, shared: Arc::default(), clock: Clock::start() }, waiting)
    }

    fn item(bytes: usize) -> Item {
        Item::Message(Incoming { key: String::new(), encoding: String::new(), payload: vec![0; bytes] })
    }

    #[test]
    fn a_disk_that_does_not_keep_up_costs_items_that_are_counted_and_nobody_waits() {
        let (door, waiting) = door(2);
        for bytes in 1..=5 {
            door.put(item(bytes));
        }
        let kept: Vec<usize> = waiting.try_iter().map(|(_, item)| weight(&item)).collect();
        assert_eq!((kept, door.shared.dropped.load(Ordering::Relaxed)), (vec![1, 2], 3));
    }

    #[test]
    fn long_items_do_not_fill_the_memory() {
        let (door, waiting) = door(100);
        for _ in 0..5 {
            door.put(item(QUEUE_BYTES / 2));
        }
        assert_eq!((waiting.try_iter().count(), door.shared.dropped.load(Ordering::Relaxed)), (2, 3));
    }

    #[test]
    fn log_times_never_go_back() {
        let clock = Clock::start();
        let times: Vec<u64> = (0..1000).map(|_| clock.now_ns()).collect();
        assert!(times.is_sorted() && times[0] > 1_700_000_000_000_000_000);
    }
}
