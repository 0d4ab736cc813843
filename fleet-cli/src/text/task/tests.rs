//! Tasks in words.

use super::*;
use xtb_client::fake::task;

fn at(x_m: f64, yaw_deg: Option<f64>) -> Waypoint {
    Waypoint { x_m, y_m: 0.0, yaw_rad: yaw_deg.map(f64::to_radians) }
}

#[test]
fn kinds_are_told_with_what_is_not_plain() {
    let four: Vec<_> = (0..4).map(|x| at(f64::from(x), None)).collect();
    for (kind, expected) in [
        (TaskKind::Goto { to: at(-1.0, Some(90.0)) }, "goto (-1.00, 0.00) 90°"),
        (
            TaskKind::Route { points: four.clone(), loops: 2, dwell_s: 1.5 },
            "route (0.00, 0.00) (1.00, 0.00) (2.00, 0.00) and 1 more, 2 times, 1.5 s at each",
        ),
        (
            TaskKind::Patrol { points: four[..1].to_vec(), dwell_s: 0.0, for_s: Some(600.0) },
            "patrol (0.00, 0.00) for 600 s",
        ),
        (TaskKind::Wander { for_s: 10.0 }, "wander for 10 s"),
    ] {
        assert_eq!(what(&kind), expected);
    }
}

#[test]
fn times_get_coarser_as_they_grow() {
    for (ms, expected) in [
        (0, "0 s"),
        (59_999, "59 s"),
        (61_000, "1 min 01 s"),
        (3_600_000, "1 h 00 min"),
        (90_061_000, "25 h 01 min"),
    ] {
        assert_eq!(since(ms + 5, 5), expected);
    }
    assert_eq!(since(1, 2), "0 s");
}

#[test]
fn counts_name_only_what_there_is() {
    assert_eq!(count(&[]), "no tasks");
    assert_eq!(count(&[task(1, TaskState::Done), task(2, TaskState::Done)]), "all ended: 2 done");
    let mixed = [task(1, TaskState::Queued), task(2, TaskState::Failed), task(3, TaskState::Running)];
    assert_eq!(count(&mixed), "1 running, 1 queued; 1 failed");
}

#[test]
fn a_line_has_robot_legs_and_reason() {
    let mut view = task(3, TaskState::Blocked);
    (view.legs, view.legs_done, view.reason) = (Some(4), 1, Some("a chair".into()));
    assert_eq!(line(&view), "t3 blocked on xtb-1: goto (1.00, 2.00) · 1/4 · a chair");
    assert_eq!(line(&task(4, TaskState::Queued)), "t4 queued: goto (1.00, 2.00)");
}

#[test]
fn a_task_that_waits_is_no_robots_whoever_had_it_before() {
    let on = |state| TaskView { robot: Some(Name::robot("xtb-1").unwrap()), ..task(1, state) };
    assert!(line(&on(TaskState::Running)).starts_with("t1 running on xtb-1: "));
    assert!(line(&on(TaskState::Done)).starts_with("t1 done on xtb-1: "));
    for state in [TaskState::Queued, TaskState::Paused] {
        assert_eq!(robot(&on(state)), None);
        assert!(!line(&on(state)).contains("xtb-1"));
    }
}
