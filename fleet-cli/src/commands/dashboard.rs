//! `dashboard`: the fleet in a browser.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::recording::playback_worker::PlaybackWorker;
use clap::Args;
use serde::Serialize;
use std::net::{IpAddr, SocketAddr};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::MissedTickBehavior;
use xtb_client::client::Client;
use xtb_client::scene::live::{Live, Wanted};
use xtb_client::subscription::Subscriptions;
use xtb_client::{Error, Result};
use xtb_dashboard::{Origin, Running, Settings, Shown};

const DASHBOARD_HELP: &str = "\
Any address other than 127.0.0.1 needs a token: everyone with access can drive robots. The connection is not \
encrypted; to encrypt it, use a proxy with TLS (--allow-origin gives its address).

Examples:
  fleet-cli dashboard
  fleet-cli dashboard --listen 0.0.0.0:8080 --token \"$(openssl rand -hex 16)\"
  fleet-cli dashboard --allow-origin https://fleet.example";

/// Arguments of `dashboard`.
#[derive(Debug, Clone, Args)]
#[command(after_help = DASHBOARD_HELP)]
pub struct DashboardArgs {
    /// Address to listen on; port 0 picks a free port.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080", value_parser = address)]
    pub listen: SocketAddr,
    /// Access token (at least 16 characters). Safer in the environment, where other users cannot see it.
    #[arg(long, env = "XTB_DASHBOARD_TOKEN", value_name = "TOKEN", hide_env_values = true)]
    pub token: Option<String>,
    /// View only: no page can send commands.
    #[arg(long)]
    pub read_only: bool,
    /// Address of the page as browsers see it, such as behind a proxy; for several, repeat it.
    #[arg(long, value_name = "URL")]
    pub allow_origin: Vec<Origin>,
    /// Address of a proxy on another machine: the limit on connections per address does not apply to it; for
    /// several, repeat it.
    #[arg(long, value_name = "IP")]
    pub proxy: Vec<IpAddr>,
    /// Maximum frames per second.
    #[arg(long, value_name = "HZ", default_value_t = HZ, value_parser = rate)]
    pub hz: f64,
    /// Also serve the live scene for the Foxglove app [default: 127.0.0.1:8765].
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8765", value_parser = address)]
    pub foxglove: Option<SocketAddr>,
}

/// Times a second that a page gets a frame, if nobody says otherwise.
const HZ: f64 = 20.0;

impl DashboardArgs {
    /// Everything as it is by default, but for the address.
    #[must_use]
    pub fn at(listen: SocketAddr) -> Self {
        let (allow_origin, proxy) = (Vec::new(), Vec::new());
        Self { listen, token: None, read_only: false, allow_origin, proxy, hz: HZ, foxglove: None }
    }
}

pub(super) fn address(text: &str) -> std::result::Result<SocketAddr, String> {
    let numbers = text.replacen("localhost:", "127.0.0.1:", 1);
    numbers.parse().map_err(|_| "expected IP:PORT, such as 127.0.0.1:8080 or 0.0.0.0:8080".to_owned())
}

/// Driving by hand needs a picture that is not older than 300 ms.
fn rate(text: &str) -> std::result::Result<f64, String> {
    crate::values::number(text, 5.0, 20.0, "Hz")
}

#[cfg(feature = "foxglove")]
type Foxglove = xtb_dashboard::foxglove::Handle;
#[cfg(not(feature = "foxglove"))]
type Foxglove = std::convert::Infallible;

/// Frames a second of a recording at most.
const PLAYED_HZ: f64 = 20.0;
/// How soon after a page samples come.
const LOOK_EVERY: Duration = Duration::from_millis(200);

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
    let settings = settings(args);
    settings.check()?;
    let starting = async {
        let client = Client::open(&ctx.settings).await?;
        let live = Live::open(&client, Wanted::default()).await?;
        let shown = Shown { scene: Arc::clone(&live.scene), commands: Some(client.clone()) };
        let foxglove = foxglove(ctx, args, &live).await?;
        let running = Running::start(settings, shown).await?;
        Ok::<_, Error>((client, live, running, foxglove))
    };
    let (client, live, running, foxglove) = tokio::select! {
        started = starting => started?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    ready(ctx, &running, args.read_only)?;
    tokio::select! {
        () = &mut stop => {}
        () = sensors_for_pages(&client, &live, &running) => {}
    }
    running.stop().await;
    drop((live, foxglove));
    client.close().await;
    Ok(Exit::Done)
}

/// Robots send samples only while a page is there to show them.
async fn sensors_for_pages(client: &Client, live: &Live, running: &Running) {
    let mut look = tokio::time::interval(LOOK_EVERY);
    look.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut sources: Option<Subscriptions> = None;
    loop {
        look.tick().await;
        if running.pages() == 0 {
            sources = None;
        } else if sources.is_none() {
            let opened = live.sensors(client).await;
            sources = opened.inspect_err(|failure| tracing::warn!("{failure}")).ok();
        }
    }
}

/// Shows a recording that is played, until it is interrupted. Nothing can be commanded.
///
/// # Errors
/// A port that is taken, or an address that needs a token.
pub(crate) async fn played(ctx: &Context, playing: Arc<PlaybackWorker>, listen: SocketAddr) -> Result<Exit> {
    let stop = pin!(interrupted());
    let settings =
        Settings { token: None, read_only: true, hz: PLAYED_HZ, ..settings(&DashboardArgs::at(listen)) };
    let running = Running::start(settings, Shown { scene: playing.scene(), commands: None }).await?;
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
        proxies: args.proxy.clone(),
        hz: args.hz,
    }
}

fn ready(ctx: &Context, running: &Running, read_only: bool) -> Result<()> {
    let address = running.address().to_string();
    let ready =
        Ready { ready: true, url: running.url(), address, read_only, fleet: ctx.settings.fleet.as_str() };
    ctx.out.result(&ready, |ready| {
        let only = if ready.read_only { ", read only" } else { "" };
        format!("dashboard of fleet {} ready{only}: {}", ready.fleet, ready.url)
    })
}

/// The live scene for the Foxglove app, as long as what comes back is kept.
#[cfg(feature = "foxglove")]
async fn foxglove(ctx: &Context, args: &DashboardArgs, live: &Live) -> Result<Option<Foxglove>> {
    let Some(listen) = args.foxglove else { return Ok(None) };
    let serving = xtb_dashboard::foxglove::serve(Arc::clone(&live.scene), listen).await?;
    ctx.out.note(&format!("Foxglove opens ws://{}", serving.address()));
    Ok(Some(serving))
}

/// See above: it is not built in.
#[cfg(not(feature = "foxglove"))]
async fn foxglove(_: &Context, args: &DashboardArgs, _: &Live) -> Result<Option<Foxglove>> {
    match args.foxglove {
        None => Ok(None),
        Some(_) => {
            Err(Error::new(xtb_client::ErrorKind::Invalid, "this fleet-cli was built without Foxglove")
                .hint("build it with `cargo build --release -p fleet-cli --features foxglove`"))
        }
    }
}
