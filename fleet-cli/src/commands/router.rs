//! `router`: an embedded Zenoh router, the whole infrastructure that a small lab needs; several form a mesh.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use clap::Args;
use serde::Serialize;
use std::pin::pin;
use std::time::Duration;
use xtb_bus::Bus;
use xtb_client::DEFAULT_ENDPOINT;
use xtb_client::Result;
use xtb_services::router;

const ROUTER_HELP: &str = "\
With --connect it forms a mesh with other routers: robots and clients of all of them are one fleet. Each pair of \
routers needs one of the two to connect. A router that is not there is tried again until it is. XTB_CONNECT and \
the fleet config are not used.

Example, on the second of two computers: fleet-cli router --listen tcp/0.0.0.0:7447 --connect tcp/10.0.0.1:7447";

/// Between two looks at the links to other routers.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Arguments of `router`.
#[derive(Debug, Clone, Args)]
#[command(after_help = ROUTER_HELP)]
pub struct RouterArgs {
    /// Endpoint to listen on; port 0 picks a free port.
    #[arg(long, value_name = "ENDPOINT", default_value = DEFAULT_ENDPOINT)]
    pub listen: String,
}

/// The one line that says it is ready.
#[derive(Debug, Serialize)]
struct Ready<'a> {
    ready: bool,
    router: &'a str,
    /// Routers that it keeps a link to, or tries to.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    connect: &'a [String],
}

/// Runs until it is interrupted.
///
/// # Errors
/// A port that is taken, or an endpoint that is none.
pub async fn run(ctx: &Context, args: &RouterArgs) -> Result<Exit> {
    // Not those of the environment or the config: they say where clients of this computer find a router.
    let connect = if ctx.connect_given { ctx.settings.connect.as_slice() } else { &[] };
    let mut stop = pin!(interrupted());
    let (bus, endpoint) = tokio::select! {
        opened = router::open(&args.listen, connect) => opened?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    let ready = Ready { ready: true, router: &endpoint, connect };
    ctx.out.result(&ready, |Ready { router, connect, .. }| match connect {
        [] => format!("router ready on {router}"),
        connect => format!("router ready on {router}, in a mesh with {}", connect.join(", ")),
    })?;
    tokio::select! {
        () = &mut stop => {}
        () = tell_links(ctx, &bus) => {}
    }
    bus.close().await;
    Ok(Exit::Done)
}

/// Notes each change of the number of routers that a link stands to; does not end.
async fn tell_links(ctx: &Context, bus: &Bus) {
    let mut look = tokio::time::interval(LOOK_EVERY);
    let mut told = 0;
    loop {
        look.tick().await;
        let linked = bus.linked_routers().await;
        if linked != told {
            told = linked;
            let routers = if linked == 1 { "router" } else { "routers" };
            ctx.out.note(&format!("linked to {linked} other {routers}"));
        }
    }
}
