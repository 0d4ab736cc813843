//! `dashboard`: the fleet in a browser.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::pki;
use crate::recording::playback_worker::PlaybackWorker;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::MissedTickBehavior;
use xtb_bus::Enrolled;
use xtb_client::client::Client;
use xtb_client::scene::live::{Live, Wanted};
use xtb_client::subscription::Subscriptions;
use xtb_client::{Error, ErrorKind, Result};
use xtb_dashboard::{Origin, Running, Secure, ServerSettings, Shown};
use xtb_identity::Registry;

const DASHBOARD_HELP: &str = "\
On 127.0.0.1 everyone on this computer can open the page. On any other address it uses TLS with the certificate of \
the dashboard's identity, and people sign in with their own token (`fleet-cli pki token NAME`) or with a client \
certificate of the fleet; what they may do follows from their role, and what they do carries their name. Without an \
identity such an address is refused, unless --insecure is given with one token for all.

Examples:
  fleet-cli dashboard
  fleet-cli pki add-service dashboard --address 10.0.0.1
  fleet-cli enrol dashboard.xtbid --to dashboard-identity
  fleet-cli --identity dashboard-identity dashboard --listen 0.0.0.0:8443
  fleet-cli dashboard --allow-origin https://fleet.example
  fleet-cli dashboard --listen 0.0.0.0:8080 --insecure --token \"$(openssl rand -hex 16)\"";

/// Arguments of `dashboard`.
#[derive(Debug, Clone, Args)]
#[command(after_help = DASHBOARD_HELP)]
pub struct DashboardArgs {
    /// Address to listen on; port 0 picks a free port.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080", value_parser = address)]
    pub listen: SocketAddr,
    /// Use TLS on 127.0.0.1 too, and let people sign in there.
    #[arg(long, conflicts_with_all = ["insecure", "token"])]
    pub tls: bool,
    /// The fleet's PKI, whose identities.toml says who may sign in [default: ~/.config/xtb/pki].
    #[arg(long, env = "XTB_PKI", value_name = "DIR")]
    pub pki: Option<PathBuf>,
    /// Serve other computers without TLS: whoever reads along can drive every robot.
    #[arg(long)]
    pub insecure: bool,
    /// Without TLS: access token for everybody (at least 16 characters). Safer in the environment, where other users
    /// cannot see it.
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
    #[cfg_attr(not(feature = "foxglove"), arg(hide = true))]
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
        let (token, pki, foxglove) = (None, None, None);
        let (tls, insecure, read_only) = (false, false, false);
        Self { listen, tls, pki, insecure, token, read_only, allow_origin, proxy, hz: HZ, foxglove }
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
#[derive(Debug, Serialize, JsonSchema)]
struct Ready<'a> {
    ready: bool,
    /// To be opened in a browser; with the token for everybody, if there is one.
    url: String,
    /// Such as `127.0.0.1:8080`.
    address: String,
    read_only: bool,
    fleet: &'a str,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Ready<'_>>];

/// Serves the page until it is interrupted.
///
/// # Errors
/// No router, a port that is taken, or an address that others can reach without TLS.
pub async fn run(ctx: &Context, args: &DashboardArgs) -> Result<Exit> {
    let mut stop = pin!(interrupted());
    let settings = ServerSettings { secure: secure(ctx, args)?, ..settings(args) };
    settings.check()?;
    if settings.secure.is_none() && !args.listen.ip().is_loopback() {
        let text = "no TLS (--insecure): whoever reads along on this network gets the token, and can drive every robot";
        ctx.out.note(&format!("warning: {text}"));
    }
    let starting = async {
        let client = Client::open(&ctx.settings).await?;
        let live = Live::open(&client, Wanted::default()).await?;
        let shown = Shown { scene: Arc::clone(&live.scene), commands: Some(client.clone()), playback: None };
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
    let settings = ServerSettings {
        token: None,
        read_only: true,
        hz: PLAYED_HZ,
        ..settings(&DashboardArgs::at(listen))
    };
    let shown = Shown { scene: playing.scene(), commands: None, playback: Some(playing) };
    let running = Running::start(settings, shown).await?;
    ready(ctx, &running, true)?;
    stop.await;
    running.stop().await;
    Ok(Exit::Done)
}

/// What TLS needs, if it is used: the dashboard's identity, and the registry of people.
fn secure(ctx: &Context, args: &DashboardArgs) -> Result<Option<Secure>> {
    if args.insecure || (!args.tls && args.listen.ip().is_loopback()) {
        return Ok(None);
    }
    let hint = "`fleet-cli pki add-service dashboard --address HOST` makes an identity with a certificate for the \
                page; `fleet-cli enrol dashboard.xtbid --to DIR`, then `fleet-cli --identity DIR dashboard`";
    match &ctx.settings.identity {
        Some(Enrolled { folder, identity }) if identity.page.is_some() => {
            let registry = pki::place(args.pki.as_deref())?.join(Registry::FILE);
            Ok(Some(Secure { identity: folder.clone(), registry }))
        }
        Some(Enrolled { folder, identity }) => {
            let text = format!("{} in {} has no certificate for the page", identity.name, folder.display());
            Err(Error::new(ErrorKind::Config, text).hint(hint))
        }
        None if args.tls => Err(Error::new(ErrorKind::Config, "TLS needs an identity").hint(hint)),
        // Refused with the rest of the settings, which know why.
        None => Ok(None),
    }
}

fn settings(args: &DashboardArgs) -> ServerSettings {
    ServerSettings {
        listen: args.listen,
        secure: None,
        token: args.token.clone().filter(|token| !token.is_empty()),
        insecure: args.insecure,
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
        Some(_) => Err(Error::new(ErrorKind::Invalid, "this fleet-cli was built without Foxglove")
            .hint("build it with `cargo build --release -p fleet-cli --features foxglove`")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Output;
    use xtb_identity::{Identity, Page, Role};

    fn ctx(identity: Option<Identity>) -> Context {
        let mut settings = xtb_client::Settings::new("lab").unwrap();
        settings.identity =
            identity.map(|identity| Enrolled { folder: "/etc/xtb/dashboard".into(), identity });
        let out = Output { json: true, colors: false };
        Context { settings, connect_given: false, home: None, observer: Default::default(), out }
    }

    fn identity(name: &str, role: Role, page: Option<Page>) -> Identity {
        let own = format!("{name}.1").parse().unwrap();
        let (fleet, none) = (xtb_protocol::Name::new("lab").unwrap(), String::new);
        let mut identity = Identity::new(fleet, own, role, Vec::new(), none(), none(), none());
        identity.page = page;
        identity
    }

    fn args(listen: &str, pki: Option<&str>) -> DashboardArgs {
        DashboardArgs { pki: pki.map(PathBuf::from), ..DashboardArgs::at(listen.parse().unwrap()) }
    }

    #[test]
    fn tls_is_for_others_and_for_who_asks_for_it() {
        let page = Page { certificate: String::new(), key: String::new() };
        let dashboard = ctx(Some(identity("dashboard", Role::Dashboard, Some(page))));
        let found = secure(&dashboard, &args("0.0.0.0:8443", Some("/pki"))).unwrap().unwrap();
        let (folder, registry) = (found.identity.to_str(), found.registry.to_str());
        assert_eq!((folder, registry), (Some("/etc/xtb/dashboard"), Some("/pki/identities.toml")));
        assert_eq!(secure(&dashboard, &args("127.0.0.1:8080", Some("/pki"))).unwrap(), None);
        let asked = DashboardArgs { tls: true, ..args("127.0.0.1:8080", Some("/pki")) };
        assert!(secure(&dashboard, &asked).unwrap().is_some());
        let insecure = DashboardArgs { insecure: true, ..args("0.0.0.0:8080", None) };
        assert_eq!(secure(&dashboard, &insecure).unwrap(), None);

        let alice = ctx(Some(identity("alice", Role::Operator, None)));
        let failure = secure(&alice, &args("0.0.0.0:8443", None)).unwrap_err();
        assert_eq!(failure.message, "alice in /etc/xtb/dashboard has no certificate for the page");
        assert!(failure.hint.contains("pki add-service dashboard"), "{}", failure.hint);
        assert!(secure(&ctx(None), &asked).is_err());
        assert_eq!(secure(&ctx(None), &args("0.0.0.0:8443", None)).unwrap(), None, "refused by the settings");
    }
}
