//! `watch`: any key of ours as JSON lines.

use crate::cli::WatchArgs;
use crate::client::Client;
use crate::context::Context;
use crate::error::{Exit, Failure, Kind, Result};
use crate::interrupt::interrupted;
use serde::Serialize;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::sync::mpsc;
use xtb_bus::{BusError, Incoming};
use xtb_protocol::keys::{Channel, Key};
use xtb_protocol::messages::{About, Event, Message, Request, RobotState, Roster, Sensors, Setpoint, Truth};

/// Messages between Zenoh and the printer; those that find no room are dropped and counted.
const QUEUE: usize = 1024;

#[derive(Debug, Serialize)]
struct Decoded<'a, M> {
    key: &'a str,
    #[serde(rename = "type")]
    name: &'static str,
    value: M,
}

#[derive(Debug, Serialize)]
struct Undecodable<'a> {
    key: &'a str,
    encoding: &'a str,
    bytes: usize,
    error: String,
}

/// Prints messages until it is interrupted or has printed `--count`.
///
/// # Errors
/// No router, or a key expression that is none.
pub async fn run(ctx: &Context, args: &WatchArgs) -> Result<Exit> {
    let client = Client::open(ctx).await?;
    let (sender, mut queue) = mpsc::channel(QUEUE);
    let dropped = Arc::new(AtomicU64::new(0));
    let counter = Arc::clone(&dropped);
    let each = move |incoming: Incoming| {
        if sender.try_send(incoming).is_err() {
            counter.fetch_add(1, Ordering::Relaxed);
        }
    };
    let subscription = client.bus().subscribe(&args.key_expr, each).await.map_err(not_a_key_expr)?;
    let mut stop = pin!(interrupted());
    let mut left = args.count;
    while left != Some(0) {
        let incoming = tokio::select! {
            () = &mut stop => break,
            incoming = queue.recv() => incoming,
        };
        let Some(incoming) = incoming else { break };
        ctx.out.text(&line(&incoming)?)?;
        left = left.map(|left| left - 1);
    }
    drop(subscription);
    let dropped = dropped.load(Ordering::Relaxed);
    if dropped > 0 {
        ctx.out.note(&format!("warning: {dropped} messages came faster than they could be printed"));
    }
    client.close().await;
    Ok(Exit::Done)
}

fn not_a_key_expr(error: BusError) -> Failure {
    match error {
        BusError::Operation { key, reason, .. } => {
            Failure::new(Kind::Usage, format!("cannot watch {key:?}: {reason}"))
                .hint("a key expression looks like xtb/lab/*/state or xtb/**")
        }
        other => other.into(),
    }
}

fn line(incoming: &Incoming) -> Result<String> {
    let Some(key) = Key::parse(&incoming.key) else {
        return undecodable(incoming, "not a key of this project".to_owned());
    };
    match key.channel {
        Channel::State => decoded::<RobotState>(incoming),
        Channel::Sensors => decoded::<Sensors>(incoming),
        Channel::Event => decoded::<Event>(incoming),
        Channel::About => decoded::<About>(incoming),
        Channel::Cmd(_) => decoded::<Request>(incoming),
        Channel::Teleop(_) => decoded::<Setpoint>(incoming),
        Channel::SimTruth => decoded::<Truth>(incoming),
        Channel::SimRoster => decoded::<Roster>(incoming),
        Channel::Alive => undecodable(incoming, "presence carries no payload".to_owned()),
    }
}

fn decoded<M: Message>(incoming: &Incoming) -> Result<String> {
    match incoming.decode::<M>() {
        Ok(value) => json(&Decoded { key: &incoming.key, name: M::NAME, value }),
        Err(error) => undecodable(incoming, error.to_string()),
    }
}

fn undecodable(incoming: &Incoming, error: String) -> Result<String> {
    let Incoming { key, encoding, payload } = incoming;
    json(&Undecodable { key, encoding, bytes: payload.len(), error })
}

fn json(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value).map_err(|error| Failure::new(Kind::Failed, error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::codec::{self, Format};

    fn incoming(key: &str, encoding: &str, payload: &[u8]) -> Incoming {
        Incoming { key: key.into(), encoding: encoding.into(), payload: payload.into() }
    }

    #[test]
    fn our_keys_are_decoded_in_either_encoding() {
        let setpoint = Setpoint { lease: None, seq: 3, echo_tick_ms: None, rpm: 10.0, steering: -0.5 };
        for format in [Format::Postcard, Format::Json] {
            let bytes = codec::encode(&setpoint, format).unwrap();
            let got =
                line(&incoming("xtb/lab/xtb-1/teleop/me", &codec::encoding::<Setpoint>(format), &bytes));
            assert_eq!(
                got.unwrap(),
                r#"{"key":"xtb/lab/xtb-1/teleop/me","type":"Setpoint","value":{"lease":null,"seq":3,"echo_tick_ms":null,"rpm":10.0,"steering":-0.5}}"#
            );
        }
    }

    #[test]
    fn what_cannot_be_read_is_shown_as_such() {
        let broken = line(&incoming("xtb/lab/xtb-1/state", "application/json", b"{}")).unwrap();
        assert!(broken.contains(r#""bytes":2,"error":"not a RobotState"#), "{broken}");
        let foreign = line(&incoming("ros/lab", "text/plain", b"x")).unwrap();
        assert!(foreign.contains("not a key of this project"), "{foreign}");
    }
}
