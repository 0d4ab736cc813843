//! `record`: what is said on the fleet's keys, into MCAP that Foxglove and Python open.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::output;
use crate::recording::recorder_worker::{RecorderWorker, RecordingProgress};
use crate::values::{number, seconds};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;
use std::pin::pin;
use std::time::{Duration, Instant, SystemTime};
use xtb_client::client::Client;
use xtb_client::subscription::plan::WatchPlan;
use xtb_client::subscription::{Inlet, Subscriptions, not_a_key_expr};
use xtb_client::{Error, ErrorKind, Result};
use xtb_recording::fleet::mcap_writer::McapSettings;
use xtb_recording::fleet::recorder::RecordingCounts;

/// Arguments of `record`.
#[derive(Debug, Clone, Args)]
pub struct RecordArgs {
    /// Key expressions [default: all keys of the fleet].
    #[arg(value_name = "KEYEXPR")]
    pub key_exprs: Vec<String>,
    /// First file; further files get -2, -3 … before the extension [default: FLEET-SECONDS.mcap in this
    /// folder].
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Overwrite existing files.
    #[arg(long)]
    pub force: bool,
    /// Start a new file when one reaches this size, such as 500MB or 1GiB.
    #[arg(long, value_name = "SIZE", default_value = "1GiB", value_parser = size)]
    pub max_size: u64,
    /// Chunk duration, 0.05 to 1 s: the most that is lost at a kill -9 or a power cut.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = chunk)]
    pub chunk: Duration,
    /// Stop after this time [default: at Ctrl-C].
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub lasting: Option<Duration>,
}

/// `500MB`, `1GiB`, or bytes.
fn size(text: &str) -> std::result::Result<u64, String> {
    const UNITS: [(&str, u64); 7] = [
        ("KiB", 1 << 10),
        ("MiB", 1 << 20),
        ("GiB", 1 << 30),
        ("kB", 1_000),
        ("MB", 1_000_000),
        ("GB", 1_000_000_000),
        ("", 1),
    ];
    let wrong =
        || format!("{text:?} is not a size: a number with B, kB, MB, GB, KiB, MiB or GiB, at least 64KiB");
    let bare = text.strip_suffix('B').filter(|rest| rest.ends_with(|c: char| c.is_ascii_digit()));
    let text = bare.unwrap_or(text);
    let read = |(unit, bytes): (&str, u64)| {
        text.strip_suffix(unit)?.trim_end().parse::<u64>().ok()?.checked_mul(bytes)
    };
    UNITS.into_iter().find_map(read).filter(|bytes| *bytes >= 64 << 10).ok_or_else(wrong)
}

fn chunk(text: &str) -> std::result::Result<Duration, String> {
    number(text, 0.05, 1.0, "seconds").map(Duration::from_secs_f64)
}

const SHOW_EVERY: Duration = Duration::from_millis(500);

#[derive(Debug, Serialize, JsonSchema)]
struct Ready {
    ready: bool,
    recording: PathBuf,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Ended {
    files: Vec<PathBuf>,
    bytes: u64,
    seconds: f64,
    #[serde(flatten)]
    counts: RecordingCounts,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Ready>, line_of::<Ended>];

/// Records until it is interrupted, `--for` is over, or the disk is full.
///
/// # Errors
/// No router, a key expression that is none, a file that is there already or cannot be written.
pub async fn run(ctx: &Context, args: RecordArgs) -> Result<Exit> {
    // Before anything else: what comes in the first second shall not be missed.
    let mut stop = pin!(interrupted());
    let client = Client::open(&ctx.settings).await?;
    let path = args.out.clone().unwrap_or_else(|| usual_path(ctx));
    let settings = McapSettings {
        path: path.clone(),
        force: args.force,
        max_bytes: args.max_size,
        fleet: ctx.settings.fleet.to_string(),
        keys: match args.key_exprs.as_slice() {
            [] => vec![everything(&client)],
            key_exprs => key_exprs.to_vec(),
        },
    };
    let writing = RecorderWorker::start(settings, args.chunk)?;
    let sources = match listen(&client, &args.key_exprs, &writing.inlet()).await {
        Ok(sources) => sources,
        Err(failure) => {
            // Nothing was recorded: no empty file stays behind.
            drop(writing.finish());
            drop(std::fs::remove_file(&path));
            return Err(failure);
        }
    };
    let began = Instant::now();
    match ctx.out.json {
        true => ctx.out.line(&Ready { ready: true, recording: path })?,
        false => ctx.out.note(&format!("recording to {}; stop with Ctrl-C", path.display())),
    }
    let mut shown = output::ProgressLine::new();
    let mut tick = tokio::time::interval(SHOW_EVERY);
    let mut refused = None;
    while refused.is_none()
        && !writing.ended()
        && args.lasting.is_none_or(|lasting| began.elapsed() < lasting)
    {
        let left = args.lasting.map_or(SHOW_EVERY, |lasting| lasting.saturating_sub(began.elapsed()));
        tokio::select! {
            () = &mut stop => break,
            // What was recorded until now is kept.
            error = client.refused(), if refused.is_none() => refused = Some(error),
            () = tokio::time::sleep(left) => {}
            _ = tick.tick() => shown.show(&progress(&writing.progress(), began.elapsed())),
        }
    }
    shown.end();
    let seconds = began.elapsed().as_secs_f64();
    drop(sources);
    let finishing = tokio::task::spawn_blocking(|| writing.finish());
    let RecordingProgress { files, bytes, counts } =
        finishing.await.map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))??;
    client.close().await;
    ctx.out.result(&Ended { files, bytes, seconds, counts }, words)?;
    refused.map_or(Ok(Exit::Done), Err)
}

/// Listens on what is wanted: by default on everything, and what only answers is asked once.
async fn listen(client: &Client, key_exprs: &[String], inlet: &Inlet) -> Result<Subscriptions> {
    let mut sources = Subscriptions::of_recorder();
    if !key_exprs.is_empty() {
        for key_expr in key_exprs {
            sources.add(client, key_expr, inlet).await?;
        }
        return Ok(sources);
    }
    let map = client.keys().map();
    let tasks = client.keys().dispatch_tasks();
    let everything = everything(client);
    let plans = [
        (everything.clone(), WatchPlan::of(&everything)?),
        (map.clone(), WatchPlan::Answers(vec![map])),
        (tasks.clone(), WatchPlan::Answers(vec![tasks])),
    ];
    for (key_expr, plan) in plans {
        sources.add_plan(client, &key_expr, plan, inlet).await.map_err(not_a_key_expr)?;
    }
    Ok(sources)
}

/// All keys of the fleet.
fn everything(client: &Client) -> String {
    format!("{}**", client.keys().map().trim_end_matches("map"))
}

fn usual_path(ctx: &Context) -> PathBuf {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    PathBuf::from(format!("{}-{}.mcap", ctx.settings.fleet, now.as_secs()))
}

fn progress(progress: &RecordingProgress, elapsed: Duration) -> String {
    let RecordingCounts { messages, unreadable, dropped, .. } = progress.counts;
    let mut text = format!(
        "{:.0} s  {messages} messages  {}  {dropped} dropped",
        elapsed.as_secs_f64(),
        in_bytes(progress.bytes)
    );
    if unreadable > 0 {
        text.push_str(&format!("  {unreadable} unreadable"));
    }
    if let [.., last] = progress.files.as_slice() {
        text.push_str(&format!("  {}", last.display()));
    }
    text
}

fn words(ended: &Ended) -> String {
    let RecordingCounts { messages, unreadable, dropped, .. } = ended.counts;
    let files: Vec<String> = ended.files.iter().map(|file| file.display().to_string()).collect();
    let mut text = format!(
        "{messages} messages in {:.1} s, {}: {}",
        ended.seconds,
        in_bytes(ended.bytes),
        files.join(", ")
    );
    if dropped > 0 {
        text.push_str(&format!(
            "\n{dropped} messages arrived faster than they could be written and were \
                                lost"
        ));
    }
    if unreadable > 0 {
        text.push_str(&format!("\n{unreadable} messages of other programs or another release were skipped"));
    }
    text
}

fn in_bytes(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.2} GB", bytes as f64 / 1e9),
    }
}
