//! An identity on this computer: a folder of its own, which nobody else can read.
//!
//! `identity.toml` says who; `ca.pem`, `certificate.pem` and `key.pem` are what Zenoh reads.

use crate::private_file;
use crate::tls::Tls;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use thiserror::Error;
use xtb_identity::{Identity, IdentityError, Page};

/// A longer file of an identity is none.
const MAX_FILE: u64 = 64 * 1024;
/// Where a program looks for its identity, unless an argument says it. Empty = it has none.
const FOLDER: &str = "XTB_IDENTITY";

/// It could not be written or read.
#[derive(Debug, Error)]
pub enum EnrolError {
    /// A file or the folder.
    #[error("{}: {reason}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// Why not.
        reason: io::Error,
    },
    /// What stands in it.
    #[error("the identity in {}: {reason}", folder.display())]
    Identity {
        /// Where.
        folder: PathBuf,
        /// What is wrong.
        reason: IdentityError,
    },
}

/// An identity in its folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Enrolled {
    /// Where.
    pub folder: PathBuf,
    /// Who.
    pub identity: Identity,
}

impl Enrolled {
    /// The folder that is meant when no argument names one: that of `XTB_IDENTITY` (empty = none), else
    /// `xtb/identity` below the user's configuration, if it is there.
    #[must_use]
    pub fn default_folder() -> Option<PathBuf> {
        if let Some(folder) = std::env::var_os(FOLDER) {
            return (!folder.is_empty()).then(|| PathBuf::from(folder));
        }
        Self::place().filter(|folder| folder.join("identity.toml").exists())
    }

    /// Where `enrol` puts it when no argument names a folder.
    #[must_use]
    pub fn place() -> Option<PathBuf> {
        let absolute =
            |name| std::env::var_os(name).map(PathBuf::from).filter(|path: &PathBuf| path.is_absolute());
        let base =
            absolute("XDG_CONFIG_HOME").or_else(|| absolute("HOME").map(|home| home.join(".config")))?;
        Some(base.join("xtb").join("identity"))
    }

    /// Writes an identity into a folder (mode 0700; the files 0600), instead of the one that is there.
    ///
    /// # Errors
    /// [`EnrolError::File`].
    pub fn write(identity: &Identity, folder: &Path) -> Result<Self, EnrolError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |reason| EnrolError::File { path, reason }
        };
        let facts = identity.facts().to_text().map_err(broken(folder))?;
        private_file::folder(folder).map_err(failed(folder))?;
        let page = identity.page.iter().flat_map(|page| {
            [("page-key.pem", page.key.as_str()), ("page-certificate.pem", page.certificate.as_str())]
        });
        for (name, text) in page.chain([
            ("key.pem", identity.key.as_str()),
            ("certificate.pem", &identity.certificate),
            ("ca.pem", &identity.ca),
            ("identity.toml", &facts), // last: with it the folder counts
        ]) {
            let path = folder.join(name);
            private_file::write(&path, text.as_bytes()).map_err(failed(&path))?;
        }
        Ok(Self { folder: folder.to_owned(), identity: identity.clone() })
    }

    /// Reads a folder, and checks that its files belong together.
    ///
    /// # Errors
    /// [`EnrolError`].
    pub fn load(folder: &Path) -> Result<Self, EnrolError> {
        let text = |name: &str| {
            let path = folder.join(name);
            read(&path).map_err(|reason| EnrolError::File { path, reason })
        };
        let mut identity = Identity::parse_facts(&text("identity.toml")?).map_err(broken(folder))?;
        identity.ca = text("ca.pem")?;
        identity.certificate = text("certificate.pem")?;
        identity.key = text("key.pem")?;
        if folder.join("page-certificate.pem").exists() {
            let (certificate, key) = (text("page-certificate.pem")?, text("page-key.pem")?);
            identity.page = Some(Page { certificate, key });
        }
        identity.check().map_err(broken(folder))?;
        Ok(Self { folder: folder.to_owned(), identity })
    }

    /// What a session needs of it.
    #[must_use]
    pub fn tls(&self) -> Tls {
        Tls::in_folder(&self.folder)
    }

    /// Files and the folder that others than their owner can read, with their modes.
    #[must_use]
    pub fn readable_by_others(&self) -> Vec<(PathBuf, u32)> {
        let paths = [self.folder.clone(), self.folder.join("key.pem")];
        let mode = |path: &PathBuf| Some(fs::metadata(path).ok()?.mode() & 0o777);
        let open = |path: PathBuf| Some((mode(&path)?, path)).filter(|(mode, _)| mode & 0o077 != 0);
        paths.into_iter().filter_map(open).map(|(mode, path)| (path, mode)).collect()
    }
}

fn broken(folder: &Path) -> impl FnOnce(IdentityError) -> EnrolError {
    let folder = folder.to_owned();
    move |reason| EnrolError::Identity { folder, reason }
}

fn read(path: &Path) -> io::Result<String> {
    let about = fs::metadata(path)?;
    if !about.is_file() || about.len() > MAX_FILE {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "it is not a file of an identity"));
    }
    fs::read_to_string(path)
}
