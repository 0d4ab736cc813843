//! Where the dispatcher's ledger lies, and how it is opened.

use crate::ledger::{Ledger, Recovered};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use xtb_client::{Error, ErrorKind, Result};
use xtb_dispatch::task_store::record::VERSION;
use xtb_dispatch::{DispatcherSettings, LedgerEntry, Record, ReplayError, TaskStore};
use xtb_protocol::messages::MAX_TERM;
use xtb_protocol::{Name, Uuid};

/// A ledger that is held, and what stands in it.
#[derive(Debug)]
pub struct Store {
    /// The ledger.
    pub ledger: Ledger<LedgerEntry>,
    /// Its entries, from the last snapshot on.
    pub entries: Vec<LedgerEntry>,
    /// It is new: there was none, or that was put aside.
    pub created: bool,
    /// Where the one of before is kept, if that was put aside.
    pub set_aside: Option<PathBuf>,
    /// Number of the copy, if it is a stand-by's.
    pub copy: Option<u64>,
}

impl Store {
    /// Takes a fleet's ledger, or begins one where none ever was.
    ///
    /// # Errors
    /// What the ledger says; or entries of a later version, or out of their place.
    pub fn open(path: &Path, fleet: &Name) -> Result<Self> {
        make_folder(path)?;
        let (ledger, recovered) = Ledger::<LedgerEntry>::create_or_open(path, fleet.as_str())?;
        Self::read(path, ledger, recovered)
    }

    /// Begins a new ledger. One that is there is kept aside, whole, under a name with today's date.
    ///
    /// # Errors
    /// Another process holds it; there is something else than a ledger of this fleet; the system refuses.
    pub fn fresh(path: &Path, fleet: &Name) -> Result<Self> {
        make_folder(path)?;
        let (ledger, set_aside) = Ledger::<LedgerEntry>::begin_anew(path, fleet.as_str(), wall_ms())?;
        let recovered = Recovered { created: true, rows: Vec::new() };
        Ok(Self { set_aside, ..Self::read(path, ledger, recovered)? })
    }

    fn read(path: &Path, ledger: Ledger<LedgerEntry>, recovered: Recovered<LedgerEntry>) -> Result<Self> {
        let Recovered { created, rows } = recovered;
        let mut entries = Vec::with_capacity(rows.len());
        for row in rows {
            let entry = row.record;
            let newer = entry.v == 0 || entry.v > VERSION;
            if newer || entry.n != row.seq {
                let what = if newer {
                    format!("record {} has version {}, this program reads up to {VERSION}", row.seq, entry.v)
                } else {
                    format!("record {} has number {}", row.seq, entry.n)
                };
                return Err(Error::new(ErrorKind::Failed, format!("ledger {}: {what}", path.display()))
                    .hint("use the newer fleet-cli that wrote it; nothing was changed"));
            }
            entries.push(entry);
        }
        let copy = ledger.copy_id()?;
        Ok(Self { ledger, entries, created, set_aside: None, copy })
    }

    /// Refuses a stand-by's copy: only the dispatcher that it follows may write it.
    ///
    /// # Errors
    /// It is one.
    pub fn no_copy(&self) -> Result<()> {
        if self.copy.is_none() {
            return Ok(());
        }
        let message = format!("ledger {} is the copy of a stand-by", self.ledger.path().display());
        Err(Error::new(ErrorKind::Failed, message).hint(
            "`dispatch serve --standby` follows the dispatcher; `dispatch serve --promote` continues with this \
             copy when the dispatcher and its ledger are lost",
        ))
    }

    /// Makes it the ledger of an active dispatcher, in the next term, whatever the other one has; gives the term.
    ///
    /// # Errors
    /// It has no records, its terms are used up, or the disk refuses.
    pub fn promote(&mut self) -> Result<u32> {
        let term = self.raise_term()?;
        self.end_copy()?;
        Ok(term)
    }

    /// Writes the next term.
    pub(super) fn raise_term(&mut self) -> Result<u32> {
        let path = self.ledger.path().to_owned();
        let refused =
            |what: &str| Error::new(ErrorKind::Failed, format!("ledger {}: {what}", path.display()));
        let keep = DispatcherSettings::default().keep_ended;
        let book = TaskStore::replay(keep, self.entries.iter().cloned());
        let book = book.map_err(|error| unreadable(&path, &error))?;
        if book.ledger().is_none() {
            return Err(
                refused("it has no records").hint("`dispatch serve` without --promote starts a new one")
            );
        }
        let term = book.term().saturating_add(1);
        if term > MAX_TERM {
            return Err(
                refused("all terms are used up").hint("--fresh starts a new ledger and keeps this one")
            );
        }
        let record = Record::Term { term };
        let entry = LedgerEntry { v: record.version(), n: book.next_n(), at_ms: wall_ms(), record };
        self.ledger.append(std::slice::from_ref(&entry))?;
        self.entries.push(entry);
        Ok(term)
    }

    /// It is no copy any more.
    pub(super) fn end_copy(&mut self) -> Result<()> {
        self.ledger.set_copy_id(None)?;
        self.copy = None;
        Ok(())
    }
}

fn make_folder(path: &Path) -> Result<()> {
    let Some(folder) = path.parent().filter(|folder| *folder != Path::new("")) else { return Ok(()) };
    std::fs::create_dir_all(folder).map_err(|error| {
        let message = format!("cannot create the folder {}: {error}", folder.display());
        Error::new(ErrorKind::Failed, message).hint("choose another ledger with --ledger")
    })
}

/// The ledger that is meant: the one named, or the fleet's in the user's data folder.
///
/// # Errors
/// [`ErrorKind::Invalid`]: none is named, and there is no such folder.
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
        Error::new(
            ErrorKind::Invalid,
            "there is no folder for the ledger: neither XDG_DATA_HOME nor HOME is set",
        )
        .hint("give a file with --ledger")
    })
}

/// A ledger's place for a while: what lies there goes when this does.
#[derive(Debug)]
pub struct Scratch(PathBuf);

impl Scratch {
    /// In the system's folder for such things, of this process.
    #[must_use]
    pub fn new() -> Self {
        Self(std::env::temp_dir().join(format!("xtb-{}.ledger", Uuid::new_v4().simple())))
    }

    /// Where.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Default for Scratch {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        for end in ["", "-wal", "-shm", "-lock", "-history", "-history-wal", "-history-shm"] {
            let mut name = self.0.clone().into_os_string();
            name.push(end);
            let _ = std::fs::remove_file(name);
        }
    }
}

/// Entries that are intact and make no sense together.
#[must_use]
pub fn unreadable(path: &Path, error: &ReplayError) -> Error {
    Error::new(ErrorKind::Failed, format!("ledger {}: {error}", path.display()))
        .hint("`fleet-cli dispatch export --json` saves the readable records; nothing was changed")
}

/// The wall clock, in ms since 1970.
#[must_use]
pub fn wall_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_millis()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fleet() -> Name {
        Name::new("lab").unwrap()
    }

    fn entry(v: u32, n: u64) -> LedgerEntry {
        LedgerEntry { v, n, at_ms: 5, record: Record::Opened { ledger: 7 } }
    }

    #[test]
    fn a_ledger_is_read_back_and_is_gone_with_its_scratch() {
        let scratch = Scratch::new();
        let mut store = Store::open(scratch.path(), &fleet()).unwrap();
        assert!(store.created && store.entries.is_empty());
        store.ledger.append(&[entry(VERSION, 1)]).unwrap();
        drop(store);
        let store = Store::open(scratch.path(), &fleet()).unwrap();
        assert_eq!((store.created, store.entries.as_slice()), (false, &[entry(VERSION, 1)][..]));
        drop(store);
        let path = scratch.path().to_owned();
        drop(scratch);
        let beside = std::fs::read_dir(path.parent().unwrap()).unwrap();
        let stem = path.file_name().unwrap().to_str().unwrap();
        let left =
            beside.filter(|file| file.as_ref().unwrap().file_name().to_str().unwrap().starts_with(stem));
        assert_eq!(left.count(), 0);
    }

    #[test]
    fn entries_of_a_later_program_or_out_of_their_place_are_refused() {
        for (wrong, words) in [(entry(VERSION + 1, 1), "has version 5"), (entry(VERSION, 3), "has number 3")]
        {
            let scratch = Scratch::new();
            Store::open(scratch.path(), &fleet()).unwrap().ledger.append(&[wrong]).unwrap();
            let failure = Store::open(scratch.path(), &fleet()).unwrap_err();
            assert!(failure.message.contains(words), "{failure:?}");
        }
    }

    #[test]
    fn a_copy_is_nobodys_ledger_until_it_is_promoted() {
        let scratch = Scratch::new();
        let mut store = Store::open(scratch.path(), &fleet()).unwrap();
        assert!(store.promote().unwrap_err().message.contains("no records"));
        store.ledger.append(&[entry(2, 1)]).unwrap();
        store.ledger.set_copy_id(Some(7)).unwrap();
        drop(store);
        let mut store = Store::open(scratch.path(), &fleet()).unwrap();
        assert!(store.no_copy().unwrap_err().hint.contains("--promote"));
        assert_eq!(store.promote().unwrap(), 1);
        drop(store);
        let store = Store::open(scratch.path(), &fleet()).unwrap();
        store.no_copy().unwrap();
        assert_eq!(TaskStore::replay(9, store.entries).unwrap().term(), 1);
    }

    #[test]
    fn a_simulation_has_another_ledger_than_the_lab() {
        let named = Path::new("some.ledger");
        assert_eq!(path(Some(named), &fleet()).unwrap(), named);
        let (Ok(real), Ok(simulated)) = (path(None, &fleet()), simulated(None, &fleet())) else { return };
        assert!(real.ends_with("xtb/lab.ledger") && simulated.ends_with("xtb/sim/lab.ledger"));
    }
}
