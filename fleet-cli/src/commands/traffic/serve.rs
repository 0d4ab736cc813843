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
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::watch;
use xtb_client::client::Client;
use xtb_client::map_source::{self, MapSource};
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

/// The presence of a traffic control that has ended is gone within this.
const GONE_WITHIN: Duration = Duration::from_secs(3);
const LOOK_AGAIN: Duration = Duration::from_millis(50);

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
    let load = |file| map_file::to_serve(&ctx.out, file, args.fine.resolution_m);
    let own = args.map.as_deref().map(load).transpose()?;
    let mut stop = pin!(interrupted());
    let starting = async {
        let client = Client::open(&ctx.settings).await?;
        let (map, maps) = match own {
            Some((map, kept)) => {
                let (bus, keys, kept) = (client.bus(), client.keys(), Some(kept));
                let maps = MapService::start_kept(bus, keys, &map, kept, ctx.settings.timeout).await?;
                (map, Some(maps))
            }
            None => (the_fleets(ctx, &client).await?, None),
        };
        let news = match &maps {
            Some(maps) => News::Own(maps.maps()),
            None => News::Fleets(MapSource::open(client.bus(), client.keys()).await?),
        };
        let service = TrafficService::start(&client, &map, ctx.settings.timeout).await?;
        Ok::<_, Error>((client, map, (maps, news), service))
    };
    let (client, map, (maps, news), service) = tokio::select! {
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
        () = map_file::follow_if_any(args.map.as_deref(), args.fine.resolution_m, maps.as_ref()) => {}
        failure = follow(ctx, &client, map, news, service) => return Err(failure),
    }
    drop(maps);
    client.close().await;
    Ok(Exit::Done)
}

/// Versions of the map that follow.
enum News {
    /// This program serves it.
    Own(watch::Receiver<Arc<Map>>),
    /// Another one does.
    Fleets(MapSource),
}

impl News {
    /// The next map with another floor or other zones than this one.
    async fn after(&mut self, map: &Map) -> Map {
        loop {
            let next = match self {
                Self::Own(maps) => match maps.changed().await {
                    Ok(()) => Some(maps.borrow_and_update().as_ref().clone()),
                    Err(_) => std::future::pending().await,
                },
                Self::Fleets(maps) => match maps.next().await {
                    same if same.hash == map.hash() => None,
                    next => Map::try_from(next.as_ref())
                        .inspect_err(|error| tracing::warn!("the fleet's map: {error}"))
                        .ok(),
                },
            };
            if let Some(next) = next.filter(|next| next.hash() != map.hash()) {
                return next;
            }
        }
    }
}

/// Leads on each version of the map, one after the other; ends if it cannot begin anew.
async fn follow(
    ctx: &Context,
    client: &Client,
    mut map: Map,
    mut news: News,
    mut service: TrafficService,
) -> Error {
    loop {
        map = news.after(&map).await;
        drop(service);
        tracing::info!("traffic control goes on with the map {} ({})", map.name(), map.hash());
        // Its own presence is seen for a moment yet.
        let began = Instant::now();
        service = loop {
            match TrafficService::start(client, &map, ctx.settings.timeout).await {
                Ok(service) => break service,
                Err(failure) if began.elapsed() > GONE_WITHIN => return failure,
                Err(_) => tokio::time::sleep(LOOK_AGAIN).await,
            }
        };
    }
}

async fn the_fleets(ctx: &Context, client: &Client) -> Result<Map> {
    let served = map_source::served(client.bus(), client.keys(), ctx.settings.timeout).await?;
    let Some(message) = served.first() else {
        return Err(map_source::no_map().hint(
            "serve one with `fleet-cli traffic serve --map FILE`; `fleet-cli sim` serves its world's \
                   map",
        ));
    };
    Map::try_from(message).map_err(|error| Error::new(ErrorKind::Config, error.to_string()))
}
