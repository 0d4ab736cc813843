//! What every command needs to know: connection, fleet, own name, output.

use crate::args::GlobalArgs;
use crate::config::FleetConfig;
use crate::output::Output;
use xtb_client::{DEFAULT_ENDPOINT, DEFAULT_FLEET, Settings, unique_name};
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::keys::NameError;

/// Where clients look for a router's name unless `--connect` says it.
const ROUTERS: &str = "XTB_CONNECT";

/// The options of one invocation, resolved: command line over environment over config over default.
#[derive(Debug, Clone)]
pub struct Context {
    /// Routers, fleet, own name, timeout and roster.
    pub settings: Settings,
    /// Whether `--connect` stands on the command line (`sim` then runs no router of its own).
    pub connect_given: bool,
    /// Where and how to print.
    pub out: Output,
}

impl Context {
    /// Reads the config, and the environment for its place.
    ///
    /// # Errors
    /// [`ErrorKind::Config`].
    pub fn new(global: &GlobalArgs, out: Output) -> Result<Self> {
        let config = FleetConfig::find(global.config.as_deref())?;
        let mut connect = global.connect.clone();
        if connect.is_empty() {
            connect = config.connect;
        }
        if connect.is_empty() {
            connect.push(DEFAULT_ENDPOINT.to_owned());
        }
        let settings = Settings {
            connect,
            identity: None,
            fleet: match global.fleet.clone().or(config.fleet) {
                Some(fleet) => fleet,
                None => Name::new(DEFAULT_FLEET).map_err(impossible)?,
            },
            client: match global.client.clone() {
                Some(client) => client,
                None => unique_name("cli").map_err(impossible)?,
            },
            timeout: global.timeout,
            robots: config.robots,
        };
        Ok(Self { settings, connect_given: global.connect_given, out })
    }

    /// The same with other settings.
    #[must_use]
    pub fn with(&self, change: impl FnOnce(&mut Settings)) -> Self {
        let mut own = self.clone();
        change(&mut own.settings);
        own
    }

    /// `verb` runs a router of its own, and which one clients use is named in the environment or in the
    /// config: says that this is not used.
    #[must_use]
    pub fn unused_routers(&self, verb: &str) -> Option<String> {
        let set = std::env::var(ROUTERS).is_ok_and(|routers| !routers.is_empty());
        let from = match set {
            _ if self.connect_given => return None,
            true => ROUTERS,
            false if self.settings.connect != [DEFAULT_ENDPOINT] => "the fleet config",
            false => return None,
        };
        let routers = self.settings.connect.join(", ");
        Some(format!(
            "{verb} runs its own router and ignores {routers} ({from}); to use that router, give --connect"
        ))
    }
}

fn impossible(error: NameError) -> Error {
    Error::new(ErrorKind::Invalid, error.to_string())
}

#[cfg(test)]
impl Context {
    /// As the client was opened, printing JSON.
    pub(crate) fn of(client: &xtb_client::Client) -> Self {
        let out = Output { json: true, colors: false };
        Self { settings: client.settings().clone(), connect_given: false, out }
    }
}
