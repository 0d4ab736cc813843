//! Arguments of `record`, `play` and `export`.

use super::values::{number, part_of_a_day, seconds};
use clap::{ArgGroup, Args};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

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
    #[arg(long, value_name = "ADDRESS", group = "how", num_args = 0..=1, default_missing_value = "127.0.0.1:8080", value_parser = super::dashboard::address)]
    pub dashboard: Option<SocketAddr>,
}

/// Arguments of `export`.
#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("format").required(true))]
pub struct ExportArgs {
    /// File written by `record`.
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Write one table (CSV) for each message type: RobotState.csv …
    #[arg(long, group = "format")]
    pub csv: bool,
    /// Folder for the tables [default: FILE without its extension].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Overwrite existing tables.
    #[arg(long)]
    pub force: bool,
}

/// `500MB`, `1GiB`, or bytes.
fn size(text: &str) -> Result<u64, String> {
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

fn chunk(text: &str) -> Result<Duration, String> {
    number(text, 0.05, 1.0, "seconds").map(Duration::from_secs_f64)
}

fn speed(text: &str) -> Result<f64, String> {
    number(text, 0.01, 1000.0, "times")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_the_usual_units() {
        for (text, bytes) in [
            ("1GiB", 1 << 30),
            ("64KiB", 65_536),
            ("500MB", 500_000_000),
            ("2 GB", 2_000_000_000),
            ("100000", 100_000),
            ("100000B", 100_000),
        ] {
            assert_eq!(size(text), Ok(bytes), "{text}");
        }
        for text in ["", "GiB", "1TiB", "-1GiB", "1.5GiB", "1KiB", "99999999999GiB"] {
            assert!(size(text).is_err(), "{text}");
        }
    }
}
