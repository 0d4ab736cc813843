//! `router`: an embedded Zenoh router, the whole infrastructure that a small lab needs.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use clap::Args;
use serde::Serialize;
use std::pin::pin;
use xtb_client::DEFAULT_ENDPOINT;
use xtb_client::Result;
use xtb_services::router;

/// Arguments of `router`.
#[derive(Debug, Clone, Args)]
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
}

/// Runs until it is interrupted.
///
/// # Errors
/// A port that is taken, or an endpoint that is none.
pub async fn run(ctx: &Context, args: &RouterArgs) -> Result<Exit> {
    let mut stop = pin!(interrupted());
    let (bus, endpoint) = tokio::select! {
        opened = router::open(&args.listen) => opened?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    let ready = Ready { ready: true, router: &endpoint };
    ctx.out.result(&ready, |ready| format!("router ready on {}", ready.router))?;
    stop.await;
    bus.close().await;
    Ok(Exit::Done)
}
