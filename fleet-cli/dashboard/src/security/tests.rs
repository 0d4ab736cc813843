//! Who is refused, and who is not.

use super::*;
use std::net::SocketAddr;
use xtb_client::ErrorKind;

const TOKEN: &str = "0123456789abcdef";
const IN: Entry = Entry::In(Visitor::Anybody);

fn guard(listen: &str, token: Option<&str>, allowed: &[&str]) -> Guard {
    let listen: SocketAddr = listen.parse().unwrap();
    let access = Access::plain(listen, token.map(str::to_owned), "c00kie".into(), true).unwrap();
    Guard::new(listen.ip(), access, allowed.iter().map(|origin| origin.parse().unwrap()).collect())
}

fn admit(guard: &Guard, method: Method, path: &str, headers: &[(&str, &str)]) -> Result<Entry, Refusal> {
    let headers = headers.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap()));
    let peer = Peer { from: "192.168.1.9".parse().unwrap(), certificate: None };
    guard.admit(&method, &path.parse().unwrap(), &HeaderMap::from_iter(headers), &peer)
}

#[test]
fn only_the_pages_own_origin_opens_the_socket_or_posts() {
    let guard = guard("127.0.0.1:8080", None, &[]);
    for (method, path) in [(Method::GET, "/ws"), (Method::POST, "/"), (Method::DELETE, "/x")] {
        let with = |origin| {
            let host = ("host", "localhost:8080");
            admit(&guard, method.clone(), path, &[host, ("origin", origin)])
        };
        assert_eq!(with("http://localhost:8080"), Ok(IN));
        for foreign in [
            "http://evil.example",
            "http://localhost:8081",
            "https://localhost:8080",
            "http://127.0.0.1:8080",
            "http://localhost:8080.evil.example",
            "http://localhost:8080@evil.example",
            "null",
            "",
        ] {
            assert_eq!(with(foreign), Err(Refusal::Origin), "{foreign}");
        }
        let none = admit(&guard, method, path, &[("host", "localhost:8080")]);
        assert_eq!(none, Err(Refusal::Origin), "browsers send one");
    }
}

#[test]
fn a_name_that_nobody_told_us_of_is_refused() {
    let local = guard("127.0.0.1:8080", None, &["https://fleet.example"]);
    let with = |guard: &Guard, host: &str| admit(guard, Method::GET, "/", &[("host", host)]);
    for good in ["127.0.0.1:8080", "localhost:9000", "LOCALHOST", "[::1]:8080", "fleet.example"] {
        assert_eq!(with(&local, good), Ok(IN), "{good}");
    }
    for bad in ["evil.example:8080", "192.168.1.7:8080", "localhost.evil.example", "a b", "", "x:y", "[::1"] {
        assert_eq!(with(&local, bad), Err(Refusal::Host), "{bad}");
    }
    assert_eq!(admit(&local, Method::GET, "/", &[]), Err(Refusal::Host));
    let anywhere = guard("0.0.0.0:8080", Some(TOKEN), &[]);
    assert_eq!(with(&anywhere, "192.168.1.7:8080"), Err(Refusal::Token), "an address cannot be rebound");
    assert_eq!(with(&anywhere, "evil.example:8080"), Err(Refusal::Host));
}

#[test]
fn an_allowed_origin_comes_through_its_proxy() {
    let guard = guard("127.0.0.1:8080", None, &["https://fleet.example/"]);
    for (host, origin, admitted) in [
        ("fleet.example", "https://fleet.example", true),
        ("127.0.0.1:8080", "https://fleet.example", true),
        ("fleet.example", "https://fleet.example:8443", false),
        ("127.0.0.1:8080", "https://other.example", false),
    ] {
        let headers = [("host", host), ("origin", origin)];
        assert_eq!(admit(&guard, Method::GET, "/ws", &headers).is_ok(), admitted, "{host} {origin}");
    }
}

#[test]
fn the_token_is_asked_for_everywhere_but_for_health() {
    let guard = guard("0.0.0.0:8080", Some(TOKEN), &[]);
    let host = ("host", "192.168.1.7:8080");
    let with = |path: &str, more: (&str, &str)| admit(&guard, Method::GET, path, &[host, more]);
    let none = ("accept", "*/*");
    for path in [
        "/",
        "/assets/app.js",
        "/metrics",
        "/?token=",
        "/?token=0123456789abcdeX",
        "/metrics?token=0123456789abcdef",
    ] {
        assert_eq!(with(path, none), Err(Refusal::Token), "{path}");
    }
    assert_eq!(with("/healthz", none), Ok(IN));
    assert_eq!(with("/?token=0123456789abcdef", none), Ok(Entry::SetCookie));
    assert_eq!(with("/", ("cookie", "a=b; xtb_dashboard=c00kie")), Ok(IN));
    for wrong in ["xtb_dashboard=", "xtb_dashboard=c00kiX", "xtb_dashboard=c00kie0", "x=c00kie"] {
        assert_eq!(with("/", ("cookie", wrong)), Err(Refusal::Token), "{wrong}");
    }
    assert_eq!(with("/ws", ("authorization", "Bearer 0123456789abcdef")), Ok(IN));
    assert_eq!(with("/metrics", ("authorization", "Bearer 0123456789")), Err(Refusal::Token));
    assert_eq!(with("/ws", ("cookie", "xtb_dashboard=c00kie")), Err(Refusal::Origin));
    let forged = [host, ("authorization", "Bearer 0123456789abcdef"), ("origin", "http://evil.example")];
    assert_eq!(admit(&guard, Method::GET, "/ws", &forged), Err(Refusal::Origin));
    assert!(guard.set_cookie().contains("HttpOnly; SameSite=Strict"));
    assert!(!guard.set_cookie().contains(TOKEN));
}

#[test]
fn without_tls_other_machines_are_refused_unless_one_insists_and_has_a_token() {
    let new = |listen: &str, token: Option<&str>, insecure| {
        Access::plain(listen.parse().unwrap(), token.map(str::to_owned), String::new(), insecure)
    };
    for listen in ["0.0.0.0:1", "192.168.1.7:1", "[::]:1"] {
        let failure = new(listen, Some(TOKEN), false).unwrap_err();
        assert_eq!(failure.kind, ErrorKind::Invalid);
        assert_eq!(failure.message, format!("whoever reaches {listen} could drive every robot"));
        assert!(failure.hint.contains("pki add-service dashboard") && failure.hint.contains("--insecure"));
        assert!(new(listen, None, true).unwrap_err().hint.contains("openssl rand"));
        assert!(new(listen, Some(TOKEN), true).is_ok());
    }
    assert!(new("127.0.0.1:1", Some("short"), false).unwrap_err().hint.contains("openssl rand"));
    assert!(new("127.0.0.1:1", None, false).is_ok() && new("[::1]:1", None, false).is_ok());
}

/// TLS on any address, for people of whom alice has a token.
fn closed() -> Guard {
    let registry = "version = 1\nfleet = \"lab\"\n\
        [router]\nnames = []\nport = 7447\ngeneration = 1\nexpires = \"2100-01-01T00:00:00Z\"\n\
        [[identity]]\nname = \"alice\"\nrole = \"operator\"\ngeneration = 1\nexpires = \"2100-01-01T00:00:00Z\"\n\
        token_sha256 = \"9f9f5111f7b27a781f1f1ddde5ebc2dd2b796bfc7365c9c28b548e564176929f\"\n";
    let people = People::new(xtb_identity::Registry::parse(registry).unwrap());
    let hosts = vec!["fleet.lab".to_owned(), "10.0.0.1".to_owned()];
    Guard::new("0.0.0.0".parse().unwrap(), Access::People { people, hosts }, Vec::new())
}

#[test]
fn over_tls_a_stranger_gets_what_leads_to_signing_in_alone() {
    let guard = closed();
    let with = |method: Method, path: &str, more: (&str, &str)| {
        admit(&guard, method, path, &[("host", "fleet.lab:8443"), more])
    };
    let none = ("accept", "*/*");
    for path in OPEN_PATHS {
        assert_eq!(with(Method::GET, path, none), Ok(IN), "{path}");
    }
    for path in ["/", "/ws", "/metrics", "/assets/main.js", "/sign-in/", "/who/x", "/?token=0123456789abcdef"]
    {
        let own = ("origin", "https://fleet.lab:8443");
        assert_eq!(with(Method::GET, path, own), Err(Refusal::SignIn), "{path}");
    }
    for (origin, admitted) in
        [("https://fleet.lab:8443", true), ("http://fleet.lab:8443", false), ("https://fleet.lab", false)]
    {
        assert_eq!(with(Method::POST, "/sign-in", ("origin", origin)).is_ok(), admitted, "{origin}");
    }
    assert_eq!(with(Method::POST, "/sign-in", none), Err(Refusal::Origin));
    let evil = admit(&guard, Method::GET, "/sign-in", &[("host", "evil.example:8443")]);
    assert_eq!(evil, Err(Refusal::Host));
}

#[test]
fn over_tls_a_token_and_a_cookie_say_who_it_is() {
    let guard = closed();
    let host = ("host", "10.0.0.1:8443");
    let bearer = [host, ("authorization", "Bearer 0123456789abcdef")];
    let Ok(Entry::In(Visitor::Person(alice))) = admit(&guard, Method::GET, "/metrics", &bearer) else {
        panic!("she is not let in")
    };
    assert_eq!(alice.name.as_str(), "alice");
    assert!(admit(&guard, Method::GET, "/ws", &bearer).is_ok(), "a program needs no origin");
    let cookie = guard.people().unwrap().sign_in(&alice, Instant::now()).unwrap();
    let set = persons_cookie(Some(&cookie));
    assert!(set.contains("__Host-") && set.contains("Secure; HttpOnly; SameSite=Strict; Path=/"), "{set}");
    let own = set.split(';').next().unwrap();
    let headers = [host, ("cookie", own), ("origin", "https://10.0.0.1:8443")];
    assert!(matches!(admit(&guard, Method::GET, "/ws", &headers), Ok(Entry::In(Visitor::Person(_)))));
    assert_eq!(admit(&guard, Method::GET, "/ws", &headers[..2]), Err(Refusal::Origin));
    // Another program's cookie, without the prefix that browsers watch over.
    let plain = format!("xtb_dashboard={cookie}");
    assert_eq!(admit(&guard, Method::GET, "/", &[host, ("cookie", &plain)]), Err(Refusal::SignIn));
    let wrong = [host, ("authorization", "Bearer 0123456789abcdeX")];
    for _ in 0..crate::guesses::MOST {
        assert_eq!(admit(&guard, Method::GET, "/metrics", &wrong), Err(Refusal::SignIn));
    }
    assert_eq!(admit(&guard, Method::GET, "/metrics", &bearer), Err(Refusal::Guesses));
    assert!(admit(&guard, Method::GET, "/ws", &headers).is_ok(), "who is in stays in");
}

#[test]
fn scripts_and_frames_of_others_are_forbidden() {
    for rule in ["default-src 'none'", "script-src 'self'", "connect-src 'self'", "frame-ancestors 'none'"] {
        assert!(CSP.contains(rule), "{rule}");
    }
    assert!(!CSP.contains("unsafe") && !CSP.contains('*'));
    assert!(HEADERS.iter().all(|(name, _)| !name.starts_with("access-control")));
}
