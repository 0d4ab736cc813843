//! The hand on the page's joystick.

#![allow(dead_code)] // tests and measurements each use a part

use crate::driver::Browser;
use fantoccini::actions::{InputSource, MouseActions, PointerAction};
use fleet_tests::{Fleet, GroundTruth, eventually};

/// Takes xtb-1 by hand and holds the stick ahead until it rolls.
pub(crate) async fn drive(fleet: &Fleet, browser: &Browser) {
    browser.click("[data-robot=xtb-1]").await;
    browser.click("#drive-begin").await;
    browser.until("the joystick", "return !document.getElementById('drive').hidden").await;
    let stick = "const box = document.getElementById('stick').getBoundingClientRect();
        return [Math.round(box.left + box.width / 2), Math.round(box.top + box.height / 2)];";
    let at = browser.ask(stick).await;
    let (x, y) = (at[0].as_f64().unwrap(), at[1].as_f64().unwrap());
    eventually("rolling", || async {
        // A page that was held up lets go by itself: then the hand has to do so too, and press again.
        if browser.ask("return document.querySelector('#stick.held') === null;").await == true {
            browser.page.release_actions().await.unwrap();
            press(browser, (x, y)).await;
        }
        let truth = fleet.truth(1);
        (truth.speed_mps > 0.05 && truth.neutral_since_s.is_none()).then_some(())
    })
    .await;
}

/// Takes the stick at its centre, and pushes it ahead.
async fn press(browser: &Browser, (x, y): (f64, f64)) {
    let button = fantoccini::actions::MOUSE_BUTTON_LEFT;
    let hold = MouseActions::new("mouse".into())
        .then(PointerAction::MoveTo { duration: None, x, y })
        .then(PointerAction::Down { button })
        .then(PointerAction::MoveBy { duration: None, x: 0.0, y: -60.0 });
    browser.page.perform_actions(hold).await.unwrap();
}

/// Since when the motor of xtb-1 is neutral, in s of the world.
pub(crate) async fn neutral_since_s(fleet: &impl GroundTruth) -> f64 {
    eventually("neutral", || async { fleet.truth(1).neutral_since_s }).await
}
