//! What a robot said of itself, in its own recording: who has control, goals, latches, changed settings. The ground for
//! an audit.

use super::{Header, PARAMS, Recording};
use crate::error::Error;
use serde::de::DeserializeOwned;
use std::path::Path;
use xtb_protocol::messages::{Event, ParamChange};

/// The topic of events.
pub const EVENTS: &str = "event";

/// An event's message; `number` is that of the last step before it.
///
/// # Errors
/// The event cannot be written as JSON.
pub fn message(number: u64, event: &Event) -> serde_json::Result<String> {
    Ok(super::with_number(number, "", &serde_json::to_string(event)?))
}

/// Events of a recording, each with its time since boot in ns.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedEvents {
    /// Who recorded what.
    pub header: Header,
    /// When the recording begins on the robot's clock, in ns since boot.
    pub began_ns: u64,
    /// The events, in their order.
    pub events: Vec<(u64, Event)>,
    /// Settings that were changed while it ran, in their order.
    pub params: Vec<(u64, ParamChange)>,
}

/// Reads a recording's events.
///
/// # Errors
/// It cannot be read, or is no recording of a robot. A cut is no error, and neither are events of a later version:
/// they are left out.
pub fn read(path: &Path) -> Result<RecordedEvents, Error> {
    let mut recording = Recording::open(path)?;
    let header = recording.header().cloned().ok_or_else(|| Error::NotOfARobot("it has no header".into()))?;
    let (mut began_ns, mut events, mut params) = (None, Vec::new(), Vec::new());
    while let Some((topic, log_ns, text)) = recording.next_timed()? {
        began_ns.get_or_insert(log_ns);
        match topic.as_str() {
            EVENTS => events.extend(numbered(&text).map(|event| (log_ns, event))),
            PARAMS => params.extend(numbered(&text).map(|change| (log_ns, change))),
            _ => {}
        }
    }
    Ok(RecordedEvents { header, began_ns: began_ns.unwrap_or_default(), events, params })
}

/// What follows the number of a message.
fn numbered<T: DeserializeOwned>(text: &str) -> Option<T> {
    let (_, rest) = super::take_number(text.strip_prefix('{')?, "n")?;
    serde_json::from_str(&format!("{{{rest}")).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::writer::StepWriter;
    use xtb_control::{Controller, Sample, Stamp, VehicleConfig};
    use xtb_protocol::Name;
    use xtb_protocol::keys::FleetKeys;
    use xtb_protocol::messages::EventKind;
    use xtb_robot::step_log::Step;

    #[test]
    fn events_are_read_back_and_do_not_disturb_the_steps() {
        let folder = tempfile::tempdir().unwrap();
        let name = |text: &str| Name::new(text).unwrap();
        let header = Header {
            version: "1".into(),
            fleet: "lab".into(),
            robot: "xtb-1".into(),
            epoch: 7,
            started: "2026-11-24T08:00:00Z".into(),
            vehicle_toml: String::new(),
        };
        let path = folder.path().join("xtb-1.mcap");
        let mut writer =
            StepWriter::create(&path, &header, &FleetKeys::new(name("lab")).robot(&name("xtb-1"))).unwrap();
        let event = Event {
            robot: name("xtb-1"),
            epoch: 7,
            seq: 1,
            tick_ms: 20,
            kind: EventKind::Lease { holder: Some(name("alice-1")) },
        };
        let change = ParamChange {
            tick_ms: 20,
            age_ms: 0,
            by: name("bob-1"),
            name: "navigation.drive.limit_mps".into(),
            from: 1.0,
            to: 0.2,
        };
        let sample = Sample::Encoder { pulses: 1 };
        for number in 0..3 {
            let t = Stamp::from_ms(10 + 10 * number);
            let outputs = Controller::new(VehicleConfig::default()).step(t, &sample);
            writer.write(&Step { number, t, sample, outputs }).unwrap();
            if number == 1 {
                writer.write_event(t, &event).unwrap();
                writer.write_param(t, &change).unwrap();
            }
        }
        writer.finish().unwrap();
        let told = read(&path).unwrap();
        assert_eq!((told.header, told.began_ns), (header, 10_000_000));
        assert_eq!(told.events, [(20_000_000, event)]);
        assert_eq!(told.params, [(20_000_000, change)]);
        let mut recording = Recording::open(&path).unwrap();
        for number in 0..3 {
            assert_eq!(recording.next_step().unwrap().unwrap().number, number);
        }
        assert_eq!(recording.next_step().unwrap(), None);
    }
}
