//! `watch`: any key of ours as JSON lines.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::output::json_line;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::sync::mpsc;
use xtb_bus::Incoming;
use xtb_client::client::Client;
use xtb_client::messages::AnyMessage;
use xtb_client::subscription::plan::WatchPlan;
use xtb_client::subscription::{Inlet, Item, Subscriptions, hidden, not_a_key_expr};
use xtb_client::{Error, ErrorKind, Result};

/// Arguments of `watch`.
#[derive(Debug, Clone, Args)]
pub struct WatchArgs {
    /// Zenoh key expression, such as `xtb/lab/*/event` or `xtb/**`; about and roster are read once, commands
    /// cannot be watched.
    #[arg(value_name = "KEYEXPR")]
    pub key_expr: String,
    /// Stop after this many messages.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,
}

/// Messages between Zenoh and the printer; those that find no room are dropped and counted.
const QUEUE: usize = 1024;

#[derive(Debug, Serialize, JsonSchema)]
struct Decoded<'a> {
    key: &'a str,
    #[serde(rename = "type")]
    name: &'static str,
    value: &'a AnyMessage,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Undecodable<'a> {
    key: &'a str,
    encoding: &'a str,
    bytes: usize,
    error: String,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Decoded<'_>>, line_of::<Undecodable<'_>>];

/// Prints messages until it is interrupted or has printed `--count`; where only answers are to be
/// had, it ends after these.
///
/// # Errors
/// No router, one that does not admit this identity, a key expression that is none or that names only commands, or
/// nobody to answer.
pub async fn run(ctx: &Context, args: &WatchArgs) -> Result<Exit> {
    let plan = WatchPlan::of(&args.key_expr)?;
    let client = Client::open(&ctx.settings).await?;
    if let Some(words) = hidden(&client, &args.key_expr, &plan) {
        ctx.out.note(&format!("warning: {words}"));
    }
    match plan {
        WatchPlan::Answers(ask) => print_answers(ctx, &client, args, &ask).await?,
        plan => tokio::select! {
            followed = follow(ctx, &client, args, plan) => followed?,
            refused = client.refused() => return Err(refused),
        },
    }
    client.close().await;
    Ok(Exit::Done)
}

async fn print_answers(ctx: &Context, client: &Client, args: &WatchArgs, ask: &[String]) -> Result<()> {
    let asking = async {
        let mut answers = Vec::new();
        for key_expr in ask {
            answers.extend(client.get(key_expr).await.map_err(not_a_key_expr)?);
        }
        Ok::<_, Error>(answers)
    };
    let answers = tokio::select! {
        () = interrupted() => return Ok(()),
        answers = asking => answers?,
    };
    if answers.is_empty() {
        return Err(Error::new(ErrorKind::NoRobot, format!("No answer on {}", args.key_expr))
            .hint("`fleet-cli list` shows the robots present; only `fleet-cli sim` publishes a roster"));
    }
    let most = args.count.map_or(usize::MAX, |count| usize::try_from(count).unwrap_or(usize::MAX));
    answers.into_iter().take(most).try_for_each(|answer| ctx.out.text(&line(&Item::Message(answer))?))
}

async fn follow(ctx: &Context, client: &Client, args: &WatchArgs, plan: WatchPlan) -> Result<()> {
    let (queue, mut items) = mpsc::channel(QUEUE);
    let dropped = Arc::new(AtomicU64::new(0));
    let drops = Arc::clone(&dropped);
    let inlet: Inlet = Arc::new(move |item| {
        if queue.try_send(item).is_err() {
            drops.fetch_add(1, Ordering::Relaxed);
        }
    });
    let mut sources = Subscriptions::default();
    sources.add_plan(client, &args.key_expr, plan, &inlet).await.map_err(not_a_key_expr)?;
    let mut stop = pin!(interrupted());
    let mut left = args.count;
    while left != Some(0) {
        let item = tokio::select! {
            () = &mut stop => break,
            item = items.recv() => item,
        };
        let Some(item) = item else { break };
        ctx.out.text(&line(&item)?)?;
        left = left.map(|left| left - 1);
    }
    drop(sources);
    let dropped = dropped.load(Ordering::Relaxed);
    if dropped > 0 {
        ctx.out.note(&format!("warning: {dropped} messages arrived faster than they could be printed"));
    }
    Ok(())
}

fn line(item: &Item) -> Result<String> {
    match (item, AnyMessage::of(item)) {
        (Item::Message(Incoming { key, .. }) | Item::Presence(key, _), Ok((_, news))) => {
            json_line(&Decoded { key, name: news.name(), value: &news })
        }
        (Item::Message(Incoming { key, encoding, payload }), Err(error)) => {
            json_line(&Undecodable { key, encoding, bytes: payload.len(), error: error.to_string() })
        }
        (Item::Presence(key, _), Err(error)) => {
            json_line(&Undecodable { key, encoding: "", bytes: 0, error: error.to_string() })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::codec::{self, Format};
    use xtb_protocol::messages::Setpoint;

    fn incoming(key: &str, encoding: &str, payload: &[u8]) -> Item {
        Item::Message(Incoming { key: key.into(), encoding: encoding.into(), payload: payload.into() })
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

    #[test]
    fn presence_is_true_or_false() {
        for there in [true, false] {
            let shown = line(&Item::Presence("xtb/lab/xtb-1/alive".into(), there)).unwrap();
            assert_eq!(shown, format!(r#"{{"key":"xtb/lab/xtb-1/alive","type":"Alive","value":{there}}}"#));
        }
    }
}
