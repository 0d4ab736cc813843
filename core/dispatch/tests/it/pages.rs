//! Lists and answers fit into a message, however much is remembered.

use crate::bench::{Bench, goto};
use xtb_protocol::codec::{Format, encode, json_bytes};
use xtb_protocol::messages::{
    DispatchBody, DispatchOutcome, DispatchReply, GoalStatus, MAX_POINTS, MAX_SUBMISSION, Message,
    PAGE_BYTES, TaskId, TaskKind, TaskList, TaskSpec, TaskState, Waypoint,
};

/// 4 MiB: what nobody here reads more of.
const MOST: usize = 4 << 20;

/// As long as a task can be.
fn long_route() -> TaskSpec {
    let point = Waypoint { x_m: -0.123_456_789_012_345_68, y_m: 1.0 / 3.0, yaw_rad: Some(-0.1 / 0.3) };
    TaskSpec::new(TaskKind::Route { points: vec![point; MAX_POINTS], loops: 1, dwell_s: 0.1 })
}

fn submit_many(bench: &mut Bench, spec: &TaskSpec, count: usize) {
    let ticket = bench.ask(DispatchBody::Submit { tasks: vec![spec.clone(); count] });
    bench.run_ms(20);
    assert!(matches!(bench.answer(ticket), Some(DispatchOutcome::Submitted(_))));
}

fn ids(list: &TaskList) -> Vec<u64> {
    list.tasks.iter().map(|task| task.id.number()).collect()
}

#[test]
fn a_list_of_long_routes_fits_into_a_message_and_says_what_it_leaves_out() {
    let mut bench = Bench::new(0);
    (0..4).for_each(|_| submit_many(&mut bench, &long_route(), MAX_SUBMISSION));
    let list = bench.dispatcher.list(bench.now_ms);
    assert!(
        json_bytes(&bench.dispatcher.store().tasks().map(|task| task.view()).collect::<Vec<_>>()) > 4 * MOST
    );
    for format in [Format::Json, Format::Postcard] {
        assert!(encode(&list, format).unwrap().len() < MOST);
    }
    const { assert!(TaskList::MAX_BYTES <= MOST && DispatchReply::MAX_BYTES <= MOST) };
    assert!(list.tasks.len() > 50, "{}", list.tasks.len());
    assert_eq!(list.tasks.len() as u64 + list.left_out, 4 * MAX_SUBMISSION as u64);
}

#[test]
fn pages_name_each_task_once_also_while_tasks_change() {
    let mut bench = Bench::new(0);
    submit_many(&mut bench, &long_route(), MAX_SUBMISSION);
    let (mut observed, mut after, mut pages) = (Vec::new(), TaskId::new(0), 0);
    loop {
        let page = bench.dispatcher.page(bench.now_ms, after);
        assert!(json_bytes(&page) < PAGE_BYTES + 1000);
        observed.extend(ids(&page));
        pages += 1;
        let following = bench.dispatcher.store().tasks_after(page.tasks.last().unwrap().id).count();
        assert_eq!(page.left_out, following as u64);
        if page.left_out == 0 {
            break;
        }
        after = page.tasks.last().unwrap().id;
        // What was shown changes, and more comes at the end.
        bench.ask(DispatchBody::Cancel { tasks: vec![after] });
        if pages == 1 {
            submit_many(&mut bench, &goto(1.0, 0.0), 1);
        }
        bench.run_ms(100);
    }
    assert!(pages > 3, "{pages}");
    assert_eq!(observed, (1..=MAX_SUBMISSION as u64 + 1).collect::<Vec<_>>());
    assert_eq!(ids(&bench.dispatcher.page(bench.now_ms, TaskId::new(100_000))), [0_u64; 0]);
}

#[test]
fn a_list_that_is_too_long_has_what_is_under_way_first_then_what_waits_then_the_last_ends() {
    let mut bench = Bench::new(1);
    submit_many(&mut bench, &goto(2.0, 0.0), 60);
    bench.ask(DispatchBody::Cancel { tasks: (1..=50).map(TaskId::new).collect() });
    bench.run_ms(2000);
    submit_many(&mut bench, &long_route(), 150);
    let running = bench.dispatcher.store().busy().next().unwrap().1.number();
    let list = bench.dispatcher.list(bench.now_ms);
    let shown = ids(&list);
    assert!(shown.is_sorted() && list.left_out > 0);
    assert!(shown.contains(&running), "{running} is driven: {shown:?}");
    let state = |id: u64| bench.state(TaskId::new(id));
    let open: Vec<u64> = (1..=210).filter(|id| !state(*id).is_final()).collect();
    if shown.iter().any(|id| state(*id).is_final()) {
        assert!(open.iter().all(|id| shown.contains(id)));
    }
    // More long ones than there is room for: nothing that has ended is shown.
    submit_many(&mut bench, &TaskSpec { priority: 9, ..long_route() }, 200);
    let list = bench.dispatcher.list(bench.now_ms);
    assert!(list.tasks.iter().all(|task| !task.state.is_final()));
    assert!(ids(&list).contains(&running) || bench.state(TaskId::new(running)) == TaskState::Done);
}

#[test]
fn what_is_published_has_all_that_is_open_and_the_last_hundred_that_ended() {
    let mut bench = Bench::new(0);
    submit_many(&mut bench, &goto(2.0, 0.0), 300);
    bench.ask(DispatchBody::Cancel { tasks: (1..=250).map(TaskId::new).collect() });
    bench.run_ms(2000);
    let list = bench.dispatcher.published(bench.now_ms);
    assert_eq!((ids(&list), list.left_out), ((151..=300).collect(), 150));
    let asked = bench.dispatcher.list(bench.now_ms);
    assert_eq!((asked.tasks.len(), asked.left_out), (300, 0));
}

#[test]
fn an_answer_that_is_cut_has_what_went_wrong_first_and_counts_the_rest() {
    let mut bench = Bench::new(0);
    (0..20).for_each(|_| submit_many(&mut bench, &goto(2.0, 0.0), MAX_SUBMISSION));
    let ended = bench.ask(DispatchBody::Cancel { tasks: (1..=100).map(TaskId::new).collect() });
    bench.run_ms(100);
    let reply = bench.reply(ended).unwrap();
    assert!(matches!(&reply.result, DispatchOutcome::Changed(changes) if changes.len() == 100));
    assert_eq!(reply.left_out, 0);
    bench.full = true;
    bench.refused(vec![goto(1.0, 0.0)]);
    let ticket = bench.ask(DispatchBody::CancelAll {});
    bench.run_ms(100);
    let reply = bench.reply(ticket).unwrap();
    let DispatchOutcome::Changed(changes) = &reply.result else { panic!("{reply:?}") };
    assert!(reply.left_out > 0 && json_bytes(changes) <= PAGE_BYTES);
    assert_eq!(changes.len() as u64 + reply.left_out, 20 * MAX_SUBMISSION as u64 - 100);
    assert!(changes.iter().all(|change| change.error.is_some()));
}

#[test]
fn a_robot_that_says_very_much_does_not_fill_the_ledger_with_it() {
    let mut bench = Bench::new(1);
    let id = bench.submit(TaskSpec { retries: 0, ..goto(2.0, 0.0) });
    bench.run_ms(500);
    bench.robots[0].end(GoalStatus::Failed, Some(&"é".repeat(7000)));
    bench.run_ms(1000);
    assert_eq!(bench.state(id), TaskState::Failed);
    assert!(bench.reason(id).contains("éé"), "{}", bench.reason(id));
    assert!(bench.reason(id).chars().count() <= 401, "{}", bench.reason(id).len());
}
