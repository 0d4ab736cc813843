//! Routers that form a mesh, and clients that have several of them to go to.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Notify;
use xtb_bus::{Bus, Question, Service, SessionRole};
use xtb_protocol::Name;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{Roster, RosterEntry};

const PATIENCE: Duration = Duration::from_secs(20);
const WITHIN: Duration = Duration::from_secs(2);
const LOOK_EVERY: Duration = Duration::from_millis(10);
const ANYWHERE: &str = "tcp/127.0.0.1:0";
/// Of a cable: whether the link is there again before the router has computed its routes differs from time to time.
const CUTS: usize = 5;

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

/// A dispatcher whose stand-by has taken over, or a robot that has gone to another router: both routers know of a queryable
/// under one key for a while.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_queryable_that_another_router_had_too_is_known_to_a_router_that_links_later() {
    let first = router(ANYWHERE, &[]).await;
    let second = router(ANYWHERE, &first.locators().await).await;
    let key = FleetKeys::new(Name::new("lab").unwrap()).robot(&Name::new("xtb-1").unwrap()).about();
    let asks = async |router: &Bus| {
        let asker = client(&router.locators().await).await;
        let answers = asker.get(&key, WITHIN).await.unwrap();
        let who = answers.into_iter().filter_map(|answer| answer.decode::<Roster>().ok()?.robots.pop());
        who.map(|entry| entry.name.to_string()).collect::<Vec<_>>()
    };
    let elsewhere = client(&first.locators().await).await;
    let left = serve(&elsewhere, &key, "xtb-1").await;
    eventually("the first answer", async || asks(&second).await == ["xtb-1"]).await;
    let here = client(&second.locators().await).await;
    let _stays = serve(&here, &key, "xtb-2").await;
    eventually("the second answer", async || asks(&second).await.contains(&"xtb-2".to_owned())).await;
    drop(left);
    eventually("it alone", async || asks(&first).await == ["xtb-2"]).await;
    let third = router(ANYWHERE, &second.locators().await).await;
    eventually("its answer through a new link", async || asks(&third).await == ["xtb-2"]).await;
}

/// A router computes its routes at most every 100 ms. A link that was lost and opened again meanwhile, because another
/// one was lost just before, is a new link all the same: nothing was told over it.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_link_that_is_back_before_the_routes_are_computed_is_told_everything() {
    let first = router(ANYWHERE, &[]).await;
    let [cable, other] = [Cable::to(&first).await, Cable::to(&first).await];
    let second = router(ANYWHERE, std::slice::from_ref(&cable.endpoint)).await;
    let _third = router(ANYWHERE, std::slice::from_ref(&other.endpoint)).await;
    let robot = client(&first.locators().await).await;
    let _token = robot.declare_alive(&presence()).await.unwrap();
    let asker = client(&second.locators().await).await;
    let is_linked = async || first.linked_routers().await == 2 && second.linked_routers().await == 1;
    let is_seen = async || asker.alive(&presence(), WITHIN).await.unwrap() == [presence()];
    for _ in 0..CUTS {
        eventually("the links", is_linked).await;
        eventually("its presence", is_seen).await;
        other.pull_out_and_in().await;
        cable.pull_out_and_in().await;
    }
    eventually("the links", is_linked).await;
    eventually("its presence", is_seen).await;
}

/// A way to a router. When it is pulled out, both ends of the connection know at once.
struct Cable {
    endpoint: String,
    opened: Arc<AtomicUsize>,
    pulled_out: Arc<Notify>,
}

impl Cable {
    async fn to(router: &Bus) -> Self {
        let locator = router.locators().await.remove(0);
        let address = locator.trim_start_matches("tcp/").to_owned();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        let cable = Self { endpoint, opened: Arc::default(), pulled_out: Arc::default() };
        let (opened, pulled_out) = (cable.opened.clone(), cable.pulled_out.clone());
        tokio::spawn(async move {
            while let Ok((mut near, _)) = listener.accept().await {
                let mut far = TcpStream::connect(&address).await.unwrap();
                opened.fetch_add(1, Ordering::Relaxed);
                let pulled_out = pulled_out.clone();
                tokio::spawn(async move {
                    tokio::select! {
                        _ = tokio::io::copy_bidirectional(&mut near, &mut far) => {}
                        () = pulled_out.notified() => {}
                    }
                });
            }
        });
        cable
    }

    /// Waits until the next connection is there.
    async fn pull_out_and_in(&self) {
        let before = self.opened.load(Ordering::Relaxed);
        self.pulled_out.notify_waiters();
        eventually("another connection", async || self.opened.load(Ordering::Relaxed) > before).await;
    }
}

/// Answers with a roster of this robot.
async fn serve(bus: &Bus, key: &str, robot: &str) -> Service {
    let (runtime, own) = (tokio::runtime::Handle::current(), key.to_owned());
    let entry = RosterEntry { name: Name::new(robot).unwrap(), tags: Vec::new(), start_pose: None };
    let each = move |question: Question| {
        let (own, roster) = (own.clone(), Roster { robots: vec![entry.clone()] });
        runtime.spawn(async move { question.reply(&own, &roster, Format::Json).await.unwrap() });
    };
    bus.serve(key, each).await.unwrap()
}
