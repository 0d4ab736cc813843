//! Taking a goal back: on Ctrl-C, when its time is up, and when nobody knows whether it was taken.

use super::{Task, stop_hint};
use crate::context::Context;
use crate::error::{Exit, Failure, Kind, Result};
use crate::feed::Feed;
use crate::lease::Control;
use std::time::Instant;
use xtb_protocol::messages::{Body, RejectCode, RobotState};
use xtb_protocol::{Name, Uuid};

/// Slower than one encoder pulse a window.
const STANDING_MPS: f64 = 0.02;

/// What came of a `cancel`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::commands) enum Cancel {
    /// The goal ran and was ended.
    Ended,
    /// It did not run: it had ended by itself, or never began.
    NotRunning,
}

/// Asks the robot to end a goal.
pub(in crate::commands) async fn ask(control: &Control, robot: &Name, goal: Uuid) -> Result<Cancel> {
    // A link that was away for a second has cost the lease, but not the right to end the own goal.
    if control.is_lost() {
        answer(robot, goal, control.regain().await)?;
    }
    let asked = control.request(Uuid::new_v4(), Body::Cancel { goal }).await;
    answer(robot, goal, asked.map(drop))
}

/// Reads the answer to a `cancel`: only "no such goal runs" is as good as yes.
fn answer(robot: &Name, goal: Uuid, asked: Result<()>) -> Result<Cancel> {
    match asked {
        Ok(()) => Ok(Cancel::Ended),
        Err(Failure { kind: Kind::Refused(RejectCode::UnknownGoal), .. }) => Ok(Cancel::NotRunning),
        Err(Failure {
            kind: kind @ Kind::Refused(RejectCode::LeaseHeld | RejectCode::LeaseLost),
            message,
            ..
        }) => {
            let message = format!("goal {goal} is not ours to cancel any more: {message}");
            Err(Failure::new(kind, message).hint(stop_hint(robot)))
        }
        Err(failure) => {
            let message = format!("goal {goal} was not cancelled, {robot} may still drive: {failure}");
            Err(Failure::new(failure.kind, message).hint(stop_hint(robot)))
        }
    }
}

/// Nobody knows whether the goal was taken, only what came of the attempt to take it back.
pub(super) fn unconfirmed(
    robot: &Name,
    goal: Uuid,
    failure: &Failure,
    cancelled: &Result<Cancel>,
) -> Failure {
    let end = match cancelled {
        Ok(Cancel::Ended) => format!("goal {goal} had begun and was cancelled"),
        Ok(Cancel::NotRunning) => format!("goal {goal} does not run"),
        Err(_) => format!("goal {goal} could not be cancelled either: {robot} may drive"),
    };
    Failure::new(Kind::OutcomeUnknown, format!("{failure}; {end}")).hint(stop_hint(robot))
}

/// Ctrl-C: the goal ends, and the robot is watched until it stands.
pub(super) async fn interrupted(
    ctx: &Context,
    control: &Control,
    feed: &Feed,
    task: &Task,
    goal: Uuid,
) -> Result<Exit> {
    let asked = Instant::now();
    let how = match ask(control, &task.robot, goal).await? {
        Cancel::Ended => "goal cancelled",
        Cancel::NotRunning => "the goal does not run",
    };
    let standing = async {
        while !feed.last(&task.robot).is_some_and(|seen| seen.at > asked && stands(&seen.state)) {
            feed.news().await;
        }
    };
    let robot = &task.robot;
    let failure = match tokio::time::timeout(ctx.timeout, standing).await {
        Ok(()) => Failure::new(Kind::Interrupted, format!("{robot} stands: {how}")),
        Err(_) => Failure::new(Kind::Interrupted, format!("{how}, but {robot} was not seen standing"))
            .hint(stop_hint(robot)),
    };
    ctx.out.failure(&failure);
    Ok(Exit::Interrupted)
}

fn stands(state: &RobotState) -> bool {
    state.reference_rpm == 0.0 && state.speed_mps.is_some_and(|speed| speed.abs() < STANDING_MPS)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOAL: Uuid = Uuid::from_u128(1);

    fn robot() -> Name {
        Name::new("xtb-1").unwrap()
    }

    #[test]
    fn only_an_unknown_goal_counts_as_ended_by_itself() {
        let said = |kind| answer(&robot(), GOAL, Err(Failure::new(kind, "no")));
        assert_eq!(answer(&robot(), GOAL, Ok(())), Ok(Cancel::Ended));
        assert_eq!(said(Kind::Refused(RejectCode::UnknownGoal)), Ok(Cancel::NotRunning));
        for (kind, words) in [
            (Kind::Refused(RejectCode::LeaseHeld), "not ours to cancel"),
            (Kind::Refused(RejectCode::LeaseLost), "not ours to cancel"),
            (Kind::OutcomeUnknown, "may still drive"),
            (Kind::Failed, "may still drive"),
        ] {
            let failure = said(kind).unwrap_err();
            assert_eq!(failure.kind, kind);
            assert!(failure.message.contains(words), "{failure}");
            assert!(failure.hint.contains("fleet-cli stop xtb-1"), "{}", failure.hint);
        }
    }

    #[test]
    fn an_unconfirmed_goal_stays_unknown_whatever_came_of_its_cancel() {
        let unknown = Failure::new(Kind::OutcomeUnknown, "xtb-1 does not answer");
        for (cancelled, said) in [
            (Ok(Cancel::Ended), "was cancelled"),
            (Ok(Cancel::NotRunning), "does not run"),
            (Err(unknown.clone()), "may drive"),
        ] {
            let failure = unconfirmed(&robot(), GOAL, &unknown, &cancelled);
            assert_eq!(failure.kind, Kind::OutcomeUnknown);
            assert!(failure.message.contains(said), "{failure}");
            assert!(failure.hint.contains("fleet-cli stop xtb-1"), "{}", failure.hint);
        }
    }
}
