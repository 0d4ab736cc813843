//! Talking with the fleet's dispatcher: questions that are asked until answered, and news of tasks.

mod pages;

use crate::client::Client;
use crate::error::{Error, ErrorKind, Result};
use serde::Serialize;
use std::pin::pin;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use xtb_bus::{BusError, Incoming, Subscription};
use xtb_identity::Action;
use xtb_protocol::Uuid;
use xtb_protocol::codec::{self, Format};
use xtb_protocol::keys::Channel;
use xtb_protocol::messages::{
    Adopted, DispatchBody, DispatchCode, DispatchError, DispatchOutcome, DispatchReply, DispatchRequest,
    DispatchStatus, FleetHomes, Message, StandbyReply, StandbyRequest, Suspension, SuspensionCause,
    TaskChange, TaskHistory, TaskId, TaskSpec, Waypoint,
};
use xtb_protocol::wire::CodecError;

/// A dispatcher that is just starting, or is started again, is waited for this long.
const STARTS_WITHIN: Duration = Duration::from_secs(5);
/// The dispatcher answers a change within 5 s, confirmed or not.
const CONFIRMS_WITHIN: Duration = Duration::from_secs(6);
/// Anything else it answers as soon as it is in the ledger; then the same is asked again.
const ANSWERS_WITHIN: Duration = Duration::from_secs(2);
/// Whether it is there shows within this.
const IS_THERE_WITHIN: Duration = Duration::from_millis(500);
/// Between a question that nobody answered and the next one.
const ASK_AGAIN: Duration = Duration::from_millis(200);
/// Who waits longer than this is told for what.
const SAY_SO_AFTER: Duration = Duration::from_secs(1);

const HOW_TO_START: &str = "start one with `fleet-cli dispatch serve` or `fleet-cli sim --dispatch`";

/// What became of the tasks of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Changes {
    /// Each; of very many first those that are not as asked.
    pub tasks: Vec<TaskChange>,
    /// Changes for which the answer had no room.
    pub left_out: u64,
}

/// Tasks that were taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Taken {
    /// In the order of the submission.
    pub tasks: Vec<TaskId>,
    /// What keeps the dispatcher from assigning them.
    pub suspended: Vec<Suspension>,
}

/// The suspension of the dispatcher as a whole, if there is one.
#[must_use]
pub fn fleet_stop(all: &[Suspension]) -> Option<&Suspension> {
    all.iter().find(|suspension| matches!(suspension.cause, SuspensionCause::FleetStop { .. }))
}

/// How the dispatcher stands.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Status {
    /// Ledger, map and tasks.
    #[serde(flatten)]
    pub dispatcher: DispatchStatus,
    /// What is suspended.
    pub suspended: Vec<Suspension>,
}

/// The fleet's dispatcher, as a client sees it.
#[derive(Debug, Clone, Copy)]
pub struct DispatcherClient<'a> {
    client: &'a Client,
    starts_within: Duration,
    waiting: Option<Waiting>,
}

/// Says what is waited for, until what it gives back is dropped.
pub type Waiting = fn(&'static str) -> Box<dyn Send>;

impl<'a> DispatcherClient<'a> {
    /// Over a client's session.
    #[must_use]
    pub fn of(client: &'a Client) -> Self {
        Self { client, starts_within: STARTS_WITHIN, waiting: None }
    }

    /// The same; `waiting` is called when an answer takes longer than a second.
    #[must_use]
    pub fn saying(self, waiting: Waiting) -> Self {
        Self { waiting: Some(waiting), ..self }
    }

    /// Submits tasks, all or none. Asked again with the same id until answered, so that they are taken
    /// once.
    ///
    /// # Errors
    /// The dispatcher's refusal, [`ErrorKind::NoDispatcher`], or [`ErrorKind::OutcomeUnknown`].
    pub async fn submit(&self, tasks: Vec<TaskSpec>) -> Result<Taken> {
        self.submit_as(Uuid::new_v4(), tasks).await
    }

    /// The same under an id of the caller's: a submission that was taken before, also by a client of the same name
    /// that was killed since, is answered with the same tasks.
    ///
    /// # Errors
    /// As [`Self::submit`].
    pub async fn submit_as(&self, id: Uuid, tasks: Vec<TaskSpec>) -> Result<Taken> {
        let request = DispatchRequest { id, body: DispatchBody::Submit { tasks } };
        let reply = self.ask(request, self.starts_within).await?;
        match reply.result {
            DispatchOutcome::Submitted(tasks) => Ok(Taken { tasks, suspended: reply.suspended }),
            other => Err(unexpected(&other)),
        }
    }

    /// Lets it assign tasks again; what that has ended, and what is suspended all the same.
    ///
    /// # Errors
    /// As [`Self::submit`].
    pub async fn activate(&self) -> Result<(Option<Suspension>, Vec<Suspension>)> {
        let reply = self.ask(new(DispatchBody::Activate {}), self.starts_within).await?;
        match reply.result {
            DispatchOutcome::Activated(ended) => Ok((ended, reply.suspended)),
            other => Err(unexpected(&other)),
        }
    }

    /// Takes the tasks of other maps over to the fleet's.
    ///
    /// # Errors
    /// As [`Self::submit`].
    pub async fn adopt(&self) -> Result<Adopted> {
        match self.ask(new(DispatchBody::Adopt {}), self.starts_within).await?.result {
            DispatchOutcome::Adopted(adopted) => Ok(adopted),
            other => Err(unexpected(&other)),
        }
    }

    /// How it stands.
    ///
    /// # Errors
    /// As [`Self::show`].
    pub async fn status(&self) -> Result<Status> {
        let reply = self.ask(new(DispatchBody::Status {}), Duration::ZERO).await?;
        match reply.result {
            DispatchOutcome::Status(dispatcher) => Ok(Status { dispatcher, suspended: reply.suspended }),
            other => Err(unexpected(&other)),
        }
    }

    /// How it stands with its stand-by, and in which term it assigns; of two the one of the later term. `None`: it
    /// does not say.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`]: Zenoh would not.
    pub async fn standby(&self) -> Result<Option<StandbyReply>> {
        let name = self.client.name();
        let (key, channel) =
            (self.client.keys().dispatch_standby(Some(name)), Channel::DispatchStandby(name.clone()));
        let (within, mut replies) = (self.within(IS_THERE_WITHIN), Vec::<StandbyReply>::new());
        let each = |answer: Incoming| match answer.decode() {
            Ok(reply) => replies.push(reply),
            Err(error) => tracing::debug!("on {}: {error}", answer.key),
        };
        self.client.bus().ask_each(&key, &channel, &StandbyRequest::Status {}, within, each).await?;
        Ok(replies.into_iter().max_by_key(|reply| reply.term))
    }

    /// Which robots are at a dock or on the way to one; `None`: it does not say, because it is older than docks.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`]: Zenoh would not.
    pub async fn homes(&self) -> Result<Option<FleetHomes>> {
        let key = self.client.keys().dispatch_homes();
        let answers = crate::client::get(self.client.bus(), &key, self.within(IS_THERE_WITHIN)).await?;
        let read = |answer: &Incoming| {
            answer.decode().inspect_err(|error| tracing::warn!("on {}: {error}", answer.key)).ok()
        };
        Ok(answers.iter().find_map(read))
    }

    /// Cancels, pauses, resumes or retries; answered when robots have confirmed, or have not in time.
    ///
    /// # Errors
    /// As [`Self::submit`].
    pub async fn change(&self, body: DispatchBody) -> Result<Changes> {
        let DispatchReply { result, left_out, .. } = self.ask(new(body), self.starts_within).await?;
        match result {
            DispatchOutcome::Changed(tasks) => Ok(Changes { tasks, left_out }),
            other => Err(unexpected(&other)),
        }
    }

    /// Adds points to a route that has `after` points, in m and rad; the same again changes nothing.
    ///
    /// # Errors
    /// As [`Self::submit`]; [`DispatchCode::Stale`]: it has other points.
    pub async fn extend(&self, task: TaskId, after: u32, points: Vec<Waypoint>) -> Result<()> {
        self.change_one(DispatchBody::Extend { task, after, points }).await
    }

    /// As [`Self::change`], of one task.
    ///
    /// # Errors
    /// As [`Self::change`]; why it is not as asked.
    pub async fn change_one(&self, body: DispatchBody) -> Result<()> {
        let changes = self.change(body).await?;
        worst(&changes.tasks).map_or(Ok(()), |error| Err(error.clone().into()))
    }

    /// One task with its history.
    ///
    /// # Errors
    /// As [`Self::submit`]; a dispatcher that does not run is not waited for.
    pub async fn show(&self, task: TaskId) -> Result<TaskHistory> {
        match self.ask(new(DispatchBody::Show { task }), Duration::ZERO).await?.result {
            DispatchOutcome::Shown(history) => Ok(*history),
            other => Err(unexpected(&other)),
        }
    }

    /// Longer on a slow link.
    fn within(&self, usual: Duration) -> Duration {
        self.client.round_trip().patience(usual)
    }

    /// Whether one runs.
    pub async fn is_there(&self) -> bool {
        let within = self.within(IS_THERE_WITHIN);
        let alive = self.client.bus().alive(&self.client.keys().dispatch_alive(), within).await;
        alive.is_ok_and(|keys| !keys.is_empty())
    }

    /// Says what is waited for if the answer takes its time.
    async fn ask(&self, request: DispatchRequest, patience: Duration) -> Result<DispatchReply> {
        let body = &request.body;
        let shows = matches!(body, DispatchBody::Show { .. } | DispatchBody::Status {});
        let hint = "`fleet-cli tasks` shows all tasks to whoever may look";
        self.client.may(Action::ChangeTasks).map_err(|error| if shows { error.hint(hint) } else { error })?;
        let what = match body {
            DispatchBody::Show { .. } | DispatchBody::Status {} => None,
            DispatchBody::Submit { .. } | DispatchBody::Activate {} | DispatchBody::Adopt {} => {
                Some("waiting for a dispatcher")
            }
            _ => Some("waiting for the dispatcher and for the robots' confirmation"),
        };
        let mut asking = pin!(self.ask_quietly(&request, patience));
        tokio::select! {
            outcome = &mut asking => return outcome,
            () = tokio::time::sleep(SAY_SO_AFTER) => {}
        }
        let _said = what.zip(self.waiting).map(|(what, say)| say(what));
        asking.await
    }

    async fn ask_quietly(&self, request: &DispatchRequest, patience: Duration) -> Result<DispatchReply> {
        request.validate().map_err(|error| Error::new(ErrorKind::Invalid, error.to_string()))?;
        let (within, left_undone) = match &request.body {
            DispatchBody::Submit { .. } => (ANSWERS_WITHIN, "nothing was submitted"),
            DispatchBody::Show { .. } | DispatchBody::Status {} => (ANSWERS_WITHIN, "no request was sent"),
            DispatchBody::Activate {} | DispatchBody::Adopt {} => (ANSWERS_WITHIN, "nothing was changed"),
            _ => (CONFIRMS_WITHIN, "nothing was changed"),
        };
        let began = Instant::now();
        let (mut was_there, mut busy) = (false, None);
        loop {
            let (asked, within) = (Instant::now(), self.within(within));
            match self.ask_once(request, within).await? {
                Some(DispatchReply { result: DispatchOutcome::Error(error), .. }) => match error.code {
                    DispatchCode::Overloaded => busy = Some(error),
                    _ => return Err(error.into()),
                },
                Some(reply) => return Ok(reply),
                // Where nobody could have got it the question ends at once.
                None if asked.elapsed() >= within => was_there = true,
                None => was_there |= self.is_there().await,
            }
            if began.elapsed() >= patience {
                // What turned one away may have taken another.
                return Err(match busy.filter(|_| !was_there) {
                    Some(busy) => busy.into(),
                    None => self.client.explained(self.silent(patience, left_undone, was_there)).await,
                });
            }
            tokio::time::sleep(ASK_AGAIN).await;
        }
    }

    /// Asks; a dispatcher of the version before, which cannot read the question and says so, in its version too.
    async fn ask_once(&self, request: &DispatchRequest, within: Duration) -> Result<Option<DispatchReply>> {
        let Some((reply, format)) = self.ask_in(request, Format::Postcard, within).await? else {
            return Ok(None);
        };
        let unread =
            matches!(&reply.result, DispatchOutcome::Error(error) if error.code == DispatchCode::Malformed);
        if !unread || format != Format::Previous {
            return Ok(Some(reply));
        }
        Ok(self.ask_in(request, Format::Previous, within).await?.map(|(reply, _)| reply))
    }

    async fn ask_in(
        &self,
        request: &DispatchRequest,
        format: Format,
        within: Duration,
    ) -> Result<Option<(DispatchReply, Format)>> {
        let key = self.client.keys().dispatch_cmd(Some(self.client.name()));
        let bytes = codec::encode(request, format).map_err(|error| match error {
            CodecError::TooNew { .. } => too_new(&error),
            other => BusError::from(other).into(),
        })?;
        let encoding = codec::encoding::<DispatchRequest>(format);
        let answer = match self.client.bus().ask_raw(&key, &encoding, bytes, within).await {
            Ok(answer) => answer,
            Err(error @ BusError::Operation { .. }) => {
                tracing::debug!("{error}");
                None
            }
            Err(error) => return Err(error.into()),
        };
        let Some(Incoming { encoding, payload, .. }) = answer else { return Ok(None) };
        codec::decode(&encoding, &payload).map(Some).map_err(|error| not_ours(&error.to_string()))
    }

    /// Nobody has answered.
    fn silent(&self, waited: Duration, left_undone: &str, was_there: bool) -> Error {
        let fleet = self.client.fleet();
        if was_there {
            let message = format!("the dispatcher of fleet {fleet} does not answer: outcome unknown");
            return Error::new(ErrorKind::OutcomeUnknown, message)
                .hint("`fleet-cli tasks` shows its tasks as soon as it answers");
        }
        let waited = match waited.as_secs() {
            0 => String::new(),
            seconds => format!(" (waited {seconds} s)"),
        };
        let message = format!("fleet {fleet} has no dispatcher{waited}: {left_undone}");
        Error::new(ErrorKind::NoDispatcher, message).hint(HOW_TO_START)
    }
}

fn new(body: DispatchBody) -> DispatchRequest {
    DispatchRequest { id: Uuid::new_v4(), body }
}

fn unexpected(outcome: &DispatchOutcome) -> Error {
    not_ours(&format!("{outcome:?}").chars().take(80).collect::<String>())
}

fn not_ours(what: &str) -> Error {
    Error::new(ErrorKind::Failed, format!("unreadable answer from the dispatcher: {what}"))
        .hint("compare `fleet-cli --version` here and where the dispatcher runs")
}

/// It is of the version before, which does not know this.
fn too_new(error: &CodecError) -> Error {
    Error::new(ErrorKind::Failed, format!("the dispatcher is of an earlier release: {error}"))
        .hint("update where the dispatcher runs (docs/upgrade.md)")
}

/// Why a task is not as asked, if it is not; the worst of several decides how the command ends.
#[must_use]
pub fn worst(changes: &[TaskChange]) -> Option<&DispatchError> {
    let errors = || changes.iter().filter_map(|change| change.error.as_ref());
    errors().find(|error| error.code == DispatchCode::Unconfirmed).or_else(|| errors().next())
}

/// Says when a task has changed, until it is dropped.
pub struct TaskChanges {
    arrived: Arc<Notify>,
    _subscription: Subscription,
}

impl TaskChanges {
    /// Subscribes.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`]: Zenoh would not.
    pub async fn open(client: &Client) -> Result<Self> {
        let arrived = Arc::new(Notify::new());
        let notify = Arc::clone(&arrived);
        let _subscription =
            client.bus().subscribe(&client.keys().dispatch_event(), move |_| notify.notify_one()).await?;
        Ok(Self { arrived, _subscription })
    }

    /// Waits for a change since the last call, `at_most` this long.
    pub async fn next(&self, at_most: Duration) {
        // Time is up, or something has come: both are a reason to look.
        let _ = tokio::time::timeout(at_most, self.arrived.notified()).await;
    }
}

#[cfg(test)]
mod tests;
