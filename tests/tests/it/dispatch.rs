//! The dispatcher as its users run it: processes of their own, real Zenoh. A thousand kills are the bench
//! `dispatch`'s.

use fleet_tests::dispatch::{Asker, Serve, Storm, Whom, Witness, goto, route};
use fleet_tests::{Fleet, Setup, eventually};
use std::path::Path;
use std::process::{Command, Stdio};
use xtb_protocol::messages::{
    DispatchBody, DispatchCode, DispatchOutcome, TaskId, TaskSpec, TaskState, TaskView,
};

async fn fleet(robots: usize) -> Fleet {
    Fleet::start(Setup { robots, speed: 4.0, ..Setup::default() }).await
}

/// A task as the list has it, once it is so.
async fn until(asker: &Asker, id: TaskId, what: &str, is: impl Fn(&TaskView) -> bool) -> TaskView {
    eventually(what, || async {
        let task = asker.list().await?.tasks.into_iter().find(|task| task.id == id)?;
        is(&task).then_some(task)
    })
    .await
}

fn at(fleet: &Fleet, robot: usize, (x_m, y_m): (f64, f64)) -> bool {
    let truth = fleet.truth(robot);
    (truth.x_m - x_m).hypot(truth.y_m - y_m) < 0.5
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_submitted_is_done_and_everybody_can_see_it() {
    let fleet = fleet(2).await;
    let folder = tempfile::tempdir().unwrap();
    let _serve = Serve::start(fleet.simulator.endpoint(), &folder.path().join("lab.ledger"));
    let asker = Asker::new(&fleet.bus, "test");
    let (near, far) = ((0.0, 1.2), (2.0, -1.2));
    let tasks = asker.submit(vec![goto(near.0, near.1), goto(far.0, far.1)]).await;
    let mut robots = Vec::new();
    for (id, point) in tasks.iter().zip([near, far]) {
        let done = until(&asker, *id, "done", |task| task.state == TaskState::Done).await;
        let robot = done.robot.unwrap().to_string();
        let number = robot.trim_start_matches("xtb-").parse().unwrap();
        assert!(at(&fleet, number, point), "{robot} is not at {point:?}");
        robots.push(robot);
    }
    assert_ne!(robots[0], robots[1], "one had nothing to do");
    let json = fleet.bus.get("xtb/lab/dispatch/tasks?format=json", std::time::Duration::from_secs(5)).await;
    let json: serde_json::Value = serde_json::from_slice(&json.unwrap()[0].payload).unwrap();
    assert_eq!((&json["tasks"][0]["id"], &json["tasks"][0]["state"]), (&"t1".into(), &"done".into()));
    let wrong = asker.ask(DispatchBody::Submit { tasks: vec![goto(90.0, 0.0)] }).await;
    assert!(
        matches!(&wrong, DispatchOutcome::Error(error) if error.code == DispatchCode::GoalBlocked),
        "{wrong:?}"
    );
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_that_was_killed_in_mid_task_goes_on_and_repeats_nothing() {
    let fleet = fleet(1).await;
    let folder = tempfile::tempdir().unwrap();
    let ledger = folder.path().join("lab.ledger");
    let witness = Witness::listen(&fleet.bus).await;
    let mut serve = Serve::start(fleet.simulator.endpoint(), &ledger);
    let asker = Asker::new(&fleet.bus, "test");
    let points = [(0.0, 1.2), (0.0, 2.4), (0.0, 3.4)];
    let id = asker.submit(vec![route(&points)]).await[0];
    until(&asker, id, "the first drive", |task| task.legs_done == 1).await;
    serve.kill();
    serve.restart();
    let done = until(&asker, id, "done", |task| task.state == TaskState::Done).await;
    assert_eq!((done.legs_done, done.failures), (3, 0));
    let reached: Vec<_> = witness.reached().into_iter().map(|reached| reached.goal).collect();
    let mut different = reached.clone();
    different.sort_unstable();
    different.dedup();
    assert_eq!((reached.len(), different.len()), (3, 3), "{reached:?}");
    assert!(at(&fleet, 1, points[2]));
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancelled_task_has_stopped_its_robot_when_the_answer_comes() {
    let fleet = fleet(1).await;
    let folder = tempfile::tempdir().unwrap();
    let _serve = Serve::start(fleet.simulator.endpoint(), &folder.path().join("lab.ledger"));
    let asker = Asker::new(&fleet.bus, "test");
    let id = asker.submit(vec![goto(0.0, 3.0)]).await[0];
    eventually("driving", || async { (fleet.truth(1).speed_mps > 0.1).then_some(()) }).await;
    let answer = asker.ask(DispatchBody::Cancel { tasks: vec![id] }).await;
    let DispatchOutcome::Changed(changes) = &answer else { panic!("{answer:?}") };
    assert_eq!((changes[0].state, &changes[0].error), (Some(TaskState::Cancelled), &None));
    let state = fleet.state(1).await;
    assert!(state.goal.is_none_or(|goal| goal.status.is_final()), "the goal goes on");
    fleet.end().await;
}

/// Exit code, and the error's words.
fn refused(command: &mut Command) -> (Option<i32>, String) {
    let output = command.env_clear().stdin(Stdio::null()).output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_dispatcher_of_a_fleet_or_a_ledger_is_refused() {
    let fleet = fleet(1).await;
    let folder = tempfile::tempdir().unwrap();
    let (ledger, other) = (folder.path().join("lab.ledger"), folder.path().join("other.ledger"));
    let serve = Serve::start(fleet.simulator.endpoint(), &ledger);
    let second = |ledger: &Path| Serve::command(fleet.simulator.endpoint(), ledger);
    let (code, said) = refused(&mut second(&ledger));
    assert!(code == Some(1) && said.contains("in use by another dispatcher"), "{code:?} {said}");
    let (code, said) = refused(&mut second(&other));
    assert!(code == Some(1) && said.contains("this fleet already has a dispatcher"), "{code:?} {said}");
    drop(serve);
    drop(Serve::start(fleet.simulator.endpoint(), &other));
    fleet.end().await;
}

/// `fleet-cli sim --dispatch --until-done` on this ledger.
fn simulation(ledger: &Path) -> (fleet_tests::processes::Process, String) {
    let mut command = Command::new(fleet_tests::processes::program("fleet-cli"));
    command.args(["--json", "sim", "--robots", "2", "--speed", "4", "--listen", "tcp/127.0.0.1:0"]);
    command.args(["--until-done", "--dispatch", "--ledger"]).arg(ledger);
    let (process, ready) = fleet_tests::processes::Process::start_ready(&mut command);
    let endpoint = ready.split('"').find(|part| part.starts_with("tcp/"));
    (process, endpoint.unwrap_or_else(|| panic!("the simulator says {ready:?}")).to_owned())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_simulation_with_a_dispatcher_goes_on_with_the_same_ledger_until_all_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let ledger = folder.path().join("sim.ledger");
    let (mut first, endpoint) = simulation(&ledger);
    let asker = Asker::connect(&endpoint, "test").await;
    let lane = |x_m: f64| [(x_m, 1.2), (x_m, 2.2), (x_m, 1.0)];
    let tasks: Vec<TaskSpec> = [0.0, 2.0, 0.0, 2.0].iter().map(|x_m| route(&lane(*x_m))).collect();
    let last = *asker.submit(tasks).await.last().unwrap();
    until(&asker, TaskId::new(1), "some drives", |task| task.legs_done > 0).await;
    first.signal(fleet_tests::processes::Signal::Kill);
    let _ = first.0.wait();
    let (mut second, endpoint) = simulation(&ledger);
    let asker = Asker::connect(&endpoint, "test").await;
    let seen = until(&asker, last, "the list again", |_| true).await;
    assert!(!seen.state.is_final(), "nothing was left to be gone on with");
    let ended = tokio::task::spawn_blocking(move || second.0.wait().unwrap());
    let ended = tokio::time::timeout(fleet_tests::PATIENCE, ended).await.unwrap().unwrap();
    assert!(ended.success(), "a task failed, or a truck was touched");
    let written = fleet_tests::dispatch::Written::read(&ledger);
    assert_eq!((written.submitted.len(), written.legs.len()), (4, 12));
}

/// A simulation of a world in this file, with a dispatcher on this ledger, and what it says when it is ready.
fn in_world(
    world: &Path,
    ledger: &Path,
    more: &[&str],
) -> (fleet_tests::processes::Process, serde_json::Value) {
    let mut command = Command::new(fleet_tests::processes::program("fleet-cli"));
    command.args(["--json", "sim", "--robots", "1", "--speed", "4", "--listen", "tcp/127.0.0.1:0"]);
    command.arg("--world").arg(world).arg("--dispatch").arg("--ledger").arg(ledger).args(more);
    let (process, ready) = fleet_tests::processes::Process::start_ready(&mut command);
    (process, serde_json::from_str(&ready).unwrap())
}

#[tokio::test(flavor = "multi_thread")]
async fn tasks_of_one_world_do_not_drive_robots_in_another_until_they_are_adopted() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let ledger = place("sim.ledger");
    // Worlds without a name are called as their files are.
    for (name, side_m) in [("barn.toml", 9), ("hall.toml", 12)] {
        std::fs::write(place(name), format!("[room]\nwidth_m = {side_m}\ndepth_m = {side_m}\n")).unwrap();
    }
    let endpoint = |ready: &serde_json::Value| ready["router"].as_str().unwrap().to_owned();
    let (mut barn, ready) = in_world(&place("barn.toml"), &ledger, &[]);
    assert_eq!((&ready["dispatcher"]["map"], &ready["dispatcher"]["open"]), (&"barn".into(), &0.into()));
    let asker = Asker::connect(&endpoint(&ready), "test").await;
    let ids = asker.submit(vec![route(&[(0.0, 1.0), (0.0, 2.0)]); 3]).await;
    until(&asker, ids[0], "under way", |task| task.state == TaskState::Running).await;
    barn.signal(fleet_tests::processes::Signal::Interrupt);
    let _ = barn.0.wait();

    let (mut hall, ready) = in_world(&place("hall.toml"), &ledger, &[]);
    assert_eq!(ready["dispatcher"]["map"], "hall");
    let suspended = &ready["suspended"][0];
    assert_eq!(suspended["cause"], serde_json::json!({"other_map": {"of": "barn", "now": "hall"}}));
    let open = suspended["tasks"].as_u64().unwrap();
    assert!((2..=3).contains(&open), "{ready}");
    let asker = Asker::connect(&endpoint(&ready), "test").await;
    let here = asker.submit(vec![goto(0.0, 1.5)]).await[0];
    until(&asker, here, "done", |task| task.state == TaskState::Done).await;
    let last = until(&asker, ids[2], "waiting", |_| true).await;
    assert!(last.reason.as_deref().unwrap().contains("map barn, the fleet's map is hall"), "{last:?}");
    assert_eq!((last.state, &last.robot), (TaskState::Queued, &None));
    let adopted = asker.ask(DispatchBody::Adopt {}).await;
    let DispatchOutcome::Adopted(adopted) = &adopted else { panic!("{adopted:?}") };
    assert_eq!((adopted.map.as_deref(), adopted.tasks.len() as u64), (Some("hall"), open));
    until(&asker, ids[2], "done", |task| task.state == TaskState::Done).await;
    hall.signal(fleet_tests::processes::Signal::Interrupt);
    let _ = hall.0.wait();

    let (_barn, ready) = in_world(&place("barn.toml"), &ledger, &["--fresh"]);
    assert_eq!((&ready["dispatcher"]["tasks"], &ready["suspended"]), (&0.into(), &serde_json::json!([])));
    let aside = ready["set_aside"].as_str().unwrap();
    assert!(fleet_tests::dispatch::Written::read(Path::new(aside)).submitted.len() >= 4, "{aside}");
}

#[tokio::test(flavor = "multi_thread")]
async fn killed_ten_times_it_loses_nothing_and_does_nothing_twice() {
    let folder = tempfile::tempdir().unwrap();
    let storm = Storm { whom: Whom::Dispatcher, kills: 10, tasks: 12, robots: 3, seed: 7, speed: 4.0 };
    let totals = storm.pass(folder.path(), |_| ()).await;
    assert!(totals.is_kept(), "{totals}");
}
