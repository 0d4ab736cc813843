//! The log of both programs: to standard error, as text for people or as JSON lines for programs.

use clap::ValueEnum;
use std::io::IsTerminal;
use tracing_subscriber::EnvFilter;

/// Variables that say how detailed the log is, such as `debug`; the first that is set counts.
const DETAIL: [&str; 2] = ["XTB_LOG", "RUST_LOG"];

/// How a line of the log looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// One JSON object a line.
    Json,
}

/// Begins to log; `usual` is how detailed, in the words of `RUST_LOG`, unless the environment says so.
pub fn start(format: LogFormat, usual: &str) {
    let set = DETAIL.iter().find_map(|name| std::env::var(name).ok().filter(|text| !text.is_empty()));
    let filter = set.and_then(|text| EnvFilter::try_new(text).ok()).unwrap_or_else(|| EnvFilter::new(usual));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    match format {
        LogFormat::Text => log.with_ansi(std::io::stderr().is_terminal()).init(),
        LogFormat::Json => log.json().flatten_event(true).with_current_span(false).init(),
    }
}
