//! Which orders are refused, with which error; the order that there is goes on.

use crate::bench::Bench;
use serde_json::{Value, json};
use xtb_protocol::messages::{DispatchCode, LeaseState};
use xtb_vda5050::incoming::{MAX_BYTES, MAX_NODES};
use xtb_vda5050::{Ask, Protocol, incoming};

/// What one says to an order, in 2.1 and in 3.0, after the order `a` with one node of a base and a horizon.
fn refusals(make: impl Fn(&Bench) -> Value, v2: &str, v3: &str) {
    for (protocol, name) in [(Protocol::V2_1, v2), (Protocol::V3_0, v3)] {
        let mut bench = Bench::new(protocol);
        let first = bench.order("a", 1, 0, 3, 2);
        let first = if protocol.is_v3() { bench.order("a", 0, 0, 3, 2) } else { first };
        bench.send(&first);
        if protocol.is_v3() {
            let update = bench.order("a", 1, 2, 2, 1);
            bench.send(&update);
        }
        let asked = bench.asked.len();
        let order = make(&bench);
        bench.vehicle.order(order.to_string().as_bytes());
        bench.run();
        assert_eq!(bench.errors(), [name], "{protocol:?} {order}");
        assert_eq!((bench.nodes().as_str(), bench.state()["orderUpdateId"].as_u64()), ("n1+ n2", Some(1)));
        assert_eq!(bench.asked.len(), asked, "the dispatcher hears nothing of it");
        let references = bench.state()["errors"][0]["errorReferences"].as_array().unwrap();
        assert!(references.iter().any(|of| of["referenceKey"] == "topic"), "{references:?}");
        // The next one that is accepted ends it.
        let update = bench.order("a", 2, 2, 2, 2);
        bench.send(&update);
        assert_eq!(bench.errors(), [""; 0]);
    }
}

#[test]
fn stale_updates() {
    refusals(|bench| bench.order("a", 0, 0, 3, 2), "orderUpdateError", "OUTDATED_ORDER_UPDATE");
}

#[test]
fn another_order_under_the_same_numbers() {
    refusals(|bench| bench.order("a", 1, 2, 5, 5), "orderUpdateError", "SAME_ORDER_UPDATE_ID");
}

#[test]
fn another_order_while_one_is_not_finished() {
    refusals(|bench| bench.order("b", 0, 0, 3, 2), "orderError", "OTHER_ORDER_ACTIVE");
}

#[test]
fn updates_that_do_not_begin_where_the_base_ends() {
    refusals(|bench| bench.order("a", 2, 4, 3, 2), "orderUpdateError", "INVALID_ORDER");
}

#[test]
fn orders_for_another_robot() {
    let other = |bench: &Bench| {
        let mut order = bench.order("a", 2, 2, 3, 2);
        order["serialNumber"] = json!("xtb-2");
        order
    };
    refusals(other, "validationError", "VALIDATION_FAILURE");
}

#[test]
fn nodes_of_another_map_or_without_a_place() {
    let on = |map: &'static str| {
        move |bench: &Bench| {
            let mut order = bench.order("a", 2, 2, 3, 2);
            order["nodes"][1]["nodePosition"]["mapId"] = json!(map);
            order
        }
    };
    refusals(on("elsewhere"), "noRouteError", "UNKNOWN_MAP_ID");
    let nowhere = |bench: &Bench| {
        let mut order = bench.order("a", 2, 2, 3, 2);
        order["nodes"][1]["nodePosition"] = Value::Null;
        order
    };
    refusals(nowhere, "noRouteError", "NO_ROUTE_TO_TARGET");
}

#[test]
fn actions_that_no_robot_can_do() {
    for list in ["nodes", "edges"] {
        let with_action = |bench: &Bench| {
            let mut order = bench.order("a", 2, 2, 3, 2);
            order[list][1]["actions"] =
                json!([{"actionType": "pick", "actionId": "p", "blockingType": "HARD"}]);
            order
        };
        refusals(with_action, "orderError", "INVALID_ORDER_ACTION");
    }
}

#[test]
fn malformed_orders() {
    let cases: [fn(&mut Value); 9] = [
        |order| order["nodes"] = json!("none"),
        |order| order["nodes"][1]["sequenceId"] = json!(5),
        |order| order["edges"][0]["sequenceId"] = json!(9),
        |order| order["edges"][0]["released"] = json!(false),
        |order| order["nodes"][0]["released"] = json!(false),
        |order| order["edges"][0]["startNodeId"] = json!("elsewhere"),
        |order| order["nodes"][1]["nodePosition"]["x"] = json!(1e9),
        |order| order["nodes"][1]["nodeId"] = json!("x".repeat(300)),
        |order| drop(order["edges"].as_array_mut().unwrap().pop()),
    ];
    for spoil in cases {
        let make = |bench: &Bench| {
            let mut order = bench.order("a", 2, 2, 3, 2);
            spoil(&mut order);
            order
        };
        refusals(make, "validationError", "VALIDATION_FAILURE");
    }
    for bytes in [&b"{"[..], b"", b"[1]", b"\xff\xfe", &vec![b' '; MAX_BYTES + 1]] {
        let mut bench = Bench::new(Protocol::V2_1);
        bench.vehicle.order(bytes);
        bench.run();
        assert_eq!(bench.errors(), ["validationError"]);
    }
}

#[test]
fn too_many_nodes() {
    let many = |bench: &Bench| bench.order("a", 2, 2, MAX_NODES as u32 + 1, 2);
    refusals(many, "orderError", "INSUFFICIENT_MEMORY");
    let with_rest = |bench: &Bench| bench.order("a", 2, 2, MAX_NODES as u32, 2);
    refusals(with_rest, "orderError", "INSUFFICIENT_MEMORY");
}

#[test]
fn what_3_0_calls_unsupported_is_refused_there_and_ignored_before() {
    for (protocol, refused) in [(Protocol::V2_1, false), (Protocol::V3_0, true)] {
        let mut bench = Bench::new(protocol);
        let mut order = bench.order("a", 0, 0, 2, 2);
        order["edges"][0]["trajectory"] = json!({"degree": 1, "knotVector": [], "controlPoints": []});
        bench.send(&order);
        assert_eq!(bench.errors() == ["UNSUPPORTED_PARAMETER"], refused);
    }
}

#[test]
fn the_same_order_again_is_ignored() {
    let mut bench = Bench::new(Protocol::V3_0);
    let order = bench.order("a", 0, 0, 3, 3);
    bench.send(&order);
    bench.drive();
    let before = bench.published.len();
    bench.send(&order);
    assert_eq!((bench.errors(), bench.published.len()), (vec![], before), "nothing is said about it");
    assert_eq!(bench.dispatcher.tasks.len(), 1);
}

#[test]
fn an_order_begins_where_the_robot_is() {
    for (x_m, radius, taken) in [(0.4, json!(null), true), (0.6, json!(null), false), (2.0, json!(2.5), true)]
    {
        for protocol in [Protocol::V2_1, Protocol::V3_0] {
            let mut bench = Bench::new(protocol);
            bench.robot.pose.x_m = x_m;
            let mut order = bench.order("a", 0, 0, 3, 3);
            if let Some(radius) = radius.as_f64() {
                let ellipse = json!({"a": radius, "b": radius, "theta": 0.0});
                order["nodes"][0]["nodePosition"]["allowedDeviationXY"] =
                    protocol.pick(json!(radius), ellipse);
            }
            bench.turn();
            bench.send(&order);
            let name = protocol.pick("noRouteError", "START_NODE_OUT_OF_RANGE");
            assert_eq!(bench.errors(), if taken { vec![] } else { vec![name] }, "{x_m} {radius}");
        }
    }
}

#[test]
fn what_the_dispatcher_refuses_is_no_order_and_what_passes_is_asked_again() {
    for (code, v3, kept) in [
        (DispatchCode::KeepOut, "NO_ROUTE_TO_TARGET", false),
        (DispatchCode::GoalBlocked, "NO_ROUTE_TO_TARGET", false),
        (DispatchCode::UnknownRobot, "MOBILE_ROBOT_NOT_AVAILABLE", false),
        (DispatchCode::LedgerFailed, "DISPATCHER_UNREACHABLE", true),
        (DispatchCode::Overloaded, "DISPATCHER_UNREACHABLE", true),
    ] {
        let mut bench = Bench::new(Protocol::V3_0);
        bench.dispatcher.refuses = Some(code);
        let order = bench.order("a", 0, 0, 3, 3);
        bench.send(&order);
        assert_eq!((bench.errors(), bench.state()["orderId"].as_str()), (vec![v3], Some("")));
        bench.dispatcher.refuses = None;
        bench.run();
        assert_eq!(bench.nodes().as_str(), if kept { "n1+ n2+" } else { "" });
    }
}

#[test]
fn a_robot_that_somebody_else_drives_takes_no_new_order_and_keeps_the_one_it_has() {
    for protocol in [Protocol::V2_1, Protocol::V3_0] {
        let mut bench = Bench::new(protocol);
        let order = bench.order("a", 0, 0, 3, 3);
        let lease = LeaseState { holder: xtb_protocol::Name::new("cli-7").unwrap(), age_ms: 10 };
        bench.robot.lease = Some(lease.clone());
        bench.run();
        bench.send(&order);
        assert_eq!(bench.errors(), [protocol.pick("orderError", "MOBILE_ROBOT_NOT_AVAILABLE")]);
        assert_eq!(bench.state()["operatingMode"], "MANUAL");
        bench.robot.lease = None;
        bench.turn();
        bench.send(&order);
        bench.robot.lease = Some(lease);
        bench.run();
        assert_eq!(bench.state()["operatingMode"], protocol.pick("MANUAL", "INTERVENED"));
        assert_eq!(bench.nodes(), "n1+ n2+");
    }
}

#[test]
fn a_task_says_who_shall_drive_and_what_happens_without_the_dispatcher() {
    let mut bench = Bench::new(Protocol::V2_1);
    let order = bench.order("a", 0, 0, 3, 3);
    bench.send(&order);
    let Some(Ask::Submit { spec, .. }) = bench.asked.first() else { panic!("{:?}", bench.asked) };
    let spec = serde_json::to_value(spec).unwrap();
    assert_eq!((&spec["who"], &spec["on_link_loss"]), (&json!({"robot": "xtb-1"}), &json!("finish")));
}

#[test]
fn numbers_and_texts_from_the_wire_are_repeated_short_and_without_control_characters() {
    let mut bench = Bench::new(Protocol::V2_1);
    let id = format!("\u{1b}[2J{}", "x".repeat(5000));
    let bytes = json!({"orderId": id, "orderUpdateId": 0}).to_string();
    bench.vehicle.order(bytes.as_bytes());
    bench.run();
    let error = bench.state()["errors"][0].to_string();
    assert!(error.len() < 2000 && !error.contains("\\u001b") && error.contains("u{1b}"), "{error}");
}

#[test]
fn an_order_is_read_without_what_it_does_not_need() {
    let order =
        json!({"orderId": "a", "nodes": [{"nodeId": "n", "sequenceId": 0, "released": true}], "edges": []});
    assert_eq!(incoming::order(Protocol::V2_0, order.to_string().as_bytes()).unwrap().order_update_id, 0);
}
