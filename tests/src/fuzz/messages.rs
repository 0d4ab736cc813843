//! Messages from the network: request, setpoint, emergency stop.

use std::fmt::Debug;
use xtb_protocol::Uuid;
use xtb_protocol::codec::{self, CodecError, Format, decode, encode, encoding};
use xtb_protocol::messages::{Body, Estop, Message, RejectCode, Reply, Request, Setpoint};

const FORMATS: [Format; 2] = [Format::Postcard, Format::Json];
/// A refusal repeats what it refuses only in part: it has to fit into a reply.
const MAX_REFUSAL: usize = 1024;

/// A request, as a client might send it.
#[must_use]
pub fn command(bytes: &[u8]) -> bool {
    message(bytes, |request: &Request| match request.body {
        Body::Goto { x_m, y_m, yaw_rad, finish_s, .. } => {
            in_map(x_m, y_m) && yaw_rad.is_none_or(is_angle) && is_time(finish_s)
        }
        Body::Wander { for_s, finish_s, .. } => for_s.is_none_or(is_time) && is_time(finish_s),
        Body::SetPose { x_m, y_m, yaw_rad } => in_map(x_m, y_m) && is_angle(yaw_rad),
        _ => true,
    })
}

/// A setpoint, as a joystick might send it.
#[must_use]
pub fn teleop(bytes: &[u8]) -> bool {
    message(bytes, |setpoint: &Setpoint| {
        (-353.0..=353.0).contains(&setpoint.rpm) && (-1.0..=1.0).contains(&setpoint.steering)
    })
}

/// An emergency stop.
#[must_use]
pub fn estop(bytes: &[u8]) -> bool {
    message(bytes, |_: &Estop| true)
}

// No range holds a number that is not finite.
fn in_map(x_m: f64, y_m: f64) -> bool {
    [x_m, y_m].iter().all(|m| (-1000.0..=1000.0).contains(m))
}

fn is_angle(yaw_rad: f64) -> bool {
    (-7.0..=7.0).contains(&yaw_rad)
}

fn is_time(s: f64) -> bool {
    (0.0..=86_400.0).contains(&s)
}

fn message<M: Message + PartialEq + Debug>(bytes: &[u8], in_range: fn(&M) -> bool) -> bool {
    named::<M>(bytes);
    let mut accepted = false;
    for format in FORMATS {
        match decode::<M>(&encoding::<M>(format), bytes) {
            Ok((message, read_as)) => {
                accepted = true;
                assert_eq!(read_as, format);
                assert!(in_range(&message), "{message:?}");
                reads_back(&message);
                nothing_may_be_missing_or_too_much::<M>(bytes, format);
            }
            Err(error) => refused::<M>(&error, bytes.len()),
        }
    }
    accepted
}

fn reads_back<M: Message + PartialEq + Debug>(message: &M) {
    for format in FORMATS {
        let written = encode(message, format).unwrap_or_else(|error| panic!("{message:?}: {error}"));
        let (again, _) = decode::<M>(&encoding::<M>(format), &written)
            .unwrap_or_else(|error| panic!("{message:?} in {format:?}: {error}"));
        assert_eq!(&again, message, "{format:?}");
    }
}

fn nothing_may_be_missing_or_too_much<M: Message>(bytes: &[u8], format: Format) {
    let whole = bytes.trim_ascii_end(); // JSON may end in white space
    let cut = if format == Format::Json { &whole[..whole.len() - 1] } else { &bytes[..bytes.len() - 1] };
    for cut in [cut, &cut[..cut.len() / 2]] {
        let refused = decode::<M>(&encoding::<M>(format), cut).err().map(|error| error.code());
        assert_eq!(refused, Some(RejectCode::Malformed), "cut to {}", cut.len());
    }
    let longer = [bytes, b"}"].concat();
    assert!(decode::<M>(&encoding::<M>(format), &longer).is_err());
}

/// Up to the first line feed the input is the encoding, the rest the message.
fn named<M: Message>(bytes: &[u8]) {
    let Some(end) = bytes.iter().position(|byte| *byte == b'\n') else { return };
    let name = String::from_utf8_lossy(&bytes[..end]);
    let rest = &bytes[end + 1..];
    match decode::<M>(&name, rest) {
        Ok((_, Format::Postcard)) => assert_eq!(name, encoding::<M>(Format::Postcard)),
        Ok((_, Format::Json)) => {
            assert!(name.starts_with("application/json") || name.starts_with("text/json"))
        }
        Err(CodecError::Oversized { len, .. }) => assert!(len > M::MAX_BYTES),
        Err(error) => {
            assert!(rest.len() <= M::MAX_BYTES);
            is_answered(&error);
        }
    }
}

fn refused<M: Message>(error: &CodecError, len: usize) {
    let code = error.code();
    assert_eq!(code == RejectCode::Oversized, len > M::MAX_BYTES, "{error}");
    let known = [RejectCode::Malformed, RejectCode::OutOfRange, RejectCode::Oversized];
    assert!(known.contains(&code), "{error}");
    is_answered(error);
}

/// The refusal can be said to the client.
fn is_answered(error: &CodecError) {
    let text = error.to_string();
    assert!(!text.is_empty() && text.len() <= MAX_REFUSAL, "{} bytes: {text}", text.len());
    let reply = Reply::refused(Uuid::nil(), error.code(), text, "hint");
    for format in FORMATS {
        let bytes = encode(&reply, format).unwrap_or_else(|error| panic!("{reply:?}: {error}"));
        assert!(bytes.len() < codec::MAX_BYTES);
    }
}
