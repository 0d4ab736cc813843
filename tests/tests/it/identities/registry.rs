//! A router follows its registry: who is revoked is out, the others stay, who is added comes in; and strangers who
//! only knock disturb nobody.

use super::robot::Robot;
use fleet_tests::identities::Pki;
use fleet_tests::{eventually, name};
use std::time::{Duration, Instant};
use xtb_bus::Bus;
use xtb_identity::Role;
use xtb_protocol::messages::{Body, IdentityStatus, LinkLoss, Outcome, RobotState};
use xtb_services::router::{AdmissionChange, GuardedRouter, News, ask_to_apply};

const PEOPLE: [(&str, Role); 3] =
    [("xtb-1", Role::Robot), ("alice", Role::Operator), ("bob", Role::Operator)];
/// Between two questions, and for how long each waits.
const EVERY: Duration = Duration::from_millis(20);
const ASK_WITHIN: Duration = Duration::from_millis(150);

async fn open(pki: &Pki, of: &str, router: &GuardedRouter) -> Bus {
    pki.opening(of, router.endpoint()).once().await.unwrap()
}

/// What the router says of somebody to somebody.
async fn status(pki: &Pki, bus: &Bus, of: &str) -> Option<IdentityStatus> {
    let key = pki.keys().identity(Some(&name(of)));
    let answers = bus.get(&key, Duration::from_secs(1)).await.unwrap();
    answers.first().map(|answer| answer.decode().unwrap())
}

/// Whether the robot answers this session: its state, for who may look.
async fn state(pki: &Pki, bus: &Bus) -> Option<RobotState> {
    let key = pki.keys().robot(&name("xtb-1")).state();
    let answers = bus.get(&key, ASK_WITHIN).await.unwrap();
    answers.first().map(|answer| answer.decode().unwrap())
}

/// Asks again and again: the longest time between two answers, and when the last came.
async fn longest_gap(pki: &Pki, bus: &Bus, until: Instant) -> (Duration, Instant) {
    let (mut last, mut longest) = (Instant::now(), Duration::ZERO);
    while Instant::now() < until {
        if state(pki, bus).await.is_some() {
            longest = longest.max(last.elapsed());
            last = Instant::now();
        }
        tokio::time::sleep(EVERY).await;
    }
    (longest, last)
}

#[tokio::test(flavor = "multi_thread")]
async fn who_is_revoked_is_out_within_4_s_and_the_others_are_back_within_1500_ms() {
    let mut pki = Pki::new(&PEOPLE);
    let mut router = pki.router().await;
    let (alice, bob) = (open(&pki, "alice", &router).await, open(&pki, "bob", &router).await);
    let robot = Robot::start(&pki, router.endpoint(), &alice, None).await;
    let pilot = Robot::pilot(&alice, "alice").await;
    let goal = Body::Wander { for_s: Some(60.0), on_link_loss: LinkLoss::Finish, finish_s: 120.0 };
    let Outcome::Ok(_) = pilot.ask(goal).await else { panic!("the goal is refused") };
    let goal = eventually("the goal", || async { state(&pki, &alice).await?.goal }).await.id;
    assert!(state(&pki, &bob).await.is_some());

    pki.change("bob", |entry| entry.revoked = true);
    let revoked = Instant::now();
    pki.write();
    let until = revoked + Duration::from_secs(6);
    let ((gap, back), (_, heard)) =
        tokio::join!(longest_gap(&pki, &alice, until), longest_gap(&pki, &bob, until),);
    assert!(heard - revoked <= Duration::from_secs(4), "bob was answered {:?} after it", heard - revoked);
    assert!(back > until - Duration::from_secs(1), "alice is not back");
    assert!(gap <= Duration::from_millis(1500), "alice was not answered for {gap:?}");
    let News::Reopened { change, closed } = router.news().await else { panic!("it was not opened anew") };
    assert_eq!(change, AdmissionChange { out: [name("bob")].into(), ..AdmissionChange::default() });
    assert!(closed <= Duration::from_millis(1500), "it was closed for {closed:?}");

    let now = state(&pki, &alice).await.unwrap();
    let running = matches!(&now.goal, Some(now) if now.id == goal && !now.status.is_final());
    assert!(running, "the goal has ended: {:?}, stopped because {:?}", now.goal, now.stopped_because);
    robot.driven();
    eventually("it drives on", || async { (robot.driven() > 0).then_some(()) }).await;
    // He learns why.
    let said = eventually("an answer about bob", || status(&pki, &bob, "bob")).await;
    assert_eq!((said.role.as_deref(), said.generation, said.revoked), (Some("operator"), 0, true));
    robot.end().await;
    router.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_is_added_comes_in_when_no_robot_is_driven_or_at_once_where_that_is_asked_for() {
    let mut pki = Pki::new(&PEOPLE);
    let mut router = pki.router().await;
    let alice = open(&pki, "alice", &router).await;
    let robot = Robot::start(&pki, router.endpoint(), &alice, None).await;
    let pilot = Robot::pilot(&alice, "alice").await;

    pki.add("carol", Role::Viewer);
    pki.write();
    let News::Waiting(change) = router.news().await else { panic!("it did not wait") };
    assert_eq!(change.to_string(), "added: carol");
    let carol = open(&pki, "carol", &router).await;
    assert!(state(&pki, &carol).await.is_none(), "she is admitted already");
    assert_eq!(status(&pki, &carol, "carol").await.unwrap().role.as_deref(), Some("viewer"));
    drop(pilot); // the lease expires
    assert!(matches!(router.news().await, News::Reopened { .. }));
    eventually("carol looks", || state(&pki, &carol)).await;

    let pilot = Robot::pilot(&alice, "alice").await;
    pki.add("dave", Role::Viewer);
    pki.write();
    assert!(matches!(router.news().await, News::Waiting(_)));
    ask_to_apply(pki.folder()).unwrap();
    assert!(matches!(router.news().await, News::Reopened { .. }));
    let dave = open(&pki, "dave", &router).await;
    eventually("dave looks", || state(&pki, &dave)).await;
    drop(pilot);
    robot.end().await;
    router.close().await;
    let seen = std::fs::read_to_string(pki.folder().join("seen.toml")).unwrap();
    for of in ["alice", "carol", "dave", "xtb-1"] {
        assert!(seen.contains(&format!("\"{of}\" = \"")), "{of}: {seen}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_broken_registry_changes_nothing() {
    let mut pki = Pki::new(&PEOPLE);
    let mut router = pki.router().await;
    let alice = open(&pki, "alice", &router).await;
    std::fs::write(pki.folder().join("identities.toml"), "version = 1\nfleet = ").unwrap();
    assert!(matches!(router.news().await, News::Unreadable(_)));
    assert!(status(&pki, &alice, "bob").await.is_some_and(|status| !status.revoked));
    // It follows again as soon as it can read it.
    pki.change("bob", |entry| entry.revoked = true);
    pki.write();
    assert!(matches!(router.news().await, News::Reopened { .. }));
    eventually("bob is out", || async { status(&pki, &alice, "bob").await.filter(|status| status.revoked) })
        .await;
    router.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn three_hundred_silent_strangers_do_not_disturb_who_is_linked() {
    let pki = Pki::new(&PEOPLE);
    let router = pki.router().await;
    let alice = open(&pki, "alice", &router).await;
    let robot = Robot::start(&pki, router.endpoint(), &alice, None).await;
    let pilot = Robot::pilot(&alice, "alice").await;
    let address = router.endpoint().strip_prefix("tls/").unwrap().to_owned();
    let strangers: Vec<_> = (0..300).map(|_| std::net::TcpStream::connect(&address).unwrap()).collect();
    let (held, until) = (pilot.lease(), Instant::now() + Duration::from_secs(5));
    let (gap, _) = longest_gap(&pki, &alice, until).await;
    assert!(gap < Duration::from_secs(1), "alice was not answered for {gap:?}");
    assert!(held.is_some() && pilot.lease() == held, "the lease is lost");
    drop(strangers);
    robot.end().await;
    router.close().await;
}
