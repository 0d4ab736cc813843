//! The files of a router's PKI folder: what it reads, and what it writes.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use xtb_bus::Tls;
use xtb_identity::Registry;

/// A longer registry is none: ten thousand identities are shorter.
const MAX_REGISTRY: u64 = 4 * 1024 * 1024;
const ROUTER: &str = "router";
const APPLY: &str = "apply";
const SEEN: &str = "seen.toml";

/// A router's PKI folder.
#[derive(Debug, Clone)]
pub(super) struct Folder(PathBuf);

/// What stands in it, as texts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Texts {
    pub(super) registry: String,
    /// What was asked for with [`ask_to_apply`] last.
    pub(super) apply: String,
}

/// Asks the routers that read this folder to admit those who were added at once, instead of when no robot is driven:
/// they reopen, which ends teleoperation and goals that stop on a lost link.
///
/// # Errors
/// The file cannot be written.
pub fn ask_to_apply(pki: &Path) -> io::Result<()> {
    let now = humantime::format_rfc3339_nanos(SystemTime::now());
    fs::write(pki.join(APPLY), format!("{now}\n"))
}

impl Folder {
    pub(super) fn new(folder: &Path) -> Self {
        Self(folder.to_owned())
    }

    pub(super) fn registry_file(&self) -> PathBuf {
        self.0.join(Registry::FILE)
    }

    pub(super) fn tls(&self) -> Tls {
        Tls::in_folder(&self.0.join(ROUTER))
    }

    pub(super) fn read(&self) -> io::Result<Texts> {
        Ok(Texts {
            registry: text(&self.registry_file())?,
            // Nobody has to ask.
            apply: text(&self.0.join(APPLY)).unwrap_or_default(),
        })
    }

    pub(super) fn registry(&self, texts: &Texts) -> Result<Registry, String> {
        Registry::parse(&texts.registry).map_err(|error| error.to_string())
    }

    /// When each was seen last, by what earlier runs have written.
    pub(super) fn seen(&self) -> BTreeMap<String, SystemTime> {
        let text = text(&self.0.join(SEEN)).unwrap_or_default();
        let line = |line: &str| {
            let (name, time) = line.split_once(" = ")?;
            let time = humantime::parse_rfc3339(time.trim_matches('"')).ok()?;
            Some((name.trim_matches('"').to_owned(), time))
        };
        text.lines().filter_map(line).collect()
    }

    pub(super) fn write_seen(&self, seen: &BTreeMap<String, SystemTime>) -> io::Result<()> {
        let line = |(name, time): (&String, &SystemTime)| {
            format!("\"{name}\" = \"{}\"\n", humantime::format_rfc3339_seconds(*time))
        };
        let text: String = seen.iter().map(line).collect();
        let (path, beside) = (self.0.join(SEEN), self.0.join(format!("{SEEN}.new")));
        fs::write(&beside, text)?;
        fs::rename(beside, path)
    }
}

fn text(path: &Path) -> io::Result<String> {
    let file = fs::File::open(path)?;
    let mut text = String::new();
    file.take(MAX_REGISTRY + 1).read_to_string(&mut text)?;
    if text.len() as u64 > MAX_REGISTRY {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "it is too long"));
    }
    Ok(text)
}
