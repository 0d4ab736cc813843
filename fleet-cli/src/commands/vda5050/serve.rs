//! `vda5050 serve`: orders of a master control become tasks of the dispatcher, until Ctrl-C.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use clap::{Args, ValueEnum};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;
use std::pin::pin;
use std::sync::atomic::Ordering::Relaxed;
use xtb_client::client::Client;
use xtb_client::{Error, ErrorKind, Result, Settings};
use xtb_protocol::Name;
use xtb_services::dispatch::store;
use xtb_services::vda5050::{Bridge, BridgeOptions, Broker, Login};
use xtb_vda5050::Protocol;
use xtb_vda5050::header::is_level;
use xtb_vda5050::operating::CLIENT;

const SERVE_HELP: &str = "\
Each robot gets a connection of its own to the broker, with a last will. Orders need a dispatcher (`dispatch serve` \
or `sim --dispatch`): the released nodes of an order are one of its tasks. Orders survive restarts of bridge, \
dispatcher and broker.

Example: fleet-cli vda5050 serve --mqtt mqtt://127.0.0.1:1883 --protocol 2.1";

/// Which version of VDA 5050.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Version {
    /// 2.0.0.
    #[value(name = "2.0")]
    V2_0,
    /// 2.1.0.
    #[value(name = "2.1")]
    V2_1,
    /// 3.0.0.
    #[value(name = "3.0")]
    V3_0,
}

/// Arguments of `vda5050 serve`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SERVE_HELP)]
pub struct Vda5050ServeArgs {
    /// Broker: mqtt://HOST[:PORT], or with TLS mqtts://HOST[:PORT].
    #[arg(long, value_name = "URL")]
    pub mqtt: String,
    /// User at the broker.
    #[arg(long, value_name = "USER")]
    pub mqtt_user: Option<String>,
    /// File whose first line is the password.
    #[arg(long, value_name = "FILE", requires = "mqtt_user")]
    pub mqtt_password_file: Option<PathBuf>,
    /// Certificate authorities of the broker, in PEM, for mqtts.
    #[arg(long, value_name = "FILE")]
    pub mqtt_ca: Option<PathBuf>,
    /// Version of VDA 5050.
    #[arg(long, value_name = "VERSION", default_value = "2.1")]
    pub protocol: Version,
    /// First level of the topics [default: uagv, with 3.0 vda5050].
    #[arg(long, value_name = "NAME", value_parser = level)]
    pub interface: Option<String>,
    /// Manufacturer in topics and messages.
    #[arg(long, value_name = "NAME", default_value = "xtb", value_parser = level)]
    pub manufacturer: String,
    /// Where orders are kept [default: vda5050/FLEET in $XDG_DATA_HOME/xtb or ~/.local/share/xtb].
    #[arg(long, value_name = "FOLDER")]
    pub state: Option<PathBuf>,
    /// Only these robots [default: all that are there].
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robots: Vec<Name>,
}

fn level(text: &str) -> std::result::Result<String, String> {
    let what = "1 to 64 letters, digits, _, -, . and :";
    if is_level(text) { Ok(text.to_owned()) } else { Err(format!("a level of a topic has {what}")) }
}

/// The one line that says it is ready.
#[derive(Debug, Serialize, JsonSchema)]
struct Ready<'a> {
    ready: bool,
    fleet: &'a Name,
    broker: String,
    version: &'static str,
    topics: String,
    state: String,
}

/// What it did, said at the end.
#[derive(Debug, Serialize, JsonSchema)]
struct Ended {
    connected: u64,
    received: u64,
    dropped: u64,
    published: u64,
    held_back: u64,
    asked: u64,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Ready<'_>>, line_of::<Ended>];

/// Serves until it is interrupted.
///
/// # Errors
/// No such broker, a folder that another bridge uses, or no router.
pub(super) async fn run(ctx: &Context, args: &Vda5050ServeArgs) -> Result<Exit> {
    let login = match &args.mqtt_user {
        Some(user) => Some(Login::read(user, args.mqtt_password_file.as_deref())?),
        None => None,
    };
    let broker = Broker::new(&args.mqtt, args.mqtt_ca.as_deref(), login)?;
    let protocol = match args.protocol {
        Version::V2_0 => Protocol::V2_0,
        Version::V2_1 => Protocol::V2_1,
        Version::V3_0 => Protocol::V3_0,
    };
    let options = BridgeOptions {
        broker,
        protocol,
        interface: args.interface.clone().unwrap_or_else(|| protocol.interface().to_owned()),
        manufacturer: args.manufacturer.clone(),
        folder: folder(args, &ctx.settings.fleet)?,
        robots: args.robots.clone(),
    };
    let settings = Settings { client: name(ctx)?, ..ctx.settings.clone() };
    let ready = Ready {
        ready: true,
        fleet: &settings.fleet,
        broker: options.broker.place(),
        version: protocol.version(),
        topics: format!("{}/{}/{}", options.interface, protocol.topic_level(), options.manufacturer),
        state: options.folder.display().to_string(),
    };
    let mut stop = pin!(interrupted());
    let starting = async {
        let client = Client::open(&settings).await?;
        let bridge = Bridge::start(&client, options).await?;
        Ok::<_, Error>((client, bridge))
    };
    let (client, bridge) = tokio::select! {
        started = starting => started?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    ctx.out.result(&ready, |Ready { fleet, broker, version, topics, state, .. }| {
        format!(
            "VDA 5050 {version} for fleet {fleet}, broker {broker}, topics {topics}/ROBOT/…, orders kept in {state}; \
             stop with Ctrl-C: robots finish what is released to them, the next `vda5050 serve` continues"
        )
    })?;
    let refused = tokio::select! {
        () = &mut stop => None,
        error = client.refused() => Some(error),
    };
    let counters = bridge.counters();
    let ended = Ended {
        connected: counters.connected.load(Relaxed),
        received: counters.received.load(Relaxed),
        dropped: counters.dropped.load(Relaxed),
        published: counters.published.load(Relaxed),
        held_back: counters.held_back.load(Relaxed),
        asked: counters.asked.load(Relaxed),
    };
    bridge.stop().await;
    client.close().await;
    if let Some(error) = refused {
        return Err(error);
    }
    ctx.out.result(&ended, |Ended { connected, received, dropped, published, held_back, asked }| {
        format!(
            "ended: {connected} connections, {received} messages received, {dropped} dropped, {published} published, \
             {held_back} held back, {asked} requests"
        )
    })?;
    Ok(Exit::Done)
}

/// The same at each start, so that the dispatcher knows submissions again.
fn name(ctx: &Context) -> Result<Name> {
    let name = match &ctx.settings.identity {
        Some(enrolled) => format!("{}-{CLIENT}", enrolled.identity.name),
        None => CLIENT.to_owned(),
    };
    Name::new(&name).map_err(|error| Error::new(ErrorKind::Config, error.to_string()))
}

fn folder(args: &Vda5050ServeArgs, fleet: &Name) -> Result<PathBuf> {
    if let Some(folder) = &args.state {
        return Ok(folder.clone());
    }
    let ledger = store::path(None, fleet).map_err(|error| error.hint("give a folder with --state"))?;
    Ok(ledger.with_file_name("vda5050").join(fleet.as_str()))
}
