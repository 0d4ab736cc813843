//! Alerts and events on the page: called, acknowledged by name, searched, unfolded.

use crate::signing_in::screen;
use crate::{beside_another, driver, fleet_on_page};
use fleet_tests::dispatch::Serve;
use fleet_tests::processes::program;
use std::process::Command;

#[tokio::test(flavor = "multi_thread")]
async fn an_alert_is_seen_in_the_title_acknowledged_with_a_click_and_found_in_the_history() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, _dashboard, browser) = fleet_on_page(2, 2.0).await;
    let ledger = tempfile::tempdir().unwrap();
    let _serve = Serve::start(fleet.simulator.endpoint(), &ledger.path().join("lab.ledger"));
    browser.until("the dispatcher", "return store.frame.dispatcher && store.alerts !== null").await;
    assert_eq!(browser.ask("return document.title").await, "XTB lab");
    let mut estop = Command::new(program("fleet-cli"));
    estop.args(["--connect", fleet.simulator.endpoint(), "--client", "bob", "estop", "xtb-2"]);
    assert!(estop.status().unwrap().success());
    browser.until("the title counts", "return document.title === '(1) XTB lab'").await;
    browser.click("#alert-badge").await;
    let told = "return document.querySelector('[data-alert=\"1\"]')?.textContent
        .includes('xtb-2 latched: emergency stop, by bob')";
    browser.until("the alert", told).await;
    screen(&browser, "alerts").await;
    browser.click("[aria-label='Acknowledge alert 1']").await;
    browser.until("by whom", "return store.alerts.alerts[0].acknowledged?.by.startsWith('web-')").await;
    browser.until("the title", "return document.title === 'XTB lab'").await;

    fleet.reaches(1, 0.0, 1.0).await;
    browser.click("[data-for=events]").await;
    let line = "[...document.querySelectorAll('#events .fold')]
        .find((line) => line.textContent.includes('xtb-1: drive reached'))";
    browser.until("the drive is one line", &format!("return Boolean({line})")).await;
    browser.ask(&format!("{line}.click()")).await;
    let details = format!(
        "return [...({line}?.parentElement.querySelectorAll('li') ?? [])]
            .some((event) => event.textContent.includes('goal running'))"
    );
    browser.until("its events", &details).await;
    let search = "const field = document.getElementById('event-search');
        field.value = 'LATCHED estop';
        field.dispatchEvent(new Event('input', {bubbles: true}));
        field.form.requestSubmit();";
    browser.ask(search).await;
    let found = "return [...document.querySelectorAll('#history li')]
        .some((event) => event.textContent.includes('xtb-2 LATCHED estop by bob'))";
    browser.until("the history", found).await;
    screen(&browser, "events").await;
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}
