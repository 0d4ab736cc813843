//! Goals: one robot drives to a point or wanders; sent, followed to its end, taken back.

mod cancel;
mod follow;

pub use cancel::{Cancelled, cancel, stop_hint};
pub use follow::GoalOutcome;

use crate::client::{Client, LastState};
use crate::control::Control;
use crate::error::{Error, ErrorKind, Result};
use crate::state_feed::{Events, StateFeed};
use follow::Follow;
use std::fmt;
use std::time::{Duration, Instant};
use tokio::time::{Interval, MissedTickBehavior};
use xtb_protocol::Uuid;
use xtb_protocol::messages::{Body, GoalStatus, LinkLoss, RejectCode, Via};

/// A goal that outlives its client may take this long (the robot's own default too).
const FINISH_WITHIN: Duration = Duration::from_secs(300);
/// How often progress is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// How often the robot is asked how it stands, if the link can.
const STATE_EVERY: Duration = Duration::from_millis(150);
/// A robot that was not heard for this long may be anywhere: watching ends, outcome unknown.
const GIVE_UP_AFTER: Duration = Duration::from_secs(5);
/// Control that was lost shows within this, two retains.
const LOSS_SHOWS: Duration = Duration::from_millis(300);
/// Who has lost control waits this long to see what came of the goal.
const LOSS_SETTLES: Duration = Duration::from_secs(1);

/// What a goal is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GoalTarget {
    /// Drive to a point of the map.
    Point {
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
        /// On arrival, in rad from east.
        yaw_rad: Option<f64>,
        /// How; `None` = as the robot likes.
        via: Option<Via>,
    },
    /// Wander.
    Wander {
        /// `None` = until it is stopped.
        lasting: Option<Duration>,
    },
}

impl fmt::Display for GoalTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // No minus before a zero.
        let round = |value: f64| (value * 100.0).round() / 100.0 + 0.0;
        match self {
            Self::Point { x_m, y_m, .. } => write!(f, "({:.2}, {:.2})", round(*x_m), round(*y_m)),
            Self::Wander { .. } => f.write_str("wander"),
        }
    }
}

/// What to ask of a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoalRequest {
    /// What for.
    pub target: GoalTarget,
    /// How long it may take; [`drive`] cancels it then.
    pub within: Option<Duration>,
    /// What the robot does when this client falls silent.
    pub on_link_loss: LinkLoss,
}

impl GoalRequest {
    /// Drive to a point of the map, as long as this client lives.
    #[must_use]
    pub fn to(x_m: f64, y_m: f64) -> Self {
        let target = GoalTarget::Point { x_m, y_m, yaw_rad: None, via: None };
        Self { target, within: None, on_link_loss: LinkLoss::Halt }
    }

    /// How long a robot goes on that does not hear its client any more, in s.
    #[must_use]
    pub fn finish_s(&self) -> f64 {
        self.within.unwrap_or(FINISH_WITHIN).as_secs_f64()
    }

    /// The request.
    #[must_use]
    pub fn body(&self) -> Body {
        let (on_link_loss, finish_s) = (self.on_link_loss, self.finish_s());
        match self.target {
            GoalTarget::Point { x_m, y_m, yaw_rad, via } => {
                Body::Goto { x_m, y_m, yaw_rad, via, on_link_loss, finish_s }
            }
            GoalTarget::Wander { lasting } => {
                let for_s = lasting.map(|lasting| lasting.as_secs_f64());
                // The shorter of the two ends it.
                Body::Wander { for_s, on_link_loss, finish_s: for_s.map_or(finish_s, |s| s.max(finish_s)) }
            }
        }
    }
}

/// Sends a goal. Whether the robot has taken it may stay unknown: then it is told to forget it.
///
/// # Errors
/// As [`Control::request`].
pub async fn start(control: &Control, goal: Uuid, request: &GoalRequest) -> Result<()> {
    match control.request(goal, request.body()).await {
        Ok(_) => Ok(()),
        Err(error) if error.kind == ErrorKind::OutcomeUnknown => {
            let cancelled = cancel(control, goal).await;
            Err(cancel::unconfirmed(control.robot(), goal, &error, &cancelled))
        }
        Err(error) => Err(error),
    }
}

/// Sends a goal and stays with it until it has ended, one way or another.
///
/// # Errors
/// As [`start`]; control was taken, or the robot is not heard any more: then the outcome is unknown.
pub async fn drive(client: &Client, control: &Control, request: &GoalRequest) -> Result<GoalOutcome> {
    let mut watch = GoalWatch::open(client, control).await?;
    watch.start(request).await?;
    loop {
        match watch.next().await {
            GoalStep::Running(_) => {}
            GoalStep::Ended(end) => return Ok(end),
            GoalStep::ControlLost => return Err(control.lost().unwrap_or_else(|| taken(control))),
            GoalStep::Unheard(silent) => {
                let message =
                    format!("no message from {} for {:.1} s", control.robot(), silent.as_secs_f64());
                return Err(Error::new(ErrorKind::OutcomeUnknown, message));
            }
        }
        if request.within.is_some_and(|within| watch.elapsed() > within)
            && cancel(control, watch.goal()).await? == Cancelled::Ended
        {
            let reason = Some("time limit reached".to_owned());
            return Ok(GoalOutcome { status: GoalStatus::Cancelled, reason });
        }
    }
}

fn taken(control: &Control) -> Error {
    let message = format!("another client took control of {}", control.robot());
    Error::new(ErrorKind::Refused(RejectCode::LeaseLost), message)
}

/// How a watched goal stands.
#[derive(Debug, Clone, PartialEq)]
pub enum GoalStep {
    /// It goes on; the robot's last state since it was sent.
    Running(Option<Box<LastState>>),
    /// It has ended.
    Ended(GoalOutcome),
    /// Somebody else controls the robot, and the goal has not ended.
    ControlLost,
    /// The robot was not heard for so long: the outcome is unknown.
    Unheard(Duration),
}

/// One goal, watched from before it is sent: nothing of it can be missed.
pub struct GoalWatch<'a> {
    client: &'a Client,
    control: &'a Control,
    feed: StateFeed,
    events: Events,
    follow: Follow,
    began: Instant,
    /// When the robot was last heard.
    heard: Instant,
    /// Since when somebody else holds the lease.
    taken: Option<Instant>,
    look: Interval,
}

impl<'a> GoalWatch<'a> {
    /// Listens for what the robot will say of a goal that is not sent yet.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`]: Zenoh would not.
    pub async fn open(client: &'a Client, control: &'a Control) -> Result<Self> {
        let robot = control.robot();
        let feed = StateFeed::asked(client, robot, STATE_EVERY);
        let events = Events::open(client, &client.keys().robot(robot)).await?;
        let follow = Follow::new(Uuid::new_v4(), control.lease().map(|lease| lease.epoch));
        let (now, mut look) = (Instant::now(), tokio::time::interval(LOOK_EVERY));
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        Ok(Self { client, control, feed, events, follow, began: now, heard: now, taken: None, look })
    }

    /// Sends it.
    ///
    /// # Errors
    /// As [`start`].
    pub async fn start(&mut self, request: &GoalRequest) -> Result<()> {
        start(self.control, self.goal(), request).await?;
        // Not before: while the request was on its way, states showed what was before it.
        self.began = Instant::now();
        self.heard = self.began;
        Ok(())
    }

    /// The goal's id.
    #[must_use]
    pub fn goal(&self) -> Uuid {
        self.follow.goal()
    }

    /// The robot's states.
    #[must_use]
    pub fn feed(&self) -> &StateFeed {
        &self.feed
    }

    /// Since it was sent.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.began.elapsed()
    }

    /// How long the robot was not heard.
    #[must_use]
    pub fn silent(&self) -> Duration {
        self.heard.elapsed()
    }

    /// What was last left to go, in m.
    #[must_use]
    pub fn distance_m(&self) -> Option<f64> {
        self.follow.distance_m()
    }

    /// The next look at it, ten times a second.
    pub async fn next(&mut self) -> GoalStep {
        loop {
            let mut looked = None;
            tokio::select! {
                event = self.events.next() => self.follow.event(&event),
                _ = self.look.tick() => looked = Some(self.look_at()),
            }
            if let Some(end) = self.follow.ended(self.elapsed()) {
                if end.status != GoalStatus::Reached {
                    self.loss_shows().await;
                }
                return GoalStep::Ended(end);
            }
            if self.taken.is_some_and(|at| at.elapsed() > LOSS_SETTLES) {
                return GoalStep::ControlLost;
            }
            if self.silent() > GIVE_UP_AFTER {
                return match self.taken {
                    Some(_) => GoalStep::ControlLost,
                    None => GoalStep::Unheard(self.silent()),
                };
            }
            if let Some(seen) = looked {
                return GoalStep::Running(seen.map(Box::new));
            }
        }
    }

    fn look_at(&mut self) -> Option<LastState> {
        let seen = self.feed.last(self.control.robot()).filter(|seen| seen.at >= self.began)?;
        self.follow.state(self.elapsed(), &seen.state);
        self.heard = seen.at;
        let lease = seen.state.lease.as_ref();
        if self.control.is_lost() && lease.is_some_and(|lease| lease.holder != *self.control.client_name()) {
            self.taken.get_or_insert_with(Instant::now);
        }
        Some(seen)
    }

    /// Waits until it shows whether control was lost with the goal: a retain is due each 100 ms, the goal's
    /// end is told at once.
    async fn loss_shows(&self) {
        let (began, within) = (Instant::now(), LOSS_SHOWS + self.client.round_trip().bound());
        let ours = || {
            // One from before may show the holder from before.
            let seen = self.feed.last(self.control.robot()).filter(|seen| seen.at > began);
            let lease = seen.as_ref().and_then(|seen| seen.state.lease.as_ref());
            lease.is_some_and(|lease| lease.holder == *self.control.client_name())
        };
        let mut look = tokio::time::interval(LOOK_EVERY / 5);
        while !self.control.is_lost() && !ours() && began.elapsed() < within {
            look.tick().await;
        }
    }
}
