//! What a simulator says, version 1, as JSON: nobody sends it in another way. This file is never edited
//! to pass: what changes needs a new version of its type, and a file of its own.

use super::name;
use std::collections::BTreeMap;
use xtb_control::frames::MapPose;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{Message, Roster, RosterEntry, SimStats, Truth, TruthRobot};

fn pinned<M: Message + PartialEq + std::fmt::Debug>(message: &M, json: &str) {
    let text = encode(message, Format::Json).unwrap();
    assert_eq!(std::str::from_utf8(&text).unwrap(), json);
    assert_eq!(&decode::<M>(&encoding::<M>(Format::Json), &text).unwrap().0, message);
}

#[test]
fn stats_truth_and_roster() {
    assert_eq!((SimStats::VERSION, Truth::VERSION, Roster::VERSION), (1, 1, 1));
    pinned(
        &SimStats { t_s: 68.5, speed: 4.0, real_time_factor: Some(0.75), first: None },
        r#"{"t_s":68.5,"speed":4.0,"real_time_factor":0.75}"#,
    );
    pinned(
        &SimStats { t_s: 0.0, speed: 1.0, real_time_factor: None, first: None },
        r#"{"t_s":0.0,"speed":1.0,"real_time_factor":null}"#,
    );
    pinned(
        &SimStats { t_s: 1.0, speed: 1.0, real_time_factor: None, first: Some(501) },
        r#"{"t_s":1.0,"speed":1.0,"real_time_factor":null,"first":501}"#,
    );
    let robot = TruthRobot {
        x_m: 0.25,
        y_m: -1.5,
        yaw_rad: 1.5,
        speed_mps: 0.125,
        motor_counts: 3750,
        neutral_since_s: Some(67.5),
        contacts: 0,
    };
    pinned(
        &Truth { t_s: 68.5, real_s: None, robots: BTreeMap::from([(name("xtb-1"), robot)]) },
        r#"{"t_s":68.5,"robots":{"xtb-1":{"x_m":0.25,"y_m":-1.5,"yaw_rad":1.5,"speed_mps":0.125,"motor_counts":3750,"neutral_since_s":67.5,"contacts":0}}}"#,
    );
    pinned(
        &Truth { t_s: 68.5, real_s: Some(70.25), robots: BTreeMap::new() },
        r#"{"t_s":68.5,"real_s":70.25,"robots":{}}"#,
    );
    let start_pose = Some(MapPose { x_m: 1.0, y_m: 2.0, yaw_rad: 0.5 });
    let entry = RosterEntry { name: name("xtb-1"), tags: vec!["arm".into()], start_pose };
    pinned(
        &Roster { robots: vec![entry] },
        r#"{"robots":[{"name":"xtb-1","tags":["arm"],"start_pose":{"x_m":1.0,"y_m":2.0,"yaw_rad":0.5}}]}"#,
    );
}

#[test]
fn a_factor_that_is_none_is_refused() {
    for json in [
        r#"{"t_s":1.0,"speed":1.0,"real_time_factor":-0.5}"#,
        r#"{"t_s":1.0,"speed":0.0,"real_time_factor":0.5}"#,
        r#"{"t_s":-1.0,"speed":1.0,"real_time_factor":0.5}"#,
        r#"{"t_s":1.0,"speed":1.0,"real_time_factor":0.5,"robots":3}"#,
    ] {
        assert!(decode::<SimStats>("application/json", json.as_bytes()).is_err(), "{json}");
    }
}
