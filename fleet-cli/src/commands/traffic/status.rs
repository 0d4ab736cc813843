//! `traffic status`: whom traffic control leads, and whom it drives around.

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use tokio::sync::mpsc;
use xtb_client::client::Client;
use xtb_client::fleet_view::by_number;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::TrafficState;

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<TrafficState>];

/// Prints what traffic control says next.
///
/// # Errors
/// No router, or no traffic control.
pub(super) async fn run(ctx: &Context) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let (sender, mut states) = mpsc::channel(1);
    let each = move |incoming: xtb_bus::Incoming| match incoming.decode::<TrafficState>() {
        Ok(state) => drop(sender.try_send(state)),
        Err(error) => tracing::debug!("on {}: {error}", incoming.key),
    };
    let subscription = client.bus().subscribe(&client.keys().traffic_state(), each).await?;
    let heard = tokio::time::timeout(ctx.settings.timeout, states.recv()).await;
    drop(subscription);
    client.close().await;
    let Ok(Some(state)) = heard else {
        return Err(Error::new(ErrorKind::NoRobot, "no traffic control found")
            .hint("start one with `fleet-cli traffic serve`"));
    };
    ctx.out.result(&state, |state| {
        format!(
            "map {}, {} joint plans\ncoordinates: {}\nplans around: {}",
            state.map_hash,
            state.plans,
            names(&state.led),
            names(&state.obstacles)
        )
    })?;
    Ok(Exit::Done)
}

fn names(names: &[Name]) -> String {
    match names {
        [] => "none".to_owned(),
        names => {
            let mut names: Vec<&Name> = names.iter().collect();
            names.sort_by_cached_key(|name| by_number(name));
            names.into_iter().map(Name::as_str).collect::<Vec<_>>().join(", ")
        }
    }
}
