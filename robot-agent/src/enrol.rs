//! Enrolling: an identity file (`NAME.xtbid`) becomes this computer's identity. Both programs do it.

use crate::files;
use schemars::JsonSchema;
use serde::Serialize;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};
use thiserror::Error;
use xtb_bus::{EnrolError, Enrolled};
use xtb_identity::certificate::CertificateError;
use xtb_identity::{Identity, IdentityError, Role};
use xtb_protocol::Name;

/// It cannot be enrolled.
#[derive(Debug, Error)]
pub enum EnrolRefusal {
    /// The file cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// Why not.
        reason: files::FileError,
    },
    /// It is no identity, or its parts do not belong together.
    #[error("{}: {reason}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What is wrong.
        reason: IdentityError,
    },
    /// It has expired.
    #[error("{0}")]
    Expired(IdentityError),
    /// It is for the other program.
    #[error("{name} is {}: its identity is not for this program", role.noun())]
    Role {
        /// Whose.
        name: Name,
        /// What it is.
        role: Role,
    },
    /// The folder has another identity.
    #[error("{} has the identity of {there} already", folder.display())]
    Other {
        /// The folder.
        folder: PathBuf,
        /// `NAME of fleet FLEET`.
        there: String,
    },
    /// The folder has a later certificate.
    #[error("{} has certificate {there} of {name} already, and this is certificate {generation}", folder.display())]
    Older {
        /// The folder.
        folder: PathBuf,
        /// Whose.
        name: Name,
        /// Its generation there.
        there: u32,
        /// In the file.
        generation: u32,
    },
    /// No folder is named, and there is no home.
    #[error("there is no home folder for the identity")]
    NoPlace,
    /// It cannot be written.
    #[error("cannot write the identity: {0}")]
    Write(EnrolError),
    /// It is enrolled, and the file is still there.
    #[error("enrolled, but cannot delete {}: {reason}", path.display())]
    Delete {
        /// Which.
        path: PathBuf,
        /// Why not.
        reason: std::io::Error,
    },
}

impl EnrolRefusal {
    /// What to do.
    #[must_use]
    pub fn hint(&self) -> String {
        match self {
            Self::Read { .. } => "give the .xtbid file that `fleet-cli pki add-…` wrote".into(),
            Self::File { .. } => "get the .xtbid file again, unchanged".into(),
            Self::Expired(IdentityError::Expired { name, .. }) => {
                format!("`fleet-cli pki renew {name}` makes the next one")
            }
            Self::Expired(_) => String::new(),
            Self::Role { role: Role::Robot, name } => format!("on the robot: robot-agent enrol {name}.xtbid"),
            Self::Role { name, .. } => format!("on that computer: fleet-cli enrol {name}.xtbid"),
            Self::Other { .. } => "--force replaces it, --to DIR keeps both".into(),
            Self::Older { .. } => "enrol the newest file; --force replaces it all the same".into(),
            Self::NoPlace => "name a folder with --to DIR".into(),
            Self::Write(_) => "--to DIR names another folder".into(),
            Self::Delete { .. } => "delete it: it holds the private key".into(),
        }
    }

    /// Whether the file is wrong, not this computer.
    #[must_use]
    pub fn is_of_the_file(&self) -> bool {
        matches!(
            self,
            Self::Read { .. } | Self::File { .. } | Self::Expired(_) | Self::Role { .. } | Self::NoPlace
        )
    }
}

/// What was enrolled, and what is to be said of it.
#[derive(Debug)]
pub struct EnrolOutcome {
    /// The identity in its folder.
    pub enrolled: Enrolled,
    /// When its certificate ends.
    pub expires: SystemTime,
    /// What deserves a warning.
    pub warnings: Vec<String>,
}

/// Enrols `file` in `folder`; `force` replaces another identity. `may` says which roles are this program's.
///
/// # Errors
/// [`EnrolRefusal`].
pub fn enrol(
    file: &Path,
    folder: Option<&Path>,
    force: bool,
    now: SystemTime,
    may: impl Fn(Role) -> bool,
) -> Result<EnrolOutcome, EnrolRefusal> {
    let read = |reason| EnrolRefusal::Read { path: file.to_owned(), reason };
    let text = files::text(file, files::MAX_TEXT).map_err(read)?;
    let wrong = |reason| EnrolRefusal::File { path: file.to_owned(), reason };
    let identity = Identity::parse(&text).map_err(wrong)?;
    if !may(identity.role) {
        return Err(EnrolRefusal::Role { name: identity.name, role: identity.role });
    }
    let mut warnings = Vec::new();
    match identity.check_at(now) {
        Err(error @ IdentityError::NotYet { .. }) => warnings
            .push(format!("{error}; this computer's clock says {}", humantime::format_rfc3339_seconds(now))),
        Err(error) => return Err(EnrolRefusal::Expired(error)),
        Ok(()) => {}
    }
    let broken = |reason: CertificateError| wrong(IdentityError::Certificate { what: "certificate", reason });
    let expires = identity.certificate().map_err(broken)?.not_after;
    let folder = folder.map(Path::to_owned).or_else(Enrolled::place).ok_or(EnrolRefusal::NoPlace)?;
    if !force {
        replaces(&identity, &folder)?;
    }
    let mode = std::fs::metadata(file).map_or(0, |about| about.mode() & 0o777);
    if mode & 0o077 != 0 {
        warnings.push(format!(
            "{} can be read by others (mode {mode:04o}) and holds the private key: whoever has read it can be {}",
            file.display(),
            identity.name
        ));
    }
    let enrolled = Enrolled::write(&identity, &folder).map_err(EnrolRefusal::Write)?;
    for (path, mode) in enrolled.readable_by_others() {
        warnings.push(format!("{} can be read by others (mode {mode:04o}): chmod go= it", path.display()));
    }
    Ok(EnrolOutcome { enrolled, expires, warnings })
}

/// Whether it may take the place of what is there.
fn replaces(identity: &Identity, folder: &Path) -> Result<(), EnrolRefusal> {
    let Ok(Enrolled { identity: there, .. }) = Enrolled::load(folder) else { return Ok(()) };
    let folder = folder.to_owned();
    if (&there.name, &there.fleet) != (&identity.name, &identity.fleet) {
        return Err(EnrolRefusal::Other {
            folder,
            there: format!("{} of fleet {}", there.name, there.fleet),
        });
    }
    if there.generation > identity.generation {
        let (name, generation) = (there.name, identity.generation);
        return Err(EnrolRefusal::Older { folder, name, there: there.generation, generation });
    }
    Ok(())
}

/// The same for scripts.
#[derive(Debug, Serialize, JsonSchema)]
pub struct EnrolReport<'a> {
    name: &'a Name,
    fleet: &'a Name,
    role: Role,
    generation: u32,
    expires: String,
    routers: &'a [String],
    folder: String,
    warnings: &'a [String],
}

impl EnrolOutcome {
    /// Deletes the file that was enrolled, or warns that it is still there.
    ///
    /// # Errors
    /// [`EnrolRefusal::Delete`].
    pub fn settle(&mut self, file: &Path, delete: bool) -> Result<(), EnrolRefusal> {
        if delete {
            return std::fs::remove_file(file)
                .map_err(|reason| EnrolRefusal::Delete { path: file.to_owned(), reason });
        }
        let file = file.display();
        self.warnings.push(format!("{file} still holds the private key: delete it (--remove does)"));
        Ok(())
    }

    /// For scripts.
    #[must_use]
    pub fn report(&self) -> EnrolReport<'_> {
        let Enrolled { identity, folder } = &self.enrolled;
        let Identity { name, fleet, role, generation, routers, .. } = identity;
        EnrolReport {
            name,
            fleet,
            role: *role,
            generation: *generation,
            expires: humantime::format_rfc3339_seconds(self.expires).to_string(),
            routers,
            folder: folder.display().to_string(),
            warnings: &self.warnings,
        }
    }

    /// What it is, in one sentence.
    #[must_use]
    pub fn text(&self) -> String {
        let Enrolled { identity, folder } = &self.enrolled;
        let Identity { name, role, fleet, generation, routers, .. } = identity;
        format!(
            "{name}, {role} of fleet {fleet}: {}\ncertificate {generation} until {}, router {}, in {}",
            role.allows(),
            self.day(),
            routers.join(", "),
            folder.display()
        )
    }

    /// The day on which it ends.
    #[must_use]
    pub fn day(&self) -> String {
        humantime::format_rfc3339_seconds(self.expires).to_string().chars().take(10).collect()
    }

    /// Days that are left.
    #[must_use]
    pub fn days_left(&self, now: SystemTime) -> u64 {
        self.expires.duration_since(now).unwrap_or(Duration::ZERO).as_secs() / (24 * 3600)
    }
}
