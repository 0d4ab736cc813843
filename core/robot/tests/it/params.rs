//! Settings that change while the robot runs: who may change what, when, and who did.

use crate::bench::*;
use xtb_protocol::messages::{
    Body, Lease, ParamBody, ParamCode, ParamInfo, ParamList, ParamOutcome, ParamReply, ParamRequest,
    ParamValue,
};
use xtb_protocol::{Name, Uuid};

const LIMIT: &str = "navigation.drive.limit_mps";
const CRUISE: &str = "navigation.drive.cruise_mps";
const MEETING: &str = "navigation.drive.meeting_mps";
const OBSTACLE: &str = "navigation.drive.obstacle_cm";
const LOOK_AHEAD: &str = "navigation.drive.look_ahead_m";

fn ask(bench: &mut Bench, client: &str, lease: Option<Lease>, body: ParamBody) -> ParamReply {
    let request = ParamRequest { id: Uuid::from_u128(7), lease, body };
    let reply = bench.robot.param(bench.now, &Name::new(client).unwrap(), &request);
    assert_eq!(reply.id, request.id);
    reply
}

fn set(bench: &mut Bench, lease: Option<Lease>, values: &[(&str, f64)]) -> Result<ParamList, ParamCode> {
    let values = values.iter().map(|(name, value)| ParamValue { name: (*name).to_owned(), value: *value });
    match ask(bench, CLIENT, lease, ParamBody::Set { values: values.collect() }).result {
        ParamOutcome::Ok(list) => Ok(list),
        ParamOutcome::Error(error) => {
            assert!(!error.message.is_empty() && !error.hint.is_empty(), "{error:?}");
            Err(error.code)
        }
    }
}

fn list(bench: &mut Bench) -> ParamList {
    match ask(bench, "cli-9", None, ParamBody::List {}).result {
        ParamOutcome::Ok(list) => list,
        ParamOutcome::Error(error) => panic!("{error:?}"),
    }
}

fn param(bench: &mut Bench, name: &str) -> ParamInfo {
    list(bench).params.into_iter().find(|param| param.name == name).unwrap()
}

#[test]
fn every_setting_of_the_list_has_unit_range_and_words_and_is_within_its_range() {
    let mut bench = Bench::new();
    let params = list(&mut bench).params;
    assert!(params.len() >= 8);
    for param in params {
        assert!(!param.unit.is_empty() && !param.about.is_empty(), "{param:?}");
        assert!((param.min..=param.max).contains(&param.value), "{param:?}");
        assert_eq!(param.value, param.saved);
    }
}

#[test]
fn a_lower_speed_needs_no_control_and_a_higher_one_does() {
    let mut bench = Bench::new();
    assert!(set(&mut bench, None, &[(LIMIT, 0.15)]).is_ok());
    assert_eq!(param(&mut bench, LIMIT).value, 0.15);
    assert_eq!(set(&mut bench, None, &[(LIMIT, 0.3)]), Err(ParamCode::LeaseRequired));
    assert_eq!(set(&mut bench, None, &[(LIMIT, 0.1), (LOOK_AHEAD, 0.3)]), Err(ParamCode::LeaseRequired));
    assert_eq!(param(&mut bench, LIMIT).value, 0.15, "all or none");
    let lease = bench.lease_of(CLIENT);
    let other = Lease { root: lease.root + 1, ..lease };
    assert_eq!(set(&mut bench, Some(other), &[(LIMIT, 0.3)]), Err(ParamCode::LeaseLost));
    assert!(set(&mut bench, Some(lease), &[(LIMIT, 0.3)]).is_ok());
    bench.retains = false;
    bench.run_ms(2_000);
    assert_eq!(set(&mut bench, Some(lease), &[(LIMIT, 0.4)]), Err(ParamCode::LeaseLost), "it has run out");
}

#[test]
fn what_is_unknown_out_of_range_or_unsafe_is_refused_by_name_and_nothing_changes() {
    let mut bench = Bench::new();
    let before = list(&mut bench);
    let lease = Some(bench.lease_of(CLIENT));
    for (values, code) in [
        (&[("vehicle.geometry.body_length_m", 0.5)][..], ParamCode::UnknownParam),
        (&[("limit_mps", 0.2)], ParamCode::UnknownParam),
        (&[(LIMIT, 0.05)], ParamCode::OutOfRange),
        (&[(LIMIT, f64::NAN)], ParamCode::OutOfRange),
        (&[(CRUISE, 0.15)], ParamCode::Conflict),
        // The obstacle rule cannot stop from there.
        (&[(CRUISE, 0.6)], ParamCode::Conflict),
        // The vehicle's own rule is the least.
        (&[(OBSTACLE, 24.0)], ParamCode::Conflict),
        (&[(LOOK_AHEAD, 0.3), (MEETING, 0.4)], ParamCode::Conflict),
    ] {
        assert_eq!(set(&mut bench, lease, values), Err(code), "{values:?}");
    }
    assert_eq!(list(&mut bench).params, before.params);
    assert!(set(&mut bench, lease, &[(CRUISE, 0.15), (MEETING, 0.12)]).is_ok(), "both together fit");
}

#[test]
fn how_a_path_is_followed_changes_only_while_nothing_is_under_way() {
    let mut bench = Bench::new();
    let lease = Some(bench.lease_of(CLIENT));
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    assert_eq!(set(&mut bench, lease, &[(LOOK_AHEAD, 0.3)]), Err(ParamCode::Driving));
    assert!(set(&mut bench, lease, &[(LOOK_AHEAD, param(&mut Bench::new(), LOOK_AHEAD).value)]).is_ok());
    assert!(set(&mut bench, lease, &[(LIMIT, 0.2)]).is_ok(), "a speed limit counts at once");
    bench.ask(Body::Stop {});
    bench.run_ms(500);
    assert!(set(&mut bench, lease, &[(LOOK_AHEAD, 0.3)]).is_ok());
}

#[test]
fn the_last_changes_say_who_what_and_when() {
    let mut bench = Bench::new();
    set(&mut bench, None, &[(LIMIT, 0.5)]).unwrap();
    set(&mut bench, None, &[(LIMIT, 0.5)]).unwrap();
    bench.run_ms(3_000);
    let lower = ParamBody::Set { values: vec![ParamValue { name: LIMIT.to_owned(), value: 0.25 }] };
    ask(&mut bench, "cli-2", None, lower);
    let changes = list(&mut bench).changes;
    let told = changes.iter().map(|it| (it.by.as_str(), it.name.as_str(), it.from, it.to, it.age_ms));
    let told: Vec<_> = told.collect();
    assert_eq!(told, [(CLIENT, LIMIT, 1.0, 0.5, 3_000), ("cli-2", LIMIT, 0.5, 0.25, 0)]);
    let mut recorded = Vec::new();
    while let Some(change) = bench.robot.agent_mut().next_param_change() {
        recorded.push((change.by.to_string(), change.to));
    }
    assert_eq!(recorded, [(CLIENT.to_owned(), 0.5), ("cli-2".to_owned(), 0.25)]);
    for n in 0..200 {
        let value = 0.249 - f64::from(n) * 0.000_1;
        set(&mut bench, None, &[(LIMIT, value)]).unwrap();
    }
    assert_eq!(list(&mut bench).changes.len(), 64, "the oldest are forgotten");
}

#[test]
fn what_differs_from_the_file_is_saved_and_nothing_else() {
    let mut bench = Bench::new();
    assert_eq!(bench.robot.agent().params_to_save(), []);
    set(&mut bench, None, &[(LIMIT, 0.25), (CRUISE, 0.3)]).unwrap();
    let refused = ask(&mut bench, CLIENT, None, ParamBody::Save {}).result;
    assert!(matches!(refused, ParamOutcome::Error(error) if error.code == ParamCode::LeaseRequired));
    let lease = Some(bench.lease_of(CLIENT));
    assert!(matches!(ask(&mut bench, CLIENT, lease, ParamBody::Save {}).result, ParamOutcome::Ok(_)));
    let values = bench.robot.agent().params_to_save();
    let named: Vec<_> = values.iter().map(|value| (value.name.as_str(), value.value)).collect();
    assert_eq!(named, [(LIMIT, 0.25), (CRUISE, 0.3)]);
    bench.robot.agent_mut().params_saved(&values);
    assert_eq!(bench.robot.agent().params_to_save(), []);
    assert_eq!(param(&mut bench, LIMIT).saved, 0.25);
}

#[test]
fn a_speed_limit_holds_for_a_hand_on_the_joystick_too() {
    let mut bench = Bench::new();
    let rpm = |bench: &mut Bench| {
        for _ in 0..20 {
            bench.setpoint(1000.0);
            bench.run_ms(20);
        }
        bench.state().reference_rpm
    };
    // The first ones of a client that comes anew rearm it.
    bench.setpoint(0.0);
    bench.run_ms(50);
    let before = rpm(&mut bench);
    set(&mut bench, None, &[(LIMIT, 0.1)]).unwrap();
    let limited = rpm(&mut bench);
    let mps = limited * bench.robot.vehicle().mps_per_rpm();
    assert!(before > limited && (mps - 0.1).abs() < 1e-3, "{before} {limited} rpm, {mps} m/s");
}
