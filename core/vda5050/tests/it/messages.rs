//! What is published, when, and how it is called. The bench checks every message against its schema.

use crate::bench::{Bench, serial};
use serde_json::json;
use xtb_control::Mode;
use xtb_protocol::messages::{BatteryLevel, Fault, FaultState, Latch, LatchState, StopReason};
use xtb_vda5050::factsheet::{self, Body};
use xtb_vda5050::record::OrderRecord;
use xtb_vda5050::{Effect, Protocol, Topic, Vehicle};

const ALL: [Protocol; 3] = [Protocol::V2_0, Protocol::V2_1, Protocol::V3_0];

fn connections(bench: &Bench) -> Vec<&str> {
    let of = bench.published.iter().filter(|(topic, _)| *topic == Topic::Connection);
    of.map(|(_, message)| message["connectionState"].as_str().unwrap()).collect()
}

#[test]
fn a_robot_is_online_while_it_is_there() {
    for protocol in ALL {
        let mut bench = Bench::new(protocol);
        assert_eq!(connections(&bench), ["ONLINE"]);
        bench.vehicle.robot(None, false);
        let Some(Effect::Publish(Topic::Connection, message)) = bench.vehicle.step(bench.now_ms).pop() else {
            panic!()
        };
        let broken = protocol.pick("CONNECTIONBROKEN", "CONNECTION_BROKEN");
        assert_eq!((&message["connectionState"], &message["headerId"]), (&json!(broken), &json!(1)));
        assert_eq!(bench.vehicle.will(bench.now_ms)["connectionState"], broken);
        let offline = bench.vehicle.offline(bench.now_ms);
        crate::schema::assert_valid(protocol, "connection", &offline);
        assert_eq!(offline["connectionState"], "OFFLINE");
    }
}

#[test]
fn nothing_is_said_of_a_robot_that_was_never_heard() {
    let mut vehicle = Vehicle::new(serial(Protocol::V2_1), OrderRecord::default());
    vehicle.robot(None, true);
    assert_eq!(vehicle.step(1), []);
}

#[test]
fn a_clock_that_is_set_back_silences_nobody() {
    let mut bench = Bench::new(Protocol::V2_1);
    bench.now_ms -= 3_600_000;
    bench.published.clear();
    let order = bench.order("a", 0, 0, 3, 3);
    bench.send(&order);
    assert_eq!(bench.nodes(), "n1+ n2+");
}

#[test]
fn states_come_on_change_and_otherwise_each_second_or_half_a_minute() {
    let mut bench = Bench::new(Protocol::V3_0);
    let count = |bench: &Bench| bench.published.iter().filter(|(topic, _)| *topic == Topic::State).count();
    let start = count(&bench);
    (0..14).for_each(|_| bench.run()); // 28 s
    assert_eq!(count(&bench), start);
    bench.run();
    assert_eq!(count(&bench), start + 1);
    bench.robot.speed_mps = Some(0.3);
    (0..5).for_each(|_| bench.run()); // 10 s
    let driving = count(&bench) - start - 1;
    assert!((10..=11).contains(&driving), "one a second while it drives: {driving}");
    let before = count(&bench);
    for turn in 0..20 {
        let detail = Some(format!("{turn} bytes"));
        bench.robot.faults = vec![FaultState { fault: Fault::GyroSilent, age_ms: 9, detail }];
        bench.turn();
    }
    assert!((8..=10).contains(&(count(&bench) - before)), "at most each 100 ms: {}", count(&bench) - before);
    let ids: Vec<u64> = bench
        .published
        .iter()
        .filter(|(topic, _)| *topic == Topic::State)
        .map(|(_, message)| message["headerId"].as_u64().unwrap())
        .collect();
    assert!(ids.iter().enumerate().all(|(i, id)| *id == i as u64), "{ids:?}");
}

#[test]
fn a_broker_that_is_back_hears_everything_again() {
    let mut bench = Bench::new(Protocol::V2_1);
    bench.published.clear();
    bench.vehicle.connected();
    bench.run();
    let mut topics: Vec<Topic> = bench.published.iter().map(|(topic, _)| *topic).collect();
    topics.sort();
    assert_eq!(topics, [Topic::Connection, Topic::State, Topic::Factsheet]);
}

#[test]
fn latches_and_faults_are_errors_with_what_to_do_about_them() {
    for protocol in ALL {
        let mut bench = Bench::new(protocol);
        let latch = |latch| LatchState { latch, age_ms: 5, by: "cli-7".to_owned(), present: false };
        bench.robot.latches = vec![latch(Latch::Estop)];
        bench.robot.faults =
            vec![FaultState { fault: Fault::GyroSilent, age_ms: 9, detail: Some("no bytes".into()) }];
        bench.robot.stopped_because = vec![StopReason::PoseUncertain];
        bench.run();
        let lost = protocol.pick("localizationError", "LOCALIZATION_ERROR");
        assert_eq!(bench.errors(), ["estop", "gyro_silent", lost]);
        let errors = bench.state()["errors"].as_array().unwrap();
        assert_eq!(errors[0]["errorLevel"], "FATAL");
        assert_eq!(errors[1]["errorLevel"], protocol.pick("FATAL", "CRITICAL"));
        assert!(errors[0]["errorHint"].as_str().unwrap().contains("fleet-cli reset xtb-1"), "{errors:?}");
        let stop = protocol.pick("eStop", "activeEmergencyStop");
        assert_eq!(bench.state()["safetyState"][stop], "REMOTE");
        bench.robot.latches = vec![latch(Latch::Runaway)];
        bench.run();
        assert_eq!(bench.state()["safetyState"][stop], "MANUAL");
    }
}

#[test]
fn every_fault_and_latch_fits_the_schema() {
    for protocol in ALL {
        let mut bench = Bench::new(protocol);
        bench.robot.faults = Fault::ALL.map(|fault| FaultState { fault, age_ms: 0, detail: None }).to_vec();
        bench.robot.latches = Latch::ALL
            .map(|latch| LatchState { latch, age_ms: 0, by: String::new(), present: true })
            .to_vec();
        bench.run();
        assert_eq!(bench.errors().len(), Fault::ALL.len() + Latch::ALL.len());
    }
}

#[test]
fn position_battery_and_mode_are_called_as_the_version_has_them() {
    for protocol in ALL {
        let mut bench = Bench::new(protocol);
        (bench.robot.pose.yaw_rad, bench.robot.battery_level) = (40.0, BatteryLevel::Warn);
        bench.robot.obstacle.front = Some(true);
        bench.run();
        let (position, battery) =
            protocol.pick(("agvPosition", "batteryState"), ("mobileRobotPosition", "powerSupply"));
        let state = bench.state().clone();
        assert!(state[position]["theta"].as_f64().unwrap().abs() <= std::f64::consts::PI);
        assert_eq!(
            (&state[position]["mapId"], &state["maps"][0]["mapStatus"]),
            (&json!("world"), &json!("ENABLED"))
        );
        assert_eq!(state[battery][protocol.pick("batteryCharge", "stateOfCharge")], 40.0);
        assert_eq!(
            (&state["operatingMode"], &state["safetyState"]["fieldViolation"]),
            (&json!("AUTOMATIC"), &json!(true))
        );
        bench.robot.mode = Mode::Manual;
        bench.run();
        assert_eq!(bench.state()["operatingMode"], "MANUAL");
        (bench.robot.mode, bench.robot.pose.age_ms) = (Mode::Idle, None);
        bench.run();
        assert_eq!(bench.state()["operatingMode"], protocol.pick("SERVICE", "STARTUP"));
        assert_eq!(bench.state()[position][protocol.pick("positionInitialized", "localized")], false);
    }
}

#[test]
fn a_factsheet_says_what_can_be_done() {
    for protocol in ALL {
        let serial = serial(protocol);
        let sheet =
            factsheet::compose(&serial, "1.0", Some(Body { length_m: 0.6, width_m: 0.4, speed_mps: 1.5 }));
        let mut message = serde_json::Value::Object(serial.header(0, 0));
        message.as_object_mut().unwrap().extend(sheet.as_object().unwrap().clone());
        crate::schema::assert_valid(protocol, "factsheet", &message);
        let actions = protocol.pick("agvActions", "mobileRobotActions");
        let actions = message["protocolFeatures"][actions].as_array().unwrap().len();
        assert_eq!(actions, protocol.pick(6, 7));
    }
}

#[test]
fn a_record_of_a_later_program_is_not_read() {
    let text = OrderRecord::default().to_json();
    assert_eq!(OrderRecord::from_json(&text).unwrap(), OrderRecord::default());
    assert!(
        OrderRecord::from_json(&text.replacen("\"v\":1", "\"v\":2", 1)).unwrap_err().contains("version 2")
    );
    assert!(OrderRecord::from_json("{").is_err());
}
