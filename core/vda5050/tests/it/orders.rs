//! Orders that are driven: base and horizon, updates, the end.

use crate::bench::Bench;
use xtb_protocol::messages::{TaskId, TaskState};
use xtb_vda5050::{Ask, Effect, Protocol};

const ALL: [Protocol; 3] = [Protocol::V2_0, Protocol::V2_1, Protocol::V3_0];

#[test]
fn an_order_is_one_task_and_its_nodes_go_as_the_robot_arrives() {
    for protocol in ALL {
        let mut bench = Bench::new(protocol);
        let order = bench.order("a", 0, 0, 4, 3);
        bench.send(&order);
        assert_eq!((bench.nodes().as_str(), bench.last()), ("n1+ n2+ n3", ("n0", 0)));
        assert_eq!(bench.state()["newBaseRequest"], false);
        bench.drive();
        assert_eq!((bench.nodes().as_str(), bench.last()), ("n2+ n3", ("n1", 2)));
        assert_eq!(bench.state()["newBaseRequest"], true, "one node of the base is left");
        bench.drive();
        assert_eq!((bench.nodes().as_str(), bench.last()), ("n3", ("n2", 4)), "it waits for its horizon");
        assert_eq!(bench.dispatcher.tasks.len(), 1);
        assert_eq!(bench.dispatcher.driven, [(1.0, 0.0), (2.0, 0.0)]);
    }
}

#[test]
fn an_update_while_the_robot_drives_extends_its_task() {
    for protocol in ALL {
        let mut bench = Bench::new(protocol);
        let (order, update) = (bench.order("a", 0, 0, 4, 2), bench.order("a", 1, 2, 4, 3));
        bench.send(&order);
        bench.send(&update);
        assert_eq!((bench.nodes().as_str(), bench.last()), ("n1+ n2+ n3+ n4", ("n0", 0)));
        assert_eq!(bench.state()["orderUpdateId"], 1);
        (0..3).for_each(|_| bench.drive());
        assert_eq!((bench.nodes().as_str(), bench.last()), ("n4", ("n3", 6)));
        assert_eq!(bench.dispatcher.tasks.len(), 1, "the same task all along");
        assert_eq!(bench.dispatcher.driven, [(1.0, 0.0), (2.0, 0.0), (3.0, 0.0)]);
    }
}

#[test]
fn an_update_after_the_base_was_driven_is_a_part_of_its_own() {
    let mut bench = Bench::new(Protocol::V3_0);
    let (order, update) = (bench.order("a", 0, 0, 2, 2), bench.order("a", 1, 2, 2, 2));
    bench.send(&order);
    bench.drive();
    assert_eq!((bench.nodes().as_str(), bench.last()), ("", ("n1", 2)));
    bench.send(&update);
    bench.drive();
    assert_eq!((bench.last(), bench.dispatcher.tasks.len()), (("n2", 4), 2));
}

#[test]
fn an_update_that_crosses_the_end_of_the_base_drives_its_nodes_once() {
    let mut bench = Bench::new(Protocol::V2_1);
    let (order, update) = (bench.order("a", 0, 0, 2, 2), bench.order("a", 1, 2, 2, 2));
    bench.send(&order);
    bench.dispatcher.drive(); // nobody was told
    bench.vehicle.order(update.to_string().as_bytes());
    bench.run();
    assert!(bench.asked.iter().any(|ask| matches!(ask, Ask::Extend { .. })), "it believed in the task");
    bench.run();
    bench.drive();
    assert_eq!((bench.nodes().as_str(), bench.last()), ("", ("n2", 4)));
    assert_eq!(bench.dispatcher.driven, [(1.0, 0.0), (2.0, 0.0)]);
}

#[test]
fn a_horizon_changes_without_the_dispatcher() {
    let mut bench = Bench::new(Protocol::V2_1);
    let (order, update) = (bench.order("a", 0, 0, 4, 2), bench.order("a", 1, 2, 6, 1));
    bench.send(&order);
    let asked = bench.asked.len();
    bench.send(&update);
    assert_eq!((bench.nodes().as_str(), bench.asked.len()), ("n1+ n2 n3 n4 n5 n6", asked));
}

#[test]
fn an_order_of_many_nodes_is_driven_in_parts_of_a_hundred_points() {
    let mut bench = Bench::new(Protocol::V3_0);
    let order = bench.order("a", 0, 0, 81, 81);
    bench.send(&order);
    let update = bench.order("a", 1, 160, 41, 41);
    bench.send(&update);
    for _ in 0..80 {
        bench.dispatcher.drive();
        bench.turn();
    }
    bench.run();
    assert_eq!((bench.last(), bench.dispatcher.tasks.len()), (("n80", 160), 2));
    for _ in 0..40 {
        bench.dispatcher.drive();
        bench.turn();
    }
    bench.run();
    let expected: Vec<(f64, f64)> = (1..=120).map(|x| (f64::from(x), 0.0)).collect();
    assert_eq!((bench.nodes(), &bench.dispatcher.driven), (String::new(), &expected));
}

#[test]
fn a_restart_at_any_point_goes_on_and_drives_no_node_twice() {
    let order = Bench::new(Protocol::V2_1).order("a", 0, 0, 3, 3);
    for kill_at in 0..12 {
        for silent in [false, true] {
            let mut bench = Bench::new(Protocol::V2_1);
            bench.vehicle.order(order.to_string().as_bytes());
            for turn in 0..60 {
                if turn == kill_at {
                    bench.silent = silent;
                    bench.turn();
                    bench.silent = false;
                    bench.kill();
                    // Nobody has acknowledged it: the master sends it again.
                    bench.vehicle.robot(Some(&bench.robot), true);
                    bench.vehicle.order(order.to_string().as_bytes());
                }
                if turn % 4 == 3
                    && let Some(point) = bench.dispatcher.drive()
                {
                    (bench.robot.pose.x_m, bench.robot.pose.y_m) = (point.x_m, point.y_m);
                }
                bench.turn();
            }
            bench.run();
            assert_eq!(bench.dispatcher.driven, [(1.0, 0.0), (2.0, 0.0)], "{kill_at} {silent}");
            assert_eq!((bench.nodes().as_str(), bench.last()), ("", ("n2", 4)));
        }
    }
}

#[test]
fn a_bridge_that_has_lost_what_it_kept_submits_the_same_task() {
    let mut bench = Bench::new(Protocol::V3_0);
    let order = bench.order("a", 0, 0, 3, 3);
    bench.send(&order);
    bench.drive();
    bench.saved.clear();
    bench.kill();
    bench.turn();
    bench.robot.pose.x_m = 0.0; // else it would be too far from the first node
    bench.turn();
    bench.send(&order);
    assert_eq!((bench.dispatcher.tasks.len(), bench.last()), (1, ("n1", 2)));
}

#[test]
fn a_task_that_fails_or_is_cancelled_by_somebody_keeps_the_order_and_says_so() {
    for (state, v2, v3) in [
        (TaskState::Failed, "nodeUnreachable", "NODE_UNREACHABLE"),
        (TaskState::Cancelled, "taskCancelled", "TASK_CANCELLED"),
        (TaskState::Blocked, "pathBlocked", "PATH_BLOCKED"),
    ] {
        for protocol in [Protocol::V2_1, Protocol::V3_0] {
            let mut bench = Bench::new(protocol);
            let order = bench.order("a", 0, 0, 3, 3);
            bench.send(&order);
            bench.dispatcher.tasks.get_mut(&TaskId::new(1)).unwrap().state = state;
            bench.run();
            assert_eq!((bench.errors(), bench.nodes().as_str()), (vec![protocol.pick(v2, v3)], "n1+ n2+"));
            if state != TaskState::Blocked {
                bench.act("cancelOrder", "c", &serde_json::json!([]));
                assert_eq!((bench.action("c").as_str(), bench.nodes().as_str()), ("FINISHED", ""));
            }
        }
    }
}

#[test]
fn a_ledger_that_is_lost_keeps_the_order_until_it_is_cancelled() {
    let mut bench = Bench::new(Protocol::V2_1);
    let order = bench.order("a", 0, 0, 3, 3);
    bench.send(&order);
    bench.dispatcher.tasks.clear();
    bench.kill();
    bench.run();
    assert_eq!((bench.errors(), bench.nodes().as_str()), (vec!["nodeUnreachable"], "n1+ n2+"));
    assert!(bench.dispatcher.tasks.is_empty(), "nothing is driven on a guess");
}

#[test]
fn a_task_of_the_same_name_in_another_ledger_is_not_the_orders() {
    let mut bench = Bench::new(Protocol::V2_1);
    let order = bench.order("a", 0, 0, 3, 3);
    bench.send(&order);
    bench.vehicle.task((8, TaskId::new(1)), TaskState::Done, 2, None);
    bench.run();
    assert_eq!((bench.nodes().as_str(), bench.last()), ("n1+ n2+", ("n0", 0)));
}

#[test]
fn nothing_is_asked_for_what_could_not_be_kept() {
    let mut bench = Bench::new(Protocol::V2_1);
    let order = bench.order("a", 0, 0, 3, 3);
    bench.vehicle.order(order.to_string().as_bytes());
    let effects = bench.vehicle.step(bench.now_ms + 50);
    assert!(matches!(effects[..2], [Effect::Save(_), Effect::Ask(Ask::Submit { .. })]), "{effects:?}");
    bench.vehicle.not_saved(bench.now_ms + 50, "the disk is full".to_owned());
    bench.run();
    let effects = bench.vehicle.step(bench.now_ms);
    assert!(
        bench.saved.contains("n2") && bench.dispatcher.tasks.len() == 1,
        "it was tried again: {effects:?}"
    );
}

#[test]
fn an_extension_whose_answer_was_lost_and_that_was_driven_meanwhile_is_not_driven_again() {
    for killed in [false, true] {
        let mut bench = Bench::new(Protocol::V2_1);
        let (order, update) = (bench.order("a", 0, 0, 2, 2), bench.order("a", 1, 2, 2, 2));
        bench.send(&order);
        bench.silent = true;
        bench.vehicle.order(update.to_string().as_bytes());
        bench.run();
        let ask = bench.unanswered.take().unwrap();
        assert!(matches!(ask, Ask::Extend { .. }), "{ask:?}");
        bench.dispatcher.ask(&ask);
        for _ in 0..2 {
            let _ = bench.dispatcher.drive();
        }
        match killed {
            true => bench.kill(),
            false => {
                bench.vehicle.answered(bench.now_ms, xtb_vda5050::Answer::Unreachable("lost".to_owned()))
            }
        }
        bench.silent = false;
        bench.run();
        bench.run();
        assert_eq!(bench.dispatcher.driven, [(1.0, 0.0), (2.0, 0.0)], "{killed}");
        assert_eq!((bench.last(), bench.dispatcher.tasks.len()), (("n2", 4), 1));
    }
}
