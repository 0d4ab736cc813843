//! Taking a goal back: because somebody wants to, and when nobody knows whether the robot has taken it.

use crate::control::Control;
use crate::error::{Error, ErrorKind, Result};
use xtb_protocol::messages::{Body, RejectCode};
use xtb_protocol::{Name, Uuid};

/// What to do about a robot that may drive on.
#[must_use]
pub fn stop_hint(robot: &Name) -> String {
    format!("`fleet-cli stop {robot}` stops the robot, `fleet-cli why {robot}` shows its state")
}

/// What came of a `cancel`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cancelled {
    /// The goal ran and was ended.
    Ended,
    /// It did not run: it had ended by itself, or never began.
    NotRunning,
}

/// Asks the robot to end a goal.
///
/// # Errors
/// The goal is not this client's any more, or the robot may still drive.
pub async fn cancel(control: &Control, goal: Uuid) -> Result<Cancelled> {
    let robot = control.robot();
    // A link that was away for a second has cost the lease, but not the right to end the own goal.
    if control.is_lost() {
        answer(robot, goal, control.regain().await)?;
    }
    let asked = control.request(Uuid::new_v4(), Body::Cancel { goal }).await;
    answer(robot, goal, asked.map(drop))
}

/// Reads the answer to a `cancel`: only "no such goal runs" is as good as yes.
fn answer(robot: &Name, goal: Uuid, asked: Result<()>) -> Result<Cancelled> {
    match asked {
        Ok(()) => Ok(Cancelled::Ended),
        Err(Error { kind: ErrorKind::Refused(RejectCode::UnknownGoal), .. }) => Ok(Cancelled::NotRunning),
        Err(Error {
            kind: kind @ ErrorKind::Refused(RejectCode::LeaseHeld | RejectCode::LeaseLost),
            message,
            ..
        }) => {
            let message = format!("goal {goal} can no longer be cancelled by this client: {message}");
            Err(Error::new(kind, message).hint(stop_hint(robot)))
        }
        Err(failure) => {
            let message = format!("goal {goal} was not cancelled, {robot} may still be driving: {failure}");
            Err(Error::new(failure.kind, message).hint(stop_hint(robot)))
        }
    }
}

/// Nobody knows whether the goal was taken, only what came of the attempt to take it back.
pub(super) fn unconfirmed(robot: &Name, goal: Uuid, failure: &Error, cancelled: &Result<Cancelled>) -> Error {
    let end = match cancelled {
        Ok(Cancelled::Ended) => format!("goal {goal} had started and was cancelled"),
        Ok(Cancelled::NotRunning) => format!("goal {goal} is not running"),
        Err(_) => format!("goal {goal} could not be cancelled either: {robot} may be driving"),
    };
    Error::new(ErrorKind::OutcomeUnknown, format!("{failure}; {end}")).hint(stop_hint(robot))
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
        let said = |kind| answer(&robot(), GOAL, Err(Error::new(kind, "no")));
        assert_eq!(answer(&robot(), GOAL, Ok(())), Ok(Cancelled::Ended));
        assert_eq!(said(ErrorKind::Refused(RejectCode::UnknownGoal)), Ok(Cancelled::NotRunning));
        for (kind, words) in [
            (ErrorKind::Refused(RejectCode::LeaseHeld), "no longer be cancelled"),
            (ErrorKind::Refused(RejectCode::LeaseLost), "no longer be cancelled"),
            (ErrorKind::OutcomeUnknown, "may still be driving"),
            (ErrorKind::Failed, "may still be driving"),
        ] {
            let failure = said(kind).unwrap_err();
            assert_eq!(failure.kind, kind);
            assert!(failure.message.contains(words), "{failure}");
            assert!(failure.hint.contains("fleet-cli stop xtb-1"), "{}", failure.hint);
        }
    }

    #[test]
    fn an_unconfirmed_goal_stays_unknown_whatever_came_of_its_cancel() {
        let unknown = Error::new(ErrorKind::OutcomeUnknown, "xtb-1 does not answer");
        for (cancelled, said) in [
            (Ok(Cancelled::Ended), "was cancelled"),
            (Ok(Cancelled::NotRunning), "is not running"),
            (Err(unknown.clone()), "may be driving"),
        ] {
            let failure = unconfirmed(&robot(), GOAL, &unknown, &cancelled);
            assert_eq!(failure.kind, ErrorKind::OutcomeUnknown);
            assert!(failure.message.contains(said), "{failure}");
            assert!(failure.hint.contains("fleet-cli stop xtb-1"), "{}", failure.hint);
        }
    }
}
