//! Values on the command line: numbers with units and ranges, and names.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::time::{Duration, SystemTime};
use xtb_protocol::messages::{HistoryKind, Latch};

/// The latches by name: completions know them, so they must be written down.
pub(crate) const LATCHES: [&str; Latch::ALL.len()] =
    ["estop", "remote_takeover", "board_lost", "gyro_lost", "runaway", "sensor_fault", "battery_critical"];

pub(crate) fn latch() -> impl TypedValueParser<Value = Latch> {
    PossibleValuesParser::new(LATCHES).try_map(|name| name.parse::<Latch>())
}

pub(crate) fn history_kind() -> impl TypedValueParser<Value = HistoryKind> {
    PossibleValuesParser::new(HistoryKind::ALL.map(HistoryKind::as_str)).try_map(|name| {
        let kind = HistoryKind::ALL.into_iter().find(|kind| kind.as_str() == name);
        kind.ok_or_else(|| format!("no kind of event: {name}"))
    })
}

pub(crate) fn number(text: &str, min: f64, max: f64, unit: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (min..=max).contains(&value) => Ok(value),
        _ => Err(format!("expected a number of {unit} within {min}..={max}")),
    }
}

pub(crate) fn seconds(text: &str) -> Result<Duration, String> {
    number(text, 0.01, 86_400.0, "seconds").map(Duration::from_secs_f64)
}

/// A time, or how long ago.
pub(crate) fn moment(text: &str) -> Result<SystemTime, String> {
    let ago = || SystemTime::now().checked_sub(humantime::parse_duration(text).ok()?);
    let at = humantime::parse_rfc3339_weak(text).ok().or_else(ago);
    at.ok_or_else(|| "expected a time such as 2026-11-24T08:00:00Z, or a duration such as 24h".to_owned())
}

/// Seconds from 0 to a day.
pub(crate) fn part_of_a_day(text: &str) -> Result<f64, String> {
    number(text, 0.0, 86_400.0, "seconds")
}

pub(crate) fn metres(text: &str) -> Result<f64, String> {
    let most = xtb_protocol::messages::MAX_COORDINATE_M;
    number(text, -most, most, "metres")
}

/// Between the middles of two robots.
pub(crate) fn apart(text: &str) -> Result<f64, String> {
    number(text, 0.3, 20.0, "metres")
}

/// A `ROS_DOMAIN_ID`.
pub(crate) fn ros_domain() -> impl TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(0..=232)
}

pub(crate) fn fix_rate(text: &str) -> Result<f64, String> {
    number(text, 0.0, 50.0, "Hz")
}

pub(crate) fn fix_noise(text: &str) -> Result<f64, String> {
    number(text, 0.001, 10.0, "metres")
}

pub(crate) fn part(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1.0, "").map_err(|_| "expected a number within 0..=1".to_owned())
}

pub(crate) fn drop_outs(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1.0e6, "seconds")
}

pub(crate) fn degrees(text: &str) -> Result<f64, String> {
    number(text, -360.0, 360.0, "degrees")
}

pub(crate) fn rpm(text: &str) -> Result<f64, String> {
    number(text, 1.0, xtb_control::WheelRpm::MAX, "rpm")
}
