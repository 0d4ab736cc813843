//! The version of the wire before: what its programs wrote, as they wrote it, is read today, and said again in their
//! version it has their bytes. `wire_6.txt` was printed by the tests of that version and is never edited to pass. When
//! the wire changes, a file with today's bytes takes its place.

use xtb_protocol::Uuid;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{
    About, AckReply, AckRequest, DispatchBody, DispatchCode, DispatchError, DispatchOutcome, DispatchReply,
    DispatchRequest, Estop, Estopped, Event, Fix, FleetAlerts, FleetHomes, FleetMap, FleetPlaces,
    HistoryReply, HistoryRequest, IdentityStatus, LogReply, LogRequest, MapEdit, MapEditReply, MapHistory,
    Message, NearState, ParamReply, ParamRequest, Reply, Request, RobotState, Roster, Route, Sensors,
    Setpoint, SimStats, StandbyReply, StandbyRequest, TaskChange, TaskEvent, TaskId, TaskList, TaskState,
    TrafficState, Truth, Waypoint,
};
use xtb_protocol::wire::{CodecError, WIRE};

/// A line each: the type; `json` or the version; the JSON or the bytes.
const SAID: &str = include_str!("wire_6.txt");

/// An encoding and bytes in it.
type Said = (String, Vec<u8>);

/// What a version of the wire is, and what was said in the one before.
struct Kind {
    name: &'static str,
    /// Today's.
    version: u32,
    /// Reads a message and says it again.
    again: fn(&str, &[u8]) -> Result<Said, CodecError>,
}

fn kind<M: Message>() -> Kind {
    let again = |written: &str, bytes: &[u8]| {
        let (message, format) = decode::<M>(written, bytes)?;
        Ok((encoding::<M>(format), encode(&message, format)?))
    };
    Kind { name: M::NAME, version: M::VERSION, again }
}

/// Every type that the programs of before had.
fn kinds() -> Vec<Kind> {
    vec![
        kind::<About>(),
        kind::<AckReply>(),
        kind::<AckRequest>(),
        kind::<DispatchReply>(),
        kind::<DispatchRequest>(),
        kind::<Estop>(),
        kind::<Estopped>(),
        kind::<Event>(),
        kind::<Fix>(),
        kind::<FleetAlerts>(),
        kind::<FleetHomes>(),
        kind::<FleetMap>(),
        kind::<FleetPlaces>(),
        kind::<HistoryReply>(),
        kind::<HistoryRequest>(),
        kind::<IdentityStatus>(),
        kind::<LogReply>(),
        kind::<LogRequest>(),
        kind::<MapEdit>(),
        kind::<MapEditReply>(),
        kind::<MapHistory>(),
        kind::<NearState>(),
        kind::<ParamReply>(),
        kind::<ParamRequest>(),
        kind::<Reply>(),
        kind::<Request>(),
        kind::<RobotState>(),
        kind::<Roster>(),
        kind::<Route>(),
        kind::<Sensors>(),
        kind::<Setpoint>(),
        kind::<SimStats>(),
        kind::<StandbyReply>(),
        kind::<StandbyRequest>(),
        kind::<TaskEvent>(),
        kind::<TaskList>(),
        kind::<TrafficState>(),
        kind::<Truth>(),
    ]
}

fn unhex(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect()
}

/// Whoever raises one of these raises [`WIRE`] too.
#[test]
fn this_version_of_the_wire_is_these_versions_of_the_types() {
    let versions: Vec<String> =
        kinds().iter().map(|kind| format!("{} {}", kind.name, kind.version)).collect();
    assert_eq!(WIRE, 7);
    assert_eq!(
        versions.join(", "),
        concat!(
            "About 1, AckReply 1, AckRequest 1, DispatchReply 3, DispatchRequest 3, Estop 1, Estopped 1, Event 4, ",
            "Fix 1, FleetAlerts 1, FleetHomes 1, FleetMap 1, FleetPlaces 1, HistoryReply 1, HistoryRequest 1, ",
            "IdentityStatus 2, LogReply 2, LogRequest 1, MapEdit 1, MapEditReply 1, MapHistory 1, NearState 1, ",
            "ParamReply 1, ParamRequest 1, Reply 1, Request 2, RobotState 5, Roster 1, Route 1, Sensors 3, ",
            "Setpoint 1, SimStats 1, StandbyReply 1, StandbyRequest 1, TaskEvent 1, TaskList 2, TrafficState 1, ",
            "Truth 1",
        )
    );
}

#[test]
fn every_message_of_the_version_before_is_read_and_has_its_bytes_when_it_is_said_again() {
    for Kind { name, version, again } in kinds() {
        let mut said = 0;
        for line in SAID.lines().filter(|line| line.split(' ').next() == Some(name)) {
            let (_, rest) = line.split_once(' ').unwrap();
            let (written, bytes) = match rest.split_once(' ').unwrap() {
                ("json", text) => ("application/json".to_owned(), text.as_bytes().to_vec()),
                (old, hex) => {
                    assert!(version.abs_diff(old.parse().unwrap()) <= 1, "{name} {old}");
                    (format!("application/x-postcard;xtb.{name}.v{old}"), unhex(hex))
                }
            };
            let (encoding, repeated) =
                again(&written, &bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
            // JSON may hold more today: what is left out has a default.
            if written != "application/json" {
                assert_eq!((encoding, repeated), (written, bytes), "{name}");
            }
            said += 1;
        }
        assert!(said > 0, "nothing of {name}");
    }
}

#[test]
fn what_the_version_before_has_no_words_for_is_not_said_in_it_nor_read() {
    let id = Uuid::from_u128(7);
    let points = vec![Waypoint { x_m: 1.0, y_m: 0.0, yaw_rad: None }];
    let extend =
        DispatchRequest { id, body: DispatchBody::Extend { task: TaskId::new(1), after: 2, points } };
    too_new(&extend);
    let error = DispatchError { code: DispatchCode::Stale, message: "m".to_owned(), hint: "h".to_owned() };
    let change =
        TaskChange { id: TaskId::new(1), state: Some(TaskState::Running), error: Some(error.clone()) };
    for result in [DispatchOutcome::Error(error), DispatchOutcome::Changed(vec![change])] {
        too_new(&DispatchReply { id, result, left_out: 0, suspended: Vec::new() });
    }
}

fn too_new<M: Message>(message: &M) {
    let refused = encode(message, Format::Previous).unwrap_err();
    assert!(matches!(refused, CodecError::TooNew { .. }), "{refused}");
    let bytes = encode(message, Format::Postcard).unwrap();
    let read = decode::<M>(&encoding::<M>(Format::Previous), &bytes);
    assert!(matches!(read, Err(CodecError::TooNew { .. })), "a layout that it did not have");
}

#[test]
fn versions_before_that_and_of_the_future_are_refused() {
    for Kind { name, version, again } in kinds() {
        for other in [0, version.saturating_sub(2), version + 1] {
            let refused = again(&format!("application/x-postcard;xtb.{name}.v{other}"), &[]).unwrap_err();
            assert!(matches!(refused, CodecError::WrongVersion { .. }), "{name} {other}: {refused}");
        }
    }
}

#[test]
fn what_a_robot_has_not_cannot_be_said_of_a_robot_of_before() {
    let said = |text: &str| decode::<Sensors>("application/json", text.as_bytes()).unwrap().0;
    let line = SAID.lines().find_map(|line| line.strip_prefix("Sensors json ")).unwrap();
    assert!(encode(&said(line), Format::Previous).is_ok());
    for without in [
        line.replace(r#""tilt":[512.5,513.0]"#, r#""tilt":null"#),
        line.replace(r#""remote":[938,null,58275]"#, r#""remote":null"#),
        line.replace("[1,1,1,1,1,1]", "[1]").replace("[null,null,null,null,null,null]", "[null]"),
    ] {
        assert_ne!(line, without);
        let refused = encode(&said(&without), Format::Previous).unwrap_err();
        assert!(matches!(refused, CodecError::TooNew { version: 2, .. }), "{refused}");
    }
}

/// Types of which nothing changed are the same in both: nobody is asked in which version it is.
#[test]
fn a_type_that_stayed_as_it_was_has_one_encoding() {
    assert_eq!(encoding::<Request>(Format::Previous), encoding::<Request>(Format::Postcard));
    assert_eq!(
        encoding::<DispatchRequest>(Format::Previous),
        "application/x-postcard;xtb.DispatchRequest.v2"
    );
}
