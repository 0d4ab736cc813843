//! The bytes of the wire, version by version. The files below are never edited to pass: bytes that change need a
//! new version of their type, and a file of their own.

mod dispatch;
mod dispatch_v2;
mod dispatch_v3;
mod identity;
mod log;
mod log_v2;
mod map_edit;
mod near;
mod param;
mod previous;
mod sensors_v3;
mod sim;
mod standby;
mod v1;
mod v2;
mod v4;
mod v5;

use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::Message;
use xtb_protocol::{Name, Uuid};

fn id() -> Uuid {
    Uuid::from_u128(0x0011_2233_4455_6677_8899_aabb_ccdd_eeff)
}

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Both encodings of a message are as pinned, and read back as the message.
fn pinned<M: Message + PartialEq + std::fmt::Debug>(message: &M, postcard: &str, json: &str) {
    pinned_in(Format::Postcard, message, postcard, json);
}

/// The same with the bytes of this version.
fn pinned_in<M: Message + PartialEq + std::fmt::Debug>(
    version: Format,
    message: &M,
    postcard: &str,
    json: &str,
) {
    let bytes = encode(message, version).unwrap();
    let text = encode(message, Format::Json).unwrap();
    assert_eq!((hex(&bytes).as_str(), std::str::from_utf8(&text).unwrap()), (postcard, json));
    for (format, bytes) in [(version, &bytes), (Format::Json, &text)] {
        let (read, said) = decode::<M>(&encoding::<M>(format), bytes).unwrap();
        assert_eq!((&read, said), (message, format));
    }
}
