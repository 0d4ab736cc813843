//! `map serve`: publishes a map to the fleet until Ctrl-C.

use crate::commands::map::ResolutionArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::map_file;
use crate::values::ros_domain;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;
use std::pin::pin;
use xtb_client::client::Client;
use xtb_client::{Error, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::MapHash;
use xtb_services::map_server::MapService;
use xtb_services::ros2::FleetNode;

const SERVE_HELP: &str = "\
Robots plan on the served map. Only one map can be served at a time. Operators change its zones and places on the
dashboard's page and with `fleet-cli place`; what they change is written to FILE, and who did so and why to
FILE.history.jsonl (`fleet-cli map history`).";

/// Arguments of `map serve`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SERVE_HELP)]
pub struct MapServeArgs {
    /// Map (map_server YAML) or world (TOML).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
    /// Also for ROS 2: /map and /estop, in this ROS_DOMAIN_ID [default: 0].
    #[arg(long, value_name = "DOMAIN", num_args = 0..=1, default_missing_value = "0", value_parser = ros_domain())]
    pub ros2: Option<u32>,
}

/// The one line that says it is ready.
#[derive(Debug, Serialize, JsonSchema)]
struct Ready<'a> {
    ready: bool,
    fleet: &'a Name,
    name: &'a str,
    hash: MapHash,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Ready<'_>>];

/// Serves until it is interrupted.
///
/// # Errors
/// A file that is no map, no router, or another map that is served already.
pub(super) async fn run(ctx: &Context, args: &MapServeArgs) -> Result<Exit> {
    let (map, kept) = map_file::to_serve(&ctx.out, &args.file, args.fine.resolution_m)?;
    let mut stop = pin!(interrupted());
    let starting = async {
        let client = Client::open(&ctx.settings).await?;
        let (bus, keys, kept) = (client.bus(), client.keys(), Some(kept));
        let service = MapService::start_kept(bus, keys, &map, kept, ctx.settings.timeout).await?;
        let ros2 = match args.ros2 {
            Some(domain) => Some(FleetNode::start(&client, domain, Some(&map)).await?),
            None => None,
        };
        Ok::<_, Error>((client, (service, ros2)))
    };
    let (client, services) = tokio::select! {
        started = starting => started?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    let ready = Ready { ready: true, fleet: &ctx.settings.fleet, name: map.name(), hash: map.hash() };
    ctx.out.result(&ready, |ready| {
        format!("map {} ({}) served to fleet {}; stop with Ctrl-C", ready.name, ready.hash, ready.fleet)
    })?;
    tokio::select! {
        () = &mut stop => {}
        error = client.refused() => return Err(error),
        () = map_file::follow(&args.file, args.fine.resolution_m, &services.0) => {}
    }
    drop(services);
    client.close().await;
    Ok(Exit::Done)
}
