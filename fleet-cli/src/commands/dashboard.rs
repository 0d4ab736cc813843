//! `dashboard`: the fleet in a browser.

pub(crate) mod carry;
pub(crate) mod wheel;

use crate::cli::DashboardArgs;
use crate::client::Client;
use crate::context::Context;
use crate::dashboard::{Running, Settings, Shown};
use crate::error::{Exit, Failure, Kind, Result};
use crate::interrupt::interrupted;
use crate::scene::live::{Live, Wanted};
use serde::Serialize;
use std::pin::pin;
use std::sync::Arc;

/// The one line that says it is ready.
#[derive(Debug, Serialize)]
struct Ready<'a> {
    ready: bool,
    /// To be opened in a browser; with the token, if there is one.
    url: String,
    /// Such as `127.0.0.1:8080`.
    address: String,
    read_only: bool,
    fleet: &'a str,
}

/// Serves the page until it is interrupted.
///
/// # Errors
/// No router, a port that is taken, or an address that needs a token.
pub async fn run(ctx: &Context, args: &DashboardArgs) -> Result<Exit> {
    let mut stop = pin!(interrupted());
    let starting = async {
        foxglove(args)?;
        let client = Client::open(ctx).await?;
        let live = Live::open(&client, Wanted { sensors: true, truth: false }).await?;
        let shown = Shown {
            scene: Arc::clone(&live.scene),
            commands: Some((ctx.clone(), client.clone())),
            rewinds: Arc::new(|| 0),
        };
        let running = Running::start(settings(args), shown).await?;
        Ok::<_, Failure>((client, live, running))
    };
    let (client, live, running) = tokio::select! {
        started = starting => started?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    ready(ctx, &running, args.read_only)?;
    stop.await;
    running.stop().await;
    drop(live);
    client.close().await;
    Ok(Exit::Done)
}

/// Shows a scene that somebody else keeps up to date, such as a recording that is played, until it is
/// interrupted. Nothing can be commanded.
///
/// # Errors
/// A port that is taken, or an address that needs a token.
pub async fn show(ctx: &Context, args: &DashboardArgs, shown: Shown) -> Result<Exit> {
    let stop = pin!(interrupted());
    let running = Running::start(settings(args), Shown { commands: None, ..shown }).await?;
    ready(ctx, &running, true)?;
    stop.await;
    running.stop().await;
    Ok(Exit::Done)
}

fn settings(args: &DashboardArgs) -> Settings {
    Settings {
        listen: args.listen,
        token: args.token.clone().filter(|token| !token.is_empty()),
        read_only: args.read_only,
        allow_origins: args.allow_origin.clone(),
        hz: args.hz,
    }
}

fn ready(ctx: &Context, running: &Running, read_only: bool) -> Result<()> {
    let address = running.address().to_string();
    let ready = Ready { ready: true, url: running.url(), address, read_only, fleet: ctx.fleet.as_str() };
    ctx.out.result(&ready, |ready| {
        let only = if ready.read_only { ", read only" } else { "" };
        format!("dashboard of fleet {} ready{only}: {}", ready.fleet, ready.url)
    })
}

fn foxglove(args: &DashboardArgs) -> Result<()> {
    match args.foxglove {
        None => Ok(()),
        Some(_) => Err(Failure::new(Kind::Usage, "this fleet-cli was built without Foxglove")
            .hint("`cargo build --release -p fleet-cli --features foxglove` builds it in")),
    }
}
