//! Traffic control as its users run it: processes of their own, real time, real Zenoh. Many robots and all
//! troubles are the bench `traffic`'s.

use fleet_tests::Live;
use fleet_tests::live::Trouble;
use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;
use xtb_chaos::meetings::{Meeting, ObservedRobot, Setting};
use xtb_control::frames::MapPose;
use xtb_protocol::messages::RouteSource;

#[tokio::test(flavor = "multi_thread")]
async fn two_swap_places_through_a_door_under_traffic_control() {
    let south = |x_m, yaw_rad| MapPose { x_m, y_m: 2.9, yaw_rad };
    let north = |x_m, yaw_rad| MapPose { x_m, y_m: 5.1, yaw_rad };
    let setting = Setting {
        starts: vec![south(-0.5, FRAC_PI_2), north(0.5, -FRAC_PI_2)],
        goals: vec![north(-0.5, FRAC_PI_2), south(0.5, -FRAC_PI_2)],
        ..Setting::door(1)
    };
    let folder = tempfile::tempdir().unwrap();
    let mut live = Live::start(&setting, 1, false, folder.path()).await;
    let mut led = BTreeSet::new();
    let mut each = |_: &Meeting, sights: &[ObservedRobot]| {
        let by_traffic = |sight: &&ObservedRobot| {
            sight.state.nav.route.as_ref().is_some_and(|route| route.source == RouteSource::Traffic)
        };
        led.extend(sights.iter().filter(by_traffic).map(|sight| sight.state.robot.to_string()));
    };
    let told = live.meet(&setting.goals, Trouble::None, &mut each).await;
    assert_eq!((told.meeting.reached, told.meeting.contacts), (2, 0), "{:?}", told.meeting.touched);
    assert_eq!(led.len(), 2, "{led:?} only");
}

#[tokio::test(flavor = "multi_thread")]
async fn vehicles_of_three_kinds_are_led_as_what_they_say_they_are() {
    let drives = fleet_tests::vehicles::three_kinds(6, 11, 8.0).await;
    assert_eq!((drives.reached, drives.contacts), (6, 0), "{:?}", drives.failed);
}
