//! What crosses between Zenoh's threads and the control loop: every queue bounded, every overflow counted.
//!
//! | from → to | what | bound | when full |
//! | --- | --- | --- | --- |
//! | downlink → loop | emergency stop | [`ESTOPS`](crate::fast_path::ESTOPS) | only an acknowledgement is lost, counted |
//! | downlink → loop | stop | 1 number, the latest wins | nothing is lost: one stop is as good as two |
//! | downlink → loop | the holder lives | 1 time, the latest wins | – |
//! | downlink → loop | requests | [`REQUESTS`] | refused as overloaded, counted |
//! | downlink → loop | questions about settings | [`PARAMS`] | refused as overloaded, counted |
//! | downlink → loop | setpoint of the holder | 1, latest wins | the older one is dropped, counted |
//! | downlink → loop | "take a turn now" ([`Wake`]) | 1 flag | one turn sees all that has come |
//! | Zenoh → map reader | maps, unread | 1, latest wins | the older one is dropped, counted |
//! | nav inputs, map reader → loop | poses, paths, maps | [`NAV_INPUTS`] | dropped, counted; newer ones follow |
//! | other robots → loop | their states | the latest of 64 robots | those of more are dropped, counted |
//! | loop → downlink | replies | [`REPLIES`] | requests wait in their own queue |
//! | loop → uplink | snapshot | 1, latest wins | the older one is dropped |
//! | loop → uplink | events | [`EVENTS`] | dropped, counted |
//! | loop → log | line broken, line works again | [`NOTES`] | dropped |
//! | Zenoh → uplink | questions for `state`, `about` | 64 | dropped, counted; the client asks again |

use crate::counters::Counters;
use crate::fast_path::{Answer, FastPath, Response};
use crate::neighbours::NeighbourSlot;
use crate::snapshot::Snapshot;
use crate::wake::Wake;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc as std_mpsc};
use tokio::sync::{mpsc, watch};
use xtb_control::Stamp;
use xtb_nav::navigator::PreparedMap;
use xtb_protocol::Name;
use xtb_protocol::messages::{Event, Fix, MapHash, ParamRequest, ParamValue, Request, Route, Setpoint};
use xtb_robot::agent::Arrival;

/// Requests waiting for a turn.
pub(crate) const REQUESTS: usize = 64;
/// Questions about settings waiting for a turn.
pub(crate) const PARAMS: usize = 16;
/// Replies on their way out.
pub(crate) const REPLIES: usize = 256;
/// Events on their way out.
pub(crate) const EVENTS: usize = 256;
/// Poses, paths and maps on their way to the loop.
pub(crate) const NAV_INPUTS: usize = 64;
/// Notes on their way to the log.
pub(crate) const NOTES: usize = 16;

/// Numbers messages in the order of their arrival, and holds the number of the latest stop: it
/// reaches the loop at the next turn, whatever waits in the queues.
#[derive(Debug, Default)]
pub(crate) struct Arrivals {
    latest: AtomicU64,
    stop: AtomicU64,
}

impl Arrivals {
    /// The next number; 0 is never one.
    pub(crate) fn next(&self) -> Arrival {
        self.latest.fetch_add(1, Ordering::SeqCst) + 1
    }

    /// A stop with this number has arrived.
    pub(crate) fn stop(&self, arrival: Arrival) {
        self.stop.fetch_max(arrival, Ordering::SeqCst);
    }

    /// The number of the latest stop; 0 = none yet.
    pub(crate) fn latest_stop(&self) -> Arrival {
        self.stop.load(Ordering::SeqCst)
    }
}

/// A request with the question that its reply belongs to.
pub(crate) struct Job {
    /// Its place among all messages.
    pub(crate) arrival: Arrival,
    /// Who asks.
    pub(crate) client: Name,
    /// What is asked.
    pub(crate) request: Request,
    /// How to answer.
    pub(crate) answer: Answer,
}

/// A question about settings with where its answer goes.
pub(crate) struct ParamJob {
    /// Who asks.
    pub(crate) client: Name,
    /// What.
    pub(crate) request: ParamRequest,
    /// How to answer.
    pub(crate) answer: Answer,
}

/// What the second level has to know.
pub(crate) enum NavInput {
    /// A measured pose, and when it came in.
    Fix(Stamp, Fix),
    /// From traffic control.
    Route(Box<Route>),
    /// The fleet's map, for a robot without one of its own.
    Floor(Arc<PreparedMap>),
    /// The hash of the fleet's map.
    FleetMap(MapHash),
}

/// A line broke, or works again. The loop does not log: standard error can be a pipe that is full.
#[derive(Debug)]
pub(crate) struct LineNote {
    /// Which.
    pub(crate) line: &'static str,
    /// The system's words; `None` = works again.
    pub(crate) error: Option<String>,
}

/// The latest setpoint with the time of its arrival.
#[derive(Debug, Default)]
pub(crate) struct SetpointSlot(Mutex<Option<Waiting>>);

/// A setpoint that waits for its turn.
#[derive(Debug)]
pub(crate) struct Waiting {
    /// When it arrived.
    pub(crate) at: Stamp,
    /// Its place among all messages.
    pub(crate) arrival: Arrival,
    /// Who sent it.
    pub(crate) client: Name,
    /// What it asks for.
    pub(crate) setpoint: Setpoint,
}

impl SetpointSlot {
    /// Puts a setpoint; the one before is dropped if no turn has seen it, but a late one never displaces
    /// a newer one of the same grant.
    pub(crate) fn put(&self, new: Waiting, counters: &Counters) {
        let mut slot = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let newer =
            |old: &Waiting| old.setpoint.lease == new.setpoint.lease && old.setpoint.seq > new.setpoint.seq;
        if !slot.as_ref().is_some_and(newer) && slot.replace(new).is_none() {
            return;
        }
        counters.setpoints_overwritten.fetch_add(1, Ordering::Relaxed);
    }

    /// Takes it.
    pub(crate) fn take(&self) -> Option<Waiting> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// The control loop's ends.
pub(crate) struct LoopEnds {
    /// Requests.
    pub(crate) requests: std_mpsc::Receiver<Job>,
    /// Questions about settings.
    pub(crate) params: std_mpsc::Receiver<ParamJob>,
    /// Settings that were written into the file.
    pub(crate) saved: std_mpsc::Receiver<Vec<ParamValue>>,
    /// Setpoints.
    pub(crate) setpoint: Arc<SetpointSlot>,
    /// Poses, paths, maps.
    pub(crate) nav_inputs: std_mpsc::Receiver<NavInput>,
    /// What other robots say of themselves.
    pub(crate) neighbours: Arc<NeighbourSlot>,
    /// Whether it wants to know.
    pub(crate) listens: watch::Sender<bool>,
    /// Order of arrival, and stops.
    pub(crate) arrivals: Arc<Arrivals>,
    /// What must not wait in a queue.
    pub(crate) fast_path: Arc<FastPath>,
    /// What must not wait for the next turn.
    pub(crate) wake: Arc<Wake>,
    /// Replies.
    pub(crate) replies: mpsc::Sender<(Answer, Response)>,
    /// Snapshots.
    pub(crate) snapshot: watch::Sender<Option<Snapshot>>,
    /// Events.
    pub(crate) events: mpsc::Sender<Event>,
    /// For the log.
    pub(crate) notes: mpsc::Sender<LineNote>,
    /// Whether the link to the router stands.
    pub(crate) link_up: Arc<AtomicBool>,
    /// What was refused or dropped outside.
    pub(crate) counters: Arc<Counters>,
}

/// The session's ends.
pub(crate) struct SessionEnds {
    /// Requests.
    pub(crate) requests: std_mpsc::SyncSender<Job>,
    /// Questions about settings.
    pub(crate) params: std_mpsc::SyncSender<ParamJob>,
    /// Settings that were written into the file.
    pub(crate) saved: std_mpsc::SyncSender<Vec<ParamValue>>,
    /// Setpoints.
    pub(crate) setpoint: Arc<SetpointSlot>,
    /// Poses, paths, maps.
    pub(crate) nav_inputs: std_mpsc::SyncSender<NavInput>,
    /// What other robots say of themselves.
    pub(crate) neighbours: Arc<NeighbourSlot>,
    /// Whether the loop wants to know.
    pub(crate) listens: watch::Receiver<bool>,
    /// Order of arrival, and stops.
    pub(crate) arrivals: Arc<Arrivals>,
    /// What must not wait in a queue.
    pub(crate) fast_path: Arc<FastPath>,
    /// What must not wait for the next turn.
    pub(crate) wake: Arc<Wake>,
    /// Replies that were refused before they reached the loop.
    pub(crate) reply_sender: mpsc::Sender<(Answer, Response)>,
    /// Replies.
    pub(crate) replies: mpsc::Receiver<(Answer, Response)>,
    /// Snapshots.
    pub(crate) snapshot: watch::Receiver<Option<Snapshot>>,
    /// Events.
    pub(crate) events: mpsc::Receiver<Event>,
    /// Whether the link to the router stands.
    pub(crate) link_up: Arc<AtomicBool>,
    /// What was refused or dropped outside.
    pub(crate) counters: Arc<Counters>,
}

/// Both ends of every queue; the third is for [`log`].
#[must_use]
pub(crate) fn mailbox() -> (LoopEnds, SessionEnds, mpsc::Receiver<LineNote>) {
    let (request_sender, request_receiver) = std_mpsc::sync_channel(REQUESTS);
    let (param_sender, param_receiver) = std_mpsc::sync_channel(PARAMS);
    let (saved_sender, saved_receiver) = std_mpsc::sync_channel(PARAMS);
    let (nav_input_sender, nav_input_receiver) = std_mpsc::sync_channel(NAV_INPUTS);
    let (reply_sender, reply_receiver) = mpsc::channel(REPLIES);
    let (event_sender, event_receiver) = mpsc::channel(EVENTS);
    let (note_sender, note_receiver) = mpsc::channel(NOTES);
    let (snapshot_sender, snapshot_receiver) = watch::channel(None);
    let (listens_sender, listens_receiver) = watch::channel(false);
    let neighbours = Arc::new(NeighbourSlot::default());
    let setpoint = Arc::new(SetpointSlot::default());
    let arrivals = Arc::new(Arrivals::default());
    let fast_path = Arc::new(FastPath::default());
    let wake = Arc::new(Wake::default());
    let link_up = Arc::new(AtomicBool::new(false));
    let counters = Arc::new(Counters::default());
    let loop_ends = LoopEnds {
        requests: request_receiver,
        params: param_receiver,
        saved: saved_receiver,
        setpoint: setpoint.clone(),
        nav_inputs: nav_input_receiver,
        neighbours: neighbours.clone(),
        listens: listens_sender,
        arrivals: arrivals.clone(),
        fast_path: fast_path.clone(),
        wake: wake.clone(),
        replies: reply_sender.clone(),
        snapshot: snapshot_sender,
        events: event_sender,
        notes: note_sender,
        link_up: link_up.clone(),
        counters: counters.clone(),
    };
    let session_ends = SessionEnds {
        requests: request_sender,
        params: param_sender,
        saved: saved_sender,
        setpoint,
        nav_inputs: nav_input_sender,
        neighbours,
        listens: listens_receiver,
        arrivals,
        fast_path,
        wake,
        reply_sender,
        replies: reply_receiver,
        snapshot: snapshot_receiver,
        events: event_receiver,
        link_up,
        counters,
    };
    (loop_ends, session_ends, note_receiver)
}

/// Logs what the control loop notes, until it ends.
pub(crate) async fn log(mut notes: mpsc::Receiver<LineNote>) {
    while let Some(LineNote { line, error }) = notes.recv().await {
        match error {
            Some(error) => tracing::warn!("{line} lost: {error}"),
            None => tracing::info!("{line} restored"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::messages::Lease;

    #[test]
    fn a_late_setpoint_does_not_displace_a_newer_one_of_the_same_grant() {
        let (slot, counters) = (SetpointSlot::default(), Counters::default());
        let put = |root, seq| {
            let lease = Some(Lease { epoch: 1, root });
            let setpoint = Setpoint { lease, seq, echo_tick_ms: None, rpm: 0.0, steering: 0.0 };
            let client = Name::new("me").unwrap();
            slot.put(Waiting { at: Stamp::ZERO, arrival: 0, client, setpoint }, &counters);
        };
        put(1, 2);
        put(1, 1);
        put(1, 3);
        put(2, 1);
        let setpoint = slot.take().unwrap().setpoint;
        assert_eq!((setpoint.lease.unwrap().root, setpoint.seq), (2, 1));
        put(1, 9);
        put(1, 8);
        assert_eq!(slot.take().unwrap().setpoint.seq, 9);
        assert_eq!(counters.rejected_so_far().setpoints_overwritten, 4);
    }
}
