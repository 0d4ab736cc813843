//! Where the dispatcher's ledger lies, and how it is opened.

use crate::error::{Failure, Kind, Result};
use crate::services::ledger::{Ledger, Recovered};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use xtb_dispatch::record::VERSION;
use xtb_dispatch::{BookError, Entry};
use xtb_protocol::Name;

/// A ledger that is held, and what stands in it.
#[derive(Debug)]
pub struct Store {
    /// The ledger.
    pub ledger: Ledger<Entry>,
    /// Its entries, from the last snapshot on.
    pub entries: Vec<Entry>,
    /// It is new: there was none.
    pub created: bool,
}

impl Store {
    /// Takes a fleet's ledger, or begins one where none ever was.
    ///
    /// # Errors
    /// What the ledger says; or entries of a later version, or out of their place.
    pub fn open(path: &Path, fleet: &Name) -> Result<Self> {
        if let Some(folder) = path.parent().filter(|folder| *folder != Path::new("")) {
            std::fs::create_dir_all(folder).map_err(|error| {
                let message = format!("cannot make the folder {}: {error}", folder.display());
                Failure::new(Kind::Failed, message).hint("name another ledger with --ledger")
            })?;
        }
        let (ledger, Recovered { created, rows }) = Ledger::<Entry>::create_or_open(path, fleet.as_str())?;
        let mut entries = Vec::with_capacity(rows.len());
        for row in rows {
            let entry = row.record;
            let newer = entry.v == 0 || entry.v > VERSION;
            if newer || entry.n != row.seq {
                let what = if newer {
                    format!("record {} has version {}, this program reads up to {VERSION}", row.seq, entry.v)
                } else {
                    format!("record {} says that it is number {}", row.seq, entry.n)
                };
                return Err(Failure::new(Kind::Failed, format!("ledger {}: {what}", path.display()))
                    .hint("use the newer fleet-cli that wrote it; nothing was changed"));
            }
            entries.push(entry);
        }
        Ok(Self { ledger, entries, created })
    }
}

/// The ledger that is meant: the one named, or the fleet's in the user's data folder.
///
/// # Errors
/// [`Kind::Usage`]: none is named, and there is no such folder.
pub fn path(named: Option<&Path>, fleet: &Name) -> Result<PathBuf> {
    named_or_usual(named, &["xtb"], fleet)
}

/// The ledger of simulated robots, which is never by accident that of real ones.
///
/// # Errors
/// As [`path`].
pub fn simulated(named: Option<&Path>, fleet: &Name) -> Result<PathBuf> {
    named_or_usual(named, &["xtb", "sim"], fleet)
}

fn named_or_usual(named: Option<&Path>, folders: &[&str], fleet: &Name) -> Result<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let base = || {
        absolute("XDG_DATA_HOME").or_else(|| absolute("HOME").map(|home| home.join(".local").join("share")))
    };
    let usual =
        || base().map(|base| base.join(folders.iter().collect::<PathBuf>()).join(format!("{fleet}.ledger")));
    named.map(Path::to_owned).or_else(usual).ok_or_else(|| {
        Failure::new(Kind::Usage, "there is no folder for the ledger: neither XDG_DATA_HOME nor HOME is set")
            .hint("name a file with --ledger")
    })
}

/// Entries that are intact and make no sense together.
#[must_use]
pub fn unreadable(path: &Path, error: &BookError) -> Failure {
    Failure::new(Kind::Failed, format!("ledger {}: {error}", path.display()))
        .hint("`fleet-cli dispatch export --json` saves what can be read; nothing was changed")
}

/// The wall clock, in ms since 1970.
#[must_use]
pub fn wall_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_millis()).unwrap_or(u64::MAX)
}
