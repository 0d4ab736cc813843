//! Records every step of the controller on a thread of its own: the ground for every incident.
//!
//! The control loop hands steps over through a bounded queue and never waits; what finds the queue
//! full is counted (`rejected.record_dropped` in the state). A disk that is full or gone ends the
//! recording, not the robot: the fault `recording_failed` says so. A chunk is closed every second, of the
//! robot's time or of ours, whichever is over first: that is what a `kill -9` costs at most, and what is
//! missing for whoever fetches the recording of a robot that drives. A second thread sees it onto the disk,
//! so that a disk that takes long keeps nothing from being written.

use crate::config::AgentConfig;
use std::fs;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};
use xtb_control::Stamp;
use xtb_control::config::render_toml;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{Event, ParamChange};
use xtb_recording::Error;
use xtb_recording::robot::Header;
use xtb_recording::robot::writer::{StepWriter, fresh_path};
use xtb_robot::step_log::Step;

/// Steps that wait for the disk: about 20 s.
const QUEUE: usize = 4096;
/// A chunk is closed after this time.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

#[derive(Debug, Default)]
struct Shared {
    dropped: AtomicU64,
    failed: AtomicBool,
}

/// What is recorded.
#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // nearly all are steps, which must not be allocated one by one
enum Item {
    Step(Step),
    Event(Stamp, Box<Event>),
    Param(Stamp, Box<ParamChange>),
}

/// The control loop's end.
#[derive(Debug)]
pub(crate) struct Recorder {
    items: SyncSender<Item>,
    shared: Arc<Shared>,
}

impl Recorder {
    /// Hands a step over; never waits.
    pub(crate) fn push(&self, step: Step) {
        self.send(Item::Step(step));
    }

    /// Hands an event over, as of now; never waits.
    pub(crate) fn push_event(&self, now: Stamp, event: &Event) {
        self.send(Item::Event(now, Box::new(event.clone())));
    }

    /// Hands a changed setting over, as of now; never waits.
    pub(crate) fn push_param(&self, now: Stamp, change: ParamChange) {
        self.send(Item::Param(now, Box::new(change)));
    }

    fn send(&self, item: Item) {
        if self.items.try_send(item).is_err() {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Steps that could not be kept.
    pub(crate) fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }

    /// Whether nothing can be written any more.
    pub(crate) fn failed(&self) -> bool {
        self.shared.failed.load(Ordering::Relaxed)
    }
}

/// Starts a recording in `folder`. It is complete when the [`Recorder`] is dropped and the thread has
/// been joined.
///
/// # Errors
/// The folder or the file cannot be made, or there is no thread: with the folder's name.
pub(crate) fn start(
    folder: &Path,
    config: &AgentConfig,
    epoch: u64,
) -> io::Result<(Recorder, JoinHandle<()>)> {
    begin(folder, config, epoch)
        .map_err(|error| io::Error::new(error.kind(), format!("into {}: {error}", folder.display())))
}

fn begin(folder: &Path, config: &AgentConfig, epoch: u64) -> io::Result<(Recorder, JoinHandle<()>)> {
    fs::create_dir_all(folder)?;
    let started = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let header = Header {
        version: crate::VERSION.to_owned(),
        fleet: config.fleet.to_string(),
        robot: config.robot.to_string(),
        epoch,
        started: started.clone(),
        vehicle_toml: render_toml("vehicle.", &config.vehicle.parameters()),
    };
    let path = fresh_path(folder, &config.robot, &started.replace([':', '-'], ""))?;
    let keys = FleetKeys::new(config.fleet.clone()).robot(&config.robot);
    let mut writer = StepWriter::create(&path, &header, &keys).map_err(io::Error::other)?;
    tracing::info!("recording to {}", path.display());
    let (items, queue) = mpsc::sync_channel(QUEUE);
    let shared = Arc::<Shared>::default();
    let own = shared.clone();
    let thread = std::thread::Builder::new().name(format!("record-{}", header.robot)).spawn(move || {
        if let Err(error) = keep(&mut writer, &queue) {
            own.failed.store(true, Ordering::Relaxed);
            tracing::error!("recording {} stopped: {error}", path.display());
            // Whatever comes from now on is counted by the sender, which finds nobody.
        }
    })?;
    Ok((Recorder { items, shared }, thread))
}

/// Writes what comes, until the sender is gone; then finishes the file.
fn keep(writer: &mut StepWriter, queue: &Receiver<Item>) -> Result<(), Error> {
    let (to_sync, chunks) = mpsc::sync_channel(1);
    let disk = writer.disk();
    // Ends with the first error, or when the recording does.
    let syncing = std::thread::Builder::new()
        .name("record-sync".to_owned())
        .spawn(move || -> Result<(), Error> { chunks.iter().try_for_each(|()| disk.sync()) })?;
    let result = write_all(writer, queue, &to_sync);
    drop(to_sync);
    syncing.join().unwrap_or_else(|_| Err(io::Error::other("the sync thread has ended").into()))?;
    result?;
    writer.finish()
}

fn write_all(writer: &mut StepWriter, queue: &Receiver<Item>, to_sync: &SyncSender<()>) -> Result<(), Error> {
    let mut closed = Instant::now();
    let mut begun: Option<Stamp> = None;
    loop {
        let now = match queue.recv_timeout(FLUSH_EVERY) {
            Ok(Item::Step(step)) => {
                writer.write(&step)?;
                Some(step.t)
            }
            Ok(Item::Event(now, event)) => {
                writer.write_event(now, &event)?;
                Some(now)
            }
            Ok(Item::Param(now, change)) => {
                writer.write_param(now, &change)?;
                Some(now)
            }
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        };
        begun = begun.or(now);
        let recorded =
            begun.zip(now).is_some_and(|(begun, now)| now.since_s(begun) >= FLUSH_EVERY.as_secs_f64());
        if recorded || closed.elapsed() >= FLUSH_EVERY {
            writer.close_chunk()?;
            // One that is under way and one that waits for it are enough.
            if let Err(TrySendError::Disconnected(())) = to_sync.try_send(()) {
                return Ok(());
            }
            (closed, begun) = (Instant::now(), None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::{Controller, Sample, VehicleConfig};
    use xtb_protocol::Name;
    use xtb_recording::robot::Recording;

    #[test]
    fn a_disk_that_does_not_keep_up_costs_steps_that_are_counted_and_never_waits() {
        let (steps, queue) = mpsc::sync_channel(2);
        let recorder = Recorder { items: steps, shared: Arc::default() };
        let sample = Sample::Encoder { pulses: 1 };
        let outputs = Controller::new(VehicleConfig::default()).step(Stamp::ZERO, &sample);
        for number in 0..5 {
            recorder.push(Step { number, t: Stamp::ZERO, sample, outputs });
        }
        assert_eq!(recorder.dropped(), 3);
        let numbers = queue.try_iter().map(|item| match item {
            Item::Step(step) => step.number,
            Item::Event(..) | Item::Param(..) => panic!("{item:?}"),
        });
        assert_eq!(numbers.collect::<Vec<_>>(), [0, 1]);
    }

    #[test]
    fn what_is_older_than_a_second_of_the_robots_time_can_be_read_while_it_records() {
        let folder = tempfile::tempdir().unwrap();
        let (fleet, robot) = (Name::new("lab").unwrap(), Name::new("xtb-1").unwrap());
        let header = Header {
            version: crate::VERSION.to_owned(),
            fleet: fleet.to_string(),
            robot: robot.to_string(),
            epoch: 1,
            started: String::new(),
            vehicle_toml: render_toml("vehicle.", &VehicleConfig::default().parameters()),
        };
        let path = folder.path().join("growing.mcap");
        let keys = FleetKeys::new(fleet).robot(&robot);
        let mut writer = StepWriter::create(&path, &header, &keys).unwrap();
        // Ten seconds of a simulated robot's time, in no time at all; nobody finishes the file.
        let (steps, queue) = mpsc::sync_channel(1000);
        let sample = Sample::Encoder { pulses: 1 };
        for number in 0..1000 {
            let t = Stamp::from_ms(10 * number);
            let outputs = Controller::new(VehicleConfig::default()).step(t, &sample);
            steps.send(Item::Step(Step { number, t, sample, outputs })).unwrap();
        }
        drop(steps);
        let (to_sync, _chunks) = mpsc::sync_channel(1);
        write_all(&mut writer, &queue, &to_sync).unwrap();
        let mut recording = Recording::open(&path).unwrap();
        let mut read = 0;
        while recording.next_step().unwrap().is_some() {
            read += 1;
        }
        assert!(read >= 900, "{read} of 1000 steps");
    }
}
