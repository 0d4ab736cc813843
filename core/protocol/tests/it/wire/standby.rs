//! The bytes of what a dispatcher and its stand-by say in version 1. This file is never edited to pass: bytes that
//! change need a new version of their type, and a file of their own.

use super::pinned;
use xtb_protocol::Name;
use xtb_protocol::codec::{Format, encode, encoding};
use xtb_protocol::messages::{
    Copied, CopiedRecord, MAX_TERM, StandbyReply, StandbyRequest, StandbyView, Witnesses,
};

fn follow(term: u32) -> StandbyRequest {
    StandbyRequest::Follow {
        copy: 300,
        copied: true,
        ledger: 7,
        term,
        last: 12,
        sum: 0xdead_beef,
        offset: 0,
        witnesses: 2,
    }
}

#[test]
fn the_versions() {
    assert_eq!(encoding::<StandbyRequest>(Format::Postcard), "application/x-postcard;xtb.StandbyRequest.v1");
    assert_eq!(encoding::<StandbyReply>(Format::Postcard), "application/x-postcard;xtb.StandbyReply.v1");
}

#[test]
fn questions() {
    pinned(
        &follow(1),
        "00ac020107010ceffdb6f50d0002",
        concat!(
            r#"{"follow":{"copy":300,"copied":true,"ledger":7,"term":1,"last":12,"sum":3735928559,"#,
            r#""offset":0,"witnesses":2}}"#
        ),
    );
    pinned(&StandbyRequest::Leave { copy: 300 }, "01ac02", r#"{"leave":{"copy":300}}"#);
    pinned(&StandbyRequest::Status {}, "02", r#"{"status":{}}"#);
    assert!(encode(&follow(MAX_TERM + 1), Format::Postcard).is_err());
}

#[test]
fn answers() {
    let record = CopiedRecord { seq: 13, snapshot: false, bytes: 2, body: "{}".into() };
    let reply = StandbyReply {
        run: 9,
        ledger: 7,
        term: 1,
        last: 13,
        standby: Some(StandbyView { copy: 300, paired: true, last: 12, age_ms: 40 }),
        held: None,
        witnesses: Some(Witnesses { version: 2, robots: vec![Name::new("xtb-1").unwrap()] }),
        copied: Copied::Records(vec![record]),
    };
    pinned(
        &reply,
        "0907010d01ac02010c2800010201057874622d3100010d0002027b7d",
        concat!(
            r#"{"run":9,"ledger":7,"term":1,"last":13,"standby":{"copy":300,"paired":true,"last":12,"#,
            r#""age_ms":40},"held":null,"witnesses":{"version":2,"robots":["xtb-1"]},"#,
            r#""copied":{"records":[{"seq":13,"snapshot":false,"bytes":2,"body":"{}"}]}}"#
        ),
    );
    let reply = StandbyReply {
        term: 0,
        standby: None,
        held: Some("w".into()),
        witnesses: None,
        copied: Copied::Diverged {},
        ..reply
    };
    pinned(
        &reply,
        "0907000d000101770001",
        concat!(
            r#"{"run":9,"ledger":7,"term":0,"last":13,"standby":null,"held":"w","witnesses":null,"#,
            r#""copied":{"diverged":{}}}"#
        ),
    );
}
