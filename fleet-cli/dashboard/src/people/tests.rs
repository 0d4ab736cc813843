//! Who signs in, and how one is out.

use super::*;
use std::time::UNIX_EPOCH;
use xtb_identity::Router;

const FROM: IpAddr = IpAddr::V4(std::net::Ipv4Addr::new(10, 0, 0, 7));

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn entry(who: &str, role: Role, token: Option<&str>) -> RegistryEntry {
    let expires = UNIX_EPOCH + Duration::from_secs(4_000_000_000);
    let token_sha256 = token.map(token_digest);
    RegistryEntry { name: name(who), role, generation: 2, expires, revoked: false, token_sha256 }
}

fn registry() -> Registry {
    let expires = UNIX_EPOCH + Duration::from_secs(4_000_000_000);
    let router = Router { names: vec!["10.0.0.1".into()], port: 7447, generation: 1, expires };
    let mut registry = Registry::new(name("lab"), router);
    for (who, role, token) in [
        ("alice", Role::Operator, Some("alice-token-0123456789")),
        ("bob", Role::Viewer, Some("bob-token-0123456789")),
        ("xtb-1", Role::Robot, Some("robot-token-0123456789")),
    ] {
        registry.add(entry(who, role, token)).unwrap();
    }
    registry
}

fn change(people: &People, who: &str, change: impl FnOnce(&mut RegistryEntry)) {
    let mut registry = people.lock().registry.clone();
    change(registry.get_mut(&name(who)).unwrap());
    people.update(registry);
}

#[test]
fn a_token_stands_for_its_person_and_a_cookie_for_that() {
    let (people, now) = (People::new(registry()), Instant::now());
    let alice = people.by_token("alice-token-0123456789", FROM, now).unwrap();
    assert_eq!((alice.name.as_str(), alice.role), ("alice", Role::Operator));
    assert_eq!(people.by_token("bob-token-0123456789", FROM, now).unwrap().role, Role::Viewer);
    for wrong in [
        "",
        "alice",
        "alice-token-012345678",
        "robot-token-0123456789",
        &token_digest("alice-token-0123456789"),
    ] {
        assert_eq!(people.by_token(wrong, FROM, now), Err(NotTaken::Wrong), "{wrong}");
    }
    let cookie = people.sign_in(&alice, now).unwrap();
    assert!(cookie.len() == 64 && !cookie.contains("alice"));
    assert_eq!(people.by_cookie(&cookie, now).unwrap().name, alice.name);
    assert_eq!(people.by_cookie(&cookie[1..], now), None);
    assert_eq!(people.by_cookie(&cookie, now + IDLE + Duration::from_secs(1)), None);
}

#[test]
fn the_registry_decides_at_each_request() {
    let (people, now) = (People::new(registry()), Instant::now());
    let bearer = people.by_token("alice-token-0123456789", FROM, now).unwrap();
    let cookie = people.sign_in(&bearer, now).unwrap();
    let signed_in = people.by_cookie(&cookie, now).unwrap();
    let mut changes = people.changes();

    change(&people, "alice", |alice| alice.role = Role::Viewer);
    assert!(changes.has_changed().unwrap());
    changes.mark_unchanged();
    assert_eq!(people.again(&signed_in, now).unwrap().role, Role::Viewer);
    assert_eq!(people.again(&bearer, now).unwrap().role, Role::Viewer);

    change(&people, "alice", |alice| alice.revoked = true);
    assert_eq!((people.again(&signed_in, now), people.again(&bearer, now)), (None, None));
    assert_eq!(people.by_token("alice-token-0123456789", FROM, now), Err(NotTaken::Wrong));

    change(&people, "alice", |alice| alice.revoked = false);
    assert!(people.again(&signed_in, now).is_some());
    change(&people, "alice", |alice| alice.expires = SystemTime::now() - IDLE);
    assert_eq!((people.again(&signed_in, now), people.again(&bearer, now)), (None, None));
    assert_eq!(people.by_token("alice-token-0123456789", FROM, now), Err(NotTaken::Wrong));

    change(&people, "alice", |alice| alice.expires = SystemTime::now() + IDLE);
    assert!(people.again(&signed_in, now).is_some());
    change(&people, "alice", |alice| alice.token_sha256 = Some(token_digest("another-0123456789")));
    assert_eq!((people.again(&signed_in, now), people.again(&bearer, now)), (None, None));
}

#[test]
fn a_certificate_counts_while_its_generation_and_time_do() {
    let people = People::new(registry());
    let shown = |own: &str, not_after| Shown { own: own.parse().unwrap(), not_after };
    let (later, before) = (SystemTime::now() + IDLE, SystemTime::now() - IDLE);
    let alice = people.by_certificate(&shown("alice.2", later)).unwrap();
    assert_eq!((alice.name.as_str(), alice.role), ("alice", Role::Operator));
    for (own, not_after) in [
        ("alice.1", later),
        ("alice.3", later),
        ("alice.2", before),
        ("carol.1", later),
        ("xtb-1.2", later),
        ("router.1", later),
    ] {
        assert_eq!(people.by_certificate(&shown(own, not_after)), None, "{own}");
    }
    change(&people, "alice", |alice| alice.generation = 3);
    assert_eq!(people.again(&alice, Instant::now()), None);
}

#[test]
fn signing_out_ends_one_browser_and_many_browsers_make_room() {
    let (people, now) = (People::new(registry()), Instant::now());
    let alice = people.by_token("alice-token-0123456789", FROM, now).unwrap();
    let second = |s: usize| now + Duration::from_secs(s as u64);
    let cookies: Vec<_> = (0..MOST_EACH + 1).map(|s| people.sign_in(&alice, second(s)).unwrap()).collect();
    assert_eq!(people.by_cookie(&cookies[0], second(20)), None);
    let other = people.by_cookie(&cookies[1], second(20)).unwrap();
    people.sign_out(&other);
    assert_eq!(people.by_cookie(&cookies[1], second(20)), None);
    assert!(people.by_cookie(&cookies[2], second(20)).is_some());
}

#[test]
fn a_right_token_among_too_many_wrong_ones_is_not_looked_at() {
    let (people, now) = (People::new(registry()), Instant::now());
    for _ in 0..super::super::guesses::MOST {
        assert_eq!(people.by_token("wrong", FROM, now), Err(NotTaken::Wrong));
    }
    let right = "alice-token-0123456789";
    assert_eq!(people.by_token(right, FROM, now), Err(NotTaken::TooMany));
    assert!(people.by_token(right, "10.0.0.8".parse().unwrap(), now).is_ok());
    assert!(people.by_token(right, FROM, now + super::super::guesses::WINDOW).is_ok());
}
