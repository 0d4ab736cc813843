//! Records every step of the controller on a thread of its own: the ground for every incident.
//!
//! The control loop hands steps over through a bounded queue and never waits; what finds the queue
//! full is counted (`rejected.record_dropped` in the state). A disk that is full or gone ends the
//! recording, not the robot: the fault `recording_failed` says so. A chunk is closed every second, of the
//! robot's time or of ours, whichever is over first: that is what a `kill -9` costs at most, and what is
//! missing for whoever fetches the recording of a robot that drives. A second thread sees it onto the disk,
//! so that a disk that takes long keeps nothing from being written.

use crate::config::AgentConfig;
use crate::recording::{CONFIG, Header, OUTPUTS, outputs_message, sample_message};
use mcap::records::MessageHeader;
use mcap::{McapResult, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};
use xtb_control::Stamp;
use xtb_control::config::render_toml;
use xtb_protocol::keys::{FleetKeys, Name, RobotKeys};
use xtb_protocol::messages::RecordingName;
use xtb_protocol::trace::kind;
use xtb_robot::step_log::Step;

/// Steps that wait for the disk: about 20 s.
const QUEUE: usize = 4096;
/// A chunk is closed after this time.
const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// Or when it has become this long, in bytes.
const CHUNK: u64 = 1 << 20;
/// Kinds of samples, each with a topic of its own.
const KINDS: [&str; 5] = ["gyro", "encoder", "adc", "remote", "command"];

#[derive(Debug, Default)]
struct Shared {
    dropped: AtomicU64,
    failed: AtomicBool,
}

/// The control loop's end.
#[derive(Debug)]
pub(crate) struct Recorder {
    steps: SyncSender<Step>,
    shared: Arc<Shared>,
}

impl Recorder {
    /// Hands a step over; never waits.
    pub(crate) fn push(&self, step: Step) {
        if self.steps.try_send(step).is_err() {
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
/// The folder or the file cannot be made, or there is no thread.
pub(crate) fn start(
    folder: &Path,
    config: &AgentConfig,
    epoch: u64,
) -> io::Result<(Recorder, JoinHandle<()>)> {
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
    let mut writer = McapWriter::create(&path, &header, &keys).map_err(io::Error::other)?;
    tracing::info!("recording to {}", path.display());
    let (steps, queue) = mpsc::sync_channel(QUEUE);
    let shared = Arc::<Shared>::default();
    let own = shared.clone();
    let thread = std::thread::Builder::new().name(format!("record-{}", header.robot)).spawn(move || {
        if let Err(error) = writer.keep(&queue) {
            own.failed.store(true, Ordering::Relaxed);
            tracing::error!("recording {} stopped: {error}", path.display());
            // Whatever comes from now on is counted by the sender, which finds nobody.
        }
    })?;
    Ok((Recorder { steps, shared }, thread))
}

/// `DIR/xtb-1-20041201T120000Z.mcap`, with a number if that exists.
fn fresh_path(folder: &Path, robot: &Name, time: &str) -> io::Result<PathBuf> {
    let unnamed = || io::Error::other(format!("a recording cannot be named after {time:?}"));
    for number in 1.. {
        let name = RecordingName::new(robot, time, number).ok_or_else(unnamed)?;
        let path = folder.join(name.as_str());
        if !path.exists() {
            return Ok(path);
        }
    }
    Err(unnamed())
}

/// The file.
struct McapWriter {
    writer: Writer<BufWriter<File>>,
    file: Arc<File>,
    kinds: BTreeMap<&'static str, u16>,
    outputs: u16,
}

impl McapWriter {
    /// Makes the file and writes its header through to the disk.
    fn create(path: &Path, header: &Header, keys: &RobotKeys) -> McapResult<Self> {
        let options = WriteOptions::new()
            .profile("")
            .library(format!("robot-agent {}", header.version))
            .chunk_size(Some(CHUNK))
            .compression_threads(0);
        let file = File::create_new(path)?;
        let mut writer = options.create(BufWriter::new(file.try_clone()?))?;
        let mut channel = |name: &'static str, schema: &str| {
            let schema = writer.add_schema(&format!("xtb.record.{name}"), "jsonschema", schema.as_bytes())?;
            writer.add_channel(schema, &keys.record(name), "json", &BTreeMap::new())
        };
        let config = channel(CONFIG, schema(CONFIG))?;
        let outputs = channel(OUTPUTS, schema(OUTPUTS))?;
        let kinds = KINDS.into_iter().map(|kind| Ok((kind, channel(kind, schema(kind))?)));
        let kinds = kinds.collect::<McapResult<_>>()?;
        let text = serde_json::to_vec(header).map_err(io::Error::from)?;
        writer.write_to_known_channel(&message(config, 0, 0), &text)?;
        writer.flush()?;
        file.sync_all()?;
        Ok(Self { writer, file: Arc::new(file), kinds, outputs })
    }

    /// Writes what comes, until the sender is gone; then finishes the file.
    fn keep(&mut self, queue: &Receiver<Step>) -> McapResult<()> {
        let (to_sync, chunks) = mpsc::sync_channel(1);
        let file = self.file.clone();
        // Ends with the first error, or when the recording does.
        let disk = std::thread::Builder::new()
            .name("record-sync".to_owned())
            .spawn(move || -> io::Result<()> { chunks.iter().try_for_each(|()| file.sync_data()) })?;
        let result = self.write_all(queue, &to_sync);
        drop(to_sync);
        disk.join().unwrap_or_else(|_| Err(io::Error::other("the sync thread has ended")))?;
        result?;
        self.writer.finish()?;
        self.file.sync_all()?;
        Ok(())
    }

    fn write_all(&mut self, queue: &Receiver<Step>, to_sync: &SyncSender<()>) -> McapResult<()> {
        let mut closed = Instant::now();
        let mut begun: Option<Stamp> = None;
        loop {
            let now = match queue.recv_timeout(FLUSH_EVERY) {
                Ok(step) => {
                    self.write(&step)?;
                    Some(step.t)
                }
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            };
            begun = begun.or(now);
            let recorded =
                begun.zip(now).is_some_and(|(begun, now)| now.since_s(begun) >= FLUSH_EVERY.as_secs_f64());
            if recorded || closed.elapsed() >= FLUSH_EVERY {
                self.writer.flush()?;
                // One that is under way and one that waits for it are enough.
                if let Err(TrySendError::Disconnected(())) = to_sync.try_send(()) {
                    return Ok(());
                }
                (closed, begun) = (Instant::now(), None);
            }
        }
    }

    fn write(&mut self, step: &Step) -> McapResult<()> {
        let sample = sample_message(step);
        let outputs = outputs_message(step, &sample);
        if let Some(kind) = self.kinds.get(kind(&step.sample)) {
            let header = message(*kind, step.number, step.t.ns());
            self.writer.write_to_known_channel(&header, sample.as_bytes())?;
        }
        let header = message(self.outputs, step.number, step.t.ns());
        self.writer.write_to_known_channel(&header, outputs.as_bytes())
    }
}

fn message(channel_id: u16, number: u64, t_ns: u64) -> MessageHeader {
    MessageHeader { channel_id, sequence: number as u32, log_time: t_ns, publish_time: t_ns }
}

/// JSON Schema of a topic's messages; `docs/recording.md` has them in words.
fn schema(topic: &str) -> &'static str {
    match topic {
        CONFIG => include_str!("recorder/config.schema.json"),
        "gyro" => include_str!("recorder/gyro.schema.json"),
        "encoder" => include_str!("recorder/encoder.schema.json"),
        "adc" => include_str!("recorder/adc.schema.json"),
        "remote" => include_str!("recorder/remote.schema.json"),
        "command" => include_str!("recorder/command.schema.json"),
        _ => include_str!("recorder/outputs.schema.json"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::{Controller, Sample, VehicleConfig};

    #[test]
    fn a_disk_that_does_not_keep_up_costs_steps_that_are_counted_and_never_waits() {
        let (steps, queue) = mpsc::sync_channel(2);
        let recorder = Recorder { steps, shared: Arc::default() };
        let sample = Sample::Encoder { pulses: 1 };
        let outputs = Controller::new(VehicleConfig::default()).step(Stamp::ZERO, &sample);
        for number in 0..5 {
            recorder.push(Step { number, t: Stamp::ZERO, sample, outputs });
        }
        assert_eq!(recorder.dropped(), 3);
        assert_eq!(queue.try_iter().map(|step| step.number).collect::<Vec<_>>(), [0, 1]);
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
        let mut writer = McapWriter::create(&path, &header, &keys).unwrap();
        // Ten seconds of a simulated robot's time, in no time at all; nobody finishes the file.
        let (steps, queue) = mpsc::sync_channel(1000);
        let sample = Sample::Encoder { pulses: 1 };
        for number in 0..1000 {
            let t = Stamp::from_ms(10 * number);
            let outputs = Controller::new(VehicleConfig::default()).step(t, &sample);
            steps.send(Step { number, t, sample, outputs }).unwrap();
        }
        drop(steps);
        let (to_sync, _chunks) = mpsc::sync_channel(1);
        writer.write_all(&queue, &to_sync).unwrap();
        let mut recording = crate::recording::Recording::open(&path).unwrap();
        let mut read = 0;
        while recording.next_step().unwrap().is_some() {
            read += 1;
        }
        assert!(read >= 900, "{read} of 1000 steps");
    }
}
