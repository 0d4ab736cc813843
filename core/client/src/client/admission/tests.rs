//! Who may not sends nothing, and who is not admitted is told why nobody answers.

use super::*;
use crate::fake::{FakeRobot, name};
use crate::multi_robot::Targets;
use crate::{Control, DispatcherClient, Settings, estop, stop};
use std::path::PathBuf;
use xtb_bus::{Enrolled, Question, Service};
use xtb_protocol::codec::Format;
use xtb_protocol::messages::Body;

fn own(role: Role) -> Identity {
    let own = "alice.1".parse().unwrap();
    let none = String::new;
    Identity::new(name("lab"), own, role, Vec::new(), none(), none(), none())
}

/// The same session as alice, in this role.
fn alice(client: &Client, role: Role) -> Client {
    let identity = Some(Enrolled { folder: PathBuf::new(), identity: own(role) });
    let settings = Settings { identity, client: name("alice-3f9a1c"), ..client.settings().clone() };
    Client::on(&settings, client.bus().clone())
}

fn said(role: Option<&str>, generation: u32, revoked: bool, waiting: bool) -> Option<String> {
    let role = role.map(str::to_owned);
    let status = IdentityStatus { name: name("alice"), role, generation, revoked, waiting };
    verdict(&own(Role::Operator), &status).map(|error| {
        assert_eq!((error.kind, error.kind.code().as_str()), (ErrorKind::NotAdmitted, "not_admitted"));
        assert!(!error.hint.is_empty());
        error.message
    })
}

#[test]
fn who_is_not_admitted_is_told_why() {
    assert_eq!(said(Some("operator"), 1, false, false), None);
    for (role, generation, revoked, words) in [
        (None, 0, false, "the router does not know alice"),
        (Some("operator"), 0, true, "alice was revoked"),
        (Some("operator"), 2, false, "the router admits certificate 2 of alice, this is 1"),
        (Some("operator"), 0, false, "the router admits certificate 0 of alice, this is 1"),
        (Some("viewer"), 1, false, "alice is a viewer to the router, and an operator by its identity here"),
    ] {
        assert_eq!(said(role, generation, revoked, false).as_deref(), Some(words));
    }
    let waits = said(Some("operator"), 1, false, true);
    assert_eq!(waits.as_deref(), Some("the router admits alice when no robot is driven"));
    let other =
        IdentityStatus { name: name("bob"), role: None, generation: 0, revoked: true, waiting: false };
    assert_eq!(verdict(&own(Role::Operator), &other), None);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_may_not_asks_nobody() {
    let alone = Client::alone(Duration::from_secs(30)).await;
    let (robot, fake) = (name("xtb-1"), FakeRobot::start(&alone, "xtb-1").await);
    let viewer = alice(&alone, Role::Viewer);
    let words = "alice is a viewer: may look and call an emergency stop";
    let refused =
        |error: Error| assert_eq!((error.kind, error.message.as_str()), (ErrorKind::NotAllowed, words));
    refused(Control::acquire(&viewer, &robot, true).await.unwrap_err());
    refused(viewer.request(&robot, Body::Stop {}).await.unwrap_err());
    refused(DispatcherClient::of(&viewer).submit(Vec::new()).await.unwrap_err());
    refused(DispatcherClient::of(&viewer).status().await.unwrap_err());
    let robots = Targets::Robots(vec![robot.clone()]);
    let (report, missing) = stop::stop(&viewer, &robots).await;
    assert!(report.robots.is_empty() && !report.complete);
    refused(missing.alive.unwrap());
    let recorder = alice(&alone, Role::Recorder);
    let (report, missing) = estop::estop(&recorder, &robots, Duration::from_secs(1)).await;
    assert!(report.robots.is_empty() && missing.alive.unwrap().kind == ErrorKind::NotAllowed);
    assert_eq!(fake.lock().asked, []);
    assert_eq!(fake.lock().state.latches, []);
    // And who may is not held up.
    Control::acquire(&alice(&alone, Role::Operator), &robot, false).await.unwrap().release().await;
}

/// A router that says this of alice.
async fn router(client: &Client, revoked: bool) -> Service {
    let key = client.keys().identity(Some(&name("alice")));
    let (own_key, runtime) = (key.clone(), tokio::runtime::Handle::current());
    let each = move |question: Question| {
        let own_key = own_key.clone();
        runtime.spawn(async move {
            let status = IdentityStatus {
                name: name("alice"),
                role: Some("operator".to_owned()),
                generation: u32::from(!revoked),
                revoked,
                waiting: false,
            };
            question.reply(&own_key, &status, Format::Json).await.unwrap();
        });
    };
    client.bus().serve(&key, each).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_question_that_nobody_answers_ends_with_the_routers_reason() {
    let alone = Client::alone(Duration::from_millis(300)).await;
    let client = alice(&alone, Role::Operator);
    let absent = name("xtb-9");
    let acquired = async || Control::acquire(&client, &absent, false).await.map(drop).unwrap_err();
    // A router without identities says nothing.
    assert_eq!(acquired().await.kind, ErrorKind::OutcomeUnknown);
    let admits = router(&alone, false).await;
    assert_eq!(acquired().await.kind, ErrorKind::OutcomeUnknown);
    drop(admits);
    let _revoked = router(&alone, true).await;
    let error = acquired().await;
    assert_eq!((error.kind, error.message.as_str()), (ErrorKind::NotAdmitted, "alice was revoked"));
    let nobody = client.explained(client.nobody()).await;
    assert_eq!(nobody.message, "alice was revoked");
    let dispatcher = DispatcherClient::of(&client).status().await.unwrap_err();
    assert_eq!(dispatcher.message, "alice was revoked");
}
