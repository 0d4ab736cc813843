//! What becomes of a session's queryables when it takes back a subscription.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use std::time::{Duration, Instant};
use xtb_bus::{Bus, Service, SessionRole, Subscription};
use xtb_protocol::Name;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{FleetKeys, FloorCell};
use xtb_protocol::messages::Roster;

const PATIENCE: Duration = Duration::from_secs(20);
const WITHIN: Duration = Duration::from_secs(2);

async fn router() -> Bus {
    let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    xtb_bus::open(&role).await.unwrap()
}

async fn client(router: &Bus) -> Bus {
    xtb_bus::open(&SessionRole::Client { connect: router.locators().await }).await.unwrap()
}

async fn serve(bus: &Bus, key: String) -> Service {
    let runtime = tokio::runtime::Handle::current();
    let own = key.clone();
    let each = move |question: xtb_bus::Question| {
        let own = own.clone();
        runtime.spawn(async move {
            question.reply(&own, &Roster { robots: Vec::new() }, Format::Json).await.unwrap();
        });
    };
    bus.serve(&key, each).await.unwrap()
}

async fn answers(bus: &Bus, key_expr: &str) -> Vec<String> {
    let mut keys: Vec<String> =
        bus.get(key_expr, WITHIN).await.unwrap().into_iter().map(|answer| answer.key).collect();
    keys.sort();
    keys
}

async fn until(bus: &Bus, key_expr: &str, expected: &[String]) -> Vec<String> {
    let give_up = Instant::now() + PATIENCE;
    loop {
        let found = answers(bus, key_expr).await;
        if found == expected || Instant::now() > give_up {
            return found;
        }
    }
}

async fn listen(bus: &Bus, key_expr: &str) -> Subscription {
    bus.subscribe(key_expr, |_| {}).await.unwrap()
}

/// What a robot declares beside its state.
async fn robot(
    bus: &Bus,
    fleet: &FleetKeys,
    name: &str,
) -> (Vec<Service>, Vec<Subscription>, xtb_bus::PresenceToken) {
    let keys = fleet.robot(&Name::new(name).unwrap());
    let mut services = vec![serve(bus, keys.state()).await, serve(bus, keys.about()).await];
    let mut subscriptions = vec![
        listen(bus, &keys.fix()).await,
        listen(bus, &keys.route()).await,
        listen(bus, &fleet.map()).await,
        listen(bus, &keys.estop(None)).await,
        listen(bus, &fleet.estop_all(None)).await,
    ];
    services.push(serve(bus, keys.estop(None)).await);
    services.push(serve(bus, keys.cmd(None)).await);
    subscriptions.push(listen(bus, &keys.teleop(None)).await);
    services.push(serve(bus, keys.log(None)).await);
    let token = bus.declare_alive(&keys.alive()).await.unwrap();
    let publisher = bus
        .publisher::<Roster>(&keys.state(), &xtb_protocol::keys::Channel::State, Format::Json)
        .await
        .unwrap();
    tokio::spawn(async move {
        let mut tick = tokio::time::interval(Duration::from_millis(50));
        loop {
            tick.tick().await;
            if publisher.put(&Roster { robots: Vec::new() }).await.is_err() {
                return;
            }
        }
    });
    (services, subscriptions, token)
}

/// With `any_robot().state()` in place of a cell the third robot is not reached any more once it alone has ended
/// to listen: Zenoh 1.10 no longer routes questions on the very expression of a subscription that was taken back.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_is_asked_with_all_others_after_it_has_listened_to_them() {
    let fleet = FleetKeys::new(Name::new("lab").unwrap());
    let router = router().await;
    let names = ["xtb-1", "xtb-2", "xtb-3"];
    let mut sessions = Vec::new();
    let mut held = Vec::new();
    for name in names {
        let session = client(&router).await;
        held.push(robot(&session, &fleet, name).await);
        sessions.push(session);
    }
    let keys = names.map(|name| fleet.robot(&Name::new(name).unwrap()).state()).to_vec();
    let any = fleet.any_robot().state();
    let asker = client(&router).await;
    assert_eq!(until(&asker, &any, &keys).await, keys, "at first");
    asker.close().await;
    let mut listening = Vec::new();
    for session in &sessions {
        listening.push(listen(session, &fleet.any_robot().near(FloorCell::at(0.0, 0.0))).await);
    }
    let asker = client(&router).await;
    assert_eq!(until(&asker, &any, &keys).await, keys, "while all listen");
    asker.close().await;
    for left in (0..names.len()).rev() {
        listening.pop();
        let asker = client(&router).await;
        assert_eq!(until(&asker, &any, &keys).await, keys, "while {left} listen");
        asker.close().await;
    }
}
