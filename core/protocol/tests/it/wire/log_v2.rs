//! The bytes of a robot's answers about its recordings, in version 2: the names in a list are names of
//! recordings. This file is never edited to pass: bytes that change need a new version of their type, and a
//! file of their own.

use super::pinned;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{LogCode, LogFile, LogReply};
use xtb_protocol::wire::CodecError;

const RECORDING: &str = "a-20041201T120000Z.mcap";

fn files(name: &str) -> LogReply {
    let file = LogFile { file: name.to_owned(), bytes: 300, age_s: 7, open: true };
    LogReply::Files { files: vec![file], left_out: 2 }
}

#[test]
fn replies() {
    assert_eq!(encoding::<LogReply>(Format::Postcard), "application/x-postcard;xtb.LogReply.v2");
    pinned(
        &files(RECORDING),
        "000117612d3230303431323031543132303030305a2e6d636170ac02070102",
        concat!(
            r#"{"files":{"files":[{"file":"a-20041201T120000Z.mcap","bytes":300,"age_s":7,"open":true}],"#,
            r#""left_out":2}}"#
        ),
    );
    pinned(
        &LogReply::Piece { bytes: 300, open: false, data: vec![1, 255] },
        "01ac02000201ff",
        r#"{"piece":{"bytes":300,"open":false,"data":[1,255]}}"#,
    );
    pinned(
        &LogReply::Error { code: LogCode::Overloaded, message: "m".to_owned() },
        "0205016d",
        r#"{"error":{"code":"overloaded","message":"m"}}"#,
    );
}

#[test]
fn a_list_with_a_path_in_it_is_no_answer() {
    for name in ["../a-20041201T120000Z.mcap", "/etc/a-20041201T120000Z.mcap", "a.mcap", ""] {
        let refused = encode(&files(name), Format::Postcard).unwrap_err();
        assert!(matches!(&refused, CodecError::Malformed { .. }), "{refused}");
        let json = serde_json::to_vec(&files(name)).unwrap();
        assert_eq!(decode::<LogReply>("application/json", &json).unwrap_err(), refused);
    }
}
