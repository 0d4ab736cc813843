//! A stand-by: follows the dispatcher, with a copy of its ledger, and takes over when that is dead. The rules are
//! [`xtb_dispatch::replication`]'s.

mod copied_ledger;

use super::CLIENT;
use super::store::Store;
use copied_ledger::CopiedLedger;
use rustix::time::{ClockId, clock_gettime};
use std::path::PathBuf;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::time::MissedTickBehavior;
use xtb_bus::PresenceWatch;
use xtb_client::client::Client;
use xtb_client::state_feed::StateFeed;
use xtb_client::{Error, ErrorKind, Result};
use xtb_dispatch::replication::{Follower, Observed, StandbyDecision, Times};
use xtb_protocol::Name;
use xtb_protocol::codec::{self, Format};
use xtb_protocol::messages::{Copied, StandbyReply, StandbyRequest};

/// It looks around this often.
const TICK: Duration = Duration::from_millis(50);
/// A question that nobody answered is asked again after this.
const ASK_AGAIN: Duration = Duration::from_millis(100);
/// An answer is waited for this long.
const ANSWER_WITHIN: Duration = Duration::from_secs(1);
/// And that to the last word.
const LEAVE_WITHIN: Duration = Duration::from_millis(500);

/// What changes for a stand-by.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StandbyChange {
    /// It follows a dispatcher and copies its records.
    Follows,
    /// It has all of them: the dispatcher acknowledges nothing that it lacks.
    Paired,
    /// The dispatcher is silent; why it does not take over yet.
    Waits(String),
    /// No dispatcher answers, and it does not take over by itself.
    Stale {
        /// Its ledger is a copy; else it was a dispatcher's, whose stand-by may have taken over.
        copied: bool,
    },
    /// Its own ledger was another one: that is kept here, and the dispatcher's is copied from the beginning.
    BegunAnew(Option<PathBuf>),
    /// It takes over, in this term.
    TakesOver(u32),
    /// There is no dispatcher, and nobody can have newer records: its ledger is that of the last one.
    Continues,
}

impl StandbyChange {
    /// For programs.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Follows => "follows",
            Self::Paired => "paired",
            Self::Waits(_) => "waits",
            Self::Stale { .. } => "stale",
            Self::BegunAnew(_) => "begun_anew",
            Self::TakesOver(_) => "takes_over",
            Self::Continues => "continues",
        }
    }

    /// In words.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Follows => "following the dispatcher, copying its records".to_owned(),
            Self::Paired => {
                "paired: the dispatcher acknowledges nothing that is not stored here too".to_owned()
            }
            Self::Waits(why) => why.clone(),
            Self::Stale { copied: true } => {
                "no dispatcher answers, and this stand-by may lack records: it does not take over by itself. Start \
                 the dispatcher, or, if its ledger is lost, this one with --promote"
                    .to_owned()
            }
            Self::Stale { copied: false } => {
                "no dispatcher answers, and the stand-by of this ledger may have taken over: start that one, or, \
                 while it runs as a stand-by, this one without --standby"
                    .to_owned()
            }
            Self::BegunAnew(Some(aside)) => format!(
                "the dispatcher's ledger has other records: copying it anew, the previous one is kept as {}",
                aside.display()
            ),
            Self::BegunAnew(None) => "the dispatcher's ledger has other records: copying it anew".to_owned(),
            Self::TakesOver(term) => format!("the dispatcher is dead: taking over, in term {term}"),
            Self::Continues => {
                "there is no dispatcher, and this ledger has all records: continuing with it".to_owned()
            }
        }
    }
}

/// What it sees and holds, besides the copy.
struct Around {
    client: Client,
    times: Times,
    follower: Follower,
    feed: StateFeed,
    present: Arc<AtomicBool>,
    _presence: PresenceWatch,
}

/// Follows the fleet's dispatcher until it is dead: then this is its ledger, in the next term, to be given to
/// [`DispatchService::start`](super::DispatchService::start). `None`: it was stopped.
///
/// # Errors
/// The dispatcher has another ledger, the disk refuses, it took too long to take over, or Zenoh would not.
pub async fn stand_by(
    client: &Client,
    store: Store,
    stopped: impl Future<Output = ()>,
    mut tell: impl FnMut(&StandbyChange),
) -> Result<Option<Store>> {
    let mut around = Around::open(client).await?;
    let mut copy = CopiedLedger::new(store, client.fleet().clone())?;
    let mut asking = Box::pin(ask(around.client.clone(), copy.question(0)?, Duration::ZERO));
    let mut stopped = pin!(stopped);
    let mut tick = tokio::time::interval(TICK);
    tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut told = None;
    loop {
        tokio::select! {
            () = &mut stopped => {
                around.leave(copy.id()).await;
                return Ok(None);
            }
            (asked_ms, reply) = &mut asking => {
                let again = if reply.is_some() { Duration::ZERO } else { ASK_AGAIN };
                if let Some(reply) = reply {
                    let id = copy.id();
                    copy = match answered(&mut around, copy, asked_ms, reply, &mut tell) {
                        Ok(copy) => copy,
                        Err(error) => {
                            around.leave(id).await;
                            return Err(error);
                        }
                    };
                }
                let question = copy.question(around.follower.knows())?;
                asking = Box::pin(ask(around.client.clone(), question, again));
            }
            _ = tick.tick() => {}
        }
        let seen = around.seen();
        let change = match around.follower.step(since_start_ms(), &seen) {
            StandbyDecision::Paired => StandbyChange::Paired,
            StandbyDecision::CatchingUp => StandbyChange::Follows,
            StandbyDecision::Waits(why) => StandbyChange::Waits(why),
            StandbyDecision::Stale if copy.is_last() && !seen.present => {
                tell(&StandbyChange::Continues);
                return Ok(Some(copy.into_store()));
            }
            StandbyDecision::Stale => StandbyChange::Stale { copied: copy.is_copied() },
            StandbyDecision::TakeOver => return take_over(&around, copy, &mut tell).map(Some),
        };
        if told.as_ref() != Some(&change) {
            tell(&change);
            told = Some(change);
        }
    }
}

/// An answer: its records go to the disk, and then the next question says so.
fn answered(
    around: &mut Around,
    mut copy: CopiedLedger,
    asked_ms: u64,
    reply: StandbyReply,
    tell: &mut impl FnMut(&StandbyChange),
) -> Result<CopiedLedger> {
    if reply.ledger == 0 || copy.is_ahead_of(&reply) {
        return Ok(copy);
    }
    copy.check_ledger(reply.ledger)?;
    let standby = reply.standby.as_ref();
    let paired = standby.is_some_and(|standby| standby.copy == copy.id() && standby.paired);
    match reply.copied {
        Copied::Diverged {} => {
            let (anew, aside) = copy.begin_anew()?;
            tell(&StandbyChange::BegunAnew(aside));
            return Ok(anew);
        }
        Copied::Records(records) => copy.take(records)?,
    }
    around.follower.answered(asked_ms, reply.run, paired, reply.witnesses);
    Ok(copy)
}

fn take_over(around: &Around, copy: CopiedLedger, tell: &mut impl FnMut(&StandbyChange)) -> Result<Store> {
    let mut store = copy.into_store();
    let term = store.raise_term()?;
    if !around.follower.is_in_time(since_start_ms()) {
        let message = "the disk was too slow to take over: the dispatcher may have continued alone";
        return Err(Error::new(ErrorKind::Failed, message)
            .hint("start this one again with --standby, or, if the dispatcher is lost, with --promote"));
    }
    store.end_copy()?;
    tell(&StandbyChange::TakesOver(term));
    Ok(store)
}

/// Time since this computer was started, also that in which it slept: its dispatcher may have gone on meanwhile.
fn since_start_ms() -> u64 {
    #[cfg(target_os = "linux")]
    let clock = ClockId::Boottime;
    #[cfg(not(target_os = "linux"))]
    let clock = ClockId::Monotonic;
    let now = clock_gettime(clock);
    now.tv_sec.unsigned_abs() * 1_000 + u64::try_from(now.tv_nsec).unwrap_or(0) / 1_000_000
}

/// Asks once, after a while: when, and what came.
async fn ask(client: Client, question: StandbyRequest, after: Duration) -> (u64, Option<StandbyReply>) {
    tokio::time::sleep(after).await;
    let asked_ms = since_start_ms();
    (asked_ms, ask_once(&client, &question, ANSWER_WITHIN).await)
}

async fn ask_once(client: &Client, question: &StandbyRequest, within: Duration) -> Option<StandbyReply> {
    // As who it is: under identities only a dispatcher may ask by this name.
    let me = Name::new(CLIENT).map_err(|error| tracing::debug!("{error}")).ok()?;
    let key = client.keys().dispatch_standby(Some(&me));
    let encoding = codec::encoding::<StandbyRequest>(Format::Postcard);
    let told = |what: String| tracing::debug!("asking the dispatcher: {what}");
    let bytes = codec::encode(question, Format::Postcard).map_err(|error| told(error.to_string())).ok()?;
    let answer = client.bus().ask_raw(&key, &encoding, bytes, within).await;
    let answer = answer.map_err(|error| told(error.to_string())).ok()??;
    answer.decode().map_err(|error| told(error.to_string())).ok()
}

impl Around {
    async fn open(client: &Client) -> Result<Self> {
        let times = Times::default();
        let present = Arc::new(AtomicBool::new(false));
        let shown = present.clone();
        let each = move |_: &str, there: bool| shown.store(there, Ordering::Relaxed);
        let _presence = client.bus().watch_alive(&client.keys().dispatch_alive(), each).await?;
        let feed = StateFeed::open(client, &client.keys().any_robot()).await?;
        let follower = Follower::new(times, since_start_ms());
        Ok(Self { client: client.clone(), times, follower, feed, present, _presence })
    }

    /// Robots whose states come in, and one that has just heard the dispatcher.
    fn seen(&self) -> Observed {
        let states = self.feed.shared_states();
        let fresh = || states.iter().filter_map(|(name, seen)| Some((name, seen.fresh()?)));
        let hears = fresh().find(|(_, state)| {
            let lease = state.lease.as_ref().filter(|lease| lease.holder.as_str() == CLIENT);
            lease.is_some_and(|lease| lease.age_ms < self.times.heard_ms)
        });
        Observed {
            present: self.present.load(Ordering::Relaxed),
            hears: hears.map(|(name, _)| name.clone()),
            robots: fresh().map(|(name, _)| name.clone()).collect(),
        }
    }

    /// Says that it does not take over: the dispatcher need not wait to find out.
    async fn leave(&self, copy: u64) {
        let _ = ask_once(&self.client, &StandbyRequest::Leave { copy }, LEAVE_WITHIN).await;
    }
}
