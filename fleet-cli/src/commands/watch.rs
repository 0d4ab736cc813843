//! `watch`: any key of ours as JSON lines.

mod plan;

use crate::cli::WatchArgs;
use crate::client::Client;
use crate::context::Context;
use crate::error::{Exit, Failure, Kind, Result};
use crate::interrupt::interrupted;
use plan::Plan;
use serde::Serialize;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use xtb_bus::{BusError, Incoming, Presence, Subscription};
use xtb_protocol::keys::{Channel, Key};
use xtb_protocol::messages::{
    About, DispatchRequest, Estop, Event, Fix, FleetMap, Message, Request, RobotState, Roster, Route,
    Sensors, Setpoint, TaskEvent, TaskList, TrafficState, Truth,
};

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

/// Something to print.
enum Item {
    /// A message or an answer.
    Message(Incoming),
    /// A key that is now alive, or is not any more.
    Presence(String, bool),
}

/// What keeps the items coming, until it is dropped.
#[derive(Default)]
struct Sources {
    subscriptions: Vec<Subscription>,
    presences: Vec<Presence>,
    questions: JoinSet<()>,
}

/// Where sources put what they have.
#[derive(Clone)]
struct Inlet {
    queue: mpsc::Sender<Item>,
    dropped: Arc<AtomicU64>,
}

impl Inlet {
    fn put(&self, item: Item) {
        if self.queue.try_send(item).is_err() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Prints messages until it is interrupted or has printed `--count`; where only answers are to be
/// had, it ends after these.
///
/// # Errors
/// No router, a key expression that is none or that names only commands, or nobody to answer.
pub async fn run(ctx: &Context, args: &WatchArgs) -> Result<Exit> {
    let plan = Plan::of(&args.key_expr)?;
    let client = Client::open(ctx).await?;
    match plan {
        Plan::Answers(ask) => print_answers(ctx, &client, args, &ask).await?,
        plan => follow(ctx, &client, args, plan).await?,
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
        Ok::<_, Failure>(answers)
    };
    let answers = tokio::select! {
        () = interrupted() => return Ok(()),
        answers = asking => answers?,
    };
    if answers.is_empty() {
        return Err(Failure::new(Kind::NoRobot, format!("Nobody answers on {}", args.key_expr))
            .hint("`fleet-cli list` shows who is there; a roster is known to `fleet-cli sim` only"));
    }
    let most = args.count.map_or(usize::MAX, |count| usize::try_from(count).unwrap_or(usize::MAX));
    answers.iter().take(most).try_for_each(|answer| ctx.out.text(&line(answer)?))
}

async fn follow(ctx: &Context, client: &Client, args: &WatchArgs, plan: Plan) -> Result<()> {
    let (queue, mut items) = mpsc::channel(QUEUE);
    let inlet = Inlet { queue, dropped: Arc::default() };
    let sources = open(client, &args.key_expr, plan, &inlet).await.map_err(not_a_key_expr)?;
    let mut stop = pin!(interrupted());
    let mut left = args.count;
    while left != Some(0) {
        let item = tokio::select! {
            () = &mut stop => break,
            item = items.recv() => item,
        };
        let Some(item) = item else { break };
        ctx.out.text(&item_line(&item)?)?;
        left = left.map(|left| left - 1);
    }
    drop(sources);
    let dropped = inlet.dropped.load(Ordering::Relaxed);
    if dropped > 0 {
        ctx.out.note(&format!("warning: {dropped} messages came faster than they could be printed"));
    }
    Ok(())
}

async fn open(
    client: &Client,
    key_expr: &str,
    plan: Plan,
    inlet: &Inlet,
) -> std::result::Result<Sources, BusError> {
    let mut sources = Sources::default();
    match plan {
        Plan::Presence => sources.presences.push(presence(client, key_expr, inlet).await?),
        Plan::Events => {
            let each = message_to(inlet);
            sources.subscriptions.push(client.bus().subscribe_events(key_expr, each).await?);
        }
        Plan::Messages { ask, presence: there } => {
            sources.subscriptions.push(client.bus().subscribe(key_expr, message_to(inlet)).await?);
            for key_expr in there {
                sources.presences.push(presence(client, &key_expr, inlet).await?);
            }
            // Beside the stream: who answers slowly must not hold it up.
            for key_expr in ask {
                sources.questions.spawn(answers_to(client.clone(), key_expr, inlet.clone()));
            }
        }
        // Has no sources that last.
        Plan::Answers(_) => {}
    }
    Ok(sources)
}

async fn presence(client: &Client, key_expr: &str, inlet: &Inlet) -> std::result::Result<Presence, BusError> {
    let inlet = inlet.clone();
    let each = move |key: &str, there: bool| inlet.put(Item::Presence(key.to_owned(), there));
    client.bus().watch_alive(key_expr, each).await
}

fn message_to(inlet: &Inlet) -> impl Fn(Incoming) + Send + Sync + 'static {
    let inlet = inlet.clone();
    move |incoming| inlet.put(Item::Message(incoming))
}

async fn answers_to(client: Client, key_expr: String, inlet: Inlet) {
    match client.get(&key_expr).await {
        Ok(answers) => answers.into_iter().for_each(|answer| inlet.put(Item::Message(answer))),
        Err(error) => tracing::warn!("{error}"),
    }
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

fn item_line(item: &Item) -> Result<String> {
    match item {
        Item::Message(incoming) => line(incoming),
        Item::Presence(key, there) => json(&Decoded { key, name: "Alive", value: there }),
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
        Channel::Estop(_) | Channel::EstopAll(_) => decoded::<Estop>(incoming),
        Channel::Fix => decoded::<Fix>(incoming),
        Channel::Route => decoded::<Route>(incoming),
        Channel::TrafficState => decoded::<TrafficState>(incoming),
        Channel::Map => decoded::<FleetMap>(incoming),
        Channel::SimTruth => decoded::<Truth>(incoming),
        Channel::SimRoster => decoded::<Roster>(incoming),
        Channel::DispatchCmd(_) => decoded::<DispatchRequest>(incoming),
        Channel::DispatchTasks => decoded::<TaskList>(incoming),
        Channel::DispatchEvent => decoded::<TaskEvent>(incoming),
        Channel::Alive | Channel::TrafficAlive | Channel::DispatchAlive => {
            undecodable(incoming, "presence carries no payload".to_owned())
        }
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

    #[test]
    fn presence_is_true_or_false() {
        for there in [true, false] {
            let shown = item_line(&Item::Presence("xtb/lab/xtb-1/alive".into(), there)).unwrap();
            assert_eq!(shown, format!(r#"{{"key":"xtb/lab/xtb-1/alive","type":"Alive","value":{there}}}"#));
        }
    }
}
