//! How to reach a fleet, and as whom.

use crate::rights;
use std::collections::BTreeMap;
use std::time::Duration;
use xtb_bus::Enrolled;
use xtb_identity::Action;
use xtb_protocol::keys::NameError;
use xtb_protocol::messages::RosterEntry;
use xtb_protocol::{Name, Uuid};

/// Where a router of this computer listens.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";
/// The fleet that is meant when nobody names one.
pub const DEFAULT_FLEET: &str = "lab";
/// How long an answer is waited for unless something else is asked for.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(3);

/// How to reach a fleet, and as whom.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Routers to connect to, such as `tcp/192.168.1.10:7447`.
    pub connect: Vec<String>,
    /// The fleet.
    pub fleet: Name,
    /// Its identity; `None` = it uses a router without identities.
    pub identity: Option<Enrolled>,
    /// This client's name: robots show it as the holder of their lease.
    pub client: Name,
    /// For a router or an answer; longer on a slow link.
    pub timeout: Duration,
    /// Which robots should be there; empty = the fleet's simulator is asked.
    pub robots: Vec<RosterEntry>,
    /// What people here call some of them, for screens only: names stay what identifies a robot.
    pub aliases: BTreeMap<Name, String>,
}

impl Settings {
    /// A fleet at a router on this computer, as a client with a name of its own.
    ///
    /// # Errors
    /// `fleet` cannot stand in a key.
    pub fn new(fleet: &str) -> Result<Self, NameError> {
        Ok(Self {
            connect: vec![DEFAULT_ENDPOINT.to_owned()],
            fleet: Name::new(fleet)?,
            identity: None,
            client: unique_name("client")?,
            timeout: DEFAULT_TIMEOUT,
            robots: Vec::new(),
            aliases: BTreeMap::new(),
        })
    }

    /// Whether the role of its identity allows this; without an identity everything is. Asks nobody.
    ///
    /// # Errors
    /// [`ErrorKind::NotAllowed`](crate::ErrorKind::NotAllowed), with who can.
    pub fn may(&self, action: Action) -> crate::Result<()> {
        match &self.identity {
            Some(Enrolled { identity, .. }) => rights::check(&identity.name, identity.role, action),
            None => Ok(()),
        }
    }
}

/// `stem-3f9a1c`: a client's name that no other client has.
///
/// # Errors
/// `stem` cannot stand in a key.
pub fn unique_name(stem: &str) -> Result<Name, NameError> {
    Name::new(&format!("{stem}-{}", &Uuid::new_v4().simple().to_string()[..6]))
}
