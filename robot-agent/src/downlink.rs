//! Requests, setpoints and emergency stops from Zenoh to the control loop.
//!
//! The callbacks run on Zenoh's threads and never wait: they decode, check and hand over. What does
//! not fit a queue is counted; a request then is refused as overloaded, a reply is left out and its
//! client asks again with the same id.

use crate::clock::Clock;
use crate::counters::Counters;
use crate::fast_path::Answer;
use crate::fast_path::{EstopCall, FastPath};
use crate::mailbox::{Arrivals, Job, REQUESTS, Response, SessionEnds, SetpointSlot, Waiting};
use crate::wake::Wake;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError};
use tokio::sync::mpsc;
use xtb_bus::{Bus, BusError, Incoming, Question, Service, Subscription};
use xtb_protocol::keys::{FleetKeys, Key, Name, RobotKeys};
use xtb_protocol::messages::{Body, Estop, RejectCode, Reply, Request, Setpoint};
use xtb_protocol::wire::CodecError;
use xtb_protocol::{Uuid, codec};

/// Holds the declarations; dropping it ends them.
pub(crate) struct Downlink {
    _requests: Service,
    _setpoints: Subscription,
    _estops: [Subscription; 2],
    _estops_asked: Service,
}

struct RequestInbox {
    keys: RobotKeys,
    clock: Clock,
    requests: SyncSender<Job>,
    arrivals: Arc<Arrivals>,
    fast_path: Arc<FastPath>,
    wake: Arc<Wake>,
    replies: mpsc::Sender<(Answer, Response)>,
    counters: Arc<Counters>,
}

/// Declares `cmd/*`, `teleop/*` and `estop/*`, its own and everybody's.
///
/// # Errors
/// [`BusError`].
pub(crate) async fn declare(
    bus: &Bus,
    fleet: &FleetKeys,
    robot: &Name,
    clock: &Clock,
    ends: &SessionEnds,
) -> Result<Downlink, BusError> {
    let keys = &fleet.robot(robot);
    let estop_inbox = Arc::new(EstopInbox {
        keys: keys.clone(),
        arrivals: ends.arrivals.clone(),
        fast_path: ends.fast_path.clone(),
        wake: ends.wake.clone(),
        counters: ends.counters.clone(),
    });
    let take = |estop_inbox: Arc<EstopInbox>| move |incoming: Incoming| estop_inbox.published(&incoming);
    let own = bus.subscribe(&keys.estop(None), take(estop_inbox.clone())).await?;
    let all = bus.subscribe(&fleet.estop_all(None), take(estop_inbox.clone())).await?;
    let asked = bus.serve(&keys.estop(None), move |question| estop_inbox.asked(question)).await?;
    let request_inbox = RequestInbox {
        keys: keys.clone(),
        clock: clock.clone(),
        requests: ends.requests.clone(),
        arrivals: ends.arrivals.clone(),
        fast_path: ends.fast_path.clone(),
        wake: ends.wake.clone(),
        replies: ends.reply_sender.clone(),
        counters: ends.counters.clone(),
    };
    let requests = bus.serve(&keys.cmd(None), move |question| request_inbox.take(question)).await?;
    let setpoint_inbox = SetpointInbox {
        clock: clock.clone(),
        slot: ends.setpoint.clone(),
        arrivals: ends.arrivals.clone(),
        fast_path: ends.fast_path.clone(),
        wake: ends.wake.clone(),
        counters: ends.counters.clone(),
    };
    let setpoints = bus.subscribe(&keys.teleop(None), move |incoming| setpoint_inbox.take(&incoming)).await?;
    let estops = [own, all];
    Ok(Downlink { _requests: requests, _setpoints: setpoints, _estops: estops, _estops_asked: asked })
}

/// Who put this. The bus lets only keys in that name their client.
fn client_of(incoming: &Incoming) -> Option<Name> {
    Key::parse(&incoming.key)?.channel.client().cloned()
}

/// Where setpoints come in.
struct SetpointInbox {
    clock: Clock,
    slot: Arc<SetpointSlot>,
    arrivals: Arc<Arrivals>,
    fast_path: Arc<FastPath>,
    wake: Arc<Wake>,
    counters: Arc<Counters>,
}

impl SetpointInbox {
    fn take(&self, incoming: &Incoming) {
        let Some(client) = client_of(incoming) else { return };
        match incoming.decode::<Setpoint>() {
            Ok(setpoint) => {
                let at = self.clock.now();
                if !self.fast_path.admits(&client, setpoint.lease) {
                    return self.counters.fenced();
                }
                let arrival = self.arrivals.next();
                self.slot.put(Waiting { at, arrival, client, setpoint }, &self.counters);
                self.wake.call();
            }
            Err(error) => self.counters.rejected(&error),
        }
    }
}

/// Where emergency stops come in. What cannot be read is counted, and stops the robot all the same.
struct EstopInbox {
    keys: RobotKeys,
    arrivals: Arc<Arrivals>,
    fast_path: Arc<FastPath>,
    wake: Arc<Wake>,
    counters: Arc<Counters>,
}

impl EstopInbox {
    fn published(&self, incoming: &Incoming) {
        if let Some(by) = client_of(incoming) {
            self.take(by, incoming.decode::<Estop>(), None);
        }
    }

    fn asked(&self, question: Question) {
        let Some(by) = question.client().cloned() else { return };
        let decoded = question.decode::<Estop>();
        let format = decoded.as_ref().map_or_else(|_| question.likely_format(), |(_, format)| *format);
        let key = self.keys.estop(Some(&by));
        self.take(by, decoded.map(|(estop, _)| estop), Some(Answer { question, key, format }));
    }

    fn take(&self, by: Name, read: Result<Estop, CodecError>, answer: Option<Answer>) {
        let arrival = self.arrivals.next();
        let id = match read {
            Ok(estop) => estop.id,
            Err(error) => {
                self.counters.rejected(&error);
                Uuid::new_v4()
            }
        };
        let crowded = self.fast_path.estop(EstopCall { arrival, by, id, answer });
        self.wake.call();
        if crowded.is_some_and(|call| call.answer.is_some()) {
            self.counters.overloaded();
        }
    }
}

impl RequestInbox {
    fn take(&self, question: Question) {
        let Some(client) = question.client().cloned() else { return };
        let key = self.keys.cmd(Some(&client));
        match question.decode::<Request>() {
            Ok((request, format)) => {
                let arrival = self.arrivals.next();
                self.fast_path.note_heartbeat(self.clock.now(), &client, request.lease);
                let stops = matches!(request.body, Body::Stop {});
                if stops {
                    self.arrivals.stop(arrival); // whatever becomes of the rest of it
                }
                let answer = Answer { question, key, format };
                let refused = self.requests.try_send(Job { arrival, client, request, answer });
                if stops {
                    self.wake.call();
                }
                if let Err(TrySendError::Full(job) | TrySendError::Disconnected(job)) = refused {
                    self.counters.overloaded();
                    self.reply(job.answer, overloaded(job.request.id));
                }
            }
            Err(error) => {
                self.counters.rejected(&error);
                let format = question.likely_format();
                self.reply(Answer { question, key, format }, refusal(&error));
            }
        }
    }

    fn reply(&self, answer: Answer, reply: Reply) {
        if self.replies.try_send((answer, Response::Reply(reply))).is_err() {
            self.counters.overloaded();
        }
    }
}

fn overloaded(id: Uuid) -> Reply {
    let message = format!("{REQUESTS} requests are already waiting");
    Reply::refused(id, RejectCode::Overloaded, message, "try again, with fewer requests per second")
}

fn refusal(error: &CodecError) -> Reply {
    let hint = match error.code() {
        RejectCode::Malformed => {
            let (postcard, json) = (
                codec::encoding::<Request>(codec::Format::Postcard),
                codec::encoding::<Request>(codec::Format::Json),
            );
            format!("send {json} or {postcard}, see docs/protocol.md")
        }
        RejectCode::WrongVersion => "use programs of the same release on both sides".to_owned(),
        RejectCode::Oversized => "no message for a robot is that long".to_owned(),
        _ => "`about` lists the limits".to_owned(),
    };
    Reply::refused(Uuid::nil(), error.code(), error.to_string(), hint)
}

/// Sends replies until the loop's end is gone.
pub(crate) async fn send_replies(mut replies: mpsc::Receiver<(Answer, Response)>) {
    while let Some((Answer { question, key, format }, word)) = replies.recv().await {
        let sent = match word {
            Response::Reply(reply) => question.reply(&key, &reply, format).await,
            Response::Estopped(estopped) => question.reply(&key, &estopped, format).await,
        };
        if let Err(error) = sent {
            tracing::debug!("cannot send a reply: {error}");
        }
    }
}
