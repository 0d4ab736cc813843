//! The dispatcher as its users run it: a process that may be killed at any moment, clients that ask until they
//! are answered, and a witness of what the robots really drove.

mod pair;
mod storm;
mod witness;

pub use pair::ServePair;
pub use storm::{Storm, Totals, Whom};
pub use witness::{Witness, Written};

use crate::processes::{Process, Signal, program};
use crate::{PATIENCE, name};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use xtb_bus::{Bus, Incoming, SessionRole};
use xtb_protocol::codec::{self, Format};
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{
    DispatchBody, DispatchCode, DispatchOutcome, DispatchReply, DispatchRequest, StandbyReply,
    StandbyRequest, TaskId, TaskKind, TaskList, TaskSpec, Waypoint,
};
use xtb_protocol::{Name, Uuid};

/// A request is given this long, then asked again with the same id; cancellations wait for robots.
const ANSWER_WITHIN: Duration = Duration::from_secs(7);
/// A stopped process does not answer.
const STATUS_WITHIN: Duration = Duration::from_millis(500);
const AGAIN: Duration = Duration::from_millis(20);

/// `fleet-cli dispatch serve` as a process.
pub struct Serve {
    process: Process,
    endpoint: String,
    ledger: PathBuf,
    /// How long it took to be ready, from its start on.
    pub ready_within: Duration,
}

impl Serve {
    /// Starts it and waits until it is ready.
    ///
    /// # Panics
    /// If it does not start.
    #[must_use]
    pub fn start(endpoint: &str, ledger: &Path) -> Self {
        let mut command = Self::command(endpoint, ledger);
        let began = Instant::now();
        let (process, line) = Process::start_ready(&mut command);
        let ready_within = began.elapsed();
        assert!(line.starts_with("{\"ready\":true"), "the dispatcher says {line:?}");
        Self { process, endpoint: endpoint.to_owned(), ledger: ledger.to_owned(), ready_within }
    }

    /// The command line.
    #[must_use]
    pub fn command(endpoint: &str, ledger: &Path) -> Command {
        let mut command = Command::new(program("fleet-cli"));
        command.args(["--json", "dispatch", "serve", "--connect", endpoint, "--ledger"]).arg(ledger);
        command.stdin(Stdio::null());
        command
    }

    /// `kill -9`.
    pub fn kill(&mut self) {
        self.process.signal(Signal::Kill);
        let _ = self.process.0.wait();
    }

    /// Starts it again on the same ledger.
    ///
    /// # Panics
    /// If it does not start.
    pub fn restart(&mut self) {
        *self = Self::start(&self.endpoint, &self.ledger);
    }
}

/// A client of the dispatcher.
#[derive(Debug, Clone)]
pub struct Asker {
    bus: Bus,
    keys: FleetKeys,
    me: Name,
}

impl Asker {
    /// On a session that is open.
    #[must_use]
    pub fn new(bus: &Bus, me: &str) -> Self {
        Self { bus: bus.clone(), keys: FleetKeys::new(name("lab")), me: name(me) }
    }

    /// On a session of its own.
    ///
    /// # Panics
    /// If it cannot be opened.
    pub async fn connect(endpoint: &str, me: &str) -> Self {
        let role = SessionRole::Client { connect: vec![endpoint.to_owned()] };
        Self::new(&xtb_bus::open(&role).await.unwrap_or_else(|error| panic!("{error}")), me)
    }

    /// Asks once; `None` = no answer.
    ///
    /// # Panics
    /// If Zenoh fails, or the answer is none of ours.
    pub async fn ask_once(&self, request: &DispatchRequest) -> Option<DispatchReply> {
        let key = self.keys.dispatch_cmd(Some(&self.me));
        let bytes = codec::encode(request, Format::Postcard).unwrap_or_else(|error| panic!("{error}"));
        let encoding = codec::encoding::<DispatchRequest>(Format::Postcard);
        let answer = self.bus.ask_raw(&key, &encoding, bytes, ANSWER_WITHIN).await;
        let answer = answer.unwrap_or_else(|error| panic!("{error}"))?;
        Some(answer.decode().unwrap_or_else(|error| panic!("{error}")))
    }

    /// Asks again and again with the same id, until the dispatcher has settled it; how often it asked comes too.
    ///
    /// # Panics
    /// If nobody answers in time.
    pub async fn ask_until(&self, body: DispatchBody, patience: Duration) -> (DispatchOutcome, u32) {
        let request = DispatchRequest { id: Uuid::new_v4(), body };
        let give_up = Instant::now() + patience;
        let mut asked = 0;
        loop {
            asked += 1;
            if let Some(DispatchReply { id, result, .. }) = self.ask_once(&request).await {
                assert_eq!(id, request.id, "an answer to another question");
                let busy = |code| matches!(code, DispatchCode::Overloaded | DispatchCode::LedgerFailed);
                if !matches!(&result, DispatchOutcome::Error(error) if busy(error.code)) {
                    return (result, asked);
                }
            }
            assert!(Instant::now() < give_up, "no answer within {patience:?} to {request:?}");
            tokio::time::sleep(AGAIN).await;
        }
    }

    /// The same, for as long as a test waits for anything.
    ///
    /// # Panics
    /// If nobody answers in time.
    pub async fn ask(&self, body: DispatchBody) -> DispatchOutcome {
        self.ask_until(body, PATIENCE).await.0
    }

    /// Submits tasks, which must be taken.
    ///
    /// # Panics
    /// If they are not.
    pub async fn submit(&self, tasks: Vec<TaskSpec>) -> Vec<TaskId> {
        match self.ask(DispatchBody::Submit { tasks }).await {
            DispatchOutcome::Submitted(tasks) => tasks,
            other => panic!("not taken: {other:?}"),
        }
    }

    /// How a dispatcher stands with its stand-by, if there is one; of two the later one.
    ///
    /// # Panics
    /// If Zenoh fails.
    pub async fn standby(&self) -> Option<StandbyReply> {
        let (key, channel) =
            (self.keys.dispatch_standby(Some(&self.me)), Channel::DispatchStandby(self.me.clone()));
        let mut replies = Vec::<StandbyReply>::new();
        let each = |answer: Incoming| replies.extend(answer.decode::<StandbyReply>().ok());
        let asked = self.bus.ask_each(&key, &channel, &StandbyRequest::Status {}, STATUS_WITHIN, each).await;
        asked.unwrap_or_else(|error| panic!("{error}"));
        replies.into_iter().max_by_key(|reply| reply.term)
    }

    /// The list of tasks, if there is a dispatcher.
    ///
    /// # Panics
    /// If Zenoh fails, or the answer is none of ours.
    pub async fn list(&self) -> Option<TaskList> {
        let list = self.page("").await?;
        if list.left_out == 0 {
            return Some(list);
        }
        let mut whole = self.page("?after=t0").await?;
        while let Some(last) = whole.tasks.last().filter(|_| whole.left_out > 0) {
            let next = self.page(&format!("?after={}", last.id)).await?;
            whole.tasks.extend(next.tasks);
            whole.left_out = next.left_out;
        }
        Some(whole)
    }

    async fn page(&self, parameters: &str) -> Option<TaskList> {
        let selector = format!("{}{parameters}", self.keys.dispatch_tasks());
        let answers = self.bus.get(&selector, ANSWER_WITHIN).await.unwrap_or_else(|error| panic!("{error}"));
        answers.first().map(|answer| answer.decode().unwrap_or_else(|error| panic!("{error}")))
    }
}

/// A drive to a point.
#[must_use]
pub fn goto(x_m: f64, y_m: f64) -> TaskSpec {
    TaskSpec::new(TaskKind::Goto { to: Waypoint { x_m, y_m, yaw_rad: None } })
}

/// A drive along points.
#[must_use]
pub fn route(points: &[(f64, f64)]) -> TaskSpec {
    let points = points.iter().map(|&(x_m, y_m)| Waypoint { x_m, y_m, yaw_rad: None }).collect();
    TaskSpec::new(TaskKind::Route { points, loops: 1, dwell_s: 0.0 })
}
