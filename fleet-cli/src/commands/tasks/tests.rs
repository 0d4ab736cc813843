//! What `tasks` shows.

use super::*;
use xtb_client::fake::{name, task};
use xtb_protocol::messages::TaskState;

fn args(all: bool, robot: Option<&str>) -> TasksArgs {
    TasksArgs { watch: false, all, robot: robot.map(name) }
}

fn list() -> TaskList {
    let mut tasks: Vec<TaskView> = (1..=7).map(|n| task(n, TaskState::Done)).collect();
    tasks.extend([task(8, TaskState::Running), task(9, TaskState::Queued)]);
    TaskList { ledger: 1, at_ms: 66_000, ledger_failed: None, tasks, left_out: 0, suspended: Vec::new() }
}

const PLAIN: Output = Output { json: false, colors: false };

#[test]
fn of_what_has_ended_only_the_last_few_are_shown() {
    let lines = screen(&list(), &args(false, None), &PLAIN);
    assert_eq!(lines[0], "task  state    for         robot  legs  pri  what               why");
    assert_eq!(lines[1], "t3    done     1 min 04 s  xtb-1  1/1   5    goto (1.00, 2.00)");
    assert_eq!(lines[7], "t9    queued   1 min 04 s  any    0/1   5    goto (1.00, 2.00)");
    assert_eq!(lines[8], "1 running, 1 queued; 7 done (2 of them not shown: --all)");
    assert_eq!(screen(&list(), &args(true, None), &PLAIN).len(), 11);
}

#[test]
fn a_robots_tasks_are_those_that_it_has_or_that_wait_for_it() {
    let mut list = list();
    assert_eq!(screen(&list, &args(false, Some("xtb-2")), &PLAIN), ["no tasks"]);
    list.tasks[8].spec.who = Who::Robot(name("xtb-2"));
    assert!(screen(&list, &args(false, Some("xtb-2")), &PLAIN)[1].starts_with("t9"));
    assert_eq!(screen(&list, &args(true, Some("xtb-1")), &PLAIN).len(), 10);
}

#[test]
fn a_ledger_that_cannot_be_written_is_said_first() {
    let list = TaskList { ledger_failed: Some("disk full".into()), ..list() };
    let lines = screen(&list, &args(false, None), &PLAIN);
    assert_eq!(lines[0], "the ledger cannot be written: disk full");
}
