//! A dispatcher and its stand-by as their users run them: processes, real Zenoh. Two hundred kills are the bench
//! `dispatch`'s.

use fleet_tests::dispatch::{Asker, Serve, ServePair, Storm, Whom, Witness, Written, goto, route};
use fleet_tests::processes::Signal;
use fleet_tests::{Fleet, Setup, eventually};
use std::process::Stdio;
use xtb_protocol::messages::{
    DispatchBody, DispatchOutcome, StandbyReply, TaskId, TaskState, TaskView, Waypoint,
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

/// The dispatcher's view of its stand-by, once it is so.
async fn until_standby(asker: &Asker, what: &str, is: impl Fn(&StandbyReply) -> bool) -> StandbyReply {
    eventually(what, || async { asker.standby().await.filter(|reply| is(reply)) }).await
}

fn is_paired(reply: &StandbyReply) -> bool {
    reply.standby.as_ref().is_some_and(|view| view.paired)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stand_by_goes_on_with_a_task_of_a_killed_dispatcher_and_repeats_nothing() {
    let fleet = fleet(1).await;
    let folder = tempfile::tempdir().unwrap();
    let witness = Witness::listen(&fleet.bus).await;
    let asker = Asker::new(&fleet.bus, "test");
    let mut pair = ServePair::start(fleet.simulator.endpoint(), folder.path(), &asker).await;
    let id = asker.submit(vec![route(&[(0.0, 1.2), (0.0, 2.4), (0.0, 3.4)])]).await[0];
    until(&asker, id, "the first drive", |task| task.legs_done == 1).await;
    pair.kill_active(&asker).await;
    let done = until(&asker, id, "done", |task| task.state == TaskState::Done).await;
    assert_eq!((done.legs_done, done.failures), (3, 0));
    let mut reached: Vec<_> = witness.reached().into_iter().map(|reached| reached.goal).collect();
    let count = reached.len();
    reached.sort_unstable();
    reached.dedup();
    assert_eq!((count, reached.len()), (3, 3), "{reached:?}");
    let written = Written::read(pair.ledger(true));
    assert_eq!(written.submitted.into_iter().collect::<Vec<_>>(), [id]);
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stand_by_drives_the_points_that_a_killed_dispatcher_has_acknowledged() {
    let fleet = fleet(1).await;
    let folder = tempfile::tempdir().unwrap();
    let asker = Asker::new(&fleet.bus, "test");
    let mut pair = ServePair::start(fleet.simulator.endpoint(), folder.path(), &asker).await;
    let id = asker.submit(vec![route(&[(0.0, 1.2)])]).await[0];
    let points = vec![Waypoint { x_m: 0.0, y_m: 2.4, yaw_rad: None }];
    let extended = asker.ask(DispatchBody::Extend { task: id, after: 1, points }).await;
    let DispatchOutcome::Changed(changes) = &extended else { panic!("{extended:?}") };
    assert_eq!(changes[0].error, None);
    pair.kill_active(&asker).await;
    let done = until(&asker, id, "done", |task| task.state == TaskState::Done).await;
    assert_eq!((done.legs_done, done.failures), (2, 0));
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_task_is_acknowledged_when_both_have_it_or_the_dispatcher_is_alone() {
    let fleet = fleet(1).await;
    let folder = tempfile::tempdir().unwrap();
    let asker = Asker::new(&fleet.bus, "test");
    let pair = ServePair::start(fleet.simulator.endpoint(), folder.path(), &asker).await;
    let first = asker.submit(vec![goto(0.0, 1.2)]).await[0];
    assert!(Written::read(pair.ledger(false)).submitted.contains(&first), "the stand-by has it too");
    pair.signal(false, Signal::Stop);
    let second = asker.submit(vec![goto(0.0, 1.4)]).await[0];
    let alone = until_standby(&asker, "alone", |reply| !is_paired(reply)).await;
    assert!(!Written::read(pair.ledger(false)).submitted.contains(&second));
    pair.signal(false, Signal::Continue);
    let again = until_standby(&asker, "a pair again", is_paired).await;
    assert_eq!((alone.term, again.term), (0, 0), "nobody has taken over");
    eventually("the second task at the stand-by", || async {
        Written::read(pair.ledger(false)).submitted.contains(&second).then_some(())
    })
    .await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dispatcher_that_was_held_up_ends_when_its_stand_by_has_taken_over() {
    let fleet = fleet(1).await;
    let folder = tempfile::tempdir().unwrap();
    let asker = Asker::new(&fleet.bus, "test");
    let mut pair = ServePair::start(fleet.simulator.endpoint(), folder.path(), &asker).await;
    pair.signal(true, Signal::Stop);
    pair.until_taken_over(&asker, 0).await;
    let id = asker.submit(vec![goto(0.0, 1.2)]).await[0];
    pair.signal(false, Signal::Continue);
    let give_up = std::time::Instant::now() + fleet_tests::PATIENCE;
    while pair.runs(false) {
        assert!(std::time::Instant::now() < give_up, "the first dispatcher goes on");
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
    pair.restart_standby().await;
    until(&asker, id, "done", |task| task.state == TaskState::Done).await;
    let written = Written::read(pair.ledger(false));
    assert!(written.submitted.contains(&id) && written.assigned.keys().all(|seq| seq >> 27 == 1));
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_copy_is_served_only_when_it_is_promoted() {
    let fleet = fleet(1).await;
    let folder = tempfile::tempdir().unwrap();
    let asker = Asker::new(&fleet.bus, "test");
    let mut pair = ServePair::start(fleet.simulator.endpoint(), folder.path(), &asker).await;
    let id = asker.submit(vec![goto(0.0, 1.2)]).await[0];
    let serve = |more: &[&str]| {
        let mut command = Serve::command(fleet.simulator.endpoint(), pair.ledger(false));
        command.args(more).env_clear().stdin(Stdio::null());
        command
    };
    let (mut plain, mut promoted) = (serve(&[]), serve(&["--promote"]));
    pair.kill_both();
    let output = plain.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.code() == Some(1) && said.contains("the copy of a stand-by"), "{said}");
    let (_process, line) = fleet_tests::processes::Process::start_ready(&mut promoted);
    assert!(line.starts_with("{\"ready\":true"), "{line:?}");
    let term = until_standby(&asker, "a dispatcher", |_| true).await.term;
    assert_eq!(term, 1);
    let answer = asker.ask(DispatchBody::Show { task: id }).await;
    assert!(matches!(answer, DispatchOutcome::Shown(_)), "{answer:?}");
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn six_kills_of_a_dispatcher_and_its_stand_by_in_turns_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let storm = Storm { whom: Whom::Pair, kills: 6, tasks: 12, robots: 3, seed: 7, speed: 4.0 };
    let totals = storm.pass(folder.path(), |_| ()).await;
    assert!(totals.is_kept(), "{totals}");
}
