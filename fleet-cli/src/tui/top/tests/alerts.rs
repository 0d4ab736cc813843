//! Alerts on the screen, and the event list with its details.

use super::*;
use xtb_protocol::messages::{Acknowledged, Alert, AlertKind, Event, EventKind, FleetAlerts};

fn alert(id: u64, robot: Option<&str>, text: &str) -> Alert {
    Alert {
        id,
        kind: AlertKind::Latched,
        robot: robot.map(name),
        subject: None,
        text: text.to_owned(),
        remedy: "reset it".into(),
        since_ms: 4_000,
        acknowledged: None,
        ended_ms: None,
    }
}

fn with_alerts(scene: &mut Scene, alerts: Vec<Alert>) {
    scene.take(9_600, &key("dispatch/alerts"), FleetAlerts { at_ms: 5_000, alerts, left_out: 0 }.into());
}

#[test]
fn a_new_alert_rings_once_is_a_line_and_counts_in_the_title_until_it_is_seen() {
    let (mut cockpit, mut scene) = (cockpit(), fleet());
    screen(&mut cockpit, &scene, 160, 50);
    assert!(!cockpit.take_bell());
    let mut one = alert(7, Some("xtb-3"), "xtb-3 latched: emergency stop");
    with_alerts(&mut scene, vec![one.clone()]);
    let shown = screen(&mut cockpit, &scene, 160, 50);
    assert!(shown[0].contains("1 ALERT (o)"), "{}", shown[0]);
    line(&shown, "ALERT (o: seen): xtb-3 latched: emergency stop");
    assert!(cockpit.take_bell());
    screen(&mut cockpit, &scene, 160, 50);
    assert!(!cockpit.take_bell(), "once");
    with_alerts(&mut scene, vec![one.clone(), alert(8, None, "the dispatcher is suspended")]);
    assert!(screen(&mut cockpit, &scene, 160, 50)[0].contains("2 ALERTS (o)"));
    assert!(cockpit.take_bell());
    assert_eq!(commands(&letter(&mut cockpit, &scene, 'o')), [Command::Acknowledge { ids: vec![7, 8] }]);
    one.acknowledged = Some(Acknowledged { by: name("alice"), person: None, at_ms: 4_500 });
    with_alerts(&mut scene, vec![one]);
    assert!(!screen(&mut cockpit, &scene, 160, 50)[0].contains("ALERT"));
    let (mut none, scene) = (self::cockpit(), fleet());
    assert!(letter(&mut none, &scene, 'o').is_empty());
    line(&screen(&mut none, &scene, 80, 24), "no alerts: no dispatcher");
}

#[test]
fn the_list_of_alerts_has_what_to_do_and_who_has_seen_them() {
    let (mut cockpit, mut scene) = (cockpit(), fleet());
    let seen = Acknowledged { by: name("alice"), person: None, at_ms: 4_500 };
    let seen = Alert { acknowledged: Some(seen), ..alert(1, Some("xtb-1"), "xtb-1 battery: low") };
    let ended = Alert { ended_ms: Some(4_900), ..alert(2, None, "over") };
    with_alerts(&mut scene, vec![seen, ended, alert(3, None, "task t1 failed")]);
    letter(&mut cockpit, &scene, 'v');
    letter(&mut cockpit, &scene, 'v');
    let shown = screen(&mut cockpit, &scene, 160, 50);
    line(&shown, "alerts (v: events): 1 open");
    line(&shown, "xtb-1 battery: low (seen by alice)");
    line(&shown, "→ reset it");
    assert!(line(&shown, "task t1 failed").contains("1.0 s"), "{shown:?}");
    assert!(!shown.join("\n").contains("over"));
    letter(&mut cockpit, &scene, 'v');
    line(&screen(&mut cockpit, &scene, 160, 50), "events (d: details");
}

#[test]
fn many_at_once_are_one_line_and_a_screen_of_some_robots_has_theirs() {
    let (mut cockpit, mut scene) = (cockpit(), fleet());
    with_alerts(&mut scene, (1..=9).map(|id| alert(id, Some("xtb-1"), "text")).collect());
    line(&screen(&mut cockpit, &scene, 160, 50), "ALERT: 9 new ones");
    let mut some = self::cockpit();
    some.setup.robots = vec![name("xtb-2")];
    with_alerts(&mut scene, vec![alert(1, Some("xtb-1"), "not shown"), alert(2, Some("xtb-2"), "shown")]);
    assert!(screen(&mut some, &scene, 160, 50)[0].contains("1 ALERT (o)"));
    assert_eq!(commands(&letter(&mut some, &scene, 'o')), [Command::Acknowledge { ids: vec![2] }]);
}

#[test]
fn a_drive_is_one_line_and_each_event_is_shown_on_request() {
    let (mut cockpit, mut scene) = (cockpit(), fleet());
    let goal = Uuid::from_u128(7);
    for (seq, status) in
        [GoalStatus::Accepted, GoalStatus::Running, GoalStatus::Reached].into_iter().enumerate()
    {
        let kind = EventKind::Goal { id: goal, status, reason: None };
        let seq = seq as u64;
        let event = Event { robot: name("xtb-1"), epoch: 7, seq, tick_ms: 4_000 * seq, kind };
        scene.take(9_700 + seq, &key("xtb-1/event"), event.into());
    }
    let shown = screen(&mut cockpit, &scene, 160, 50);
    line(&shown, "xtb-1 drive reached after 8 s");
    assert!(!shown.join("\n").contains("goal running"));
    letter(&mut cockpit, &scene, 'd');
    let shown = screen(&mut cockpit, &scene, 160, 50);
    line(&shown, "xtb-1 goal running");
    line(&shown, "xtb-1 drive reached after 8 s");
    letter(&mut cockpit, &scene, 'd');
    assert!(!screen(&mut cockpit, &scene, 160, 50).join("\n").contains("goal running"));
}
