//! A task's life, one event at a time.

use crate::model::{GROUND, LEDGER, me};
use crate::robots::FakeRobot;
use xtb_dispatch::dispatcher::Identity;
use xtb_dispatch::{Dispatcher, Effect, Entry, Ground, Settings};
use xtb_nav::MapPose;
use xtb_protocol::messages::{
    Assignment, Body, DispatchBody, DispatchCode, DispatchError, DispatchOutcome, DispatchRequest,
    OnTakeover, Request, Roster, RosterEntry, TaskChange, TaskId, TaskKind, TaskSpec, TaskState, Waypoint,
    Who,
};
use xtb_protocol::{Name, Uuid};

const START_MS: u64 = 1_800_000_000_000;

/// A dispatcher, its ledger and its robots, with nothing in between that could go wrong by itself.
struct Bench {
    now_ms: u64,
    dispatcher: Dispatcher,
    ledger: Vec<Entry>,
    robots: Vec<FakeRobot>,
    /// Robots that neither hear nor are heard.
    cut: Vec<bool>,
    full: bool,
    /// The network holds assignments up: here they are.
    held_up: Option<Vec<Request>>,
    asked: u64,
    answers: Vec<(u64, DispatchOutcome)>,
    /// Requests to robots but for retains.
    asks: Vec<(Name, Body)>,
}

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn point(x_m: f64, y_m: f64) -> Waypoint {
    Waypoint { x_m, y_m, yaw_rad: None }
}

fn goto(x_m: f64, y_m: f64) -> TaskSpec {
    TaskSpec::new(TaskKind::Goto { to: point(x_m, y_m) })
}

fn identity(run: u64) -> Identity {
    Identity { me: me(), ledger: LEDGER, run }
}

impl Bench {
    fn new(robots: usize) -> Self {
        Self::with(robots, Settings::default())
    }

    fn with(robots: usize, settings: Settings) -> Self {
        let mut bench = Self {
            now_ms: START_MS,
            dispatcher: Dispatcher::recover(START_MS, identity(1), settings, []).unwrap(),
            ledger: Vec::new(),
            robots: (1..=robots).map(|i| FakeRobot::new(&format!("xtb-{i}"), (i as f64, 0.0))).collect(),
            cut: vec![false; robots],
            full: false,
            held_up: None,
            asked: 0,
            answers: Vec::new(),
            asks: Vec::new(),
        };
        bench.run_ms(500);
        bench
    }

    fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms / 10 {
            self.now_ms += 10;
            for (robot, _) in self.robots.iter_mut().zip(&self.cut).filter(|(robot, cut)| robot.up && !**cut)
            {
                if self.now_ms.is_multiple_of(50) {
                    let state = robot.state(self.now_ms);
                    self.dispatcher.state(self.now_ms, &state);
                }
            }
            self.robots.iter_mut().for_each(|robot| robot.turn(self.now_ms));
            self.dispatcher.step(self.now_ms, &GROUND);
            self.effects();
        }
    }

    fn effects(&mut self) {
        while let Some(effect) = self.dispatcher.next_effect() {
            match effect {
                Effect::Write(write) if self.full => {
                    self.dispatcher.not_written(self.now_ms, write.id, "the disk is full");
                }
                Effect::Write(write) => {
                    self.ledger.extend(write.entries);
                    self.dispatcher.written(self.now_ms, write.id).unwrap();
                }
                Effect::Ask { robot, request } => self.ask_robot(&robot, &request),
                Effect::Reply { ticket, reply } => self.answers.push((ticket, reply.result)),
                Effect::Event(_) => {}
            }
        }
    }

    fn ask_robot(&mut self, name: &Name, request: &Request) {
        if !matches!(request.body, Body::Retain {}) {
            self.asks.push((name.clone(), request.body.clone()));
        }
        let i = self.robots.iter().position(|robot| robot.name == *name).unwrap();
        if self.cut[i] {
            return;
        }
        if let (Body::Assign { .. }, Some(held_up)) = (&request.body, &mut self.held_up) {
            return held_up.push(request.clone());
        }
        if let Some(reply) = self.robots[i].request(self.now_ms, &me(), request) {
            self.dispatcher.replied(self.now_ms, name, &reply);
        }
    }

    fn ask(&mut self, body: DispatchBody) -> u64 {
        self.asked += 1;
        let request = DispatchRequest { id: Uuid::from_u128(u128::from(self.asked)), body };
        self.dispatcher.request(self.now_ms, self.asked, &name("cli-7"), &request, &GROUND);
        self.effects();
        self.asked
    }

    fn answer(&self, ticket: u64) -> Option<&DispatchOutcome> {
        self.answers.iter().find(|(of, _)| *of == ticket).map(|(_, answer)| answer)
    }

    fn submit(&mut self, spec: TaskSpec) -> TaskId {
        let ticket = self.ask(DispatchBody::Submit { tasks: vec![spec] });
        self.run_ms(20);
        match self.answer(ticket) {
            Some(DispatchOutcome::Submitted(tasks)) => tasks[0],
            other => panic!("{other:?}"),
        }
    }

    fn refused(&mut self, tasks: Vec<TaskSpec>) -> DispatchError {
        let ticket = self.ask(DispatchBody::Submit { tasks });
        self.run_ms(20);
        match self.answer(ticket) {
            Some(DispatchOutcome::Error(error)) => error.clone(),
            other => panic!("{other:?}"),
        }
    }

    fn change(&self, ticket: u64) -> Option<TaskChange> {
        match self.answer(ticket)? {
            DispatchOutcome::Changed(changes) => Some(changes[0].clone()),
            other => panic!("{other:?}"),
        }
    }

    fn state(&self, id: TaskId) -> TaskState {
        self.dispatcher.book().task(id).unwrap().state
    }

    fn reason(&self, id: TaskId) -> String {
        self.dispatcher.book().task(id).unwrap().reason.clone().unwrap_or_default()
    }

    fn robot_of(&self, id: TaskId) -> Option<usize> {
        let task = self.dispatcher.book().task(id)?;
        let name = &task.assigned.as_ref()?.robot;
        self.robots.iter().position(|robot| robot.name == *name)
    }

    fn by_person(&mut self, i: usize, body: Body) {
        self.asked += 1;
        let id = Uuid::from_u64_pair(9, self.asked);
        let lease = self.robots[i].lease.present();
        self.robots[i].request(self.now_ms, &name("cli-9"), &Request { id, lease, body });
    }

    fn restart(&mut self) {
        let entries = self.ledger.clone();
        self.dispatcher =
            Dispatcher::recover(self.now_ms, identity(2), Settings::default(), entries).unwrap();
    }

    fn begun(&self) -> Vec<(u64, u32)> {
        let begun = self.asks.iter().filter_map(|(_, body)| match body {
            Body::Assign { assignment: Assignment { assign_seq, leg, .. }, .. } => Some((*assign_seq, *leg)),
            _ => None,
        });
        begun.collect()
    }
}

#[test]
fn the_nearest_robot_goes_and_the_history_says_so() {
    let mut bench = Bench::new(3);
    let id = bench.submit(goto(3.2, 0.0));
    bench.run_ms(300);
    assert_eq!(bench.robot_of(id), Some(2));
    bench.run_ms(4000);
    let history = bench.dispatcher.history(id).unwrap();
    let states: Vec<TaskState> = history.steps.iter().map(|step| step.state).collect();
    use TaskState::{Assigned, Done, Queued, Running};
    assert_eq!(states, [Queued, Assigned, Running, Running, Done]);
    assert_eq!((history.task.robot, history.task.legs_done), (Some(name("xtb-3")), 1));
    bench.run_ms(2000);
    assert!(bench.robots.iter().all(|robot| robot.lease.holder().is_none()), "leases are given back");
}

#[test]
fn a_route_is_driven_in_order_as_often_as_it_says_with_its_stops() {
    let mut bench = Bench::new(1);
    let points = vec![point(1.2, 0.0), point(1.4, 0.0)];
    let id = bench.submit(TaskSpec::new(TaskKind::Route { points, loops: 2, dwell_s: 1.0 }));
    let before_ms = bench.now_ms;
    while bench.state(id) != TaskState::Done && bench.now_ms < before_ms + 30_000 {
        bench.run_ms(50);
    }
    assert_eq!(bench.begun(), [(1, 0), (1, 1), (1, 2), (1, 3)]);
    assert!(bench.now_ms - before_ms > 3000, "three stops of a second");
    assert_eq!(bench.robots[0].at, (1.4, 0.0));
}

#[test]
fn a_patrol_ends_when_its_time_is_up() {
    let mut bench = Bench::new(1);
    let points = vec![point(1.2, 0.0), point(1.0, 0.0)];
    let id = bench.submit(TaskSpec::new(TaskKind::Patrol { points, dwell_s: 0.0, for_s: Some(5.0) }));
    bench.run_ms(4000);
    assert_eq!(bench.state(id), TaskState::Running);
    bench.run_ms(2500);
    assert_eq!(bench.state(id), TaskState::Done);
    assert!(bench.robots[0].running().is_none());
}

#[test]
fn a_submission_is_taken_whole_or_refused_with_a_reason() {
    let mut bench = Bench::with(1, Settings { max_open: 3, ..Settings::default() });
    let tags = vec!["red".to_owned()];
    let entry = RosterEntry { name: name("xtb-1"), tags, start_pose: None };
    bench.dispatcher.roster(bench.now_ms, &Roster { robots: vec![entry] });
    bench.dispatcher.able(bench.now_ms, &name("xtb-1"), &["goto".to_owned()]);
    let who = |who| TaskSpec { who, ..goto(1.0, 0.0) };
    let late = TaskSpec { deadline_ms: Some(bench.now_ms - 5000), ..goto(1.0, 0.0) };
    for (spec, code, words) in [
        (who(Who::Robot(name("xtb-2"))), DispatchCode::UnknownRobot, "xtb-2"),
        (who(Who::Tag("blue".into())), DispatchCode::UnknownTag, "blue"),
        (who(Who::Able("fly".into())), DispatchCode::UnknownCapability, "fly"),
        (late, DispatchCode::DeadlinePast, "5 s"),
        (goto(1001.0, 0.0), DispatchCode::OutOfRange, "x_m"),
        (TaskSpec { priority: 10, ..goto(1.0, 0.0) }, DispatchCode::OutOfRange, "priority"),
        (goto(f64::NAN, 0.0), DispatchCode::OutOfRange, "x_m"),
    ] {
        let error = bench.refused(vec![goto(1.0, 0.0), spec]);
        assert_eq!(error.code, code);
        assert!(error.message.contains(words) && error.message.contains("task 2"), "{}", error.message);
    }
    assert_eq!(bench.refused(vec![goto(1.0, 0.0); 4]).code, DispatchCode::QueueFull);
    assert_eq!(bench.dispatcher.book().tasks().count(), 0, "nothing of a refused submission is taken");
    bench.submit(who(Who::Tag("@red".into())));
}

#[test]
fn the_same_submission_again_is_the_same_tasks_also_after_a_restart() {
    let mut bench = Bench::new(0);
    let body = DispatchBody::Submit { tasks: vec![goto(1.0, 0.0), goto(2.0, 0.0)] };
    let request = DispatchRequest { id: Uuid::from_u128(5), body };
    for ticket in [1, 2, 3] {
        bench.dispatcher.request(bench.now_ms, ticket, &name("cli-7"), &request, &GROUND);
        bench.run_ms(20);
        assert_eq!(
            bench.answer(ticket),
            Some(&DispatchOutcome::Submitted(vec![TaskId::new(1), TaskId::new(2)]))
        );
        bench.restart();
    }
    assert_eq!(bench.dispatcher.book().tasks().count(), 2);
}

#[test]
fn a_full_disk_refuses_with_its_reason_and_what_runs_goes_on() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(2.0, 0.0));
    bench.run_ms(500);
    bench.full = true;
    let error = bench.refused(vec![goto(3.0, 0.0)]);
    assert_eq!(error.code, DispatchCode::LedgerFailed);
    assert!(error.message.contains("the disk is full"), "{}", error.message);
    bench.run_ms(5000);
    assert_eq!(bench.robots[0].finished.len(), 1, "the robot has arrived meanwhile");
    assert_ne!(bench.state(id), TaskState::Done);
    assert!(bench.dispatcher.list(bench.now_ms).ledger_failed.is_some());
    bench.full = false;
    bench.run_ms(2000);
    assert_eq!(bench.state(id), TaskState::Done);
    assert_eq!(bench.submit(goto(3.0, 0.0)), TaskId::new(2));
    assert!(bench.dispatcher.list(bench.now_ms).ledger_failed.is_none());
}

#[test]
fn a_restarted_dispatcher_goes_on_at_the_leg_that_runs() {
    let mut bench = Bench::new(1);
    let points = vec![point(1.5, 0.0), point(3.5, 0.0), point(1.0, 0.0)];
    let mut spec = TaskSpec::new(TaskKind::Route { points, loops: 1, dwell_s: 0.0 });
    spec.on_link_loss = xtb_protocol::messages::LinkLoss::Finish;
    let id = bench.submit(spec);
    bench.run_ms(2500);
    assert_eq!(bench.begun(), [(1, 0), (1, 1)]);
    bench.restart();
    bench.run_ms(1000);
    assert_eq!((bench.state(id), bench.begun().len()), (TaskState::Running, 2), "nothing is asked for twice");
    bench.run_ms(12_000);
    assert_eq!(bench.state(id), TaskState::Done);
    assert_eq!(bench.begun(), [(1, 0), (1, 1), (1, 2)]);
    assert_eq!(bench.robots[0].finished.len(), 3);
}

#[test]
fn a_leg_that_was_reached_while_nobody_watched_is_not_driven_again() {
    let mut bench = Bench::new(1);
    let spec = TaskSpec { on_link_loss: xtb_protocol::messages::LinkLoss::Finish, ..goto(2.0, 0.0) };
    let id = bench.submit(spec);
    bench.run_ms(500);
    for _ in 0..500 {
        bench.now_ms += 10;
        bench.robots[0].turn(bench.now_ms);
    }
    assert_eq!(bench.robots[0].finished.len(), 1);
    bench.restart();
    bench.run_ms(500);
    assert_eq!((bench.state(id), bench.begun().len()), (TaskState::Done, 1));
}

#[test]
fn a_cancelled_task_is_answered_when_the_robot_has_confirmed() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(9.0, 0.0));
    bench.run_ms(1000);
    let ticket = bench.ask(DispatchBody::Cancel { tasks: vec![id] });
    bench.cut[0] = true;
    bench.run_ms(1000);
    assert_eq!((bench.change(ticket), bench.state(id)), (None, TaskState::Cancelling));
    bench.cut[0] = false;
    bench.run_ms(1000);
    assert_eq!(bench.change(ticket).unwrap().state, Some(TaskState::Cancelled));
    assert!(bench.robots[0].running().is_none());
    assert_eq!(bench.reason(id), "cancelled by cli-7");
}

#[test]
fn a_robot_that_does_not_confirm_is_named_and_the_task_ends_later() {
    let mut bench = Bench::new(1);
    let id = bench.submit(TaskSpec { grace_s: 8.0, ..goto(9.0, 0.0) });
    bench.run_ms(1000);
    bench.cut[0] = true;
    let ticket = bench.ask(DispatchBody::CancelAll {});
    bench.run_ms(5500);
    let change = bench.change(ticket).unwrap();
    assert_eq!((change.id, change.state), (id, Some(TaskState::Cancelling)));
    let error = change.error.unwrap();
    assert!(error.code == DispatchCode::Unconfirmed && error.message.contains("xtb-1"), "{error:?}");
    bench.run_ms(6000);
    assert_eq!(bench.state(id), TaskState::Cancelled);
    assert!(bench.reason(id).contains("ended by its own policy"), "{}", bench.reason(id));
}

#[test]
fn pause_stops_the_robot_and_resume_goes_on_at_the_same_leg() {
    let mut bench = Bench::new(1);
    let points = vec![point(1.5, 0.0), point(9.0, 0.0)];
    let id = bench.submit(TaskSpec::new(TaskKind::Route { points, loops: 1, dwell_s: 0.0 }));
    bench.run_ms(3000);
    let ticket = bench.ask(DispatchBody::Pause { tasks: vec![id] });
    bench.run_ms(500);
    assert_eq!(bench.change(ticket).unwrap().error, None);
    assert!(bench.robots[0].running().is_none());
    let other = bench.submit(goto(1.6, 0.0));
    bench.run_ms(2000);
    assert_eq!(bench.state(other), TaskState::Done, "its robot is free for others");
    assert_eq!(bench.state(id), TaskState::Paused);
    bench.ask(DispatchBody::Resume { tasks: vec![id] });
    bench.run_ms(2000);
    assert_eq!(bench.state(id), TaskState::Running);
    assert_eq!(bench.begun().iter().filter(|(_, leg)| *leg == 0).count(), 2, "one of each task");
}

#[test]
fn verbs_that_do_not_fit_say_why() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(1.1, 0.0));
    bench.run_ms(2000);
    assert_eq!(bench.state(id), TaskState::Done);
    for body in [
        DispatchBody::Cancel { tasks: vec![id] },
        DispatchBody::Pause { tasks: vec![id] },
        DispatchBody::Retry { tasks: vec![id] },
    ] {
        let ticket = bench.ask(body);
        bench.run_ms(50);
        let error = bench.change(ticket).unwrap().error.unwrap();
        assert_eq!(error.code, DispatchCode::WrongState);
        assert!(error.hint.contains(&format!("`fleet-cli task {id}`")), "{}", error.hint);
    }
    let ticket = bench.ask(DispatchBody::Cancel { tasks: vec![TaskId::new(99)] });
    bench.run_ms(50);
    assert_eq!(bench.change(ticket).unwrap().error.unwrap().code, DispatchCode::UnknownTask);
}

#[test]
fn a_goal_that_fails_is_tried_again_and_then_failed_with_the_robots_reason() {
    let mut bench = Bench::new(1);
    bench.robots[0].doomed.push((2.0, 0.0));
    let id = bench.submit(TaskSpec { retries: 1, ..goto(2.0, 0.0) });
    bench.run_ms(15_000);
    assert_eq!(bench.state(id), TaskState::Failed);
    assert_eq!(bench.reason(id), "xtb-1: blocked near (1.0, 1.0)");
    assert_eq!(bench.begun(), [(1, 0), (2, 0)]);
    bench.robots[0].doomed.clear();
    bench.ask(DispatchBody::Retry { tasks: vec![id] });
    bench.run_ms(10_000);
    assert_eq!(bench.state(id), TaskState::Done);
}

#[test]
fn a_deadline_that_passes_stops_the_robot() {
    let mut bench = Bench::new(1);
    let id = bench.submit(TaskSpec { deadline_ms: Some(bench.now_ms + 2000), ..goto(9.0, 0.0) });
    bench.run_ms(2500);
    assert_eq!((bench.state(id), bench.reason(id).as_str()), (TaskState::Failed, "its deadline is over"));
    assert!(bench.robots[0].running().is_none());
}

#[test]
fn a_robot_that_leaves_gives_its_task_back_after_the_grace_and_not_before() {
    let mut bench = Bench::new(2);
    let id = bench.submit(TaskSpec { grace_s: 15.0, ..goto(1.0, 4.0) });
    bench.run_ms(1000);
    let first = bench.robot_of(id).unwrap();
    bench.cut[first] = true;
    bench.run_ms(14_500);
    assert_eq!(bench.robot_of(id), Some(first));
    bench.run_ms(1500);
    assert_eq!(bench.robot_of(id), Some(1 - first));
    assert!(bench.robots[first].running().is_none(), "it has stopped by itself");
    bench.run_ms(12_000);
    assert_eq!(bench.state(id), TaskState::Done);
}

#[test]
fn a_latched_robot_gives_its_task_to_another_at_once() {
    let mut bench = Bench::new(2);
    let id = bench.submit(goto(1.0, 4.0));
    bench.run_ms(1000);
    let first = bench.robot_of(id).unwrap();
    bench.robots[first].latch();
    bench.run_ms(1000);
    assert_eq!(bench.robot_of(id), Some(1 - first));
    let steps = bench.dispatcher.history(id).unwrap().steps;
    assert!(
        steps.iter().any(|step| step.reason.as_deref().is_some_and(|why| why.contains("latched: estop")))
    );
    assert_eq!(bench.dispatcher.book().task(id).unwrap().failures, 0);
}

#[test]
fn an_assignment_that_was_held_up_begins_nothing_once_its_task_has_left() {
    let mut bench = Bench::new(2);
    bench.held_up = Some(Vec::new());
    let id = bench.submit(goto(1.0, 4.0));
    bench.run_ms(500);
    let first = bench.robot_of(id).unwrap();
    let late = bench.held_up.take().unwrap().remove(0);
    bench.robots[first].latch();
    bench.run_ms(1000);
    assert_eq!(bench.robot_of(id), Some(1 - first));
    bench.robots[first].latched = false;
    bench.robots[first].request(bench.now_ms, &me(), &late);
    assert!(bench.robots[first].running().is_none());
    assert!(bench.asks.iter().any(|(_, body)| matches!(body, Body::Withdraw { .. })));
}

#[test]
fn a_robot_that_is_taken_over_holds_its_task_and_names_who_has_it() {
    for (policy, after) in [
        (OnTakeover::Fail, TaskState::Failed),
        (OnTakeover::Resume, TaskState::Running),
        (OnTakeover::Requeue, TaskState::Running),
    ] {
        let mut bench = Bench::new(1);
        let id = bench.submit(TaskSpec { on_takeover: policy, grace_s: 3.0, ..goto(9.0, 0.0) });
        bench.run_ms(1000);
        bench.by_person(0, Body::Acquire { take: true });
        bench.run_ms(80);
        assert!(bench.reason(id).contains("taken over by cli-9"), "{}", bench.reason(id));
        for _ in 0..20 {
            bench.by_person(0, Body::Retain {});
            bench.run_ms(100);
            assert_ne!(bench.state(id), TaskState::Running, "{policy:?}");
        }
        bench.by_person(0, Body::Release {});
        bench.run_ms(9000);
        assert_eq!(bench.state(id), after, "{policy:?}");
    }
}

#[test]
fn a_persons_stop_is_not_undone_by_a_clock() {
    let mut bench = Bench::new(1);
    let id = bench.submit(TaskSpec { on_takeover: OnTakeover::Resume, ..goto(9.0, 0.0) });
    bench.run_ms(1000);
    bench.by_person(0, Body::Stop {});
    bench.run_ms(60_000);
    assert_eq!((bench.state(id), bench.reason(id).as_str()), (TaskState::Held, "xtb-1 was told to stop"));
    bench.ask(DispatchBody::Resume { tasks: vec![id] });
    bench.run_ms(2000);
    assert_eq!(bench.state(id), TaskState::Running);
}

#[test]
fn a_robot_that_does_not_answer_delays_nobody() {
    let mut bench = Bench::new(2);
    let first = bench.submit(TaskSpec { who: Who::Robot(name("xtb-1")), ..goto(1.0, 1.0) });
    bench.cut[0] = true;
    let second = bench.submit(TaskSpec { who: Who::Robot(name("xtb-2")), ..goto(2.0, 1.0) });
    bench.run_ms(3000);
    assert_eq!(bench.state(second), TaskState::Done);
    assert_ne!(bench.state(first), TaskState::Done);
}

#[test]
fn a_robot_that_joins_late_gets_what_waits_and_why_it_waits_is_said() {
    let mut bench = Bench::new(1);
    bench.cut[0] = true;
    bench.run_ms(2000);
    let id = bench.submit(goto(2.0, 0.0));
    bench.run_ms(1000);
    let why = bench.dispatcher.why_queued(bench.now_ms, id).unwrap();
    assert!(why.contains("xtb-1: it has not been heard"), "{why}");
    bench.cut[0] = false;
    bench.run_ms(4000);
    assert_eq!(bench.state(id), TaskState::Done);
}

/// One robot, always something of priority 9 to do: what has priority 0 has its turn.
#[test]
fn low_priorities_do_not_starve() {
    let mut bench = Bench::with(1, Settings { age_ms: 2000, ..Settings::default() });
    let low = bench.submit(TaskSpec { priority: 0, ..goto(1.1, 0.0) });
    let mut near = 0;
    while bench.state(low) != TaskState::Done && bench.now_ms < START_MS + 120_000 {
        let waiting = bench.dispatcher.book().open().filter(|task| task.id != low).count();
        if waiting < 3 {
            near += 1;
            bench.submit(TaskSpec { priority: 9, ..goto(1.0 + f64::from(near % 2) * 0.2, 0.0) });
        }
        bench.run_ms(100);
    }
    let done_ms = bench.now_ms - START_MS;
    assert_eq!(bench.state(low), TaskState::Done);
    assert!(done_ms > 2000, "it was not its turn yet: {done_ms} ms");
    assert!(done_ms < 9 * 2000 + 12_000, "{done_ms} ms");
}

#[test]
fn what_the_ground_refuses_is_not_taken() {
    struct Pit;
    impl Ground for Pit {
        fn distance_m(&self, from: &MapPose, to: &Waypoint) -> f64 {
            GROUND.distance_m(from, to)
        }
        fn rough_m(&self, from: &MapPose, to: &Waypoint) -> f64 {
            GROUND.rough_m(from, to)
        }
        fn admits(&self, to: &Waypoint) -> Result<(), (DispatchCode, String)> {
            if to.x_m > 5.0 { Err((DispatchCode::KeepOut, "in the pit".into())) } else { Ok(()) }
        }
    }
    let mut bench = Bench::new(1);
    let body = DispatchBody::Submit { tasks: vec![goto(6.0, 0.0)] };
    let request = DispatchRequest { id: Uuid::from_u128(5), body };
    bench.dispatcher.request(bench.now_ms, 50, &name("cli-7"), &request, &Pit);
    bench.effects();
    let Some(DispatchOutcome::Error(error)) = bench.answer(50) else { panic!() };
    assert_eq!((error.code, error.message.as_str()), (DispatchCode::KeepOut, "in the pit"));
}
