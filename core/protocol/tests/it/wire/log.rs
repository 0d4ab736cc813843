//! The bytes of what is asked about recordings, in version 1. This file is never edited to pass: bytes that
//! change need a new version of their type, and a file of their own.

use super::pinned;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{LogReply, LogRequest, MAX_LOG_NAME, MAX_PIECE};
use xtb_protocol::wire::CodecError;

fn read(file: &str, length: u32) -> LogRequest {
    LogRequest::Read { file: file.to_owned(), offset: 300, length }
}

#[test]
fn requests() {
    assert_eq!(encoding::<LogRequest>(Format::Postcard), "application/x-postcard;xtb.LogRequest.v1");
    pinned(&LogRequest::List {}, "00", r#"{"list":{}}"#);
    let json = r#"{"read":{"file":"a.mcap","offset":300,"length":5}}"#;
    pinned(&read("a.mcap", 5), "0106612e6d636170ac0205", json);
}

#[test]
fn a_piece_has_a_length_and_a_recording_a_name() {
    for request in [
        read("a.mcap", 0),
        read("a.mcap", MAX_PIECE + 1),
        read("", 1),
        read(&"a".repeat(MAX_LOG_NAME + 1), 1),
    ] {
        let refused = encode(&request, Format::Postcard).unwrap_err();
        assert!(matches!(refused, CodecError::OutOfRange(_)), "{request:?}: {refused}");
    }
    let whole = LogReply::Piece { bytes: 1 << 40, open: true, data: vec![255; MAX_PIECE as usize] };
    for format in [Format::Postcard, Format::Json] {
        let bytes = encode(&whole, format).unwrap();
        assert_eq!(decode::<LogReply>(&encoding::<LogReply>(format), &bytes).unwrap().0, whole);
    }
}
