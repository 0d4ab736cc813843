//! The embedded Zenoh router: the whole infrastructure that a small lab needs, and one of a mesh for a larger one.

mod change;
mod files;
mod guarded;
mod listen;
mod quiet;
mod status;
mod visitors;

pub use change::AdmissionChange;
pub use files::ask_to_apply;
pub use guarded::{GuardedRouter, News, open_leased_with_registry, open_with_registry, zenohd_config};
pub use listen::check_listen;

use std::net::TcpListener;
use std::time::Duration;
use xtb_bus::{Bus, LINK_LEASE, Opening, SessionRole};
use xtb_client::{Error, ErrorKind, Result};

/// Opens a router that routes together with those at `connect`, whether they are there yet or not; and says where
/// it can be reached (with the real port for port 0).
///
/// # Errors
/// [`ErrorKind::PortTaken`], or what Zenoh says of an endpoint.
pub async fn open(listen: &str, connect: &[String]) -> Result<(Bus, String)> {
    open_leased(listen, connect, LINK_LEASE).await
}

/// The same; others take it for lost after so much silence.
///
/// # Errors
/// As [`open`].
pub async fn open_leased(listen: &str, connect: &[String], link_lease: Duration) -> Result<(Bus, String)> {
    check_port(listen)?;
    let role = SessionRole::Router { listen: vec![listen.to_owned()], connect: connect.to_vec() };
    let bus = Opening::of(role).link_lease(link_lease).once().await?;
    let locators = bus.locators().await;
    let endpoint = locators.into_iter().next().unwrap_or_else(|| listen.to_owned());
    Ok((bus, endpoint))
}

/// Zenoh's own message does not tell a taken port from a mistyped address.
fn check_port(listen: &str) -> Result<()> {
    let address = listen.strip_prefix("tcp/").or_else(|| listen.strip_prefix("tls/"));
    if let Some(address) = address {
        TcpListener::bind(address).map_err(|error| taken(listen, &error))?;
    }
    Ok(())
}

fn taken(listen: &str, error: &std::io::Error) -> Error {
    match error.kind() {
        std::io::ErrorKind::AddrInUse => {
            Error::new(ErrorKind::PortTaken, format!("{listen} is already in use")).hint(
                "another router or simulator uses it: end that one, or choose another port with --listen",
            )
        }
        _ => Error::new(ErrorKind::Invalid, format!("cannot listen on {listen}: {error}"))
            .hint("an endpoint looks like tcp/127.0.0.1:7447"),
    }
}
