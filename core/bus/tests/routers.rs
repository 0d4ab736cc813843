//! Routers that form a mesh, and clients that have several of them to go to.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use std::time::{Duration, Instant};
use xtb_bus::{Bus, SessionRole};
use xtb_protocol::Name;
use xtb_protocol::keys::FleetKeys;

const PATIENCE: Duration = Duration::from_secs(20);
const WITHIN: Duration = Duration::from_secs(2);
const LOOK_EVERY: Duration = Duration::from_millis(10);
const ANYWHERE: &str = "tcp/127.0.0.1:0";

async fn router(listen: &str, connect: &[String]) -> Bus {
    let role = SessionRole::Router { listen: vec![listen.to_owned()], connect: connect.to_vec() };
    xtb_bus::open(&role).await.unwrap()
}

async fn client(connect: &[String]) -> Bus {
    xtb_bus::open(&SessionRole::Client { connect: connect.to_vec() }).await.unwrap()
}

/// The key of a robot's presence.
fn presence() -> String {
    let fleet = FleetKeys::new(Name::new("lab").unwrap());
    fleet.robot(&Name::new("xtb-1").unwrap()).alive()
}

async fn eventually(what: &str, mut is: impl AsyncFnMut() -> bool) {
    let give_up = Instant::now() + PATIENCE;
    while !is().await {
        assert!(Instant::now() < give_up, "waited {PATIENCE:?} in vain for: {what}");
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_router_links_to_one_that_starts_after_it() {
    // A port that is free now; nobody else is told of it.
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let late = format!("tcp/127.0.0.1:{port}");
    let first = router(ANYWHERE, std::slice::from_ref(&late)).await;
    assert_eq!(first.linked_routers().await, 0);
    let second = router(&late, &[]).await;
    eventually("the link", async || first.linked_routers().await == 1).await;
    assert_eq!(second.linked_routers().await, 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_is_seen_through_routers_that_are_not_its_own() {
    let first = router(ANYWHERE, &[]).await;
    let between = router(ANYWHERE, &first.locators().await).await;
    let last = router(ANYWHERE, &between.locators().await).await;
    let robot = client(&first.locators().await).await;
    let _token = robot.declare_alive(&presence()).await.unwrap();
    let asker = client(&last.locators().await).await;
    eventually("its presence", async || asker.alive(&presence(), WITHIN).await.unwrap() == [presence()])
        .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_whose_router_ends_goes_on_at_the_next_of_its_list() {
    let first = router(ANYWHERE, &[]).await;
    let second = router(ANYWHERE, &first.locators().await).await;
    let both = [first.locators().await, second.locators().await].concat();
    let robot = client(&both).await;
    let _token = robot.declare_alive(&presence()).await.unwrap();
    let asker = client(&second.locators().await).await;
    first.close().await;
    eventually("the end of the link", async || second.linked_routers().await == 0).await;
    eventually("its presence at the second router", async || {
        asker.alive(&presence(), WITHIN).await.unwrap() == [presence()]
    })
    .await;
}
