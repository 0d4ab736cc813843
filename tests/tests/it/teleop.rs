//! Teleoperation: a setpoint lives 200 ms, on the robot's own clock.

use crate::membership::{lone_agent, router};
use fleet_tests::{Fleet, Pilot, Setup, eventually};
use std::sync::atomic::{AtomicU32, Ordering};
use xtb_bus::SessionRole;
use xtb_control::{Mode, PwmCount};
use xtb_protocol::messages::StopReason;

/// Sends setpoints until the truck rolls at more than `mps`.
async fn drive_until_rolling(fleet: &Fleet, rpm: f64, mps: f64) {
    eventually("rolling", || async {
        fleet.setpoint(1, rpm, 0.0).await;
        (fleet.truth(1).speed_mps.abs() > mps).then_some(())
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn silence_is_neutral_on_the_robots_own_clock() {
    let fleet = Fleet::start(Setup { speed: 1.0, ..Setup::default() }).await;
    drive_until_rolling(&fleet, 20.0, 0.1).await;
    let neutral_s = eventually("neutral", || async { fleet.truth(1).neutral_since_s }).await;
    let state = fleet.until(1, "standing", |state| state.mode == Mode::Idle).await;
    // The robot's clock is the world's: when the last setpoint arrived, by its own count.
    let age_ms = state.input_age_ms.setpoint.unwrap();
    let arrived_s = (state.tick_ms - age_ms) as f64 / 1000.0;
    // 200 ms of life, a turn, the board's pulse.
    let took_s = neutral_s - arrived_s;
    assert!((0.15..=0.25).contains(&took_s), "neutral {took_s} s after the last setpoint");
    assert_eq!(state.stopped_because, vec![StopReason::SetpointExpired]);
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn teleoperation_goes_both_ways_and_steers() {
    let fleet = Fleet::start(Setup { speed: 1.0, ..Setup::default() }).await;
    drive_until_rolling(&fleet, 20.0, 0.1).await;
    assert!(fleet.truth(1).speed_mps > 0.0);
    drive_until_rolling(&fleet, -20.0, 0.1).await;
    eventually("astern", || async {
        fleet.setpoint(1, -20.0, 1.0).await;
        (fleet.truth(1).speed_mps < -0.05).then_some(())
    })
    .await;
    let before = fleet.truth(1).yaw_rad;
    eventually("turning", || async {
        fleet.setpoint(1, -20.0, 1.0).await;
        // Astern with the wheels to the right, the nose goes left: yaw grows counter-clockwise.
        (fleet.truth(1).yaw_rad - before > 0.05).then_some(())
    })
    .await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_session_ends_teleoperation() {
    let router = router("tcp/127.0.0.1:0").await;
    let endpoint = router.locators().await.remove(0);
    let agent = lone_agent(&endpoint, "lost");
    let bus = xtb_bus::open(&SessionRole::Client { connect: vec![endpoint] }).await.unwrap();
    let (pilot, puts) = (Pilot::new(&bus, "lost", "xtb-1", "driver").await, AtomicU32::new(0));
    let motor = || agent.motor.load(Ordering::Relaxed);
    let neutral = PwmCount::NEUTRAL.get();
    eventually("driving", || async {
        // A joystick that was held before the robot was ready has to be let go once.
        let rpm = if puts.fetch_add(1, Ordering::Relaxed).is_multiple_of(25) { 0.0 } else { 20.0 };
        pilot.setpoint(rpm, 0.0).await;
        (motor() > neutral).then_some(())
    })
    .await;
    router.close().await;
    eventually("neutral", || async { (motor() == neutral).then_some(()) }).await;
}
