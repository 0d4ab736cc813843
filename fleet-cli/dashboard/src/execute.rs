//! Carrying out what a page asks for, with the code of the verbs.

use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use xtb_client::client::Client;
use xtb_client::control::Control;
use xtb_client::dispatcher_client::fleet_stop;
use xtb_client::dispatcher_client::{DispatcherClient, Taken, worst};
use xtb_client::goal::{GoalRequest, GoalTarget, start};
use xtb_client::map_edit::{self, MapDraft};
use xtb_client::multi_robot::{MissingInfo, StopReport, Targets, in_turn};
use xtb_client::reset::{self, ResetCandidates, ResetReport};
use xtb_client::text::reasons;
use xtb_client::{Error, ErrorKind, Result};
use xtb_client::{estop, params, stop};
use xtb_control::frames::wrap_rad;
use xtb_protocol::messages::{
    AckBody, AckRequest, Body, DispatchBody, HistoryPlace, HistoryReply, HistoryRequest, Latch, LatchState,
    LinkLoss, ParamValue, TaskId, TaskSpec, Via,
};
use xtb_protocol::{Name, Uuid};

/// Events that a search shows at most.
const FOUND: u32 = 100;

/// Where to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    /// East.
    pub(crate) x_m: f64,
    /// North.
    pub(crate) y_m: f64,
    /// On arrival.
    pub(crate) yaw_rad: Option<f64>,
    /// How; `None` = as the robot likes.
    pub(crate) via: Option<Via>,
}

/// As `goto` without `--wait`: the goal outlives this client and is bounded by the robot's own clock.
pub(crate) async fn goto(client: &Client, robot: Name, to: Point, take: bool) -> Result<Value> {
    let Point { x_m, y_m, yaw_rad, via } = to;
    let target = GoalTarget::Point { x_m, y_m, yaw_rad, via };
    let request = GoalRequest { target, within: None, on_link_loss: LinkLoss::Finish };
    let control = Control::acquire(client, &robot, take).await?;
    let goal = Uuid::new_v4();
    let started = start(&control, goal, &request).await;
    let taken_from = control.taken_from().map(str::to_owned);
    control.release().await;
    started?;
    Ok(json!({ "robot": robot, "goal": goal, "status": "accepted", "taken_from": taken_from }))
}

/// As `set-pose`: refused while the robot is under way.
pub(crate) async fn set_pose(
    client: &Client,
    robot: Name,
    [x_m, y_m, yaw_rad]: [f64; 3],
    take: bool,
) -> Result<Value> {
    let control = Control::acquire(client, &robot, take).await?;
    let set = control.request(Uuid::new_v4(), Body::SetPose { x_m, y_m, yaw_rad: wrap_rad(yaw_rad) }).await;
    let taken_from = control.taken_from().map(str::to_owned);
    control.release().await;
    set?;
    Ok(json!({ "robot": robot, "status": "set", "taken_from": taken_from }))
}

/// Saves zones and places as a new version of the map.
pub(crate) async fn edit_map(client: &Client, draft: MapDraft, why: &str) -> Result<Value> {
    let map_edit::Saved { version, stored } = map_edit::save(client, draft, why).await?;
    Ok(json!({ "version": version, "stored": stored }))
}

/// Who changed the map, when and why.
pub(crate) async fn map_history(client: &Client) -> Result<Value> {
    value(&map_edit::history(client).await?)
}

/// As `stop`: who has stopped, and who has not said so. `known` are the robots that pages have seen.
pub(crate) async fn stop(client: &Client, known: &[Name], robot: Option<Name>) -> Result<Value> {
    report(client, stop::stop(client, &Targets::one_or_all(robot.as_ref(), known)).await)
}

/// As `estop`: who has acknowledged it, and who has not.
pub(crate) async fn estop(client: &Client, known: &[Name], robot: Option<Name>) -> Result<Value> {
    let targets = Targets::one_or_all(robot.as_ref(), known);
    report(client, estop::estop(client, &targets, client.settings().timeout).await)
}

/// As `reset`: which latches are ended, and which remain.
pub(crate) async fn reset(client: &Client, robot: Name, take: bool) -> Result<Value> {
    let mut ended = reset::each(client, &[robot], None, take).await;
    match ended.pop() {
        Some((_, ended)) => value(&ended?),
        None => Ok(json!({})),
    }
}

/// As `reset --all`: what came of each robot that had anything latched, and whose state is unknown. A robot with a latch
/// that is not among those `shown` is not reset.
pub(crate) async fn reset_all(client: &Client, shown: Option<BTreeMap<Name, Vec<Latch>>>) -> Result<Value> {
    let ResetCandidates { latched, unknown, .. } = reset::candidates(client, &[]).await?;
    let was_shown = |(robot, latches): &(Name, Vec<LatchState>)| {
        let Some(shown) = &shown else { return true };
        let known = shown.get(robot).map(Vec::as_slice).unwrap_or_default();
        latches.iter().all(|set| known.contains(&set.latch))
    };
    let (same, newly): (Vec<_>, Vec<_>) = latched.into_iter().partition(was_shown);
    let robots: Vec<Name> = same.into_iter().map(|(robot, _)| robot).collect();
    let mut ended = reset::each(client, &robots, None, false).await;
    ended.extend(newly.into_iter().map(|(robot, _)| {
        let error = Error::new(ErrorKind::Failed, "it was latched after the question: it is not reset");
        (robot, Err(error))
    }));
    let told = |(robot, ended): (Name, xtb_client::Result<ResetReport>)| {
        let told = match ended {
            Ok(report) => value(&report)?,
            Err(failure) => json!({ "robot": robot, "refused": failure.message }),
        };
        Ok((robot.to_string(), told))
    };
    let robots = ended.into_iter().map(told).collect::<Result<serde_json::Map<_, _>>>()?;
    Ok(json!({ "robots": robots, "unknown": unknown }))
}

/// As `param set limit_mps MPS --all`: on which robots it was set, and which refused. The robot that this page drives
/// by hand refuses a higher limit, for which control would have to be acquired anew.
pub(crate) async fn speed_limit(client: &Client, mps: f64, driving: Option<&Name>) -> Result<Value> {
    const LIMIT: &str = "navigation.drive.limit_mps";
    let robots: Vec<Name> = client.alive().await?.into_iter().collect();
    if robots.is_empty() {
        return Err(client.nobody());
    }
    let value = || vec![ParamValue { name: LIMIT.to_owned(), value: mps }];
    let each = robots.iter().map(|robot| async move {
        match driving == Some(robot) {
            true => params::set_without_control(client, robot, value()).await,
            false => params::set(client, robot, value(), false).await,
        }
    });
    let (mut set, mut refused) = (Vec::new(), serde_json::Map::new());
    for (robot, done) in robots.iter().zip(in_turn(each).await) {
        match done {
            Ok(_) => set.push(robot),
            Err(error) => drop(refused.insert(robot.to_string(), error.message.into())),
        }
    }
    Ok(json!({ "mps": mps, "set": set, "refused": refused }))
}

/// Submits a task; the answer has its name.
pub(crate) async fn submit(client: &Client, spec: TaskSpec) -> Result<Value> {
    let Taken { tasks, suspended } = DispatcherClient::of(client).submit(vec![spec]).await?;
    let waits = fleet_stop(&suspended).map(|stop| stop.cause.text());
    Ok(json!({ "submitted": tasks, "waits": waits }))
}

/// Lets the dispatcher assign tasks again.
pub(crate) async fn activate(client: &Client) -> Result<Value> {
    let (ended, suspended) = DispatcherClient::of(client).activate().await?;
    Ok(json!({ "ended": ended, "suspended": suspended }))
}

/// Takes the tasks of other maps over.
pub(crate) async fn adopt(client: &Client) -> Result<Value> {
    value(&DispatcherClient::of(client).adopt().await?)
}

/// Cancels, pauses, resumes or retries a task; the answer comes when its robot has confirmed.
pub(crate) async fn change(
    client: &Client,
    task: TaskId,
    body: fn(Vec<TaskId>) -> DispatchBody,
) -> Result<Value> {
    let changes = DispatcherClient::of(client).change(body(vec![task])).await?;
    if let Some(error) = worst(&changes.tasks) {
        return Err(error.clone().into());
    }
    let state = changes.tasks.first().and_then(|change| change.state);
    Ok(json!({ "task": task, "status": state.map(|state| reasons::name(&state)) }))
}

/// Says that alerts were seen, in this page's name.
pub(crate) async fn acknowledge(client: &Client, ids: Vec<u64>) -> Result<Value> {
    let request = AckRequest { body: AckBody::Alerts { ids }, person: None };
    value(&DispatcherClient::of(client).acknowledge(&request).await?)
}

/// The newest events of the history with these words, oldest first.
pub(crate) async fn events(client: &Client, search: String) -> Result<Value> {
    let request = HistoryRequest::Events {
        place: HistoryPlace::Newest,
        limit: FOUND,
        since_ms: None,
        robot: None,
        kinds: Vec::new(),
        search: Some(search),
    };
    match DispatcherClient::of(client).history(&request).await? {
        HistoryReply::Events { events, more, .. } => Ok(json!({ "events": events, "more": more })),
        _ => Err(Error::new(ErrorKind::Failed, "not an answer to a question for events")),
    }
}

fn report(client: &Client, (report, missing): (StopReport, MissingInfo)) -> Result<Value> {
    if report.robots.is_empty() {
        return Err(missing.alive.unwrap_or_else(|| client.nobody()));
    }
    value(&report)
}

fn value(value: &impl Serialize) -> Result<Value> {
    serde_json::to_value(value)
        .map_err(|error| Error::new(ErrorKind::Failed, format!("cannot write JSON: {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use xtb_client::fake::{self, FakeRobot, name};
    use xtb_protocol::messages::{Body, GoalStatus, Latch, LinkLoss};

    const PATIENT: Duration = Duration::from_secs(30);
    const THERE: Point = Point { x_m: 1.0, y_m: 2.0, yaw_rad: None, via: None };

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_goal_is_given_with_a_bound_and_the_lease_is_given_back() {
        let client = Client::alone(PATIENT).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        let given = goto(&client, name("xtb-1"), THERE, false).await.unwrap();
        let fake = fake.lock();
        let goal = fake.state.goal.as_ref().unwrap();
        assert_eq!((given["goal"].as_str().unwrap(), goal.status.is_final()), (&*goal.id.to_string(), false));
        assert_ne!(goal.status, GoalStatus::Cancelled);
        assert_eq!(fake.lease, None);
        let asked =
            |body: &Body| matches!(body, Body::Goto { on_link_loss: LinkLoss::Finish, finish_s: 300.0, .. });
        assert!(fake.asked.iter().any(|(_, body)| asked(body)), "{:?}", fake.asked);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_pose_is_set_within_a_turn_and_the_lease_is_given_back() {
        let client = Client::alone(PATIENT).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        let set = set_pose(&client, name("xtb-1"), [1.0, -2.0, 4.0], false).await.unwrap();
        assert_eq!((&set["status"], &set["taken_from"]), (&json!("set"), &Value::Null));
        let fake = fake.lock();
        let turned = 4.0 - std::f64::consts::TAU;
        let is = |body: &Body| matches!(body, Body::SetPose { x_m: 1.0, y_m: -2.0, yaw_rad } if (yaw_rad - turned).abs() < 1e-9);
        assert!(fake.asked.iter().any(|(_, body)| is(body)), "{:?}", fake.asked);
        assert_eq!(fake.lease, None);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_robot_that_somebody_controls_is_not_sent_anywhere() {
        let client = Client::alone(PATIENT).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        fake.lock().grant(&name("cli-123456"));
        let failure = goto(&client, name("xtb-1"), THERE, false).await.unwrap_err();
        assert_eq!(failure.kind.code(), "lease_held");
        assert!(failure.message.contains("cli-123456"), "{failure}");
        let taken = goto(&client, name("xtb-1"), THERE, true).await.unwrap();
        assert_eq!(taken["taken_from"], "cli-123456");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn an_emergency_stop_lists_who_has_acknowledged_and_who_has_not() {
        let client = Client::alone(Duration::from_secs(1)).await;
        // A link that is lost would be waited for.
        let _linked = client.another().await;
        let _there = FakeRobot::start(&client, "xtb-1").await;
        let silent = FakeRobot::start(&client, "xtb-2").await;
        silent.lock().mute = true;
        let _token = client.bus().declare_alive(&client.keys().robot(&name("xtb-2")).alive()).await.unwrap();
        let ended = estop(&client, &[], Some(name("xtb-2"))).await.unwrap();
        assert_eq!(ended, json!({ "robots": { "xtb-2": "unknown" }, "complete": false }));
        let ended = estop(&client, &[], Some(name("xtb-1"))).await.unwrap();
        assert_eq!(ended, json!({ "robots": { "xtb-1": "stopped" }, "complete": true }));
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_reset_says_what_is_cleared_and_what_remains() {
        let client = Client::alone(PATIENT).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        fake.lock().state.latches = vec![
            fake::latch(Latch::Estop, "cli-1", false),
            fake::latch(Latch::GyroLost, "gyro_silent", true),
        ];
        let done = reset(&client, name("xtb-1"), false).await.unwrap();
        assert_eq!(done["cleared"], json!(["estop"]));
        assert_eq!(done["remaining"][0]["latch"], "gyro_lost");
        assert_eq!(fake.lock().lease, None);
    }
}
