//! `router`: an embedded Zenoh router, the whole infrastructure that a small lab needs; several form a mesh.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::pki;
use crate::values::ros_domain;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value};
use std::path::PathBuf;
use std::pin::pin;
use std::time::Duration;
use xtb_bus::{Bus, LINK_LEASE};
use xtb_client::DEFAULT_ENDPOINT;
use xtb_client::Result;
use xtb_services::router::{self, GuardedRouter, News};

const ROUTER_HELP: &str = "\
On tls/… it admits those whom the PKI names (`fleet-cli pki`), each with the rights of its role, and follows the \
registry: who is revoked is out at once, for which the router opens anew (about a second, which ends teleoperation \
and goals that stop on a lost link); who is added comes in when no robot is driven, or at once where `fleet-cli pki` \
was given --apply. On another computer than that of the PKI it needs a copy of its folder without ca.key. On \
tcp/… it admits everybody, so others than this computer must not reach it, unless with --insecure.

With --connect it forms a mesh with other routers: robots and clients of all of them are one fleet. Each pair of \
routers needs one of the two to connect. A router that is not there is tried again until it is. XTB_CONNECT and \
the fleet config are not used.

Examples:
  fleet-cli pki init && fleet-cli router --listen tls/0.0.0.0:7447
  fleet-cli router --listen tls/0.0.0.0:7447 --connect tls/10.0.0.1:7447   on the second of two computers
  fleet-cli router --listen tls/0.0.0.0:7447 --print-acl > zenohd.json5    zenohd with the same rules";

/// Between two looks at the links to other routers.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Arguments of `router`.
#[derive(Debug, Clone, Args)]
#[command(after_help = ROUTER_HELP)]
pub struct RouterArgs {
    /// Endpoint to listen on; port 0 picks a free port.
    #[arg(long, value_name = "ENDPOINT", default_value = DEFAULT_ENDPOINT)]
    pub listen: String,
    /// For tls/: the folder of the PKI, or a copy of it without ca.key [default: ~/.config/xtb/pki].
    #[arg(long, value_name = "DIR", env = "XTB_PKI")]
    pub pki: Option<PathBuf>,
    /// Listen without identities where others can reach it: whoever does can drive every robot.
    #[arg(long)]
    pub insecure: bool,
    /// With identities: also carry this ROS_DOMAIN_ID of ROS 2 [default: 0], by the rights of each role. Without
    /// identities every domain is carried.
    #[arg(long, value_name = "DOMAIN", num_args = 0..=1, default_missing_value = "0", value_parser = ros_domain())]
    pub ros2: Option<u32>,
    /// Print the configuration of a zenohd with the same rules, as JSON5, and end. It does not follow the registry.
    #[arg(long)]
    pub print_acl: bool,
}

/// The one line that says it is ready.
#[derive(Debug, Serialize, JsonSchema)]
struct Ready<'a> {
    ready: bool,
    router: &'a str,
    /// Whether it admits only those of a registry.
    identities: bool,
    /// Routers that it keeps a link to, or tries to.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    connect: &'a [String],
}

/// zenohd's own configuration.
#[derive(Debug, Serialize, JsonSchema)]
struct ZenohdConfig {
    /// Who may do what.
    access_control: Value,
    #[serde(flatten)]
    rest: Map<String, Value>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Ready<'_>>, line_of::<ZenohdConfig>];

/// Runs until it is interrupted.
///
/// # Errors
/// A port that is taken, an endpoint that is none, or one that others could reach without identities.
pub async fn run(ctx: &Context, args: &RouterArgs) -> Result<Exit> {
    // Not those of the environment or the config: they say where clients of this computer find a router.
    let connect = if ctx.connect_given { ctx.settings.connect.as_slice() } else { &[] };
    if args.listen.starts_with("tls/") || args.print_acl {
        return guarded(ctx, args, connect).await;
    }
    if let Some(warning) = router::check_listen(&args.listen, args.insecure)? {
        ctx.out.note(&format!("warning: {warning}"));
    }
    let mut stop = pin!(interrupted());
    let (bus, endpoint) = tokio::select! {
        opened = router::open(&args.listen, connect) => opened?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    tell_ready(ctx, &endpoint, false, connect)?;
    tokio::select! {
        () = &mut stop => {}
        () = tell_links(ctx, || bus.clone()) => {}
    }
    bus.close().await;
    Ok(Exit::Done)
}

/// With identities.
async fn guarded(ctx: &Context, args: &RouterArgs, connect: &[String]) -> Result<Exit> {
    let pki = pki::place(args.pki.as_deref())?;
    if args.print_acl {
        let config = router::zenohd_config(&args.listen, connect, &pki, args.ros2)?;
        let text = format!("{config:#}");
        let mut rest = config.as_object().cloned().unwrap_or_default();
        let access_control = rest.remove("access_control").unwrap_or_default();
        ctx.out.result(&ZenohdConfig { access_control, rest }, |_| text)?;
        return Ok(Exit::Done);
    }
    let mut stop = pin!(interrupted());
    let mut router = tokio::select! {
        opened = router::open_leased_with_registry(&args.listen, connect, &pki, LINK_LEASE, args.ros2) => opened?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    tell_ready(ctx, router.endpoint(), true, connect)?;
    let bus = router.bus_watch();
    tokio::select! {
        () = &mut stop => {}
        () = tell_news(ctx, &mut router) => {}
        () = tell_links(ctx, || bus.borrow().clone()) => {}
    }
    router.close().await;
    Ok(Exit::Done)
}

fn tell_ready(ctx: &Context, router: &str, identities: bool, connect: &[String]) -> Result<()> {
    let ready = Ready { ready: true, router, identities, connect };
    ctx.out.result(&ready, |Ready { router, connect, .. }| match connect {
        [] => format!("router ready on {router}"),
        connect => format!("router ready on {router}, in a mesh with {}", connect.join(", ")),
    })
}

/// Says what happens to a router with identities; does not end.
async fn tell_news(ctx: &Context, router: &mut GuardedRouter) {
    loop {
        ctx.out.note(&match router.news().await {
            News::Reopened { change, closed } => {
                format!("opened anew after {:.1} s: {change}", closed.as_secs_f64())
            }
            News::Waiting(change) => {
                format!(
                    "{change}; admitted when no robot is driven, or at once with `fleet-cli pki … --apply`"
                )
            }
            News::Unreadable(reason) => {
                format!("warning: the registry cannot be read, the rules before are in force: {reason}")
            }
        });
    }
}

/// Notes each change of the number of routers that a link stands to; does not end.
async fn tell_links(ctx: &Context, bus: impl Fn() -> Bus) {
    let mut look = tokio::time::interval(LOOK_EVERY);
    let mut told = 0;
    loop {
        look.tick().await;
        let linked = bus().linked_routers().await;
        if linked != told {
            told = linked;
            let routers = if linked == 1 { "router" } else { "routers" };
            ctx.out.note(&format!("linked to {linked} other {routers}"));
        }
    }
}
