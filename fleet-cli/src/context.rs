//! What every command needs to know: connection, fleet, own name, output.

mod identity;

pub(crate) use identity::session_name;

use crate::args::GlobalArgs;
use crate::config::{AlertsConfig, FleetConfig, HistoryConfig};
use crate::output::Output;
use robot_agent::files;
use std::path::Path;
use xtb_client::{DEFAULT_ENDPOINT, DEFAULT_FLEET, Settings};
use xtb_client::{Error, ErrorKind, Result};
use xtb_dispatch::HomeRules;
use xtb_protocol::Name;
use xtb_protocol::keys::NameError;
use xtb_protocol::messages::MAX_PERSON;

/// Where clients look for a router's name unless `--connect` says it.
const ROUTERS: &str = "XTB_CONNECT";

/// What becomes of this computer's identity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Uses {
    /// It is used, if there is one.
    Always,
    /// It is used, but one that is out of date is no error: the verb opens no session, or finds that out itself.
    Unchecked,
    /// It is used if the command line names it, or a router with TLS: the verb runs a router of its own otherwise.
    IfAsked,
    /// It is not used: the verb opens no session, or has an identity of its own.
    Nothing,
}

/// The options of one invocation, resolved: command line over environment over identity over config
/// over default.
#[derive(Debug, Clone)]
pub struct Context {
    /// Routers, fleet, own name, timeout and roster.
    pub settings: Settings,
    /// Whether `--connect` stands on the command line (`sim` then runs no router of its own).
    pub connect_given: bool,
    /// Where robots go by themselves, as the config says; `None` = it does not.
    pub home: Option<HomeRules>,
    /// What a dispatcher of this fleet tells people, from the config.
    pub observer: (AlertsConfig, HistoryConfig),
    /// Where and how to print.
    pub out: Output,
}

impl Context {
    /// Reads the config and the identity, and the environment for their places.
    ///
    /// # Errors
    /// [`ErrorKind::Config`]; [`ErrorKind::Invalid`] for options that the identity excludes.
    pub fn new(global: &GlobalArgs, uses: Uses, out: Output) -> Result<Self> {
        let config = FleetConfig::find(global.config.as_deref())?;
        let enrolled = identity::find(global, uses)?;
        let identity = enrolled.as_ref().map(|enrolled| &enrolled.identity);
        let connect = [&global.connect, identity.map_or(&config.connect, |identity| &identity.routers)];
        let mut connect = connect.into_iter().find(|it| !it.is_empty()).cloned().unwrap_or_default();
        if connect.is_empty() {
            connect.push(DEFAULT_ENDPOINT.to_owned());
        }
        if uses != Uses::Nothing {
            identity::check_endpoints(&connect, identity)?;
        }
        let named = global.fleet.clone().or(config.fleet);
        let fleet = match (identity, named) {
            (Some(identity), named) => identity::check_fleet(identity, named.as_ref())?,
            (None, Some(fleet)) => fleet,
            (None, None) => Name::new(DEFAULT_FLEET).map_err(impossible)?,
        };
        let client = match (identity, global.client.clone()) {
            (Some(identity), Some(client)) => identity::check_client(identity, client)?,
            (None, Some(client)) => client,
            (identity, None) => session_name(identity)?,
        };
        let settings = Settings {
            connect,
            identity: enrolled,
            fleet,
            client,
            timeout: global.timeout,
            robots: config.robots,
            aliases: config.aliases,
        };
        let home = config.home.map(HomeRules::from);
        let observer = (config.alerts, config.history);
        Ok(Self { settings, connect_given: global.connect_given, home, observer, out })
    }

    /// When a dispatcher sends robots to docks: as the config says, or as usual if it is `wanted` on the command line.
    #[must_use]
    pub fn home_rules(&self, wanted: bool) -> Option<HomeRules> {
        self.home.clone().or_else(|| wanted.then(HomeRules::default))
    }

    /// Who uses this computer, such as `alice@desk`, as far as it says so; with an identity that says who it is.
    #[must_use]
    pub fn person(&self) -> Option<String> {
        let set = |name: &&str| std::env::var(name).ok().filter(|user| !user.is_empty());
        let user = ["USER", "LOGNAME"].iter().find_map(set).filter(|_| self.settings.identity.is_none())?;
        let host = files::text(Path::new("/proc/sys/kernel/hostname"), 256).unwrap_or_default();
        let person = format!("{user}@{}", if host.trim().is_empty() { "?" } else { host.trim() });
        Some(person).filter(|person| person.len() <= MAX_PERSON)
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
        let settings = client.settings().clone();
        Self { settings, connect_given: false, home: None, observer: Default::default(), out }
    }
}
