//! Instant actions.

use crate::bench::Bench;
use serde_json::json;
use xtb_protocol::messages::{TaskId, TaskState};
use xtb_vda5050::action::MAX_STATES;
use xtb_vda5050::{Ask, Protocol, Topic};

const BOTH: [Protocol; 2] = [Protocol::V2_1, Protocol::V3_0];

fn with_order(protocol: Protocol) -> Bench {
    let mut bench = Bench::new(protocol);
    let order = bench.order("a", 0, 0, 4, 3);
    bench.send(&order);
    bench
}

fn task(bench: &mut Bench) -> &mut TaskState {
    &mut bench.dispatcher.tasks.get_mut(&TaskId::new(1)).unwrap().state
}

#[test]
fn cancelling_runs_until_the_robot_stands_and_takes_no_update_afterwards() {
    for protocol in BOTH {
        let mut bench = with_order(protocol);
        bench.drive();
        bench.robot.speed_mps = Some(0.2);
        bench.act("cancelOrder", "c", &json!([]));
        assert_eq!((*task(&mut bench), bench.action("c").as_str()), (TaskState::Cancelled, "RUNNING"));
        bench.robot.speed_mps = Some(0.0);
        bench.run();
        assert_eq!((bench.action("c").as_str(), bench.nodes().as_str()), ("FINISHED", ""));
        assert_eq!(
            (bench.state()["orderId"].as_str(), bench.last()),
            (Some("a"), ("n1", 2)),
            "both are kept"
        );
        let update = bench.order("a", 1, 2, 3, 3);
        bench.send(&update);
        assert_eq!(bench.errors(), [protocol.pick("orderUpdateError", "ORDER_UPDATE_FOLLOWING_CANCEL")]);
        let next = bench.order("b", 0, 2, 2, 2);
        bench.send(&next);
        assert_eq!((bench.nodes().as_str(), bench.errors().len()), ("n2+", 0));
    }
}

#[test]
fn cancelling_nothing_or_another_order_fails() {
    for protocol in BOTH {
        let mut bench = Bench::new(protocol);
        bench.act("cancelOrder", "c", &json!([]));
        assert_eq!(bench.action("c"), "FAILED");
        assert_eq!(bench.errors(), [protocol.pick("noOrderToCancel", "NO_ORDER_TO_CANCEL")]);
        let mut bench = with_order(protocol);
        bench.act("cancelOrder", "d", &json!([{"key": "orderId", "value": "b"}]));
        assert_eq!((bench.action("d").as_str(), bench.nodes().as_str()), ("FAILED", "n1+ n2+ n3"));
    }
}

#[test]
fn an_order_that_is_cancelled_before_the_dispatcher_has_answered_does_not_stay_with_it() {
    for killed in [false, true] {
        let mut bench = Bench::new(Protocol::V2_1);
        bench.silent = true;
        let order = bench.order("a", 0, 0, 3, 3);
        bench.send(&order);
        // It was taken, and the answer is lost.
        let ask = bench.asked.last().unwrap().clone();
        bench.dispatcher.ask(&ask);
        bench.act("cancelOrder", "c", &json!([]));
        assert_eq!(bench.action("c"), "RUNNING");
        bench.silent = false;
        match killed {
            true => bench.kill(),
            false => {
                bench.vehicle.answered(bench.now_ms, xtb_vda5050::Answer::Unreachable("lost".to_owned()))
            }
        }
        bench.run();
        bench.run();
        assert_eq!(
            (*task(&mut bench), bench.action("c").as_str()),
            (TaskState::Cancelled, "FINISHED"),
            "{killed}"
        );
        assert_eq!(bench.nodes(), "");
    }
}

#[test]
fn a_pause_holds_until_stop_pause_whatever_an_operator_does() {
    for protocol in BOTH {
        let mut bench = with_order(protocol);
        bench.act("startPause", "p", &json!([]));
        assert_eq!((*task(&mut bench), bench.action("p").as_str()), (TaskState::Paused, "FINISHED"));
        assert_eq!(bench.state()["paused"], true);
        *task(&mut bench) = TaskState::Running;
        bench.run();
        assert_eq!(*task(&mut bench), TaskState::Paused);
        bench.act("stopPause", "q", &json!([]));
        assert_eq!((*task(&mut bench), bench.action("q").as_str()), (TaskState::Running, "FINISHED"));
        *task(&mut bench) = TaskState::Paused;
        bench.run();
        assert_eq!(
            (*task(&mut bench), &bench.state()["paused"]),
            (TaskState::Paused, &json!(true)),
            "an operator's"
        );
    }
}

#[test]
fn an_order_that_comes_while_the_robot_is_paused_waits() {
    let mut bench = Bench::new(Protocol::V3_0);
    bench.act("startPause", "p", &json!([]));
    assert_eq!((bench.action("p").as_str(), &bench.state()["paused"]), ("FINISHED", &json!(true)));
    let order = bench.order("a", 0, 0, 3, 3);
    bench.send(&order);
    assert!(bench.dispatcher.tasks.is_empty());
    bench.kill();
    bench.run();
    assert!(bench.dispatcher.tasks.is_empty() || *task(&mut bench) == TaskState::Paused, "{:?}", bench.asked);
    bench.act("stopPause", "q", &json!([]));
    bench.run();
    assert_eq!(bench.nodes(), "n1+ n2+");
}

#[test]
fn a_pose_is_set_when_there_is_no_order() {
    let at = json!([
        {"key": "x", "value": 1.5}, {"key": "y", "value": -2.0}, {"key": "theta", "value": 0.5},
        {"key": "mapId", "value": "world"}, {"key": "lastNodeId", "value": "n7"},
    ]);
    for (protocol, name) in [(Protocol::V2_1, "initPosition"), (Protocol::V3_0, "initializePosition")] {
        let mut bench = Bench::new(protocol);
        bench.act(name, "i", &at);
        assert_eq!(bench.asked, [Ask::SetPose { x_m: 1.5, y_m: -2.0, yaw_rad: 0.5 }]);
        assert_eq!((bench.action("i").as_str(), bench.last()), ("FINISHED", ("n7", 0)));
        let mut bench = with_order(protocol);
        bench.act(name, "j", &at);
        assert_eq!((bench.action("j").as_str(), bench.asked.len()), ("FAILED", 1));
        assert_eq!(bench.errors(), [protocol.pick("instantActionError", "INVALID_INSTANT_ACTION")]);
    }
}

#[test]
fn what_is_not_known_fails_and_what_has_ended_may_come_again_under_the_same_id() {
    for protocol in BOTH {
        let mut bench = Bench::new(protocol);
        bench.act("beep", "b", &json!([]));
        assert_eq!(bench.action("b"), "FAILED");
        assert_eq!(bench.errors(), [protocol.pick("instantActionError", "INVALID_INSTANT_ACTION")]);
        bench.act("startPause", "p", &json!([]));
        bench.act("stopPause", "q", &json!([]));
        bench.act("startPause", "p", &json!([]));
        assert_eq!(bench.state()["paused"], true, "some masters use an id again");
        bench.vehicle.instant_actions(b"{\"actions\": 7}");
        bench.run();
        assert!(bench.errors().contains(&protocol.pick("validationError", "VALIDATION_FAILURE")));
    }
}

#[test]
fn states_and_factsheets_are_sent_when_asked_for_and_actions_are_forgotten() {
    let mut bench = Bench::new(Protocol::V3_0);
    for (kind, topic) in [("stateRequest", Topic::State), ("factsheetRequest", Topic::Factsheet)] {
        let count = |bench: &Bench| bench.published.iter().filter(|(of, _)| *of == topic).count();
        let before = count(&bench);
        bench.act(kind, kind, &json!([]));
        assert!(count(&bench) > before, "{kind}");
    }
    bench.act("clearInstantActions", "x", &json!([]));
    let left = bench.state()["instantActionStates"].as_array().unwrap();
    assert_eq!(left.len(), 1, "only itself: {left:?}");
}

#[test]
fn masters_of_2_0_call_them_instant_actions() {
    let mut bench = with_order(Protocol::V2_0);
    let message =
        json!({"instantActions": [{"actionType": "cancelOrder", "actionId": "c", "blockingType": "NONE"}]});
    bench.vehicle.instant_actions(message.to_string().as_bytes());
    bench.run();
    assert_eq!(bench.action("c"), "FINISHED");
}

#[test]
fn the_list_of_actions_is_bounded_and_keeps_those_that_are_under_way() {
    let mut bench = with_order(Protocol::V2_1);
    bench.robot.speed_mps = Some(0.2);
    bench.act("cancelOrder", "c", &json!([]));
    for i in 0..2 * MAX_STATES {
        bench.act("stateRequest", &format!("s{i}"), &json!([]));
    }
    assert_eq!(bench.state()["actionStates"].as_array().unwrap().len(), MAX_STATES);
    assert_eq!(bench.action("c"), "RUNNING");
}

#[test]
fn an_action_that_is_sent_again_while_it_runs_is_done_once() {
    let mut bench = with_order(Protocol::V3_0);
    bench.robot.speed_mps = Some(0.2);
    for _ in 0..2 {
        bench.act("cancelOrder", "c", &json!([]));
        assert_eq!((bench.action("c").as_str(), bench.errors().len()), ("RUNNING", 0));
    }
}
