//! Stopping: robots drop their goals and stand; each is asked at once, must say so itself, and its own state must
//! show it. For all robots one question goes to every robot that hears it, before anybody knows who they are; what a
//! robot answers to that counts as when it is asked by itself.

use crate::client::{Client, accepted};
use crate::confirm::confirm;
use crate::crowd::Crowd;
use crate::error::Error;
use crate::heard::{AbortOnDrop, Heard};
use crate::multi_robot::{MissingInfo, MultiRobot, StopOutcome, StopReport, Targets};
use std::collections::BTreeMap;
use std::time::Duration;
use xtb_control::Mode;
use xtb_identity::Action;
use xtb_protocol::messages::{Body, Reply, RobotState};
use xtb_protocol::{Name, Uuid};

/// Of many robots none is asked by itself before this, as much longer as their pauses are, after one question to all.
const HEAD_START: Duration = Duration::from_millis(50);
/// Of many each has longer to answer: this, as much longer as their pauses are.
const LATER: Duration = Duration::from_millis(200);
/// Answers to the question to all are taken for so long, if anybody is still waited for.
const ALL_ANSWER_WITHIN: Duration = Duration::from_secs(60);

/// Asks them, and says what came of it. Who may not asks nobody: no outcomes, and the refusal in
/// [`MissingInfo::alive`].
pub async fn stop(client: &Client, targets: &Targets) -> (StopReport, MissingInfo) {
    if let Err(error) = client.may(Action::Drive) {
        return not_sent(error);
    }
    let (id, heard) = (Uuid::new_v4(), Heard::default());
    let answers = heard.clone();
    let mut stops =
        MultiRobot::new(client, move |client, robot, crowd| one(client, robot, crowd, id, answers.clone()));
    let mut asking = None;
    let missing = match targets {
        Targets::All { expect, known } => {
            asking = Some(AbortOnDrop(tokio::spawn(ask_everybody(client.clone(), id, heard.clone()))));
            stops.call_all(expect, known).await
        }
        Targets::Robots(robots) => {
            stops.call(robots.iter().cloned());
            MissingInfo::default()
        }
    };
    let outcomes = stops.outcomes_and_of(&heard).await;
    drop(asking);
    (StopReport::new(outcomes, &missing), missing)
}

/// Nobody was asked.
pub(crate) fn not_sent(error: Error) -> (StopReport, MissingInfo) {
    let missing = MissingInfo { alive: Some(error), ..MissingInfo::default() };
    (StopReport::new(BTreeMap::new(), &missing), missing)
}

async fn ask_everybody(client: Client, id: Uuid, heard: Heard<Reply>) {
    let each = |robot: Name, reply| heard.adds(&robot, reply);
    if let Err(error) = client.carry_out_by_all(id, Body::Stop {}, ALL_ANSWER_WITHIN, each).await {
        tracing::debug!("{error}");
    }
}

async fn one(client: Client, robot: Name, crowd: Crowd, id: Uuid, heard: Heard<Reply>) -> StopOutcome {
    let mut to_all = heard.answers(&robot);
    let by_itself = async {
        tokio::time::sleep(crowd.head_start(HEAD_START)).await;
        client.carry_out_all(&robot, id, Body::Stop {}, crowd.head_start(LATER)).await
    };
    let replies = tokio::select! {
        Ok(replies) = to_all.wait_for(|replies| !replies.is_empty()) => Ok(replies.clone()),
        replies = by_itself => replies,
    };
    let replies = match replies {
        Ok(replies) => replies,
        Err(error) => {
            tracing::debug!("cannot stop {robot}: {error}");
            return StopOutcome::Unknown;
        }
    };
    let outcome = match replies.as_slice() {
        [reply] if accepted(&robot, reply).is_err() => StopOutcome::Refused,
        [_] => confirm(&client, &robot, &crowd, has_stopped).await,
        _ => StopOutcome::Ambiguous,
    };
    // A second voice may have come later.
    if to_all.borrow().len() > 1 { StopOutcome::Ambiguous } else { outcome }
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
    use xtb_protocol::messages::{Done, GoalStatus, RejectCode, Request, Roster};

    /// Passes the questions on `key_expr` on.
    async fn questions(client: &Client, key_expr: &str) -> (Service, mpsc::UnboundedReceiver<Question>) {
        let (sender, receiver) = mpsc::unbounded_channel();
        let each = move |question| sender.send(question).unwrap_or_default();
        (client.bus().serve(key_expr, each).await.unwrap(), receiver)
    }

    /// Without a question to all.
    async fn alone(client: Client, robot: Name, crowd: Crowd) -> StopOutcome {
        one(client, robot, crowd, Uuid::new_v4(), Heard::default()).await
    }

    async fn outcome(client: &Client, robot: &str) -> StopOutcome {
        alone(client.clone(), name(robot), Crowd::default()).await
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn what_a_robot_answers_to_all_is_its_answer_and_its_state_has_to_show_it() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = FakeRobot::start(&client, "xtb-1").await;
        robot.lock().mute = true; // it does not answer the questions to itself
        let yes = || Reply::done(Uuid::nil(), Done::default());
        let no = Reply::refused(Uuid::nil(), RejectCode::Malformed, "no", "");
        for (replies, drives, expected) in [
            (vec![yes()], true, StopOutcome::Unconfirmed),
            (vec![yes()], false, StopOutcome::Stopped),
            (vec![yes(), yes()], false, StopOutcome::Ambiguous),
            (vec![no], false, StopOutcome::Refused),
        ] {
            robot.lock().state.goal = drives.then(|| fake::goal(Uuid::nil(), GoalStatus::Running));
            let heard = Heard::default();
            heard.says(&name("xtb-1"), &replies);
            let outcome = one(client.clone(), name("xtb-1"), Crowd::default(), Uuid::nil(), heard).await;
            assert_eq!(outcome, expected);
        }
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_answers_the_question_to_all_is_told_of_though_nobody_has_named_it() {
        let client = Client::alone(Duration::from_secs(2)).await;
        let robot = FakeRobot::start(&client, "xtb-1").await;
        let keys = client.keys().robot(&name("xtb-7"));
        let (_unnamed, mut asked) = questions(&client, &keys.cmd(None)).await;
        let key = keys.cmd(Some(client.name()));
        let unnamed = async {
            let question = asked.recv().await.unwrap();
            let (request, format) = question.decode::<Request>().unwrap();
            question.reply(&key, &Reply::done(request.id, Done::default()), format).await.unwrap();
        };
        let targets = Targets::All { expect: vec![name("xtb-1")], known: Vec::new() };
        let ((report, _), ()) = tokio::join!(stop(&client, &targets), unnamed);
        let outcomes = [("xtb-1", StopOutcome::Stopped), ("xtb-7", StopOutcome::Absent)];
        assert_eq!(report.robots, outcomes.map(|(robot, outcome)| (name(robot), outcome)).into());
        assert!(robot.lock().asked.iter().all(|(_, body)| *body == Body::Stop {}));
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
        outcome(&client, "xtb-9").await;
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
        let mut stops = MultiRobot::new(&client, alone);
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
        let mut stops = MultiRobot::new(&client, alone);
        let missing = stops.call_all(&[], &[]).await;
        assert!(missing.no_roster && missing.alive.is_none(), "{missing:?}");
        assert!(stops.outcomes().await.contains_key(&robot));
    }
}
