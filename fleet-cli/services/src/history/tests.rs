//! A history on a real disk: what it keeps, across restarts, and within its bounds.

use super::*;
use xtb_client::ErrorKind;
use xtb_client::fake::name;
use xtb_dispatch::alerts::AlertStep;
use xtb_protocol::messages::{
    Acknowledged, AlertKind, HistoryEvent, HistoryPlace, MAX_HISTORY_PAGE, StopCount, TaskState, TaskStep,
};
use xtb_protocol::{Uuid, messages::TaskId};

const DAY_MS: u64 = 24 * 3600 * 1000;
/// Changes since, robot, kinds and search of a question.
type Narrow<'a> =
    dyn Fn(&mut Option<u64>, &mut Option<Name>, &mut Vec<HistoryKind>, &mut Option<String>) + 'a;

fn now_ms() -> u64 {
    crate::dispatch::store::wall_ms()
}

fn lease(seq: u64) -> Event {
    let kind = EventKind::Lease { holder: Some(name("alice-3f9a1c")) };
    Event { robot: name("xtb-1"), epoch: u64::MAX - 1, seq, tick_ms: 5, kind }
}

fn all() -> HistoryRequest {
    HistoryRequest::Events {
        place: HistoryPlace::Newest,
        limit: MAX_HISTORY_PAGE,
        since_ms: None,
        robot: None,
        kinds: Vec::new(),
        search: None,
    }
}

/// What is in the file.
fn read(path: &Path, request: &HistoryRequest) -> HistoryReply {
    read::reply(&schema::open_to_read(path).unwrap(), request, now_ms())
}

fn events(path: &Path, request: &HistoryRequest) -> (Vec<HistoryEvent>, bool) {
    match read(path, request) {
        HistoryReply::Events { events, more, .. } => (events, more),
        other => panic!("{other:?}"),
    }
}

fn open(path: &Path) -> History {
    History::open(path, Retention::default()).unwrap().0
}

#[test]
fn events_outlive_the_program_and_are_written_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = path_beside(&folder.path().join("lab.ledger"));
    assert!(path.ends_with("lab.ledger-history"));
    let history = open(&path);
    history.event(HistoryRow::robot(now_ms(), &lease(1)));
    history.event(HistoryRow::robot(now_ms(), &lease(2)));
    drop(history);
    let history = open(&path);
    // A robot sends its last events to whoever comes late.
    history.event(HistoryRow::robot(now_ms() + 5, &lease(2)));
    let step = TaskStep { at_ms: now_ms(), state: TaskState::Done, robot: None, legs_done: 1, reason: None };
    history.event(HistoryRow::task(&TaskEvent {
        ledger: 1,
        entry: 2,
        task: TaskId::new(7),
        step: step.clone(),
    }));
    history.event(HistoryRow::task(&TaskEvent { ledger: 1, entry: 3, task: TaskId::new(7), step }));
    drop(history);
    let (found, more) = events(&path, &all());
    let texts: Vec<&str> = found.iter().map(|event| event.text.as_str()).collect();
    let controlled = "xtb-1 is controlled by alice-3f9a1c";
    assert_eq!((texts, more), (vec![controlled, controlled, "t7 done", "t7 done"], false));
    assert!(found.is_sorted_by(|one, other| one.id < other.id));
}

#[test]
fn a_page_is_what_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history");
    let history = open(&path);
    let base = now_ms();
    for n in 1..=10_u64 {
        let robot = name(if n % 2 == 0 { "xtb-2" } else { "xtb-1" });
        history.event(HistoryRow::presence(base + n, &robot, n % 3 == 0));
    }
    history.event(HistoryRow::robot(base + 11, &lease(1)));
    drop(history);
    let page = |change: &dyn Fn(&mut HistoryRequest)| {
        let mut request = all();
        change(&mut request);
        let (found, more) = events(&path, &request);
        (found.iter().map(|event| event.at_ms - base).collect::<Vec<_>>(), more)
    };
    let set = |wanted: HistoryPlace, most: u32| {
        page(&|request| {
            let HistoryRequest::Events { place, limit, .. } = request else { return };
            (*place, *limit) = (wanted, most);
        })
    };
    assert_eq!(set(HistoryPlace::Newest, 3), (vec![9, 10, 11], true));
    assert_eq!(set(HistoryPlace::Before(9), 3), (vec![6, 7, 8], true));
    assert_eq!(set(HistoryPlace::After(9), 3), (vec![10, 11], false));
    assert_eq!(set(HistoryPlace::After(u64::MAX), 3), (vec![], false));
    let by = |change: &Narrow<'_>| {
        page(&|request| {
            let HistoryRequest::Events { since_ms, robot, kinds, search, .. } = request else { return };
            change(since_ms, robot, kinds, search);
        })
        .0
    };
    assert_eq!(by(&|since, _, _, _| *since = Some(base + 10)), [10, 11]);
    assert_eq!(by(&|_, robot, _, _| *robot = Some(name("xtb-2"))), [2, 4, 6, 8, 10]);
    assert_eq!(by(&|_, _, kinds, _| *kinds = vec![HistoryKind::Lease, HistoryKind::Alert]), [11]);
    assert_eq!(by(&|_, _, _, search| *search = Some("ONLINE".into())), [3, 6, 9]);
    // Words are words, whatever they hold.
    assert_eq!(by(&|_, _, _, search| *search = Some("%' OR 1=1 --".into())), [0_u64; 0]);
}

fn sample(driven_m: f64, volts: Option<f64>) -> ActivitySample {
    ActivitySample {
        heard_s: 10.0,
        active_s: 5.0,
        driving_s: 4.0,
        driven_m,
        done: 1,
        failed: 0,
        battery_min_v: volts,
        battery_v: volts,
        stops: [("way_blocked".to_owned(), 2)].into(),
    }
}

#[test]
fn a_report_is_the_sum_of_what_was_done_that_day() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history");
    let day_ms = now_ms() / DAY_MS * DAY_MS - DAY_MS;
    let (noon, later) = (day_ms + DAY_MS / 2, day_ms + DAY_MS / 2 + PIECE_MS);
    let history = open(&path);
    history.samples(noon, vec![(name("xtb-1"), sample(1.5, Some(7.4)))]);
    history.samples(noon + 1, vec![(name("xtb-1"), sample(0.5, None))]);
    history.samples(later, vec![(name("xtb-1"), sample(1.0, Some(7.1))), (name("xtb-2"), sample(9.0, None))]);
    history.samples(noon + DAY_MS, vec![(name("xtb-1"), sample(100.0, Some(1.0)))]);
    drop(history);
    let day = HistoryRequest::Report { from_ms: day_ms, to_ms: day_ms + DAY_MS };
    let HistoryReply::Report { robots } = read(&path, &day) else { panic!("no report") };
    let [one, two] = robots.try_into().unwrap();
    assert_eq!((one.heard_s, one.active_s, one.driving_s, one.driven_m), (30.0, 15.0, 12.0, 3.0));
    assert_eq!((one.done, one.failed), (3, 0));
    assert_eq!((one.battery_min_v, one.battery_v), (Some(7.1), Some(7.1)));
    assert_eq!(one.stops, [StopCount { reason: "way_blocked".into(), count: 6 }]);
    assert_eq!((two.robot.as_str(), two.driven_m, two.battery_v), ("xtb-2", 9.0, None));
}

fn alert(id: u64) -> Alert {
    Alert {
        id,
        kind: AlertKind::Latched,
        robot: Some(name("xtb-1")),
        subject: Some("estop".into()),
        text: "xtb-1 latched".into(),
        remedy: "reset it".into(),
        since_ms: 1,
        acknowledged: None,
        ended_ms: None,
    }
}

#[test]
fn alerts_are_kept_as_they_were_last() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history");
    let history = open(&path);
    let by = Acknowledged { by: name("alice"), person: None, at_ms: 9 };
    let seen = Alert { acknowledged: Some(by), ..alert(1) };
    history.alert(alert(1));
    history.alert(alert(2));
    history.alert(seen.clone());
    let change = AlertChange { step: AlertStep::Acknowledged, alert: seen.clone() };
    history.event(HistoryRow::alert(now_ms(), &change));
    drop(history);
    let (history, kept) = History::open(&path, Retention::default()).unwrap();
    assert_eq!(kept, [seen, alert(2)]);
    drop(history);
    assert_eq!(events(&path, &all()).0[0].text, "alert 1 acknowledged by alice: xtb-1 latched");
}

#[test]
fn what_is_too_old_or_too_much_goes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("history");
    let fill = |at_ms: u64, rows: u64| {
        let history = open(&path);
        let events = (0..rows).map(|n| {
            let (id, robot) = (Uuid::from_u128(u128::from(n)), name("xtb-1"));
            let status = xtb_protocol::messages::GoalStatus::Failed;
            let kind = EventKind::Goal { id, status, reason: Some("x".repeat(2000)) };
            HistoryRow::robot(at_ms + n, &Event { robot, epoch: at_ms, seq: n, tick_ms: 0, kind })
        });
        events.for_each(|row| history.event(row));
    };
    let now = now_ms();
    fill(now - 100 * DAY_MS, 5);
    fill(now, 3000);
    assert!(std::fs::metadata(&path).unwrap().len() > 2 << 20);
    let bounds = Retention { keep_days: 90, max_mib: 1 };
    let mut writer = write::Writer::new(schema::open(&path).unwrap(), bounds, Arc::default());
    writer.prune(now + DAY_MS).unwrap();
    drop(writer);
    assert!(std::fs::metadata(&path).unwrap().len() <= 1 << 20);
    let (found, _) = events(&path, &all());
    let last = found.last().unwrap();
    assert_eq!(last.at_ms, now + 2999, "the newest stays");
    assert!(last.text.len() <= MAX_TEXT + '…'.len_utf8() && last.text.ends_with('…'), "{}", last.text.len());
    let from_the_first = HistoryRequest::Events {
        place: HistoryPlace::After(0),
        limit: 1,
        since_ms: None,
        robot: None,
        kinds: Vec::new(),
        search: None,
    };
    let first = &events(&path, &from_the_first).0[0];
    assert!(first.at_ms > now, "the oldest went first");
}

#[test]
fn what_is_no_history_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other");
    std::fs::write(&path, "no database, but a long enough text of somebody: ".repeat(40)).unwrap();
    let before = std::fs::read(&path).unwrap();
    assert!(matches!(History::open(&path, Retention::default()), Err(HistoryError::Sqlite { .. })));
    assert_eq!(std::fs::read(&path).unwrap(), before);
    let other = folder.path().join("ledger");
    Connection::open(&other)
        .unwrap()
        .execute_batch("PRAGMA application_id = 7; CREATE TABLE a (b);")
        .unwrap();
    assert!(matches!(History::open(&other, Retention::default()), Err(HistoryError::NotOurs { .. })));
}

#[test]
fn a_question_beyond_the_queue_is_answered_at_once_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let mut history = open(&folder.path().join("history"));
    // Nobody reads.
    let (questions, _waiting) = sync_channel(1);
    history.questions = Some(questions);
    let _first = history.ask(all(), 1);
    let mut second = history.ask(all(), 1);
    assert!(matches!(second.try_recv(), Ok(HistoryReply::Failed { .. })));
    let (jobs, _waiting) = sync_channel(0);
    history.jobs = Some(jobs);
    history.event(HistoryRow::robot(1, &lease(1)));
    let counters = history.counters();
    assert_eq!((counters.overloaded, counters.dropped), (1, 1));
}

#[test]
fn a_day_is_one_of_the_calendar() {
    let (date, from_ms, to_ms) = local_day(Some("2026-11-26")).unwrap();
    assert_eq!(date, "2026-11-26");
    let hours = (to_ms - from_ms) / 3_600_000;
    assert!((23..=25).contains(&hours), "{hours} h");
    let (_, _, yesterday_to) = local_day(Some("yesterday")).unwrap();
    let (_, today_from, today_to) = local_day(None).unwrap();
    assert!(yesterday_to == today_from && (today_from..today_to + 1000).contains(&now_ms()));
    for wrong in ["2026-02-30", "2026-13-01", "now", "2026-11-26 10:00", "", "'; DROP TABLE events"] {
        assert_eq!(local_day(Some(wrong)).unwrap_err().kind, ErrorKind::Invalid, "{wrong}");
    }
}
