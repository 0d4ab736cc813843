//! The words after `--`.

use crate::{HISTORY, in_repository};
use std::path::{Path, PathBuf};

pub(crate) const HELP: &str = "\
cargo bench -p fleet-tests --bench ratios -- [OPTIONS]

  --short          for CI: fewer measurements, without the largest fleet
  --against FILE   compare with the accepted runs in FILE (docs/ratios/history.json)
  --json FILE      write this run to FILE (target/tmp/ratios.json)
  --accept [DATE]  add this run, of today or of DATE (2026-11-24), to docs/ratios/history.json,
                   and write docs/ratios/history.svg and the table of docs/performance.md
  --help           this text

A FILE is seen from the repository's folder. A ratio that fell by more than 25 % is a warning;
the exit code is 1 only if a file cannot be read or written.";

#[derive(Debug)]
pub(crate) struct Options {
    pub(crate) short: bool,
    pub(crate) accept: bool,
    pub(crate) date: Option<String>,
    pub(crate) against: PathBuf,
    pub(crate) json: PathBuf,
    pub(crate) help: bool,
}

impl Options {
    pub(crate) fn read(words: impl Iterator<Item = String>) -> Result<Self, String> {
        let mut options = Self {
            short: false,
            accept: false,
            date: None,
            against: in_repository(HISTORY),
            json: Path::new(env!("CARGO_TARGET_TMPDIR")).join("ratios.json"),
            help: false,
        };
        let mut words = words.peekable();
        while let Some(word) = words.next() {
            let mut file = || words.next().map(in_repository).ok_or_else(|| format!("{word} needs a file"));
            match word.as_str() {
                "--bench" => {} // from Cargo
                "--short" => options.short = true,
                "--help" | "-h" => options.help = true,
                "--against" => options.against = file()?,
                "--json" => options.json = file()?,
                "--accept" => {
                    options.accept = true;
                    options.date = words.next_if(|next| !next.starts_with('-'));
                }
                _ => return Err(format!("unknown option {word:?}")),
            }
        }
        if options.accept && options.short {
            return Err("--accept is for the long form: leave --short out".to_owned());
        }
        match &options.date {
            Some(date) if !is_day(date) => Err(format!("{date:?} is not a day, such as 2026-11-24")),
            _ => Ok(options),
        }
    }
}

/// Digits and dashes as in 2026-11-24.
fn is_day(text: &str) -> bool {
    let fits = |(place, letter): (usize, char)| match place {
        4 | 7 => letter == '-',
        _ => letter.is_ascii_digit(),
    };
    text.len() == 10 && text.chars().enumerate().all(fits)
}
