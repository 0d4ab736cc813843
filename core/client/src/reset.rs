//! Resetting: ends latched stops whose cause is gone. It never moves a robot.
//!
//! The robot answers yes or no; which latches it has ended shows in its state before and after.

use crate::client::Client;
use crate::control::Control;
use crate::error::{Error, ErrorKind, Result};
use crate::fleet_view::FleetView;
use crate::multi_robot::in_turn;
use crate::state_feed::StateFeed;
use serde::Serialize;
use std::time::{Duration, Instant};
use xtb_protocol::messages::{Body, Latch, LatchState, RejectCode, RobotState};
use xtb_protocol::{Name, Uuid};

/// A state that shows what the reset did comes within a few of these.
pub const STATE_EVERY: Duration = Duration::from_millis(50);

/// What came of it, as `--json` prints it.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ResetReport {
    /// Whom.
    pub robot: Name,
    /// Latches that are ended; `None` = the robot's state was not heard.
    pub cleared: Option<Vec<Latch>>,
    /// Latches that are still set; `None` = the robot's state was not heard.
    pub remaining: Option<Vec<LatchState>>,
    /// What the robot said if it would not.
    pub refused: Option<String>,
    /// From whom control was taken.
    pub taken_from: Option<String>,
}

impl ResetReport {
    /// Whether it would not reset what was asked for, or said yes and has not.
    #[must_use]
    pub fn is_refused(&self, latch: Option<Latch>) -> bool {
        let asked = |set: &LatchState| latch.is_none_or(|latch| latch == set.latch);
        self.refused.is_some() || self.remaining.iter().flatten().any(asked)
    }
}

/// Robots that may have something to reset, of all that there should be.
#[derive(Debug, Clone, PartialEq)]
pub struct ResetCandidates {
    /// With what is latched.
    pub latched: Vec<(Name, Vec<LatchState>)>,
    /// They should be there and are not, or their states are unknown.
    pub unknown: Vec<Name>,
    /// Whether anybody knows which robots there should be.
    pub roster: bool,
}

/// Who has anything latched, of the roster and of whoever else is there.
///
/// # Errors
/// [`ErrorKind::Failed`] if a question could not be sent.
pub async fn candidates(client: &Client, expect: &[Name]) -> Result<ResetCandidates> {
    let roster = client.roster(expect).await?;
    let wanted = roster.clone().unwrap_or_default();
    let view = FleetView::ask(client, client.fleet(), &wanted).await?;
    let mut found = ResetCandidates { latched: Vec::new(), unknown: Vec::new(), roster: roster.is_some() };
    for row in view.robots {
        match row.state {
            Some(state) if row.alive && state.latches.is_empty() => {}
            Some(state) if row.alive => found.latched.push((row.name, state.latches)),
            _ => found.unknown.push(row.name),
        }
    }
    Ok(found)
}

/// Resets several robots, each as if it were the only one.
pub async fn each(
    client: &Client,
    robots: &[Name],
    latch: Option<Latch>,
    take: bool,
) -> Vec<(Name, Result<ResetReport>)> {
    let each = robots.iter().map(|robot| async move {
        let reset = async {
            let control = Control::acquire(client, robot, take).await?;
            let outcome = reset(client, &control, robot, latch).await;
            let taken_from = control.taken_from().map(str::to_owned);
            control.release().await;
            Ok(ResetReport { taken_from, ..outcome? })
        };
        (robot.clone(), reset.await)
    });
    in_turn(each).await
}

/// Resets with the control that is held.
///
/// # Errors
/// As [`Control::request`], but for a cause that is still there: that is reported.
pub async fn reset(
    client: &Client,
    control: &Control,
    robot: &Name,
    latch: Option<Latch>,
) -> Result<ResetReport> {
    let (feed, within) = (StateFeed::asked(client, robot, STATE_EVERY), client.patience());
    let before = next_state(&feed, robot, Instant::now(), within, |_| true).await;
    let answer = control.request(Uuid::new_v4(), Body::Reset { latch }).await;
    let refused = match answer {
        Ok(_) => None,
        Err(Error { kind: ErrorKind::Refused(RejectCode::CausePresent), message, .. }) => Some(message),
        Err(failure) => return Err(failure),
    };
    let seq = before.as_ref().map(|state| state.seq);
    let after = settled(&feed, robot, within, seq, refused.is_some(), latch).await;
    let (cleared, remaining) = match (before, after) {
        (Some(before), Some(after)) => {
            let (cleared, remaining) = compare(&before, after);
            (Some(cleared), Some(remaining))
        }
        _ => (None, None),
    };
    Ok(ResetReport { robot: robot.clone(), cleared, remaining, refused, taken_from: None })
}

/// The first state that came in after `since` and is `so`.
pub async fn next_state(
    feed: &StateFeed,
    robot: &Name,
    since: Instant,
    within: Duration,
    so: impl Fn(&RobotState) -> bool,
) -> Option<RobotState> {
    let coming = async {
        loop {
            if let Some(seen) = feed.last(robot).filter(|seen| seen.at >= since && so(&seen.state)) {
                return seen.state;
            }
            feed.news().await;
        }
    };
    tokio::time::timeout(within, coming).await.ok()
}

/// The state once it shows what the reset did. After a yes that is one without the latches that were
/// asked for; after a no, one that the robot made after its answer.
async fn settled(
    feed: &StateFeed,
    robot: &Name,
    within: Duration,
    before: Option<u64>,
    refused: bool,
    latch: Option<Latch>,
) -> Option<RobotState> {
    let answered = Instant::now();
    let asked = |set: &LatchState| latch.is_none_or(|latch| latch == set.latch);
    let later = |state: &RobotState| before.is_none_or(|seq| state.seq > seq + 1);
    let so = |state: &RobotState| later(state) && (refused || !state.latches.iter().any(asked));
    let since = if refused { answered + STATE_EVERY } else { answered };
    match next_state(feed, robot, since, within, so).await {
        // One was set anew meanwhile: what is set now counts.
        None => feed.last(robot).filter(|seen| seen.at > answered).map(|seen| seen.state),
        found => found,
    }
}

fn compare(before: &RobotState, after: RobotState) -> (Vec<Latch>, Vec<LatchState>) {
    let is_set = |latch: Latch| after.latches.iter().any(|set| set.latch == latch);
    let cleared = before.latches.iter().map(|set| set.latch).filter(|latch| !is_set(*latch));
    (cleared.collect(), after.latches)
}
