//! `traffic serve`: leads the robots with planned goals past each other, until Ctrl-C.

use crate::commands::map::ResolutionArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::map_file;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;
use std::pin::pin;
use xtb_client::client::Client;
use xtb_client::map_source;
use xtb_client::{Action, Error, ErrorKind, Result};
use xtb_nav::Map;
use xtb_protocol::Name;
use xtb_protocol::messages::MapHash;
use xtb_services::map_server::MapService;
use xtb_services::traffic::TrafficService;

const SERVE_HELP: &str = "\
Robots with planned goals (`goto` on a robot with a map) get their paths from traffic control. Each drives \
only as far as it has clearance, in an order without conflicts. Without traffic control each robot plans for \
itself.";

/// Arguments of `traffic serve`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SERVE_HELP)]
pub struct TrafficServeArgs {
    /// Map (map_server YAML) or world (TOML), also served to the fleet [default: the fleet's map].
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}

/// The one line that says it is ready.
#[derive(Debug, Serialize, JsonSchema)]
struct Ready<'a> {
    ready: bool,
    fleet: &'a Name,
    map: &'a str,
    hash: MapHash,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Ready<'_>>];

/// Serves until it is interrupted.
///
/// # Errors
/// No map, no router, or traffic control that runs already.
pub(super) async fn run(ctx: &Context, args: &TrafficServeArgs) -> Result<Exit> {
    if args.map.is_some() {
        ctx.settings.may(Action::ServeMap)?;
    }
    let load = |file| map_file::load(&ctx.out, file, args.fine.resolution_m);
    let own = args.map.as_deref().map(load).transpose()?;
    let mut stop = pin!(interrupted());
    let starting = async {
        let client = Client::open(&ctx.settings).await?;
        let (map, maps) = match own {
            Some(map) => {
                let maps = MapService::start(client.bus(), client.keys(), &map, ctx.settings.timeout).await?;
                (map, Some(maps))
            }
            None => (the_fleets(ctx, &client).await?, None),
        };
        let service = TrafficService::start(&client, &map, ctx.settings.timeout).await?;
        Ok::<_, Error>((client, map, maps, service))
    };
    let (client, map, maps, service) = tokio::select! {
        started = starting => started?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    let ready = Ready { ready: true, fleet: &ctx.settings.fleet, map: map.name(), hash: map.hash() };
    ctx.out.result(&ready, |ready| {
        format!(
            "traffic control of fleet {} on map {} ({}); stop with Ctrl-C: robots then stop at the end of \
             their clearance, and continue by themselves after 10 s",
            ready.fleet, ready.map, ready.hash
        )
    })?;
    tokio::select! {
        () = &mut stop => {}
        error = client.refused() => return Err(error),
    }
    drop((service, maps));
    client.close().await;
    Ok(Exit::Done)
}

async fn the_fleets(ctx: &Context, client: &Client) -> Result<Map> {
    let served = map_source::served(client.bus(), client.keys(), ctx.settings.timeout).await?;
    let Some(message) = served.first() else {
        return Err(Error::new(ErrorKind::Config, "no map is served to this fleet").hint(
            "serve one with `fleet-cli traffic serve --map FILE`; `fleet-cli sim` serves its world's \
                   map",
        ));
    };
    Map::try_from(message).map_err(|error| Error::new(ErrorKind::Config, error.to_string()))
}
