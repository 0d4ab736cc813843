//! What is handed over: `NAME.xtbid`, or the folder of another router. It is there when the registry has it.

use super::{CA, Pki, ROUTER, files, write_router};
use std::fs;
use std::path::{Path, PathBuf};
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::{Identity, Registry, Role};

/// A file or folder that is about to be handed over.
#[derive(Debug)]
pub struct Delivery {
    path: PathBuf,
    identity: Identity,
    /// Written already, beside its place.
    new: Option<PathBuf>,
}

impl Delivery {
    /// Where that of this name goes.
    #[must_use]
    pub fn place(name: &xtb_protocol::Name, role: Role, out: Option<&Path>) -> PathBuf {
        let file = if role == Role::Router { name.to_string() } else { format!("{name}.xtbid") };
        out.map_or_else(|| PathBuf::from(&file), |folder| folder.join(&file))
    }

    /// Refuses to write over what is there.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`].
    pub fn is_free(path: &Path, force: bool) -> Result<()> {
        if !force && path.exists() {
            let message = format!("{} already exists", path.display());
            return Err(Error::new(ErrorKind::Failed, message).hint("--force overwrites it"));
        }
        Ok(())
    }

    /// Writes it beside its place, as far as that can be done before the registry has it.
    ///
    /// # Errors
    /// The system's words.
    pub fn prepare(identity: Identity, path: PathBuf) -> Result<Self> {
        let new = match identity.role {
            Role::Router => None,
            _ => {
                let text = identity.to_text();
                let text = text.map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))?;
                Some(xtb_bus::private_file::beside(&path, text.as_bytes()).map_err(files::failed(&path))?)
            }
        };
        Ok(Self { path, identity, new })
    }

    /// Writes the registry, then hands it over.
    ///
    /// # Errors
    /// The system's words.
    pub fn finish(self, pki: &Pki) -> Result<PathBuf> {
        let Self { path, identity, new } = self;
        if let Err(failure) = pki.save() {
            // The key of an identity that nobody knows.
            new.map(fs::remove_file);
            return Err(failure);
        }
        match new {
            Some(new) => fs::rename(new, &path).map_err(files::failed(&path))?,
            None => {
                files::private_folder(&path)?;
                write_router(&path.join(ROUTER), &identity.ca, &identity.certificate, &identity.key)?;
                files::private(&path.join(CA), identity.ca.as_bytes())?;
                files::private(&path.join(Registry::FILE), pki.registry_text()?.as_bytes())?;
            }
        }
        Ok(path)
    }
}
