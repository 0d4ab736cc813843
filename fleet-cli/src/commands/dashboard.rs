//! `dashboard`: the fleet in a browser.

use crate::cli::DashboardArgs;
use crate::client::Client;
use crate::context::Context;
use crate::dashboard::Running;
use crate::error::{Exit, Result};
use crate::interrupt::interrupted;
use crate::scene::live::{Live, Wanted};
use serde::Serialize;
use std::pin::pin;
use std::sync::Arc;

/// The one line that says it is ready.
#[derive(Debug, Serialize)]
struct Ready {
    ready: bool,
    url: String,
}

/// Serves the page until it is interrupted.
///
/// # Errors
/// No router, or a port that is taken.
pub async fn run(ctx: &Context, args: &DashboardArgs) -> Result<Exit> {
    let mut stop = pin!(interrupted());
    let client = Client::open(ctx).await?;
    let live = Live::open(&client, Wanted { sensors: true, truth: false }).await?;
    let running = Running::start(&client, Arc::clone(&live.scene), args.listen, args.hz).await?;
    let ready = Ready { ready: true, url: format!("http://{}/", running.address()) };
    ctx.out.result(&ready, |ready| format!("dashboard ready on {}", ready.url))?;
    stop.as_mut().await;
    client.close().await;
    Ok(Exit::Done)
}
