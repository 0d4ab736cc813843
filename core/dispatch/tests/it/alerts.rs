//! Alerts: each rule, what ends an alert, and who has seen it.

use crate::bench::name;
use crate::robots::{FakeRobot, Goal};
use xtb_dispatch::alerts::{AlertBook, AlertStep, RobotPresence, Rules};
use xtb_protocol::Uuid;
use xtb_protocol::messages::{
    AckBody, AckReply, AckRequest, Alert, AlertKind, AlertState, BatteryLevel, GoalStatus, Latch, LatchState,
    LinkLoss, MAX_ALERT_TEXT, MAX_ALERTS, MapState, RobotState, StopReason, Suspension, SuspensionCause,
    TaskEvent, TaskId, TaskState, TaskStep,
};

const T0: u64 = 1_800_000_000_000;

/// A book, one robot, and what is known of it.
struct Rig {
    book: AlertBook,
    robot: FakeRobot,
    now_ms: u64,
    heard_ms: u64,
    expected: bool,
    suspended: Vec<Suspension>,
}

impl Rig {
    fn new(rules: Rules) -> Self {
        Self::after(rules, Vec::new())
    }

    fn after(rules: Rules, kept: Vec<Alert>) -> Self {
        Self {
            book: AlertBook::new(T0, rules, kept),
            robot: FakeRobot::new("xtb-1", (0.0, 0.0)),
            now_ms: T0,
            heard_ms: T0,
            expected: true,
            suspended: Vec::new(),
        }
    }

    fn state(&mut self, change: &dyn Fn(&mut RobotState)) -> RobotState {
        let mut state = self.robot.state(self.now_ms);
        change(&mut state);
        state
    }

    /// The robot says this for so long, 20 times a second.
    fn hear(&mut self, for_ms: u64, change: &dyn Fn(&mut RobotState)) {
        let until_ms = self.now_ms + for_ms;
        loop {
            let state = self.state(change);
            self.book.state(&state);
            self.heard_ms = self.now_ms;
            self.step();
            if self.now_ms >= until_ms {
                return;
            }
            self.now_ms += 50;
        }
    }

    /// Nothing is heard for so long.
    fn silence(&mut self, for_ms: u64) {
        for _ in 0..for_ms / 250 {
            self.now_ms += 250;
            self.step();
        }
    }

    fn step(&mut self) {
        let met = self.robot.seq > 0;
        let presence = RobotPresence { expected: self.expected, met, last_heard_ms: self.heard_ms };
        self.book.step(self.now_ms, [(&self.robot.name, presence)], &self.suspended);
    }

    fn steps(&mut self) -> Vec<(AlertStep, AlertKind)> {
        std::iter::from_fn(|| self.book.next_change()).map(|it| (it.step, it.alert.kind)).collect()
    }

    fn alerts(&self) -> Vec<Alert> {
        self.book.list(self.now_ms).alerts
    }

    fn only(&self) -> Alert {
        let [alert] = <[Alert; 1]>::try_from(self.alerts()).unwrap();
        alert
    }

    fn ack(&mut self, body: AckBody, person: Option<&str>) -> AckReply {
        let request = AckRequest { body, person: person.map(str::to_owned) };
        self.book.acknowledge(self.now_ms, &name("alice-3f9a1c"), &request)
    }
}

fn well(_: &mut RobotState) {}

fn latched(state: &mut RobotState) {
    let by = "alice".to_owned();
    state.latches = vec![LatchState { latch: Latch::Estop, age_ms: 5, by, present: false }];
}

fn drives(state: &mut RobotState, why: &[StopReason]) {
    state.stopped_because = why.to_vec();
}

/// A robot with a goal that it stands for, for this reason.
fn with_goal() -> Rig {
    let mut rig = Rig::new(Rules::default());
    rig.robot.begin(Goal {
        id: Uuid::from_u128(1),
        by: name("dispatch"),
        status: GoalStatus::Running,
        reason: None,
        ends_ms: u64::MAX,
        to: None,
        on_link_loss: LinkLoss::Halt,
        limit_ms: None,
        finish_ms: 0,
        doomed: false,
    });
    rig
}

fn failed(task: u64, state: TaskState) -> TaskEvent {
    let reason = Some("no way there".to_owned());
    let step = TaskStep { at_ms: T0, state, robot: Some(name("xtb-1")), legs_done: 0, reason };
    TaskEvent { ledger: 1, entry: task, task: TaskId::new(task), step }
}

fn fleet_stop() -> Suspension {
    Suspension { cause: SuspensionCause::FleetStop { by: Some(name("alice")) }, since_ms: T0, tasks: 3 }
}

/// What a robot says, for how long, and the alert that it makes: its kind, subject and words, and the remedy's.
#[test]
fn each_rule_over_a_robots_state_has_its_words_and_its_remedy() {
    type Change = fn(&mut RobotState);
    type Row = (u64, Change, AlertKind, Option<&'static str>, &'static str, &'static str);
    let rows: [Row; 6] = [
        (
            0,
            latched,
            AlertKind::Latched,
            Some("estop"),
            "xtb-1 latched: emergency stop, by alice",
            "`fleet-cli reset xtb-1 --latch estop`, then give a new command (a dispatcher needs none)",
        ),
        (
            0,
            |state| (state.battery_level, state.battery_v) = (BatteryLevel::Warn, Some(7.04)),
            AlertKind::Battery,
            Some("warn"),
            "xtb-1 battery: low (7.0 V)",
            "bring it home and charge it",
        ),
        (
            0,
            |state| state.battery_level = BatteryLevel::Critical,
            AlertKind::Battery,
            Some("critical"),
            "xtb-1 battery: nearly empty",
            "switch it off and charge it",
        ),
        (
            60_000,
            |state| drives(state, &[StopReason::WayBlocked]),
            AlertKind::Blocked,
            None,
            "xtb-1 makes no progress for 60 s: blocked by an unmapped obstacle",
            "clear the path; the robot also looks for another one by itself",
        ),
        (
            60_000,
            |state| drives(state, &[StopReason::InKeepOut]),
            AlertKind::Blocked,
            None,
            "xtb-1 makes no progress for 60 s: inside a keep-out zone",
            "drive it out by hand: `fleet-cli teleop xtb-1`",
        ),
        (
            40_000,
            |state| {
                let (name, hash) = ("hall".to_owned(), "1".to_owned());
                state.nav.map = Some(MapState { name, hash, fleet_hash: Some("2".to_owned()) });
            },
            AlertKind::MapMismatch,
            None,
            "xtb-1 has another map than the fleet: hall (1), not 2; no planned goals",
            "stop xtb-1 so that it takes the fleet's map; else restart its agent",
        ),
    ];
    for (after_ms, change, kind, subject, text, remedy) in rows {
        let mut rig = with_goal();
        if after_ms > 0 {
            rig.hear(after_ms - 50, &change);
            assert_eq!(rig.alerts(), [], "{text}: not yet");
            rig.now_ms += 50;
        }
        rig.hear(0, &change);
        let alert = rig.only();
        assert_eq!((alert.kind, alert.subject.as_deref()), (kind, subject), "{text}");
        assert_eq!((alert.text.as_str(), alert.remedy.as_str()), (text, remedy));
        assert_eq!((alert.robot.clone(), alert.state()), (Some(name("xtb-1")), AlertState::Open));
        assert_eq!(rig.now_ms - alert.since_ms, after_ms, "{text}: since it began");
        // Raised once, and ended when it is over.
        rig.hear(5_000, &change);
        assert_eq!(rig.steps(), [(AlertStep::Raised, kind)], "{text}");
        rig.hear(4_000, &well);
        assert_eq!(
            (rig.steps(), rig.only().state()),
            (vec![(AlertStep::Ended, kind)], AlertState::Ended),
            "{text}"
        );
    }
}

#[test]
fn what_needs_nobody_is_no_alert() {
    for reason in
        [StopReason::Planning, StopReason::Starting, StopReason::AtCusp, StopReason::ChangingDirection]
    {
        let mut rig = with_goal();
        rig.hear(300_000, &|state| drives(state, &[reason]));
        assert_eq!(rig.alerts(), [], "{reason:?}");
    }
    // Without a goal nobody waits for it.
    let mut rig = Rig::new(Rules::default());
    rig.hear(300_000, &|state| drives(state, &[StopReason::ObstacleFront]));
    assert_eq!(rig.alerts(), []);
    let mut rig = Rig::new(Rules::default());
    rig.hear(1_000, &|state| state.battery_level = BatteryLevel::Ok);
    rig.hear(1_000, &|state| state.battery_level = BatteryLevel::Unknown);
    assert_eq!(rig.alerts(), []);
}

#[test]
fn a_robot_that_moves_a_little_is_still_blocked_and_one_that_drives_is_not() {
    let blocked = |state: &mut RobotState| drives(state, &[StopReason::ObstacleFront]);
    let mut rig = with_goal();
    for _ in 0..7 {
        rig.hear(8_000, &blocked);
        rig.hear(1_000, &well);
    }
    assert_eq!(rig.only().kind, AlertKind::Blocked);
    let mut rig = with_goal();
    for _ in 0..10 {
        rig.hear(30_000, &blocked);
        rig.hear(5_000, &well);
    }
    assert_eq!(rig.alerts(), []);
}

#[test]
fn a_rule_that_is_off_is_silent() {
    let off = Rules {
        latched: false,
        gone_ms: None,
        task_failed: false,
        battery: None,
        blocked_ms: None,
        suspended: false,
        map_mismatch_ms: None,
    };
    let mut rig = Rig::new(off);
    rig.suspended = vec![fleet_stop()];
    rig.book.task(T0, &failed(1, TaskState::Failed));
    rig.hear(1_000, &|state| {
        latched(state);
        state.battery_level = BatteryLevel::Critical;
    });
    rig.silence(600_000);
    assert_eq!(rig.alerts(), []);
}

#[test]
fn a_robot_that_is_not_heard_is_gone_until_it_is_back() {
    let mut rig = Rig::new(Rules::default());
    rig.hear(1_000, &latched);
    assert_eq!(rig.steps(), [(AlertStep::Raised, AlertKind::Latched)]);
    rig.silence(9_750);
    assert_eq!(rig.steps(), []);
    rig.silence(250);
    assert_eq!(rig.steps(), [(AlertStep::Raised, AlertKind::Gone)], "and nothing is known of its latch");
    let gone = rig.alerts().pop().unwrap();
    assert_eq!(gone.text, "xtb-1 is missing: no message for 10 s");
    assert!(gone.remedy.contains("`fleet-cli doctor`"), "{}", gone.remedy);
    rig.hear(50, &well);
    assert_eq!(rig.steps(), [(AlertStep::Ended, AlertKind::Latched), (AlertStep::Ended, AlertKind::Gone)]);
}

#[test]
fn who_is_neither_expected_nor_met_is_not_gone() {
    let mut rig = Rig::new(Rules::default());
    rig.expected = false;
    rig.silence(60_000);
    assert_eq!(rig.alerts(), []);
    rig.expected = true;
    rig.silence(250);
    assert_eq!(rig.only().kind, AlertKind::Gone);
}

#[test]
fn a_failed_task_stays_until_it_is_acknowledged_or_queued_again() {
    let mut rig = Rig::new(Rules::default());
    rig.book.task(T0, &failed(1, TaskState::Failed));
    rig.book.task(T0, &failed(2, TaskState::Failed));
    rig.book.task(T0, &failed(3, TaskState::Cancelled));
    rig.hear(60_000, &well);
    assert_eq!(rig.steps(), [(AlertStep::Raised, AlertKind::TaskFailed); 2]);
    let alert = &rig.alerts()[0];
    assert_eq!(
        (alert.text.as_str(), alert.subject.as_deref()),
        ("task t1 failed on xtb-1: no way there", Some("t1"))
    );
    assert!(alert.remedy.contains("`fleet-cli retry t1`"), "{}", alert.remedy);
    rig.book.task(
        T0,
        &TaskEvent {
            step: TaskStep { robot: None, ..failed(2, TaskState::Queued).step },
            ..failed(2, TaskState::Queued)
        },
    );
    assert_eq!(rig.steps(), [(AlertStep::Ended, AlertKind::TaskFailed)]);
    let reply = rig.ack(AckBody::Alerts { ids: vec![1, 2, 9] }, None);
    assert_eq!(reply, AckReply { acknowledged: vec![1], before: vec![2], unknown: vec![9] });
    assert_eq!(rig.alerts()[0].state(), AlertState::Ended);
}

#[test]
fn a_suspended_dispatcher_is_an_alert_until_it_is_activated() {
    let mut rig = Rig::new(Rules::default());
    rig.suspended = vec![fleet_stop()];
    rig.hear(1_000, &well);
    let alert = rig.only();
    assert_eq!((alert.kind, alert.robot), (AlertKind::Suspended, None));
    assert!(alert.text.contains("emergency stop of all robots by alice"), "{}", alert.text);
    assert!(alert.remedy.contains("`fleet-cli dispatch activate`"), "{}", alert.remedy);
    // A task more is no other alert.
    rig.suspended[0].tasks = 4;
    rig.hear(1_000, &well);
    rig.suspended.clear();
    rig.hear(1_000, &well);
    assert_eq!(
        rig.steps(),
        [(AlertStep::Raised, AlertKind::Suspended), (AlertStep::Ended, AlertKind::Suspended)]
    );
}

#[test]
fn an_alert_is_acknowledged_by_name_once_and_ends_all_the_same() {
    let mut rig = Rig::new(Rules::default());
    rig.hear(1_000, &latched);
    let reply = rig.ack(AckBody::All {}, Some("alice@desk"));
    assert_eq!(reply.acknowledged, [1]);
    assert_eq!(rig.ack(AckBody::All {}, None), AckReply::default());
    assert_eq!(rig.ack(AckBody::Alerts { ids: vec![1] }, Some("bob@desk")).before, [1]);
    let seen = rig.only().acknowledged.unwrap();
    assert_eq!((seen.who().as_str(), seen.at_ms), ("alice-3f9a1c (alice@desk)", T0 + 1_000));
    rig.hear(1_000, &latched);
    assert_eq!(rig.only().state(), AlertState::Acknowledged);
    rig.hear(1_000, &well);
    rig.hear(1_000, &latched);
    let latched = (AlertStep::Raised, AlertKind::Latched);
    let (seen, ended) =
        ((AlertStep::Acknowledged, AlertKind::Latched), (AlertStep::Ended, AlertKind::Latched));
    assert_eq!(rig.steps(), [latched, seen, ended, latched], "a new latch is a new alert");
    assert_eq!(rig.alerts().iter().map(Alert::is_open).collect::<Vec<_>>(), [false, true]);
}

#[test]
fn a_restart_keeps_alerts_and_raises_none_twice() {
    let mut rig = Rig::new(Rules::default());
    rig.suspended = vec![fleet_stop()];
    rig.book.task(T0, &failed(1, TaskState::Failed));
    rig.hear(1_000, &latched);
    assert_eq!(rig.ack(AckBody::Alerts { ids: vec![2] }, None).acknowledged, [2]);
    let before = rig.alerts();
    let mut after = Rig::after(Rules::default(), before.clone());
    after.suspended = rig.suspended;
    // Nothing has been heard yet: what was so is not over.
    after.silence(5_000);
    assert_eq!((after.alerts(), after.steps()), (before, Vec::new()));
    after.hear(1_000, &latched);
    assert_eq!(after.steps(), []);
    after.hear(1_000, &well);
    assert_eq!(after.steps(), [(AlertStep::Ended, AlertKind::Latched)]);
    after.book.task(T0, &failed(7, TaskState::Failed));
    assert_eq!(after.alerts().last().unwrap().id, 4, "numbers go on");
}

#[test]
fn an_acknowledged_alert_of_a_robot_that_nobody_expects_ends() {
    let mut rig = Rig::new(Rules::default());
    rig.hear(1_000, &latched);
    let kept = rig.alerts();
    let mut after = Rig::after(Rules::default(), kept);
    after.expected = false;
    after.silence(60_000);
    assert_eq!(after.only().state(), AlertState::Open);
    after.ack(AckBody::All {}, None);
    after.silence(250);
    assert_eq!(after.only().state(), AlertState::Ended);
}

#[test]
fn the_list_is_bounded_and_what_finds_no_room_is_counted() {
    let mut rig = Rig::new(Rules::default());
    for task in 0..600 {
        rig.book.task(T0, &failed(task, TaskState::Failed));
    }
    let list = rig.book.list(T0);
    assert_eq!((list.alerts.len(), list.left_out), (MAX_ALERTS, 100));
    // Ended ones make room: the oldest goes first.
    assert_eq!(rig.ack(AckBody::Alerts { ids: vec![1, 2] }, None).acknowledged, [1, 2]);
    rig.book.task(T0, &failed(1000, TaskState::Failed));
    let list = rig.book.list(T0);
    assert_eq!((list.alerts.len(), list.left_out, list.alerts[0].id), (MAX_ALERTS, 100, 2));
    // And of ended ones 100 stay.
    let mut rig = Rig::new(Rules::default());
    for _ in 0..150 {
        rig.hear(50, &latched);
        rig.now_ms += 50;
        rig.hear(0, &well);
        rig.now_ms += 50;
    }
    let alerts = rig.alerts();
    assert_eq!((alerts.len(), alerts[0].id, alerts.last().unwrap().id), (100, 51, 150));
}

#[test]
fn a_robots_words_cannot_make_an_alert_longer_than_it_may_be() {
    let mut rig = Rig::new(Rules::default());
    rig.hear(0, &|state| {
        let by = "é".repeat(5_000);
        state.latches = vec![LatchState { latch: Latch::SensorFault, age_ms: 0, by, present: true }];
    });
    let alert = rig.only();
    assert!(alert.text.len() <= MAX_ALERT_TEXT && alert.text.ends_with('…'), "{} bytes", alert.text.len());
}

#[test]
fn a_latch_for_an_empty_battery_is_one_alert() {
    let mut rig = Rig::new(Rules::default());
    rig.hear(1_000, &|state| {
        state.battery_level = BatteryLevel::Critical;
        let by = "battery".to_owned();
        state.latches = vec![LatchState { latch: Latch::BatteryCritical, age_ms: 0, by, present: true }];
    });
    assert_eq!(rig.only().kind, AlertKind::Latched);
}
