//! Requests and setpoints from Zenoh to the control loop.
//!
//! The callbacks run on Zenoh's threads and never wait: they decode, check and hand over. What does
//! not fit a queue is counted; a request then is refused as overloaded, a reply is left out and its
//! client asks again with the same id.

use crate::clock::Clock;
use crate::mailbox::{Answer, Arrivals, Counters, Job, REQUESTS, SessionEnds, SetpointSlot, Waiting};
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError};
use tokio::sync::mpsc;
use xtb_bus::{Bus, BusError, Incoming, Question, Service, Subscription};
use xtb_protocol::codec::CodecError;
use xtb_protocol::keys::{Name, RobotKeys};
use xtb_protocol::messages::{Body, RejectCode, Reply, Request, Setpoint};
use xtb_protocol::{Uuid, codec};

/// Holds the declarations; dropping it ends them.
pub(crate) struct Downlink {
    _requests: Service,
    _setpoints: Subscription,
}

struct Desk {
    keys: RobotKeys,
    requests: SyncSender<Job>,
    arrivals: Arc<Arrivals>,
    replies: mpsc::Sender<(Answer, Reply)>,
    counters: Arc<Counters>,
}

/// Declares `cmd/*` and `teleop/*`.
///
/// # Errors
/// [`BusError`].
pub(crate) async fn declare(
    bus: &Bus,
    keys: &RobotKeys,
    clock: &Clock,
    ends: &SessionEnds,
) -> Result<Downlink, BusError> {
    let desk = Desk {
        keys: keys.clone(),
        requests: ends.requests.clone(),
        arrivals: ends.arrivals.clone(),
        replies: ends.reply_sender.clone(),
        counters: ends.counters.clone(),
    };
    let requests = bus.serve(&keys.cmd(None), move |question| desk.take(question)).await?;
    let tray = Tray {
        clock: clock.clone(),
        slot: ends.setpoint.clone(),
        arrivals: ends.arrivals.clone(),
        counters: ends.counters.clone(),
    };
    let setpoints = bus.subscribe(&keys.teleop(None), move |incoming| tray.take(&incoming)).await?;
    Ok(Downlink { _requests: requests, _setpoints: setpoints })
}

/// The last part of a key: the client's name.
fn client_of(key: &str) -> Option<Name> {
    key.rsplit('/').next().and_then(|name| Name::new(name).ok())
}

/// Where setpoints come in.
struct Tray {
    clock: Clock,
    slot: Arc<SetpointSlot>,
    arrivals: Arc<Arrivals>,
    counters: Arc<Counters>,
}

impl Tray {
    fn take(&self, incoming: &Incoming) {
        let Some(client) = client_of(&incoming.key) else {
            return self.counters.rejected(&nameless());
        };
        match incoming.decode::<Setpoint>() {
            Ok(setpoint) => {
                let (at, arrival) = (self.clock.now(), self.arrivals.next());
                self.slot.put(Waiting { at, arrival, client, setpoint }, &self.counters);
            }
            Err(error) => self.counters.rejected(&error),
        }
    }
}

fn nameless() -> CodecError {
    CodecError::Malformed { name: "client", reason: "the key does not end in a client's name".into() }
}

impl Desk {
    fn take(&self, question: Question) {
        let client = client_of(question.key_expr());
        let key = self.keys.cmd(client.as_ref());
        let decoded = match &client {
            Some(_) => question.decode::<Request>(),
            None => Err(nameless()),
        };
        match (client, decoded) {
            (Some(client), Ok((request, format))) => {
                let arrival = self.arrivals.next();
                if matches!(request.body, Body::Stop {}) {
                    self.arrivals.stop(arrival); // whatever becomes of the rest of it
                }
                let answer = Answer { question, key, format };
                let refused = self.requests.try_send(Job { arrival, client, request, answer });
                if let Err(TrySendError::Full(job) | TrySendError::Disconnected(job)) = refused {
                    self.counters.overloaded();
                    self.reply(job.answer, overloaded(job.request.id));
                }
            }
            (client, Err(error)) => {
                self.counters.rejected(&error);
                if client.is_none() {
                    return; // a wildcard cannot be answered on a key of its own
                }
                let format = question.likely_format();
                self.reply(Answer { question, key, format }, refusal(&error));
            }
            (None, Ok(_)) => {}
        }
    }

    fn reply(&self, answer: Answer, reply: Reply) {
        if self.replies.try_send((answer, reply)).is_err() {
            self.counters.overloaded();
        }
    }
}

fn overloaded(id: Uuid) -> Reply {
    let message = format!("{REQUESTS} requests are waiting already");
    Reply::refused(id, RejectCode::Overloaded, message, "ask again, less often")
}

fn refusal(error: &CodecError) -> Reply {
    let hint = match error.code() {
        RejectCode::Malformed => {
            let (postcard, json) = (
                codec::encoding::<Request>(codec::Format::Postcard),
                codec::encoding::<Request>(codec::Format::Json),
            );
            format!("send {json} or {postcard} as docs/protocol.md says")
        }
        RejectCode::WrongVersion => "use programs of the same release on both sides".to_owned(),
        RejectCode::Oversized => "nothing that a robot understands is that long".to_owned(),
        _ => "`about` lists the limits".to_owned(),
    };
    Reply::refused(Uuid::nil(), error.code(), error.to_string(), hint)
}

/// Sends replies until the loop's end is gone.
pub(crate) async fn send_replies(mut replies: mpsc::Receiver<(Answer, Reply)>) {
    while let Some((answer, reply)) = replies.recv().await {
        if let Err(error) = answer.question.reply(&answer.key, &reply, answer.format).await {
            tracing::debug!("a reply was not sent: {error}");
        }
    }
}
