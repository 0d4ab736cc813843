//! Telling a robot on the page where it stands.

use crate::driver;
use crate::{MACHINE, fleet_on_page};

#[tokio::test(flavor = "multi_thread")]
async fn a_pose_is_pressed_turned_and_set_after_the_page_has_said_what_that_does() {
    if !driver::is_there() {
        return;
    }
    let _alone = MACHINE.lock().await;
    let (fleet, _dashboard, browser) = fleet_on_page(1, 1.0).await;
    browser.click("#set-pose").await;
    let from = browser.on_screen(2.0, 1.0).await;
    browser.drag(from, (from.0 - 80.0, from.1)).await;
    let said = "return document.querySelector('.pose-note')?.textContent.includes('forgets where it believed to be')";
    browser.until("what it does", said).await;
    let at = fleet.truth(1);
    assert_eq!(fleet.state(1).await.pose.x_m, 0.0, "nothing is set yet");
    browser.click("#pose-send").await;
    let set = fleet.until(1, "the pose", |state| (state.pose.x_m - 2.0).abs() < 0.05).await.pose;
    assert!(
        (set.y_m - 1.0).abs() < 0.05 && (set.yaw_rad.abs() - std::f64::consts::PI).abs() < 0.05,
        "{set:?}"
    );
    assert_eq!((fleet.truth(1).x_m, fleet.truth(1).y_m), (at.x_m, at.y_m), "it does not move");

    // One that is under way refuses, and the page says so before.
    fleet.goto(1, -1.0, 1.0).await;
    fleet
        .until(1, "under way", |state| state.goal.as_ref().is_some_and(|goal| !goal.status.is_final()))
        .await;
    browser.click("#set-pose").await;
    browser.click_at(browser.on_screen(0.0, 0.0).await).await;
    let warned = "return document.querySelector('.pose-note [role=alert]')?.textContent.includes('refuses until it stands')";
    browser.until("the warning", warned).await;
    browser.click("#pose-send").await;
    let refused = "return document.getElementById('robot').textContent.includes('cannot be set while the robot is driving')
        || document.getElementById('robot').textContent.includes('has control')
        || document.getElementById('take') !== null";
    browser.until("the refusal", refused).await;
    assert!(fleet.state(1).await.pose.x_m > -1.5);
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}
