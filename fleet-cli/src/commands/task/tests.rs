//! What `task` shows.

use super::*;
use xtb_client::fake::task;
use xtb_protocol::messages::{TaskState, TaskStep};

#[test]
fn a_history_has_times_robots_and_reasons() {
    let step = |at_ms, state, reason: Option<&str>| TaskStep {
        at_ms,
        state,
        robot: None,
        legs_done: 0,
        reason: reason.map(str::to_owned),
    };
    let mut view = task(7, TaskState::Failed);
    (view.failures, view.reason) = (3, Some("xtb-1: blocked near (1, 2)".into()));
    view.spec.deadline_ms = Some(61_000);
    let steps = vec![
        step(1000, TaskState::Queued, None),
        step(1300, TaskState::Assigned, None),
        step(2000, TaskState::Failed, Some("xtb-1: blocked near (1, 2)")),
    ];
    let history = TaskHistory { task: view, steps, left_out: 4 };
    let shown = text(&history, 12_000, &Output { json: false, colors: false });
    let expected = "\
t7  goto (1.00, 2.00)
state    failed on xtb-1, for 10 s
why      xtb-1: blocked near (1, 2)
legs     0/1 done
failures 3 of at most 3
terms    for any robot, priority 5, deadline 1 min 00 s after submission
from     me, 11 s ago

after  state        robot  legs  why
0.0 s  queued              0
…      4 not shown
0.3 s  assigned            0
1.0 s  failed              0     xtb-1: blocked near (1, 2)
";
    assert_eq!(shown, expected);
}
