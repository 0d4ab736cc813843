//! `fetch-log`: a robot's own recording over Zenoh, piece by piece, so slowly that nothing else waits
//! for it, and from where it was when it was interrupted.

mod fetch;

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::output::{Output, Tone};
use crate::table::{Table, TableCell};
use clap::Args;
use fetch::{Fetch, Next};
use indicatif::{ProgressBar, ProgressStyle};
use schemars::JsonSchema;
use serde::Serialize;
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use xtb_client::client::Client;
use xtb_client::text::robot as describe;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::keys::Channel;
use xtb_protocol::messages::{LogCode, LogFile, LogReply, LogRequest, MAX_PIECE, RecordingName};
use xtb_protocol::wire::CodecError;

const HELP: &str = "\
Data received so far is kept in FILE.part; the same command resumes an interrupted download.

Examples:
  fleet-cli fetch-log xtb-1 --list
  fleet-cli fetch-log xtb-1                     # the newest recording
  robot-agent replay xtb-1-20041201T120000Z.mcap";

/// Arguments of `fetch-log`.
#[derive(Debug, Clone, Args)]
#[command(after_help = HELP)]
pub struct FetchLogArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// Recording, as listed by `--list` [default: the newest].
    #[arg(value_name = "RECORDING")]
    pub file: Option<String>,
    /// List the robot's recordings.
    #[arg(long, conflicts_with_all = ["file", "out", "restart"])]
    pub list: bool,
    /// Output file [default: the recording's name, in this folder].
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Download from the start, even if part of it is here already.
    #[arg(long)]
    pub restart: bool,
}

/// A question that was not answered is asked again after this.
const ASK_AGAIN: Duration = Duration::from_millis(1000);
/// A robot that turned a question away is left in peace for this long.
const TURNED_AWAY: Duration = Duration::from_millis(200);
/// Without an answer for this long (or `--timeout`, if that is longer) it is given up.
const PATIENCE: Duration = Duration::from_secs(10);

#[derive(Debug, Serialize, JsonSchema)]
struct Fetched<'a> {
    robot: &'a Name,
    file: &'a str,
    path: &'a Path,
    bytes: u64,
    /// Bytes that were here already.
    resumed_from: u64,
    /// The robot was still writing to it: this is what it held when the fetch began.
    open: bool,
}

/// A robot's recordings, as `--list` prints them.
#[derive(Debug, Serialize, JsonSchema)]
struct Files<'a> {
    robot: &'a Name,
    /// The newest first.
    files: &'a [LogFile],
    /// Older ones that the robot did not list.
    left_out: u64,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Fetched<'_>>, line_of::<Files<'_>>];

/// Lists a robot's recordings, or fetches one.
///
/// # Errors
/// No router, a robot that does not answer or has no such recording, a disk that will not.
pub async fn run(ctx: &Context, args: &FetchLogArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let (files, left_out) = list(ctx, &client, &args.robot).await?;
    if args.list {
        show(ctx.out, &Files { robot: &args.robot, files: &files, left_out })?;
        client.close().await;
        return Ok(Exit::Done);
    }
    let chosen = choose(&args.robot, &files, args.file.as_deref())?;
    // Only a bare name becomes a path, whatever the robot has listed.
    let name = own_recording(&args.robot, &chosen.file)?;
    let path = args.out.clone().unwrap_or_else(|| PathBuf::from(name.as_str()));
    let mut part = Part::open(&path, args.restart)?;
    let resumed_from = part.bytes;
    let fetching = fetch_all(ctx, &client, &args.robot, chosen, &mut part);
    let ended = tokio::select! {
        ended = fetching => ended,
        () = interrupted() => Err(Error::new(ErrorKind::Interrupted, "interrupted")),
    };
    let bytes = match ended {
        Ok(bytes) => bytes,
        Err(failure) => return Err(with_hint(failure, &part)),
    };
    part.finish(&path)?;
    client.close().await;
    let file = chosen.file.as_str();
    let fetched = Fetched { robot: &args.robot, file, path: &path, bytes, resumed_from, open: chosen.open };
    ctx.out.result(&fetched, |fetched| {
        let still = if fetched.open { "; the robot is still writing to it" } else { "" };
        format!("{}: {}{still}", fetched.path.display(), size(fetched.bytes))
    })?;
    Ok(Exit::Done)
}

async fn list(ctx: &Context, client: &Client, robot: &Name) -> Result<(Vec<LogFile>, u64)> {
    match ask(ctx, client, robot, &LogRequest::List {}).await? {
        LogReply::Files { files, left_out } => {
            if left_out > 0 {
                ctx.out.note(&format!("warning: {left_out} older recordings not listed"));
            }
            Ok((files, left_out))
        }
        other => Err(refused(robot, &other)),
    }
}

fn show(out: Output, listed: &Files<'_>) -> Result<()> {
    if out.json {
        return out.line(listed);
    }
    let mut table = Table::new(&["recording", "size", "written"]);
    for file in listed.files {
        let age = describe::age(Duration::from_secs(file.age_s));
        let written = if file.open { "now".to_owned() } else { format!("{age} ago") };
        let cell = |text: String| TableCell::new(text, Tone::Plain);
        table.row(vec![cell(file.file.clone()), cell(size(file.bytes)), cell(written)]);
    }
    out.text(&table.render(&out))
}

/// The one that was named, else the newest.
fn choose<'a>(robot: &Name, files: &'a [LogFile], named: Option<&str>) -> Result<&'a LogFile> {
    let found = match named {
        Some(name) => files.iter().find(|file| file.file == name),
        None => files.first(),
    };
    found.ok_or_else(|| {
        let message = match named {
            Some(name) => format!("{robot} has no recording {name}"),
            None => format!("{robot} has no recordings"),
        };
        Error::new(ErrorKind::Failed, message)
            .hint(format!("`fleet-cli fetch-log {robot} --list` lists its recordings"))
    })
}

/// The name, if it is that of a recording of this robot.
fn own_recording(robot: &Name, file: &str) -> Result<RecordingName> {
    let named = RecordingName::parse(file).filter(|name| name.robot() == robot);
    named.ok_or_else(|| {
        let message = format!("{robot} lists {file:?}, which is not a recording of {robot}");
        Error::new(ErrorKind::Failed, message)
            .hint(format!("another program may be answering for {robot}: check with `fleet-cli doctor`"))
    })
}

async fn fetch_all(
    ctx: &Context,
    client: &Client,
    robot: &Name,
    chosen: &LogFile,
    part: &mut Part,
) -> Result<u64> {
    let mut fetch = Fetch::new(chosen.file.clone(), part.bytes, part.tail()?);
    let bar = bar(ctx.out, chosen, part.bytes);
    while let Next::Ask(request) = fetch.next() {
        let data = match ask(ctx, client, robot, &request).await? {
            LogReply::Piece { bytes, data, .. } => fetch.take(bytes, data),
            // The place that was asked for is behind its end: it is another one.
            LogReply::Error { code: LogCode::OutOfRange, .. } => Err(fetch::Differs),
            other => return Err(refused(robot, &other)),
        };
        let data = data.map_err(|error| {
            Error::new(ErrorKind::Failed, error.to_string()).hint(
                "start over with \
                --restart",
            )
        })?;
        part.append(&data)?;
        bar.set_position(fetch.progress().0);
    }
    bar.finish_and_clear();
    Ok(fetch.progress().0)
}

fn bar(out: Output, chosen: &LogFile, have: u64) -> ProgressBar {
    if out.json {
        return ProgressBar::hidden();
    }
    // On a terminal only: indicatif hides what goes anywhere else.
    let bar = ProgressBar::new(chosen.bytes);
    let style = ProgressStyle::with_template(
        "{msg} {bar:30} {binary_bytes}/{binary_total_bytes} {binary_bytes_per_sec} {eta}",
    );
    if let Ok(style) = style {
        bar.set_style(style);
    }
    bar.set_message(chosen.file.clone());
    bar.set_position(have);
    bar.reset_eta();
    bar
}

/// Asks until there is an answer, and again while the robot turns questions away.
async fn ask(ctx: &Context, client: &Client, robot: &Name, request: &LogRequest) -> Result<LogReply> {
    let key = client.keys().robot(robot).log(Some(client.name()));
    let channel = Channel::Log(client.name().clone());
    let began = Instant::now();
    let mut asked = 0;
    loop {
        let (mut reply, mut unreadable) = (None, None);
        asked += 1;
        client
            .bus()
            .ask_each(&key, &channel, request, ASK_AGAIN, |incoming| match incoming.decode::<LogReply>() {
                Ok(read) => reply = Some(read),
                Err(error) => unreadable = Some(error),
            })
            .await?;
        match (reply, unreadable) {
            (Some(LogReply::Error { code: LogCode::Overloaded, .. }), _) | (None, None) => {}
            (Some(reply), _) => return Ok(reply),
            // Asked again, it would say the same.
            (None, Some(error)) => return Err(not_ours(robot, &error)),
        }
        tokio::time::sleep(TURNED_AWAY).await;
        if began.elapsed() >= PATIENCE.max(ctx.settings.timeout) {
            let message = format!("{robot} does not answer ({asked} requests)");
            return Err(Error::new(ErrorKind::NoRobot, message)
                .hint("`fleet-cli list` shows the robots present; older agents cannot send recordings"));
        }
    }
}

fn not_ours(robot: &Name, error: &CodecError) -> Error {
    let message = format!("unreadable answer from {robot} about its recordings: {error}");
    Error::new(ErrorKind::Failed, message).hint(match error {
        CodecError::WrongVersion { .. } => "update the older of the two programs: docs/upgrade.md".to_owned(),
        _ => format!("another program may be answering for {robot}: check with `fleet-cli doctor`"),
    })
}

fn refused(robot: &Name, reply: &LogReply) -> Error {
    match reply {
        LogReply::Error { code, message } => {
            let failure = Error::new(ErrorKind::Failed, format!("{robot}: {message}"));
            match code {
                LogCode::NotRecording => failure.hint("start it with `robot-agent --record DIR`"),
                LogCode::UnknownFile => {
                    failure.hint(format!("`fleet-cli fetch-log {robot} --list` lists its recordings"))
                }
                _ => failure,
            }
        }
        other => Error::new(ErrorKind::Failed, format!("unexpected answer from {robot}: {other:?}")),
    }
}

fn with_hint(failure: Error, part: &Part) -> Error {
    if !failure.hint.is_empty() || part.bytes == 0 {
        return failure;
    }
    let hint =
        format!("{} has {}; the same command resumes the download", part.path.display(), size(part.bytes));
    failure.hint(hint)
}

fn size(bytes: u64) -> String {
    indicatif::BinaryBytes(bytes).to_string()
}

/// What has come so far: `FILE.part`, until it is whole.
struct Part {
    path: PathBuf,
    file: File,
    bytes: u64,
}

impl Part {
    fn open(path: &Path, restart: bool) -> Result<Self> {
        if path.exists() {
            let message = format!("{} already exists", path.display());
            return Err(Error::new(ErrorKind::Failed, message).hint("choose another file with --out"));
        }
        let mut name = path.as_os_str().to_owned();
        name.push(".part");
        let part = PathBuf::from(name);
        let failed =
            |error: std::io::Error| Error::new(ErrorKind::Failed, format!("{}: {error}", part.display()));
        let mut options = OpenOptions::new();
        let options = options.read(true).write(true).create(true).truncate(restart);
        let mut file = options.open(&part).map_err(failed)?;
        let bytes = file.seek(SeekFrom::End(0)).map_err(failed)?;
        Ok(Self { path: part, file, bytes })
    }

    /// Its last bytes, one piece at most.
    fn tail(&mut self) -> Result<Vec<u8>> {
        let from = self.bytes.saturating_sub(u64::from(MAX_PIECE));
        let mut tail = Vec::new();
        let read = self.file.seek(SeekFrom::Start(from)).and_then(|_| self.file.read_to_end(&mut tail));
        read.map_err(|error| self.failed(&error))?;
        Ok(tail)
    }

    fn append(&mut self, data: &[u8]) -> Result<()> {
        self.file.write_all(data).map_err(|error| self.failed(&error))?;
        self.bytes += data.len() as u64;
        Ok(())
    }

    /// Whole and on the disk: it gets its name.
    fn finish(self, path: &Path) -> Result<()> {
        let done = self.file.sync_all().and_then(|()| std::fs::rename(&self.path, path));
        done.map_err(|error| self.failed(&error))
    }

    fn failed(&self, error: &std::io::Error) -> Error {
        Error::new(ErrorKind::Failed, format!("{}: {error}", self.path.display()))
    }
}
