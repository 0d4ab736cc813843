//! Arguments of `record`, `play` and `export`.

use super::values::{number, part_of_a_day, seconds};
use clap::{ArgGroup, Args};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// Arguments of `record`.
#[derive(Debug, Clone, Args)]
pub struct RecordArgs {
    /// Key expressions [default: everything of the fleet].
    #[arg(value_name = "KEYEXPR")]
    pub key_exprs: Vec<String>,
    /// The first file; further ones get -2, -3 … before their ending [default: FLEET-SECONDS.mcap here].
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Overwrite files that are there already.
    #[arg(long)]
    pub force: bool,
    /// Begin the next file when one has become this long, such as 500MB or 1GiB.
    #[arg(long, value_name = "SIZE", default_value = "1GiB", value_parser = size)]
    pub max_size: u64,
    /// How long a chunk collects, 0.05 to 1 s: what a kill -9 or a power cut loses at most.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = chunk)]
    pub chunk: Duration,
    /// End after this long [default: at Ctrl-C].
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub lasting: Option<Duration>,
}

/// Arguments of `play`.
#[derive(Debug, Clone, Args)]
pub struct PlayArgs {
    /// A file that `record` has written.
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Times as fast as it was.
    #[arg(long, value_name = "X", default_value = "1", value_parser = speed)]
    pub speed: f64,
    /// Where to begin, in s from the first message.
    #[arg(long, value_name = "SECONDS", default_value = "0", value_parser = part_of_a_day)]
    pub from: f64,
    /// Begin anew at the end.
    #[arg(long = "loop")]
    pub repeat: bool,
    /// Show it in the cockpit [default on a terminal].
    #[arg(long, group = "how")]
    pub top: bool,
    /// Print what happened as lines [default where no terminal is].
    #[arg(long, group = "how")]
    pub lines: bool,
    /// Show it in a browser, as `dashboard` shows a fleet; on this machine only [default: 127.0.0.1:8080].
    #[arg(long, value_name = "ADDRESS", group = "how", num_args = 0..=1, default_missing_value = "127.0.0.1:8080", value_parser = super::dashboard::address)]
    pub dashboard: Option<SocketAddr>,
}

/// Arguments of `export`.
#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("format").required(true))]
pub struct ExportArgs {
    /// A file that `record` has written.
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// A table (CSV) for each type of message: RobotState.csv …
    #[arg(long, group = "format")]
    pub csv: bool,
    /// Folder for the tables [default: FILE without its ending].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Overwrite tables that are there already.
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
        || format!("{text:?} is no size: a whole number and B, kB, MB, GB, KiB, MiB or GiB; at least 64KiB");
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
