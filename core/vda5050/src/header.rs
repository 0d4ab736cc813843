//! Headers, topics and the message `connection`.

use crate::protocol::Protocol;
use serde_json::{Map, Value, json};
use std::time::{Duration, SystemTime};
use xtb_protocol::Name;

/// Characters of an interface's or a manufacturer's name at most.
pub const MAX_LEVEL: usize = 64;

/// Who a robot is towards a master control.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Serial {
    /// Which version is spoken.
    pub protocol: Protocol,
    /// The first level of topics.
    pub interface: String,
    /// The manufacturer.
    pub manufacturer: String,
    /// The serial number: the robot's name.
    pub robot: Name,
}

/// Whether a text may be a level of a topic: 1 to [`MAX_LEVEL`] letters, digits, `_`, `-`, `.` and `:`.
#[must_use]
pub fn is_level(text: &str) -> bool {
    let allowed = |b: u8| b.is_ascii_alphanumeric() || b"_-.:".contains(&b);
    (1..=MAX_LEVEL).contains(&text.len()) && text.bytes().all(allowed)
}

/// Whether the broker still hears a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Connection {
    /// It does, and the robot is there.
    Online,
    /// The bridge was ended.
    Offline,
    /// The robot, or the bridge, is gone without a word.
    Broken,
}

impl Serial {
    /// The topic of a message, such as `uagv/v2/xtb/xtb-1/order`.
    #[must_use]
    pub fn topic(&self, name: &str) -> String {
        let Self { protocol, interface, manufacturer, robot } = self;
        format!("{interface}/{}/{manufacturer}/{robot}/{name}", protocol.topic_level())
    }

    /// The beginning of every message. `id` counts the messages of a topic, `now_ms` is in ms since 1970.
    #[must_use]
    pub fn header(&self, id: u32, now_ms: u64) -> Map<String, Value> {
        let header = json!({
            "headerId": id,
            "timestamp": timestamp(now_ms),
            "version": self.protocol.version(),
            "manufacturer": self.manufacturer,
            "serialNumber": self.robot.as_str(),
        });
        match header {
            Value::Object(header) => header,
            _ => Map::new(),
        }
    }

    /// The message `connection`.
    #[must_use]
    pub fn connection(&self, id: u32, now_ms: u64, connection: Connection) -> Value {
        let state = match connection {
            Connection::Online => "ONLINE",
            Connection::Offline => "OFFLINE",
            Connection::Broken => self.protocol.pick("CONNECTIONBROKEN", "CONNECTION_BROKEN"),
        };
        let mut message = self.header(id, now_ms);
        message.insert("connectionState".to_owned(), json!(state));
        Value::Object(message)
    }
}

/// ISO 8601 in UTC, to the millisecond.
#[must_use]
pub fn timestamp(now_ms: u64) -> String {
    // Later years have no four digits.
    let now_ms = now_ms.min(253_402_300_799_999);
    humantime::format_rfc3339_millis(SystemTime::UNIX_EPOCH + Duration::from_millis(now_ms)).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_and_times_are_as_the_standard_writes_them() {
        let robot = Name::new("xtb-1").unwrap_or_else(|error| panic!("{error}"));
        let serial = |protocol: Protocol| Serial {
            protocol,
            interface: protocol.interface().to_owned(),
            manufacturer: "xtb".to_owned(),
            robot: robot.clone(),
        };
        assert_eq!(serial(Protocol::V2_1).topic("order"), "uagv/v2/xtb/xtb-1/order");
        assert_eq!(serial(Protocol::V3_0).topic("state"), "vda5050/v3/xtb/xtb-1/state");
        assert_eq!(timestamp(1_790_000_000_123), "2026-09-21T14:13:20.123Z");
        assert!(timestamp(u64::MAX).starts_with("9999-"));
        for bad in ["", "a/b", "+", "#", "a b", "ä", &"x".repeat(65)] {
            assert!(!is_level(bad), "{bad}");
        }
        assert!(is_level("RobotCompany_1.0"));
    }
}
