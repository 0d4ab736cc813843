//! What can be wrong with a ledger, and what to do about it.

use rusqlite::ErrorCode;
use std::io;
use std::path::{Path, PathBuf};
use xtb_client::{Error, ErrorKind};

/// A ledger that cannot be opened, read or written.
#[derive(Debug, thiserror::Error)]
#[error("ledger {}: {fault}", path.display())]
pub struct LedgerError {
    /// Which file.
    pub path: PathBuf,
    /// What is wrong.
    #[source]
    pub fault: LedgerFault,
}

/// What is wrong with it.
#[derive(Debug, thiserror::Error)]
pub enum LedgerFault {
    /// Another process writes it.
    #[error("in use by another dispatcher{}", pid.map(|pid| format!(" (process {pid})")).unwrap_or_default())]
    Held {
        /// The other's process, if it has said so.
        pid: Option<u32>,
    },
    /// There is a file, of no length.
    #[error("the file is empty (0 bytes)")]
    Empty,
    /// There is something else.
    #[error("this is not a ledger: {what}")]
    NotALedger {
        /// What speaks against it.
        what: String,
    },
    /// Records were acknowledged, and there is no file.
    #[error("the file is missing, although {acknowledged} of its records were acknowledged")]
    Gone {
        /// The number of the last one.
        acknowledged: u64,
    },
    /// The log of a ledger without the ledger.
    #[error("the file is missing, but its log {} exists", log.display())]
    LogAlone {
        /// The log.
        log: PathBuf,
    },
    /// It is another fleet's.
    #[error("it belongs to the fleet `{found}`, not to `{expected}`")]
    OtherFleet {
        /// Whose it is.
        found: String,
        /// Whose it should be.
        expected: String,
    },
    /// A newer program wrote it.
    #[error("it has schema {found}, this program supports schemas up to {known}")]
    Newer {
        /// The file's schema.
        found: u32,
        /// The newest that this program knows.
        known: u32,
    },
    /// What was written is not what is read.
    #[error("it is damaged: {0}")]
    Damaged(#[from] Damage),
    /// A record is intact, but means nothing to this program.
    #[error("record {seq} is intact, but this program does not understand it: {source}")]
    Meaning {
        /// Its number.
        seq: u64,
        /// What serde says.
        source: serde_json::Error,
    },
    /// A record cannot be written down.
    #[error("a record cannot be written as JSON: {0}")]
    Encode(#[source] serde_json::Error),
    /// A record is longer than the ledger takes.
    #[error("a record of {bytes} bytes is too long, the limit is {most}")]
    TooLong {
        /// Its length.
        bytes: usize,
        /// The longest.
        most: usize,
    },
    /// The disk, or the quota, is full.
    #[error("no space left on the disk while {doing}")]
    Full {
        /// What was being done.
        doing: &'static str,
    },
    /// File or folder may not be written.
    #[error("no permission to write the file or folder ({doing})")]
    ReadOnly {
        /// What was being done.
        doing: &'static str,
    },
    /// Somebody else wrote into it although it is held: the next number is taken.
    #[error("another program has written record {seq}")]
    Overtaken {
        /// The number that was to be the next.
        seq: u64,
    },
    /// The system refused an operation on a file.
    #[error("{doing}: {source}")]
    Io {
        /// What was being done.
        doing: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// SQLite refused.
    #[error("{doing}: {source}")]
    Sqlite {
        /// What was being done.
        doing: &'static str,
        /// What SQLite says.
        source: rusqlite::Error,
    },
}

/// Where what is read is not what was written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Damage {
    /// SQLite finds its own structure broken.
    #[error("{0}")]
    Structure(String),
    /// A record's check sum is wrong.
    #[error("the check sum of record {seq} is wrong")]
    Record {
        /// Its number.
        seq: u64,
    },
    /// Numbers are missing.
    #[error("record {expected} is missing, the next one is {found}")]
    Gap {
        /// The first that is missing.
        expected: u64,
        /// The one that comes instead.
        found: u64,
    },
    /// The log is broken before its end.
    #[error("the log is damaged at page {page}, but later commits follow")]
    Log {
        /// Counted from 1.
        page: u64,
    },
    /// The log's first bytes are wrong.
    #[error("the log's header is damaged, but {pages} pages follow")]
    LogHead {
        /// How many pages follow.
        pages: u64,
    },
    /// The end is missing.
    #[error("records up to {acknowledged} were acknowledged, but only records up to {found} exist")]
    Lost {
        /// The last that was acknowledged.
        acknowledged: u64,
        /// The last that is there; 0 if none.
        found: u64,
    },
}

impl LedgerFault {
    /// With the file that it is about.
    pub(super) fn of(self, path: &Path) -> LedgerError {
        LedgerError { path: path.to_owned(), fault: self }
    }

    /// What a file operation's error means.
    pub(super) fn io(doing: &'static str, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::Full { doing },
            io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => Self::ReadOnly { doing },
            _ => Self::Io { doing, source },
        }
    }

    /// What SQLite's error means.
    pub(super) fn sqlite(doing: &'static str, source: rusqlite::Error) -> Self {
        if source
            .sqlite_error()
            .is_some_and(|error| error.extended_code == rusqlite::ffi::SQLITE_IOERR_SHMSIZE)
        {
            return Self::Full { doing };
        }
        match source.sqlite_error_code() {
            Some(ErrorCode::DiskFull) => Self::Full { doing },
            Some(ErrorCode::ReadOnly | ErrorCode::PermissionDenied) => Self::ReadOnly { doing },
            Some(ErrorCode::NotADatabase) => Self::NotALedger { what: "not an SQLite file".into() },
            Some(ErrorCode::DatabaseCorrupt) => Self::Damaged(Damage::Structure(source.to_string())),
            _ => Self::Sqlite { doing, source },
        }
    }
}

impl LedgerError {
    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> String {
        let file = self.path.display();
        let export = "`fleet-cli dispatch export --json` saves the readable records";
        match &self.fault {
            LedgerFault::Held { .. } => "a fleet has one dispatcher; stop the other one first".into(),
            LedgerFault::Empty => format!("restore {file} from a backup, or remove it to start a new one"),
            LedgerFault::NotALedger { .. } => "choose another file with --ledger".into(),
            LedgerFault::Gone { .. } | LedgerFault::LogAlone { .. } => format!(
                "restore {file} from a backup; to start a new one, remove {file}-lock and {file}-wal too"
            ),
            LedgerFault::OtherFleet { found, .. } => {
                format!("use --fleet {found}, or choose another file with --ledger")
            }
            LedgerFault::Newer { .. } | LedgerFault::Meaning { .. } => {
                "use the newer fleet-cli that wrote it; nothing was changed".into()
            }
            LedgerFault::Damaged(Damage::Lost { .. }) => format!(
                "{export}; restore {file} and {file}-wal, or remove {file}-lock to continue with the \
                 existing records"
            ),
            LedgerFault::Damaged(_) => {
                format!("{export}; then restore {file} from a backup. Nothing was changed")
            }
            LedgerFault::Full { .. } => "free disk space; no acknowledged record is lost".into(),
            LedgerFault::ReadOnly { .. } => {
                format!("the dispatcher must be able to write {file} and its folder")
            }
            LedgerFault::Overtaken { .. } => {
                format!("stop the other program that writes {file}, then start again")
            }
            LedgerFault::Encode(_) | LedgerFault::TooLong { .. } => "split the task".into(),
            LedgerFault::Io { .. } | LedgerFault::Sqlite { .. } => {
                "no acknowledged record is lost; check the disk".into()
            }
        }
    }
}

impl From<&LedgerError> for Error {
    fn from(error: &LedgerError) -> Self {
        let kind = match error.fault {
            LedgerFault::OtherFleet { .. } | LedgerFault::NotALedger { .. } => ErrorKind::Config,
            _ => ErrorKind::Failed,
        };
        Self::new(kind, error.to_string()).hint(error.hint())
    }
}

impl From<LedgerError> for Error {
    fn from(error: LedgerError) -> Self {
        Self::from(&error)
    }
}
