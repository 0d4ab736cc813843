//! `play`: a recording of the fleet again, as it happened.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::recording::playback_worker::{PlaySettings, PlaybackWorker, not_readable};
use crate::values::{number, part_of_a_day};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::io::IsTerminal;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use xtb_client::Result;
use xtb_client::messages::AnyMessage;
use xtb_recording::fleet::drawing;
use xtb_recording::fleet::player::{Move, Player};
use xtb_recording::fleet::reader::{self, RecordingReader};

/// Arguments of `play`.
#[derive(Debug, Clone, Args)]
pub struct PlayArgs {
    /// File written by `record`.
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Playback speed factor.
    #[arg(long, value_name = "X", default_value = "1", value_parser = speed)]
    pub speed: f64,
    /// Start at this time, in s after the first message.
    #[arg(long, value_name = "SECONDS", default_value = "0", value_parser = part_of_a_day)]
    pub from: f64,
    /// Repeat from the start at the end.
    #[arg(long = "loop")]
    pub repeat: bool,
    /// Show it in the cockpit (see `top`) [default on a terminal].
    #[arg(long, group = "how")]
    pub top: bool,
    /// Print events as lines [default without a terminal].
    #[arg(long, group = "how")]
    pub lines: bool,
    /// Show it in a browser, as `dashboard` does; on this computer only [default: 127.0.0.1:8080].
    #[arg(long, value_name = "ADDRESS", group = "how", num_args = 0..=1, default_missing_value = "127.0.0.1:8080", value_parser = crate::commands::dashboard::address)]
    pub dashboard: Option<SocketAddr>,
}

fn speed(text: &str) -> std::result::Result<f64, String> {
    number(text, 0.01, 1000.0, "times")
}

/// Between two looks at what is due.
const TICK: Duration = Duration::from_millis(20);

#[derive(Debug, Serialize, JsonSchema)]
struct Line<'a> {
    key: &'a str,
    #[serde(rename = "type")]
    name: &'static str,
    at_s: f64,
    value: &'a AnyMessage,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Line<'_>>];

/// Plays it: in the cockpit, on the dashboard's page, or what happened as lines; with `--json` every
/// message, as `watch` prints them.
///
/// # Errors
/// A file that is no recording, or is damaged.
pub async fn run(ctx: &Context, args: &PlayArgs) -> Result<Exit> {
    let settings =
        PlaySettings { speed: args.speed, from_ms: (args.from * 1000.0) as u64, repeat: args.repeat };
    if let Some(listen) = args.dashboard {
        let playing = PlaybackWorker::open(&args.file, settings)?;
        return super::dashboard::played(ctx, Arc::new(playing), listen).await;
    }
    let terminal = std::io::stdin().is_terminal() && std::io::stdout().is_terminal();
    if args.top || terminal && !args.lines && !ctx.out.json {
        let playing = PlaybackWorker::open(&args.file, settings)?;
        let fleet = playing.scene().lock().fleet().clone();
        let ctx = ctx.with(|settings| settings.fleet = fleet);
        return super::top::run_played(&ctx, Arc::new(playing)).await;
    }
    tokio::select! {
        played = print(ctx, &args.file, settings) => played.map(|()| Exit::Done),
        () = interrupted() => Ok(Exit::Interrupted),
    }
}

async fn print(ctx: &Context, path: &Path, settings: PlaySettings) -> Result<()> {
    let wrong = |error| not_readable(path, &error);
    let span = reader::span(path).map_err(wrong)?;
    let mut player = Player::new(span, settings);
    let (mut reader, _) = reader::begin(path).map_err(wrong)?;
    let mut looked = Instant::now();
    let mut next = None;
    let mut skipping = true;
    loop {
        let now = Instant::now();
        if player.advance(now - looked) == Move::Again {
            reader = RecordingReader::open(path).map_err(wrong)?;
            (next, skipping) = (None, true);
        }
        looked = now;
        loop {
            if next.is_none() {
                next = reader.next_message().map_err(wrong)?;
            }
            let Some(message) = next.take_if(|next| player.is_due(next.log_ns)) else { break };
            let at_ms = player.at_ms(message.log_ns);
            // What is before `--from` is passed by.
            skipping &= at_ms < player.position_ms();
            if !skipping {
                say(ctx, at_ms, &message)?;
            }
        }
        skipping = false;
        if player.ended() && !settings.repeat {
            break;
        }
        tokio::time::sleep(TICK).await;
    }
    if let Some(reason) = reader.cut_because() {
        ctx.out.note(&format!("the recording is incomplete, it ends here: {reason}"));
    }
    Ok(())
}

fn say(ctx: &Context, at_ms: u64, message: &reader::Recorded) -> Result<()> {
    let (key, news) = match reader::read(message) {
        Some(Ok(found)) => found,
        Some(Err(error)) => {
            ctx.out.note(&format!("{}: {error}", message.topic));
            return Ok(());
        }
        None => return Ok(()),
    };
    let at_s = at_ms as f64 / 1000.0;
    if ctx.out.json {
        return ctx.out.line(&Line { key: &message.topic, name: news.name(), at_s, value: &news });
    }
    match drawing::log(message.log_ns, &key, &news) {
        Some(line) => ctx.out.text(&format!("{at_s:9.3} s  {:<12} {}", line.name, line.message)),
        None => Ok(()),
    }
}
