//! Stopping: robots drop their goals and stand; each is asked at once, must say so itself, and its own state must
//! show it.

use crate::client::{Client, accepted};
use crate::confirm::confirm;
use crate::crowd::Crowd;
use crate::error::Error;
use crate::multi_robot::{MissingInfo, MultiRobot, StopOutcome, StopReport, Targets};
use std::collections::BTreeMap;
use xtb_control::Mode;
use xtb_identity::Action;
use xtb_protocol::Name;
use xtb_protocol::messages::{Body, RobotState};

/// Asks them, and says what came of it. Who may not asks nobody: no outcomes, and the refusal in
/// [`MissingInfo::alive`].
pub async fn stop(client: &Client, targets: &Targets) -> (StopReport, MissingInfo) {
    if let Err(error) = client.may(Action::Drive) {
        return not_sent(error);
    }
    let mut stops = MultiRobot::new(client, one);
    let missing = match targets {
        Targets::All { expect, known } => stops.call_all(expect, known).await,
        Targets::Robots(robots) => {
            stops.call(robots.iter().cloned());
            MissingInfo::default()
        }
    };
    (StopReport::new(stops.outcomes().await, &missing), missing)
}

/// Nobody was asked.
pub(crate) fn not_sent(error: Error) -> (StopReport, MissingInfo) {
    let missing = MissingInfo { alive: Some(error), ..MissingInfo::default() };
    (StopReport::new(BTreeMap::new(), &missing), missing)
}

async fn one(client: Client, robot: Name, crowd: Crowd) -> StopOutcome {
    let replies = match client.carry_out_all(&robot, Body::Stop {}).await {
        Ok(replies) => replies,
        Err(error) => {
            tracing::debug!("cannot stop {robot}: {error}");
            return StopOutcome::Unknown;
        }
    };
    match replies.as_slice() {
        [reply] if accepted(&robot, reply).is_err() => StopOutcome::Refused,
        [_] => confirm(&client, &robot, &crowd, has_stopped).await,
        _ => StopOutcome::Ambiguous,
    }
}

/// Nothing that came over the network drives it.
fn has_stopped(state: &RobotState) -> bool {
    let driven = matches!(state.mode, Mode::Teleop | Mode::Goto | Mode::Wander);
    !driven && state.goal.as_ref().is_none_or(|goal| goal.status.is_final())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{self, FakeRobot, name};
    use std::time::Duration;
    use tokio::sync::mpsc;
    use xtb_bus::{Question, Service};
    use xtb_protocol::codec::Format;
    use xtb_protocol::messages::{GoalStatus, Roster};

    /// Passes the questions on `key_expr` on.
    async fn questions(client: &Client, key_expr: &str) -> (Service, mpsc::UnboundedReceiver<Question>) {
        let (sender, receiver) = mpsc::unbounded_channel();
        let each = move |question| sender.send(question).unwrap_or_default();
        (client.bus().serve(key_expr, each).await.unwrap(), receiver)
    }

    async fn outcome(client: &Client, robot: &str) -> StopOutcome {
        one(client.clone(), name(robot), Crowd::default()).await
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_is_answered_for_and_is_not_there_has_not_stopped() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let _shadow = fake::yes_man(&client).await;
        assert_eq!(outcome(&client, "xtb-9").await, StopOutcome::Absent);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_robot_that_somebody_else_answers_for_too_is_said_to_be_so() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let _robot = FakeRobot::start(&client, "xtb-1").await;
        assert_eq!(outcome(&client, "xtb-1").await, StopOutcome::Stopped);
        // In a session of its own, as any program on the network.
        let other = client.another().await;
        let _shadow = fake::yes_man(&other).await;
        // Asked again until it is heard: its declaration takes time to arrive.
        client.carry_out_all(&name("xtb-9"), Body::Stop {}).await.unwrap();
        assert_eq!(outcome(&client, "xtb-1").await, StopOutcome::Ambiguous);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_robot_that_says_yes_and_drives_on_has_not_stopped() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = FakeRobot::start(&client, "xtb-1").await;
        robot.lock().state.goal = Some(fake::goal(xtb_protocol::Uuid::nil(), GoalStatus::Running));
        robot.lock().stubborn = true;
        assert_eq!(outcome(&client, "xtb-1").await, StopOutcome::Unconfirmed);
        robot.lock().stubborn = false;
        assert_eq!(outcome(&client, "xtb-1").await, StopOutcome::Stopped);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_robot_that_is_there_is_stopped_before_the_roster_is_known() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = FakeRobot::start(&client, "xtb-1").await;
        let roster_key = client.keys().sim_roster();
        let (_rosters, mut rosters) = questions(&client, &roster_key).await;
        let world = async {
            robot.until(|robot| robot.asked.iter().any(|(_, body)| *body == Body::Stop {})).await;
            // The roster comes only now.
            let question = rosters.recv().await.unwrap();
            question.reply(&roster_key, &Roster { robots: Vec::new() }, Format::Json).await.unwrap();
        };
        let mut stops = MultiRobot::new(&client, one);
        let (missing, ()) = tokio::join!(stops.call_all(&[], &[]), world);
        assert!(missing.none(), "{missing:?}");
        assert_eq!(stops.outcomes().await, BTreeMap::from([(name("xtb-1"), StopOutcome::Stopped)]));
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_roster_that_does_not_answer_leaves_a_gap_and_stops_nobody_less() {
        let client = Client::alone(Duration::from_millis(300)).await;
        let robot = Name::new("xtb-1").unwrap();
        let keys = client.keys().robot(&robot);
        let (_rosters, _unanswered) = questions(&client, &client.keys().sim_roster()).await;
        let _token = client.bus().declare_alive(&keys.alive()).await.unwrap();
        let mut stops = MultiRobot::new(&client, one);
        let missing = stops.call_all(&[], &[]).await;
        assert!(missing.no_roster && missing.alive.is_none(), "{missing:?}");
        assert!(stops.outcomes().await.contains_key(&robot));
    }
}
