//! Tasks of the dispatcher, submitted and cancelled on the page.

use crate::driver;
use crate::{beside_another, fleet_on_page};
use fleet_tests::dispatch::Serve;

#[tokio::test(flavor = "multi_thread")]
async fn a_task_is_made_of_points_on_the_map_put_aside_cancelled_and_begun_again() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, _dashboard, browser) = fleet_on_page(1, 1.0).await;
    let ledger = tempfile::tempdir().unwrap();
    let _serve = Serve::start(fleet.simulator.endpoint(), &ledger.path().join("lab.ledger"));
    browser.until("the dispatcher", "return store.frame.dispatcher").await;
    browser.click("[data-for=tasks]").await;
    let patrol = "const kind = document.querySelector('.form select');
        kind.value = 'patrol';
        return kind.dispatchEvent(new Event('change', {bubbles: true}));";
    browser.until("patrol is chosen", patrol).await;
    browser.click("#task-points").await;
    for (number, y_m) in [2.0, 4.0].into_iter().enumerate() {
        browser.click_at(browser.on_screen(0.0, y_m).await).await;
        browser.until("the point", &format!("return aim.points.length === {}", number + 1)).await;
    }
    browser.fill(".form input[placeholder=none]", "90").await;
    browser.click("#task-submit").await;
    let running = "const task = store.tasks?.tasks[0];
        return task?.state === 'running' && task.spec.kind.patrol.points.length === 2
            && Math.abs(task.spec.deadline_ms - Date.now() - 90 * 60000) < 60000
            && document.querySelector('.task-list .more')?.textContent.includes('due ') === true;";
    browser.until("the task runs", running).await;
    fleet.until(1, "a goal of the task's", |state| state.goal.is_some()).await;
    let state = |wanted: &str| format!("return store.tasks.tasks[0].state === '{wanted}'");
    browser.click("[aria-label='Pause t1']").await;
    browser.until("the task is put aside", &state("paused")).await;
    fleet.until(1, "standing", |state| state.goal.as_ref().is_some_and(|goal| goal.status.is_final())).await;
    browser.click("[aria-label='Resume t1']").await;
    browser.until("the task goes on", &state("running")).await;
    browser.click("[aria-label='Cancel t1']").await;
    browser.until("the task is cancelled", "return store.tasks.tasks[0].state === 'cancelled'").await;
    fleet.until(1, "standing", |state| state.goal.as_ref().is_some_and(|goal| goal.status.is_final())).await;
    browser.click("[aria-label='Retry t1']").await;
    browser.until("the task runs again", &state("running")).await;
    assert_eq!(browser.complaints().await, Vec::<String>::new());
    browser.end().await;
    fleet.end().await;
}
