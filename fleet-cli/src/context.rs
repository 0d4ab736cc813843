//! What every command needs to know: connection, fleet, own name, output.

use crate::cli::{DEFAULT_ENDPOINT, GlobalArgs};
use crate::config::FleetConfig;
use crate::error::{Failure, Kind, Result};
use crate::output::Output;
use std::time::Duration;
use xtb_protocol::messages::RosterEntry;
use xtb_protocol::{Name, Uuid};

/// Where clients look for a router's name unless `--connect` says it.
const ROUTERS: &str = "XTB_CONNECT";
/// The fleet that is meant when nobody names one.
const DEFAULT_FLEET: &str = "lab";

/// The options of one invocation, resolved: command line over environment over config over default.
#[derive(Debug, Clone)]
pub struct Context {
    /// Routers to connect to.
    pub connect: Vec<String>,
    /// Whether `--connect` stands on the command line (`sim` then runs no router of its own).
    pub connect_given: bool,
    /// The fleet.
    pub fleet: Name,
    /// This client's name.
    pub client: Name,
    /// For a router or an answer.
    pub timeout: Duration,
    /// The config's roster; empty = it has none.
    pub robots: Vec<RosterEntry>,
    /// Where and how to print.
    pub out: Output,
}

impl Context {
    /// Reads the config, and the environment for its place.
    ///
    /// # Errors
    /// [`Kind::Config`].
    pub fn new(global: &GlobalArgs, out: Output) -> Result<Self> {
        let config = FleetConfig::find(global.config.as_deref())?;
        let mut connect = global.connect.clone();
        if connect.is_empty() {
            connect = config.connect;
        }
        if connect.is_empty() {
            connect.push(DEFAULT_ENDPOINT.to_owned());
        }
        Ok(Self {
            connect,
            connect_given: global.connect_given,
            fleet: match global.fleet.clone().or(config.fleet) {
                Some(fleet) => fleet,
                None => own_name(DEFAULT_FLEET)?,
            },
            client: match global.client.clone() {
                Some(client) => client,
                None => own_name(&format!("cli-{}", &Uuid::new_v4().simple().to_string()[..6]))?,
            },
            timeout: global.timeout,
            robots: config.robots,
            out,
        })
    }

    /// `verb` runs a router of its own, and which one clients use is named in the environment or in the
    /// config: says that this is not used.
    #[must_use]
    pub fn unused_routers(&self, verb: &str) -> Option<String> {
        let set = std::env::var(ROUTERS).is_ok_and(|routers| !routers.is_empty());
        let from = match set {
            _ if self.connect_given => return None,
            true => ROUTERS,
            false if self.connect != [DEFAULT_ENDPOINT] => "the fleet config",
            false => return None,
        };
        let routers = self.connect.join(", ");
        Some(format!(
            "{verb} runs its own router: {routers} ({from}) is not used; only --connect changes that"
        ))
    }
}

fn own_name(text: &str) -> Result<Name> {
    Name::new(text).map_err(|error| Failure::new(Kind::Usage, error.to_string()))
}
