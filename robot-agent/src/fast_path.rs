//! The fast path: what must not wait in a queue. Whose setpoints are admitted, the holder's heartbeat, and
//! emergency stops.
//!
//! Zenoh's threads and the control loop meet here for a few instructions at a time; neither ever
//! waits for the other's lock longer than that.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::oneshot;
use xtb_bus::Question;
use xtb_control::Stamp;
use xtb_protocol::codec::Format;
use xtb_protocol::messages::{Estopped, Lease, ParamReply, ParamValue, Reply};
use xtb_protocol::{Name, Uuid};
use xtb_robot::Agent;
use xtb_robot::agent::Arrival;
use xtb_robot::authority::admission::Admission;

/// Emergency stops between two turns. One more takes the place of the newest: one stop is as good as two.
pub(crate) const ESTOPS: usize = 64;

/// Where a reply goes.
pub(crate) enum Answer {
    /// Back over the network.
    Asked {
        /// The question.
        question: Box<Question>,
        /// The robot's own key for it.
        key: String,
        /// As the request was written.
        format: Format,
    },
    /// To another part of the agent.
    Inside(oneshot::Sender<Response>),
}

/// What goes back to whoever asked.
pub(crate) enum Response {
    /// To a request.
    Reply(Reply),
    /// To an emergency stop.
    Estopped(Estopped),
    /// To a question about settings.
    Param(ParamReply),
    /// The same, once these have been written into the settings file.
    Save(ParamReply, Vec<ParamValue>),
}

/// An emergency stop on its way to the loop.
pub(crate) struct EstopCall {
    /// Its place among all messages.
    pub(crate) arrival: Arrival,
    /// Who calls.
    pub(crate) by: Name,
    /// Repetitions have the same.
    pub(crate) id: Uuid,
    /// Whom to tell that the robot stands.
    pub(crate) answer: Option<Answer>,
}

#[derive(Default)]
struct Inner {
    admission: Admission,
    /// The grant that it was made for.
    grant: Option<Lease>,
    /// When the holder was heard last, and under which grant.
    heard: Option<(Lease, Stamp)>,
    estops: VecDeque<EstopCall>,
}

/// See the module's documentation.
#[derive(Default)]
pub(crate) struct FastPath(Mutex<Inner>);

impl FastPath {
    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a message is admitted.
    pub(crate) fn admits(&self, client: &Name, lease: Option<Lease>) -> bool {
        self.lock().admission.admits(client, lease)
    }

    /// A request came in, whatever becomes of it: with the present lease it is a heartbeat of the holder. (A
    /// setpoint is one only once it has proved fresh.)
    pub(crate) fn note_heartbeat(&self, at: Stamp, client: &Name, lease: Option<Lease>) {
        let mut inner = self.lock();
        if let Some(lease) = lease.filter(|_| inner.admission.admits(client, lease)) {
            inner.heard = Some((lease, at));
        }
    }

    /// An emergency stop has arrived. Returns the call that found no room.
    pub(crate) fn estop(&self, call: EstopCall) -> Option<EstopCall> {
        let mut inner = self.lock();
        let crowded = if inner.estops.len() >= ESTOPS { inner.estops.pop_back() } else { None };
        inner.estops.push_back(call);
        crowded
    }

    /// The oldest emergency stop that no turn has seen.
    pub(crate) fn next_estop(&self) -> Option<EstopCall> {
        self.lock().estops.pop_front()
    }

    /// A call that cannot be answered yet comes first at the next turn.
    pub(crate) fn put_back(&self, call: EstopCall) {
        self.lock().estops.push_front(call);
    }

    /// Before a turn: the holder's heartbeat keeps the lease.
    pub(crate) fn tell(&self, agent: &mut Agent) {
        if let Some((lease, at)) = self.lock().heard.take() {
            agent.heard(at, lease);
        }
    }

    /// After a turn: whose messages are admitted from now on.
    pub(crate) fn follow(&self, agent: &Agent) {
        let grant = agent.lease().present();
        let mut inner = self.lock();
        if inner.grant != grant || inner.admission == Admission::Anyone {
            (inner.admission, inner.grant) = (agent.admission(), grant);
        }
    }
}
