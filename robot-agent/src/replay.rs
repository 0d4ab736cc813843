//! Replays a recording: the same samples through the same controller give the same decisions, bit for
//! bit; with a changed parameter they show which decisions would have been others.

use serde::Serialize;
use serde_json::Value;
use xtb_control::{Controller, Stamp, VehicleConfig};
use xtb_protocol::trace::exact_decision_line;
use xtb_recording::Error;
use xtb_recording::robot::{RecordedStep, Recording, RecordingEnding, checksum};

/// Where recording and replay first differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// The step's stamp.
    pub t_s: f64,
    /// The step's number since boot.
    pub step: u64,
    /// The kind of its sample.
    pub sample: String,
    /// The stage that decided it: the first one on the way through the controller.
    pub stage: &'static str,
    /// The field, such as `pwm.motor`.
    pub field: String,
    /// As recorded.
    pub recorded: String,
    /// As replayed.
    pub replayed: String,
}

/// What a replay found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Whether every sample and every decision is the same.
    pub identical: bool,
    /// Steps that were compared.
    pub samples: u64,
    /// First difference of each kind: an altered sample, then a decision.
    pub differences: Vec<Difference>,
    /// How the file ends.
    pub ending: RecordingEnding,
}

/// Field in a decision, and the stage that decides it, in the order of the walk.
const STAGES: [(&str, &str); 12] = [
    ("t_ns", "input"),
    ("remote", "remote"),
    ("ir_cm", "infrared"),
    ("obstacle", "obstacle"),
    ("tilt_deg", "tilt"),
    ("rpm", "encoder"),
    ("pose", "odometry"),
    ("goto", "goto"),
    ("mode", "mode"),
    ("reference_rpm", "reference"),
    ("pwm.piston", "platform"),
    ("pwm", "outputs"),
];

/// Steps missing between two that were recorded: no replay beyond them can be trusted.
fn gap(expected: u64, step: &RecordedStep) -> Option<Difference> {
    (step.number != expected).then(|| Difference {
        t_s: 0.0,
        step: step.number,
        sample: step.kind.clone(),
        stage: "recorder",
        field: "n".into(),
        recorded: step.number.to_string(),
        replayed: format!("{expected}: the recorder dropped {}", step.number.abs_diff(expected)),
    })
}

/// Replays everything with `vehicle` and compares.
///
/// # Errors
/// The recording cannot be read.
pub fn compare(recording: &mut Recording, vehicle: VehicleConfig) -> Result<Comparison, Error> {
    let mut controller = Controller::new(vehicle);
    let mut found = Comparison {
        identical: true,
        samples: 0,
        differences: Vec::new(),
        ending: RecordingEnding::Complete,
    };
    let mut last = Stamp::ZERO;
    while let Some(step) = recording.next_step()? {
        if let Some(gap) = gap(found.samples, &step) {
            found.differences.push(Difference { t_s: last.s(), ..gap });
            break;
        }
        let altered = altered_sample(&step, last);
        let sample = step.sample();
        found.samples += 1;
        if let Some(altered) = altered
            && found.differences.is_empty()
        {
            found.differences.push(altered);
        }
        let (t, sample) = match sample {
            Ok(sample) => sample,
            Err(reason) if !found.differences.is_empty() => {
                if let Some(first) = found.differences.first_mut() {
                    first.replayed.push_str(&format!(" ({reason})"));
                }
                break;
            }
            Err(reason) => return Err(Error::Message { number: step.number, reason }),
        };
        last = t;
        let decided = exact_decision_line(&controller.step(t, &sample));
        if decided != step.decision {
            found.differences.push(first_difference(t, &step, &decided));
            break;
        }
    }
    found.identical = found.differences.is_empty();
    found.ending = recording.ending();
    Ok(found)
}

/// Why a step cannot be trusted: steps are missing before it, or its sample was altered.
#[must_use]
pub fn unusable(expected: u64, step: &RecordedStep, last: Stamp) -> Option<Difference> {
    let gap = gap(expected, step).map(|gap| Difference { t_s: last.s(), ..gap });
    gap.or_else(|| altered_sample(step, last))
}

/// A sample that is not the one that was recorded.
fn altered_sample(step: &RecordedStep, last: Stamp) -> Option<Difference> {
    let now = checksum(step.sample_message.as_bytes());
    (now != step.sample_crc).then(|| Difference {
        t_s: step.sample().map_or(last, |(t, _)| t).s(),
        step: step.number,
        sample: step.kind.clone(),
        stage: "input",
        field: "sample check sum".into(),
        recorded: format!("{:#010x}", step.sample_crc),
        replayed: format!("{now:#010x}"),
    })
}

/// The first field on the way through the controller in which two decisions differ.
fn first_difference(t: Stamp, step: &RecordedStep, decided: &str) -> Difference {
    let difference = |stage, field: String, recorded: String, replayed: String| Difference {
        t_s: t.s(),
        step: step.number,
        sample: step.kind.clone(),
        stage,
        field,
        recorded,
        replayed,
    };
    let (Some(recorded), Some(replayed)) = (fields(&step.decision), fields(decided)) else {
        return difference("text", "decision".into(), step.decision.clone(), decided.to_owned());
    };
    let value = |all: &[(String, Value)], field: &str| {
        all.iter().find(|(name, _)| name == field).map_or("absent".to_owned(), |(_, value)| value.to_string())
    };
    for (prefix, stage) in STAGES {
        let of_stage = |all: &[(String, Value)]| -> Vec<(String, Value)> {
            let inside = |name: &str| {
                name.strip_prefix(prefix)
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[', '_']))
            };
            all.iter().filter(|(name, _)| inside(name)).cloned().collect()
        };
        let (before, after) = (of_stage(&recorded), of_stage(&replayed));
        let differs = |(name, value): &&(String, Value)| !after.iter().any(|(n, v)| n == name && v == value);
        let appeared = |(name, _): &&(String, Value)| !before.iter().any(|(n, _)| n == name);
        if let Some((field, _)) = before.iter().find(differs).or_else(|| after.iter().find(appeared)) {
            let values = (value(&before, field), value(&after, field));
            return difference(stage, field.clone(), values.0, values.1);
        }
    }
    // The same values in other bytes: the recording was written by another program.
    difference("text", "decision".into(), step.decision.clone(), decided.to_owned())
}

/// An object's leaves with their paths; `None` if it is not JSON.
fn fields(text: &str) -> Option<Vec<(String, Value)>> {
    fn walk(path: String, value: &Value, into: &mut Vec<(String, Value)>) {
        match value {
            Value::Object(object) => {
                for (key, value) in object {
                    let dot = if path.is_empty() { "" } else { "." };
                    walk(format!("{path}{dot}{key}"), value, into);
                }
            }
            Value::Array(array) if array.iter().any(|value| !value.is_string()) => {
                for (i, value) in array.iter().enumerate() {
                    walk(format!("{path}[{i}]"), value, into);
                }
            }
            leaf => into.push((path, leaf.clone())),
        }
    }
    let mut leaves = Vec::new();
    walk(String::new(), &serde_json::from_str(text).ok()?, &mut leaves);
    Some(leaves)
}

/// Two spans of the same difference that are nearer than this are one.
const SPAN_GAP_S: f64 = 0.5;

/// A decision that would have been another one, for as long as it would have.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OtherDecision {
    /// What was decided: `mode`, `maneuver`, `arrived`, `motor`, `obstacle_front`, `obstacle_rear`.
    pub decision: &'static str,
    /// As recorded.
    pub recorded: String,
    /// As it would have been.
    pub replayed: String,
    /// From this time …
    pub from_s: f64,
    /// … to this one.
    pub to_s: f64,
    /// Steps in between that differ.
    pub steps: u64,
}

/// What a replay with other parameters found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WhatIf {
    /// Steps that were replayed.
    pub samples: u64,
    /// Steps in which any decision would have been another one.
    pub differing: u64,
    /// The decisions, in the order of their beginning.
    pub decisions: Vec<OtherDecision>,
    /// A gap or an altered sample, beyond which nothing is said.
    pub difference: Option<Difference>,
    /// How the file ends.
    pub ending: RecordingEnding,
}

/// The decisions of a step, by name: modes, manoeuvres, stops.
fn decisions(line: &str) -> Option<[(&'static str, String); 6]> {
    let value: Value = serde_json::from_str(line).ok()?;
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let motor = match value["pwm"]["motor"].as_u64()? {
        3750 => "stop",
        count if count > 3750 => "ahead",
        _ => "astern",
    };
    // After arrival the last manoeuvre is only remembered.
    let maneuver = if value["mode"] == "goto" { text(&value["goto"]["maneuver"]) } else { "none".to_owned() };
    Some([
        ("mode", text(&value["mode"])),
        ("maneuver", maneuver),
        ("arrived", text(&value["goto"]["arrived"])),
        ("motor", motor.to_owned()),
        ("obstacle_front", text(&value["obstacle"]["front"])),
        ("obstacle_rear", text(&value["obstacle"]["rear"])),
    ])
}

/// Feeds the recorded samples to a controller with other parameters and lists which decisions would
/// have been others. The samples stay those of the recorded drive: this shows what the controller
/// would have decided then, not where the truck would have gone.
///
/// # Errors
/// The recording cannot be read.
pub fn what_if(recording: &mut Recording, vehicle: VehicleConfig) -> Result<WhatIf, Error> {
    let mut controller = Controller::new(vehicle);
    let mut found = WhatIf {
        samples: 0,
        differing: 0,
        decisions: Vec::new(),
        difference: None,
        ending: RecordingEnding::Complete,
    };
    let mut open: [Option<OtherDecision>; 6] = std::array::from_fn(|_| None);
    let mut last = Stamp::ZERO;
    while let Some(step) = recording.next_step()? {
        if let Some(wrong) = unusable(found.samples, &step, last) {
            found.difference = Some(wrong);
            break;
        }
        let number = step.number;
        let (t, sample) = step.sample().map_err(|reason| Error::Message { number, reason })?;
        last = t;
        let decided = exact_decision_line(&controller.step(t, &sample));
        found.samples += 1;
        let pair = decisions(&step.decision).zip(decisions(&decided));
        let Some((before, after)) = pair else {
            let reason = "unreadable decision".to_owned();
            return Err(Error::Message { number, reason });
        };
        found.differing += u64::from(before != after);
        for (place, ((decision, recorded), (_, replayed))) in
            open.iter_mut().zip(before.into_iter().zip(after))
        {
            extend(place, &mut found.decisions, t, decision, recorded, replayed);
        }
    }
    found.decisions.extend(open.into_iter().flatten());
    found.decisions.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
    found.ending = recording.ending();
    Ok(found)
}

/// Lengthens, closes or opens the span of one decision.
fn extend(
    open: &mut Option<OtherDecision>,
    closed: &mut Vec<OtherDecision>,
    t: Stamp,
    decision: &'static str,
    recorded: String,
    replayed: String,
) {
    let same = recorded == replayed;
    match open {
        // A short agreement in between does not end it.
        Some(span) if same && t.s() - span.to_s < SPAN_GAP_S => return,
        Some(span) if span.recorded == recorded && span.replayed == replayed => {
            span.to_s = t.s();
            span.steps += 1;
            return;
        }
        _ => closed.extend(open.take()),
    }
    if !same {
        let (from_s, to_s) = (t.s(), t.s());
        *open = Some(OtherDecision { decision, recorded, replayed, from_s, to_s, steps: 1 });
    }
}
