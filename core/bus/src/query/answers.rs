//! The answers to one question: how many and how long they may be, and where they wait to be read.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use tokio::sync::mpsc::{self, error::TrySendError};
use xtb_protocol::keys::{Channel, Key};
use xtb_protocol::messages::{
    DispatchReply, FleetAlerts, FleetHomes, FleetMap, FleetPlaces, HistoryReply, LogReply, MapHistory,
    Message, ParamReply, Roster, StandbyReply, TaskList, Truth,
};
use xtb_protocol::wire;
use zenoh::query::Reply as Answer;

/// Answers to one question that wait to be read, and that are collected: twice the 1,024 robots of the largest
/// fleet, so that some may be answered for twice. What comes beyond is dropped, and said.
pub(super) const ANSWERS: usize = 2048;
/// Their payloads in sum, in bytes: 1,024 robots with the longest message that a robot may answer.
pub(super) const ANSWERS_BYTES: usize = 1024 * wire::MAX_BYTES;

/// How long an answer on a channel may be, in bytes: as `decode` has it.
fn longest_bytes(channel: &Channel) -> usize {
    match channel {
        Channel::Log(_) => LogReply::MAX_BYTES,
        Channel::Param(_) => ParamReply::MAX_BYTES,
        Channel::Map => FleetMap::MAX_BYTES,
        Channel::Places => FleetPlaces::MAX_BYTES,
        Channel::MapHistory => MapHistory::MAX_BYTES,
        Channel::DispatchCmd(_) => DispatchReply::MAX_BYTES,
        Channel::DispatchStandby(_) => StandbyReply::MAX_BYTES,
        Channel::DispatchTasks => TaskList::MAX_BYTES,
        Channel::DispatchHomes => FleetHomes::MAX_BYTES,
        Channel::DispatchAlerts => FleetAlerts::MAX_BYTES,
        Channel::DispatchHistory => HistoryReply::MAX_BYTES,
        Channel::SimTruth => Truth::MAX_BYTES,
        Channel::SimRoster => Roster::MAX_BYTES,
        Channel::Alive
        | Channel::State
        | Channel::StateJson
        | Channel::Sensors
        | Channel::Event
        | Channel::EventJson
        | Channel::About
        | Channel::Fix
        | Channel::Route
        | Channel::Near(_)
        | Channel::Cmd(_)
        | Channel::Teleop(_)
        | Channel::Estop(_)
        | Channel::EstopAll(_)
        | Channel::MapEdit(_)
        | Channel::TrafficAlive
        | Channel::TrafficState
        | Channel::DispatchAlive
        | Channel::DispatchEvent
        | Channel::DispatchAck(_)
        | Channel::Identity(_)
        | Channel::SimStats => wire::MAX_BYTES,
    }
}

/// Whether no message on this answer's key may be so long. On a key that is none of ours: longer than most.
fn is_too_long(answer: &Answer) -> bool {
    answer.result().is_ok_and(|sample| {
        let key = Key::parse(sample.key_expr().as_str());
        sample.payload().len() > key.map_or(wire::MAX_BYTES, |key| longest_bytes(&key.channel))
    })
}

fn payload_bytes(answer: &Answer) -> usize {
    match answer.result() {
        Ok(sample) => sample.payload().len(),
        Err(error) => error.payload().len(),
    }
}

/// Where the answers to a question are read.
pub(crate) struct Answers {
    queue: mpsc::Receiver<Answer>,
    waiting_bytes: Arc<AtomicUsize>,
}

impl Answers {
    /// The next one; `None` = there will be no more.
    pub(crate) async fn recv(&mut self) -> Option<Answer> {
        let answer = self.queue.recv().await?;
        self.waiting_bytes.fetch_sub(payload_bytes(&answer), Ordering::Relaxed);
        Some(answer)
    }
}

/// Where the answers to a question come in, and where they are read. Coming in never waits: Zenoh hands
/// over what this very session knows before the question returns, so that nobody reads yet.
pub(crate) fn answers(key_expr: &str) -> (impl Fn(Answer) + Send + Sync + use<>, Answers) {
    let (sender, queue) = mpsc::channel(ANSWERS);
    let waiting_bytes = Arc::new(AtomicUsize::new(0));
    let answers = Answers { queue, waiting_bytes: Arc::clone(&waiting_bytes) };
    let (key_expr, full, too_long) = (key_expr.to_owned(), AtomicBool::new(false), AtomicBool::new(false));
    let inlet = move |reply: Answer| {
        if is_too_long(&reply) {
            if !too_long.swap(true, Ordering::Relaxed) {
                tracing::warn!(
                    "dropped an answer on {key_expr}: {} bytes are too many",
                    payload_bytes(&reply)
                );
            }
            return;
        }
        let bytes = payload_bytes(&reply);
        let room = waiting_bytes.fetch_add(bytes, Ordering::Relaxed) + bytes <= ANSWERS_BYTES;
        let sent = if room { sender.try_send(reply) } else { Err(TrySendError::Full(reply)) };
        if let Err(error) = sent {
            waiting_bytes.fetch_sub(bytes, Ordering::Relaxed);
            // Whoever has given up reads no more: that is no loss.
            if matches!(error, TrySendError::Full(_)) && !full.swap(true, Ordering::Relaxed) {
                tracing::warn!("more answers on {key_expr} at once than can wait: some were lost");
            }
        }
    };
    (inlet, answers)
}
