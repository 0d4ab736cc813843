//! ROS 2 and our router: what rmw_zenoh's sessions need of it.

use crate::attacker;
use fleet_tests::eventually;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use xtb_bus::Role;
use zenoh::Session;

/// A peer that knows the router alone, as rmw_zenoh opens its sessions.
async fn peer(router: &str) -> Session {
    let mut config = zenoh::Config::default();
    for (name, value) in [
        ("mode", "\"peer\"".to_owned()),
        ("connect/endpoints", format!("[{router:?}]")),
        ("listen/endpoints", "[\"tcp/127.0.0.1:0\"]".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "true".to_owned()),
    ] {
        config.insert_json5(name, &value).unwrap();
    }
    zenoh::open(config).await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn two_peers_that_know_only_our_router_hear_each_other() {
    let role = Role::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let router = xtb_bus::open(&role).await.unwrap();
    let endpoint = router.locators().await.remove(0);
    let (talker, listener) = (peer(&endpoint).await, peer(&endpoint).await);
    let heard = Arc::new(AtomicBool::new(false));
    let flag = heard.clone();
    let hear = move |_| flag.store(true, Ordering::Relaxed);
    let _listening = listener.declare_subscriber("0/chatter/**").callback(hear).await.unwrap();
    eventually("a message of the other peer", || async {
        attacker::put(&talker, "0/chatter/string", "application/cdr", vec![0, 1, 0, 0]).await;
        heard.load(Ordering::Relaxed).then_some(())
    })
    .await;
}
