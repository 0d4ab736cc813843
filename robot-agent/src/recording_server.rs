//! The recordings that a robot keeps, read piece by piece for whoever fetches them.
//!
//! One thread-pool task reads for all clients, one question after the other, and questions carry
//! Zenoh's lowest priority: neither the control loop nor a state ever waits for a recording.

use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use tokio::sync::mpsc;
use xtb_bus::{Bus, BusError, Question, Service};
use xtb_protocol::keys::{Name, RobotKeys};
use xtb_protocol::messages::{LogCode, LogFile, LogReply, LogRequest, MAX_LOGS, RecordingName};
use xtb_protocol::wire::CodecError;

/// Questions that wait for the disk; more are answered as overloaded.
const QUESTIONS: usize = 16;
/// A file that was written to this lately is taken for open. The recorder closes a chunk each second.
const OPEN_S: u64 = 5;

/// A robot's recordings in the folder of `--record`, if there is one. Others may keep theirs there too.
#[derive(Debug, Clone)]
pub(crate) struct RecordingServer {
    folder: Option<PathBuf>,
    robot: Name,
}

impl RecordingServer {
    pub(crate) fn new(folder: Option<PathBuf>, robot: Name) -> Self {
        Self { folder, robot }
    }

    /// What is answered, now. Reads the disk.
    fn answer(&self, request: &LogRequest, now: SystemTime) -> LogReply {
        let Some(folder) = &self.folder else {
            return refused(LogCode::NotRecording, "this robot's agent runs without --record");
        };
        match request {
            LogRequest::List {} => self.list(folder, now),
            LogRequest::Read { file, offset, length } => self.read(folder, file, *offset, *length, now),
        }
    }

    fn list(&self, folder: &Path, now: SystemTime) -> LogReply {
        let entries = match std::fs::read_dir(folder) {
            Ok(entries) => entries,
            Err(error) => return refused(LogCode::Unreadable, &error.to_string()),
        };
        // A file that goes away meanwhile is simply not there.
        let known = entries.filter_map(|entry| {
            let path = entry.ok()?.path();
            let file = self.own_name(path.file_name()?.to_str()?)?.to_string();
            let about = path.metadata().ok().filter(std::fs::Metadata::is_file)?;
            let age_s = age_s(&about, now);
            Some(LogFile { file, bytes: about.len(), age_s, open: age_s < OPEN_S })
        });
        let mut files: Vec<LogFile> = known.collect();
        files.sort_by(|a, b| a.age_s.cmp(&b.age_s).then_with(|| b.file.cmp(&a.file)));
        let left_out = files.len().saturating_sub(MAX_LOGS) as u64;
        files.truncate(MAX_LOGS);
        LogReply::Files { files, left_out }
    }

    fn read(&self, folder: &Path, file: &str, offset: u64, length: u32, now: SystemTime) -> LogReply {
        let Some(name) = self.own_name(file) else {
            return refused(LogCode::UnknownFile, &format!("{file:?} is not a recording's name"));
        };
        match piece(&folder.join(name.as_str()), offset, length, now) {
            Ok(reply) => reply,
            Err(error) if error.kind() == ErrorKind::NotFound => {
                refused(LogCode::UnknownFile, &format!("there is no recording {file}"))
            }
            Err(error) => refused(LogCode::Unreadable, &format!("{file}: {error}")),
        }
    }

    /// The name, if it is that of one of this robot's recordings.
    fn own_name(&self, file: &str) -> Option<RecordingName> {
        RecordingName::parse(file).filter(|name| *name.robot() == self.robot)
    }
}

/// Declares `log/*` and answers on it until what it gives back is dropped.
///
/// # Errors
/// [`BusError`].
pub(crate) async fn declare(
    bus: &Bus,
    keys: &RobotKeys,
    server: RecordingServer,
) -> Result<Service, BusError> {
    let (sender, mut questions) = mpsc::channel::<Question>(QUESTIONS);
    let (own, runtime) = (keys.clone(), tokio::runtime::Handle::current());
    let service = bus
        .serve(&keys.log(None), move |question| {
            if let Err(mpsc::error::TrySendError::Full(question)) = sender.try_send(question) {
                let keys = own.clone();
                runtime.spawn(async move { send(&question, &keys, overloaded()).await });
            }
        })
        .await?;
    let keys = keys.clone();
    tokio::spawn(async move {
        while let Some(question) = questions.recv().await {
            let server = server.clone();
            let reply = match question.decode::<LogRequest>() {
                Ok((request, _)) => {
                    let reading =
                        tokio::task::spawn_blocking(move || server.answer(&request, SystemTime::now()));
                    reading.await.unwrap_or_else(|error| refused(LogCode::Unreadable, &error.to_string()))
                }
                Err(error) => refused(code_of(&error), &error.to_string()),
            };
            send(&question, &keys, reply).await;
        }
    });
    Ok(service)
}

/// Answers on the asking client's key.
async fn send(question: &Question, keys: &RobotKeys, reply: LogReply) {
    let Some(client) = question.client() else { return };
    let format = question
        .decode::<LogRequest>()
        .map_or_else(|_| question.likely_format::<LogRequest>(), |(_, format)| format);
    if let Err(error) = question.reply(&keys.log(Some(client)), &reply, format).await {
        tracing::debug!("cannot send part of a recording: {error}");
    }
}

fn code_of(error: &CodecError) -> LogCode {
    match error {
        CodecError::OutOfRange(_) => LogCode::OutOfRange,
        _ => LogCode::Malformed,
    }
}

fn refused(code: LogCode, message: &str) -> LogReply {
    LogReply::Error { code, message: message.to_owned() }
}

fn overloaded() -> LogReply {
    refused(LogCode::Overloaded, "too many requests are waiting for the robot's disk")
}

fn piece(path: &Path, offset: u64, length: u32, now: SystemTime) -> std::io::Result<LogReply> {
    let mut file = crate::files::open(path)?;
    let about = file.metadata()?;
    if offset > about.len() {
        let message = format!("the recording has {} bytes, offset {offset} is past its end", about.len());
        return Ok(refused(LogCode::OutOfRange, &message));
    }
    file.seek(SeekFrom::Start(offset))?;
    let mut data = Vec::new();
    file.take(u64::from(length)).read_to_end(&mut data)?;
    Ok(LogReply::Piece { bytes: about.len(), open: age_s(&about, now) < OPEN_S, data })
}

fn age_s(about: &std::fs::Metadata, now: SystemTime) -> u64 {
    let written = about.modified().ok();
    written.and_then(|written| now.duration_since(written).ok()).map_or(0, |age| age.as_secs())
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECORDING: &str = "xtb-1-20041201T120000Z.mcap";
    const FOLDER: &str = "xtb-1-20041202T120000Z.mcap";

    fn robot() -> Name {
        Name::new("xtb-1").unwrap()
    }

    fn server() -> (tempfile::TempDir, RecordingServer) {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(RECORDING), b"0123456789").unwrap();
        std::fs::write(folder.path().join("xtb-1-2-20041201T120000Z.mcap"), b"another robot's").unwrap();
        std::fs::write(folder.path().join("notes.txt"), b"no recording").unwrap();
        std::fs::create_dir(folder.path().join(FOLDER)).unwrap();
        let server = RecordingServer::new(Some(folder.path().to_owned()), robot());
        (folder, server)
    }

    fn read(file: &str, offset: u64, length: u32) -> LogRequest {
        LogRequest::Read { file: file.to_owned(), offset, length }
    }

    fn code(reply: &LogReply) -> LogCode {
        match reply {
            LogReply::Error { code, .. } => *code,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn recordings_are_listed_and_nothing_else() {
        let (_folder, server) = server();
        let later = SystemTime::now() + std::time::Duration::from_secs(60);
        let LogReply::Files { files, left_out } = server.answer(&LogRequest::List {}, later) else {
            panic!()
        };
        assert_eq!((files.len(), left_out), (1, 0));
        assert_eq!((files[0].file.as_str(), files[0].bytes, files[0].open), (RECORDING, 10, false));
        assert!((59..=61).contains(&files[0].age_s));
    }

    #[test]
    fn pieces_end_where_the_recording_does() {
        let (_folder, server) = server();
        let now = SystemTime::now();
        for (offset, length, expected) in [(0, 4, "0123"), (8, 4, "89"), (10, 4, "")] {
            let LogReply::Piece { bytes, data, .. } = server.answer(&read(RECORDING, offset, length), now)
            else {
                panic!()
            };
            assert_eq!((bytes, data.as_slice()), (10, expected.as_bytes()));
        }
        assert_eq!(code(&server.answer(&read(RECORDING, 11, 4), now)), LogCode::OutOfRange);
    }

    #[test]
    fn no_name_leads_out_of_the_folder() {
        let (folder, server) = server();
        let inside = folder.path().join("inner");
        std::fs::create_dir(&inside).unwrap();
        let inner = RecordingServer::new(Some(inside), robot());
        let up = format!("../{RECORDING}");
        let round = format!("x/../../{RECORDING}");
        let root = format!("/{RECORDING}");
        for name in [&up, &round, &root, RECORDING, "notes.txt", ".", "..", "xtb-1-2-20041201T120000Z.mcap"] {
            let reply = inner.answer(&read(name, 0, 4), SystemTime::now());
            assert_eq!(code(&reply), LogCode::UnknownFile, "{name}");
        }
        assert_eq!(code(&server.answer(&read(FOLDER, 0, 4), SystemTime::now())), LogCode::Unreadable);
        let none = RecordingServer::new(None, robot()).answer(&LogRequest::List {}, SystemTime::now());
        assert_eq!(code(&none), LogCode::NotRecording);
    }
}
