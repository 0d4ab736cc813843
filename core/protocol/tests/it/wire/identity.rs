//! What a router with identities says of one of them, version 2, as JSON, and version 1 as it is read. This file is never edited to pass: what
//! changes needs a new version of its type, and a file of its own.

use xtb_protocol::Name;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{IdentityStatus, Message};

#[test]
fn an_identity_and_one_that_is_not_known() {
    assert_eq!(IdentityStatus::VERSION, 2);
    let alice = IdentityStatus {
        name: Name::new("alice").unwrap(),
        role: Some("operator".into()),
        generation: 2,
        revoked: false,
        waiting: true,
    };
    let nobody = IdentityStatus { role: None, generation: 0, waiting: false, ..alice.clone() };
    for (status, json) in [
        (alice, r#"{"name":"alice","role":"operator","generation":2,"revoked":false,"waiting":true}"#),
        (nobody, r#"{"name":"alice","role":null,"generation":0,"revoked":false,"waiting":false}"#),
    ] {
        assert_eq!(std::str::from_utf8(&encode(&status, Format::Json).unwrap()).unwrap(), json);
        let read = decode::<IdentityStatus>(&encoding::<IdentityStatus>(Format::Json), json.as_bytes());
        assert_eq!(read.unwrap().0, status);
    }
    let v1 = r#"{"name":"alice","role":"operator","generation":2,"revoked":false}"#;
    let (read, _) = decode::<IdentityStatus>("application/json", v1.as_bytes()).unwrap();
    assert_eq!((read.generation, read.waiting), (2, false));
    let long = format!(
        r#"{{"name":"alice","role":"{}","generation":1,"revoked":false,"waiting":false}}"#,
        "x".repeat(33)
    );
    assert!(decode::<IdentityStatus>("application/json", long.as_bytes()).is_err());
}
