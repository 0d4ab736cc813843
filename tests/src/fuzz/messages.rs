//! Messages from the network: requests, questions to the dispatcher, setpoints, emergency stops, pose fixes, routes,
//! states, what robots tell those near them.

use std::fmt::Debug;
use xtb_protocol::Uuid;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{
    Assignment, Body, DispatchBody, DispatchRequest, Estop, Fix, MAX_POINTS, MAX_PRIORITY, MAX_SUBMISSION,
    Message, NearState, RejectCode, Reply, Request, RobotState, Route, Setpoint, TaskAction, TaskSpec, Track,
    TrafficState, Waypoint,
};
use xtb_protocol::wire::CodecError;

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
        Body::Assign { assignment, errand, finish_s, .. } => {
            let known = Assignment::of_goal(assignment.ledger, assignment.goal_id());
            known == Some((assignment.assign_seq, assignment.leg)) && is_errand(&errand) && is_time(finish_s)
        }
        Body::SetPose { x_m, y_m, yaw_rad } => in_map(x_m, y_m) && is_angle(yaw_rad),
        _ => true,
    })
}

fn is_errand(errand: &TaskAction) -> bool {
    match *errand {
        TaskAction::Goto { x_m, y_m, yaw_rad, .. } => in_map(x_m, y_m) && yaw_rad.is_none_or(is_angle),
        TaskAction::Wander { for_s } => is_time(for_s),
    }
}

fn is_point(at: &Waypoint) -> bool {
    in_map(at.x_m, at.y_m) && at.yaw_rad.is_none_or(is_angle)
}

fn is_task(task: &TaskSpec) -> bool {
    let points = task.kind.points();
    points.len() <= MAX_POINTS
        && points.iter().all(is_point)
        && task.priority <= MAX_PRIORITY
        && is_time(task.finish_s)
        && is_time(task.grace_s)
}

/// A question to the dispatcher.
#[must_use]
pub fn dispatch(bytes: &[u8]) -> bool {
    message(bytes, |request: &DispatchRequest| match &request.body {
        DispatchBody::Submit { tasks } => {
            (1..=MAX_SUBMISSION).contains(&tasks.len()) && tasks.iter().all(is_task)
        }
        DispatchBody::Cancel { tasks }
        | DispatchBody::Pause { tasks }
        | DispatchBody::Resume { tasks }
        | DispatchBody::Retry { tasks } => (1..=MAX_SUBMISSION).contains(&tasks.len()),
        DispatchBody::Extend { after, points, .. } => {
            *after as usize <= MAX_POINTS
                && (1..=MAX_POINTS).contains(&points.len())
                && points.iter().all(is_point)
        }
        DispatchBody::Show { .. }
        | DispatchBody::CancelAll {}
        | DispatchBody::Activate {}
        | DispatchBody::Adopt {}
        | DispatchBody::Status {} => true,
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

/// A pose fix.
#[must_use]
pub fn fix(bytes: &[u8]) -> bool {
    message(bytes, |fix: &Fix| {
        in_map(fix.x_m, fix.y_m)
            && fix.yaw_rad.is_none_or(is_angle)
            && (0.001..=100.0).contains(&fix.sigma_m)
            && (0.001..=7.0).contains(&fix.sigma_yaw_rad)
    })
}

/// What traffic control tells a robot.
#[must_use]
pub fn route(bytes: &[u8]) -> bool {
    message(bytes, |route: &Route| {
        route.track.as_ref().is_none_or(is_track)
            && route.others.len() <= Route::MOST_OTHERS
            && route.others.iter().all(|pose| in_map(pose.x_m, pose.y_m) && is_angle(pose.yaw_rad))
            && (0.0..=1.0e5).contains(&route.release_m)
            && (0.0..=2.0).contains(&route.cruise_mps)
    })
}

/// What a robot tells those near it.
#[must_use]
pub fn near(bytes: &[u8]) -> bool {
    message(bytes, |near: &NearState| {
        let way = near.way.as_ref();
        way.is_none_or(|way| is_track(&way.track) && way.done_m.is_finite() && way.release_m.is_finite())
            && [near.x_m, near.y_m, near.yaw_rad, near.speed_mps].iter().all(|value| value.is_finite())
    })
}

/// What traffic control says of itself.
#[must_use]
pub fn traffic(bytes: &[u8]) -> bool {
    message(bytes, |_: &TrafficState| true)
}

/// A robot's state, as every client and traffic control read it.
#[must_use]
pub fn robot_state(bytes: &[u8]) -> bool {
    message(bytes, |state: &RobotState| {
        let track = state.nav.route.as_ref().and_then(|route| route.track.as_ref());
        track.is_none_or(is_track) && [state.pose.x_m, state.pose.y_m].iter().all(|m| m.is_finite())
    })
}

fn is_track(track: &Track) -> bool {
    let bent = |curvature_per_m: f64| (-50.0..=50.0).contains(&curvature_per_m);
    in_map(track.start.x_m, track.start.y_m)
        && track.arcs.len() <= Track::MOST_ARCS
        && track.arcs.iter().all(|arc| arc.length_m.abs() <= 1000.0 && bent(arc.curvature_per_m))
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

/// Reads bytes as a message in both formats.
pub(super) fn message<M: Message + PartialEq + Debug>(bytes: &[u8], in_range: fn(&M) -> bool) -> bool {
    named::<M>(bytes);
    let mut accepted = false;
    for format in FORMATS {
        match decode::<M>(&encoding::<M>(format), bytes) {
            Ok((message, read_as)) => {
                accepted = true;
                assert_eq!(read_as, format);
                assert!(in_range(&message), "{message:?}");
                reads_back(&message, bytes.len());
                nothing_may_be_missing_or_too_much::<M>(bytes, format);
            }
            Err(error) => refused::<M>(&error, bytes.len()),
        }
    }
    accepted
}

/// A long message may be too long in the other format, where one byte becomes six (`\\u0001`) or more.
fn reads_back<M: Message + PartialEq + Debug>(message: &M, len: usize) {
    for format in FORMATS {
        let written = match encode(message, format) {
            Ok(written) => written,
            Err(CodecError::Oversized { .. }) if len > M::MAX_BYTES / 16 => continue,
            Err(error) => panic!("{message:?}: {error}"),
        };
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
        Ok((_, format @ (Format::Postcard | Format::Previous))) => assert_eq!(name, encoding::<M>(format)),
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
        assert!(bytes.len() < xtb_protocol::wire::MAX_BYTES);
    }
}
