//! Where requests, setpoints and emergency stops go in to the control loop, wherever they come from: the network
//! ([`downlink`](crate::downlink)), or another part of the agent (`ros2`).
//!
//! It never waits: what does not fit a queue is counted; a request then is refused as overloaded, a reply is left out
//! and its client asks again with the same id.

use crate::clock::Clock;
use crate::counters::Counters;
use crate::fast_path::{Answer, EstopCall, FastPath, Response};
use crate::mailbox::{Arrivals, Job, PARAMS, ParamJob, REQUESTS, SessionEnds, SetpointSlot, Waiting};
use crate::wake::Wake;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError};
use std::time::Duration;
use tokio::sync::{mpsc, oneshot};
use xtb_protocol::messages::{
    Body, Message, ParamCode, ParamReply, ParamRequest, RejectCode, Reply, Request, Setpoint,
};
use xtb_protocol::{Name, Uuid};

/// A part of the agent waits this long for the control loop, which answers within a turn unless it hangs.
const INSIDE_WITHIN: Duration = Duration::from_secs(1);

/// See the module's documentation.
pub(crate) struct Inbox {
    clock: Clock,
    requests: SyncSender<Job>,
    params: SyncSender<ParamJob>,
    setpoint: Arc<SetpointSlot>,
    arrivals: Arc<Arrivals>,
    fast_path: Arc<FastPath>,
    wake: Arc<Wake>,
    replies: mpsc::Sender<(Answer, Response)>,
    /// What was refused or dropped.
    pub(crate) counters: Arc<Counters>,
}

impl Inbox {
    /// The control loop's.
    pub(crate) fn of(ends: &SessionEnds, clock: &Clock) -> Self {
        Self {
            clock: clock.clone(),
            requests: ends.requests.clone(),
            params: ends.params.clone(),
            setpoint: ends.setpoint.clone(),
            arrivals: ends.arrivals.clone(),
            fast_path: ends.fast_path.clone(),
            wake: ends.wake.clone(),
            replies: ends.reply_sender.clone(),
            counters: ends.counters.clone(),
        }
    }

    /// A request of a client, valid in itself.
    pub(crate) fn request(&self, client: Name, request: Request, answer: Answer) {
        let arrival = self.arrivals.next();
        self.fast_path.note_heartbeat(self.clock.now(), &client, request.lease);
        let stops = matches!(request.body, Body::Stop {});
        if stops {
            self.arrivals.stop(arrival); // whatever becomes of the rest of it
        }
        let refused = self.requests.try_send(Job { arrival, client, request, answer });
        if stops {
            self.wake.call();
        }
        if let Err(TrySendError::Full(job) | TrySendError::Disconnected(job)) = refused {
            self.counters.overloaded();
            self.reply(job.answer, overloaded(job.request.id));
        }
    }

    /// A question about settings, valid in itself.
    pub(crate) fn param(&self, client: Name, request: ParamRequest, answer: Answer) {
        self.fast_path.note_heartbeat(self.clock.now(), &client, request.lease);
        let refused = self.params.try_send(ParamJob { client, request, answer });
        if let Err(TrySendError::Full(job) | TrySendError::Disconnected(job)) = refused {
            self.counters.overloaded();
            let message = format!("{PARAMS} questions about settings are already waiting");
            let hint = "try again, less often";
            let reply = ParamReply::refused(job.request.id, ParamCode::Overloaded, message, hint);
            self.reply_param(job.answer, reply);
        }
    }

    /// What was refused before it reached the control loop.
    pub(crate) fn reply_param(&self, answer: Answer, reply: ParamReply) {
        if self.replies.try_send((answer, Response::Param(reply))).is_err() {
            self.counters.overloaded();
        }
    }

    /// A setpoint of a client, valid in itself.
    pub(crate) fn setpoint(&self, client: Name, setpoint: Setpoint) {
        let at = self.clock.now();
        if !self.fast_path.admits(&client, setpoint.lease) {
            return self.counters.fenced();
        }
        let arrival = self.arrivals.next();
        self.setpoint.put(Waiting { at, arrival, client, setpoint }, &self.counters);
        self.wake.call();
    }

    /// An emergency stop.
    pub(crate) fn estop(&self, by: Name, id: Uuid, answer: Option<Answer>) {
        let arrival = self.arrivals.next();
        let crowded = self.fast_path.estop(EstopCall { arrival, by, id, answer });
        self.wake.call();
        if crowded.is_some_and(|call| call.answer.is_some()) {
            self.counters.overloaded();
        }
    }

    /// What was refused before it reached the control loop.
    pub(crate) fn reply(&self, answer: Answer, reply: Reply) {
        if self.replies.try_send((answer, Response::Reply(reply))).is_err() {
            self.counters.overloaded();
        }
    }

    /// Asks from inside of the agent. What the control loop does not answer is told as overloaded: whether it was done
    /// is unknown.
    pub(crate) async fn ask(&self, client: &Name, request: Request) -> Reply {
        let id = request.id;
        if let Err(error) = request.validate() {
            self.counters.rejected(&error);
            return Reply::refused(id, error.code(), error.to_string(), "`about` lists the limits");
        }
        let (sender, answer) = oneshot::channel();
        self.request(client.clone(), request, Answer::Inside(sender));
        match tokio::time::timeout(INSIDE_WITHIN, answer).await {
            Ok(Ok(Response::Reply(reply))) => reply,
            _ => overloaded(id),
        }
    }

    /// The same, valid in itself, for who does not want the answer.
    pub(crate) fn tell(&self, client: Name, request: Request) {
        let (sender, _) = oneshot::channel();
        self.request(client, request, Answer::Inside(sender));
    }

    /// An emergency stop from inside of the agent; whether the robot has confirmed that it is latched.
    pub(crate) async fn ask_estop(&self, by: &Name) -> bool {
        let (sender, answer) = oneshot::channel();
        self.estop(by.clone(), Uuid::new_v4(), Some(Answer::Inside(sender)));
        let answer = tokio::time::timeout(INSIDE_WITHIN, answer).await;
        matches!(answer, Ok(Ok(Response::Estopped(estopped))) if estopped.latched)
    }
}

fn overloaded(id: Uuid) -> Reply {
    let message = format!("{REQUESTS} requests are already waiting");
    Reply::refused(id, RejectCode::Overloaded, message, "try again, with fewer requests per second")
}
