//! The controller trace: one JSON object a line, samples in, decisions out.
//!
//! How vectors are checked, how a recording becomes something a person can read and diff, and how a
//! recording keeps its samples. `docs/trace.md` is the contract. Nothing is guessed: an unknown
//! field, a missing one, a count above 1023 or a stamp that goes back is an error.

mod decision;

#[cfg(feature = "schema")]
pub use decision::decision_schema;
pub use decision::{decision_line, exact_decision_line};

use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::marker::PhantomData;
use thiserror::Error;
use xtb_control::controller::{AdcSample, GyroSample, RemoteSample};
use xtb_control::goto::GotoGoal;
use xtb_control::units::OutOfRange;
use xtb_control::vehicle::{SLOTS, USUAL_SLOTS};
use xtb_control::{AdcCount, Command, Sample, Stamp, Steering, WheelRpm};

/// A line is not a sample.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TraceError {
    /// Not the JSON object that it should be.
    #[error("{0}")]
    Json(String),
    /// None, or more than one, of the sample's kinds.
    #[error("{0} of gyro, encoder, adc, remote and command in one line, exactly one is allowed")]
    Kinds(usize),
    /// None, or more than one, of the commands.
    #[error("a command is exactly one of idle, wander, goto, teleop and follow")]
    Commands,
    /// Older than the line before.
    #[error("t_ns {t_ns} is smaller than {before} in the line before")]
    Backwards {
        /// As read.
        t_ns: u64,
        /// Of the line before.
        before: u64,
    },
    /// A bumper with another number of channels than a scan holds.
    #[error("a bumper with {0} range finders, a scan holds 6 or 8 of each")]
    Channels(usize),
    /// A value out of its range.
    #[error("{0}")]
    Value(#[from] OutOfRange),
}

/// A JSON object, and nothing else: serde would also take the fields of a struct by position.
#[derive(Debug)]
struct Object<T>(T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Object<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Fields<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Fields<T> {
            type Value = Object<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(Object)
            }
        }
        deserializer.deserialize_map(Fields(PhantomData))
    }
}

impl<T: Serialize> Serialize for Object<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

#[derive(Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Line {
    t_ns: u64,
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "GyroLine"))]
    gyro: Option<Object<GyroLine>>,
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "EncoderLine"))]
    encoder: Option<Object<EncoderLine>>,
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "AdcLine"))]
    adc: Option<Object<AdcLine>>,
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "RemoteLine"))]
    remote: Option<Object<RemoteLine>>,
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "CommandLine"))]
    command: Option<Object<CommandLine>>,
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "ObstacleLine"))]
    obstacle: Option<Object<ObstacleLine>>,
}

/// A field that may be left out, but not be null.
fn present<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<Option<T>, D::Error> {
    T::deserialize(deserializer).map(Some)
}

/// A field that may be null, but not be left out.
fn nullable<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<Option<T>, D::Error> {
    Option::deserialize(deserializer)
}

#[derive(Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct GyroLine {
    roll: i16,
    pitch: i16,
    yaw: i16,
}

#[derive(Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct EncoderLine {
    pulses: u32,
}

#[derive(Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct AdcLine {
    #[cfg_attr(feature = "schema", schemars(length(min = 6, max = 8)))]
    ir_front: Vec<f64>,
    #[cfg_attr(feature = "schema", schemars(length(min = 6, max = 8)))]
    ir_rear: Vec<f64>,
    tilt: [f64; 2],
    pistons: [f64; 4],
}

#[derive(Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct RemoteLine {
    #[serde(deserialize_with = "nullable")]
    speed: Option<u32>,
    #[serde(deserialize_with = "nullable")]
    steering: Option<u32>,
    #[serde(deserialize_with = "nullable")]
    selector: Option<u32>,
}

#[derive(Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct ObstacleLine {
    threshold_cm: f64,
}

#[derive(Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct CommandLine {
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "NoFields"))]
    idle: Option<Object<NoFields>>,
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "NoFields"))]
    wander: Option<Object<NoFields>>,
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "GotoLine"))]
    goto: Option<Object<GotoLine>>,
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "DriveLine"))]
    teleop: Option<Object<DriveLine>>,
    #[serde(default, deserialize_with = "present", skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(with = "DriveLine"))]
    follow: Option<Object<DriveLine>>,
}

#[derive(Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct NoFields {}

#[derive(Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct GotoLine {
    x_m: f64,
    y_m: f64,
}

#[derive(Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct DriveLine {
    rpm: f64,
    steering: f64,
}

fn counts<const N: usize>(values: [f64; N]) -> Result<[AdcCount; N], OutOfRange> {
    let mut counts = [AdcCount::ZERO; N];
    for (count, value) in counts.iter_mut().zip(values) {
        *count = AdcCount::try_from(value)?;
    }
    Ok(counts)
}

/// A bumper's channels from six or eight numbers; those that are left out read 0.
fn bumper(values: &[f64]) -> Result<[AdcCount; SLOTS], TraceError> {
    let mut channels = [0.0; SLOTS];
    match values.len() {
        USUAL_SLOTS | SLOTS => channels[..values.len()].copy_from_slice(values),
        len => return Err(TraceError::Channels(len)),
    }
    Ok(counts(channels)?)
}

/// Both bumpers' channels, the seventh and eighth only if there is anything on one of them.
fn bumpers<T: Clone + Default + PartialEq>(front: &[T; SLOTS], rear: &[T; SLOTS]) -> [Vec<T>; 2] {
    let beyond = front[USUAL_SLOTS..].iter().chain(&rear[USUAL_SLOTS..]);
    let slots = if beyond.into_iter().all(|value| *value == T::default()) { USUAL_SLOTS } else { SLOTS };
    [front, rear].map(|side| side[..slots].to_vec())
}

impl Line {
    fn sample(self) -> Result<Sample, TraceError> {
        let kinds = usize::from(self.gyro.is_some())
            + usize::from(self.encoder.is_some())
            + usize::from(self.adc.is_some())
            + usize::from(self.remote.is_some())
            + usize::from(self.command.is_some())
            + usize::from(self.obstacle.is_some());
        let Self { gyro, encoder, adc, remote, command, obstacle, .. } = self;
        match (gyro, encoder, adc, remote, command, obstacle) {
            (Some(Object(GyroLine { roll, pitch, yaw })), None, None, None, None, None) => {
                Ok(Sample::Gyro(GyroSample { roll, pitch, yaw }))
            }
            (None, Some(Object(EncoderLine { pulses })), None, None, None, None) => {
                Ok(Sample::Encoder { pulses })
            }
            (None, None, Some(Object(adc)), None, None, None) => Ok(Sample::Adc(AdcSample {
                ir_front: bumper(&adc.ir_front)?,
                ir_rear: bumper(&adc.ir_rear)?,
                tilt: counts(adc.tilt)?,
                pistons: counts(adc.pistons)?,
            })),
            (None, None, None, Some(Object(RemoteLine { speed, steering, selector })), None, None) => {
                Ok(Sample::Remote(RemoteSample { speed, steering, selector }))
            }
            (None, None, None, None, Some(Object(command)), None) => Ok(Sample::Command(command.command()?)),
            (None, None, None, None, None, Some(Object(ObstacleLine { threshold_cm }))) => {
                Ok(Sample::Obstacle { threshold_cm })
            }
            _ => Err(TraceError::Kinds(kinds)),
        }
    }

    fn of(t: Stamp, sample: &Sample) -> Self {
        let mut line = Self { t_ns: t.ns(), ..Self::default() };
        match *sample {
            Sample::Gyro(GyroSample { roll, pitch, yaw }) => {
                line.gyro = Some(Object(GyroLine { roll, pitch, yaw }));
            }
            Sample::Encoder { pulses } => line.encoder = Some(Object(EncoderLine { pulses })),
            Sample::Adc(adc) => {
                let [front, rear] = [adc.ir_front, adc.ir_rear].map(|side| side.map(AdcCount::get));
                let [ir_front, ir_rear] = bumpers(&front, &rear);
                line.adc = Some(Object(AdcLine {
                    ir_front,
                    ir_rear,
                    tilt: adc.tilt.map(AdcCount::get),
                    pistons: adc.pistons.map(AdcCount::get),
                }));
            }
            Sample::Remote(RemoteSample { speed, steering, selector }) => {
                line.remote = Some(Object(RemoteLine { speed, steering, selector }));
            }
            Sample::Command(command) => line.command = Some(Object(CommandLine::of(&command))),
            Sample::Obstacle { threshold_cm } => line.obstacle = Some(Object(ObstacleLine { threshold_cm })),
        }
        line
    }
}

impl DriveLine {
    fn of(rpm: WheelRpm, steering: Steering) -> Object<Self> {
        Object(Self { rpm: rpm.get(), steering: steering.get() })
    }

    fn checked(&self) -> Result<(WheelRpm, Steering), OutOfRange> {
        Ok((WheelRpm::try_from(self.rpm)?, Steering::try_from(self.steering)?))
    }
}

impl CommandLine {
    fn command(self) -> Result<Command, TraceError> {
        let Self { idle, wander, goto, teleop, follow } = self;
        match (idle, wander, goto, teleop, follow) {
            (Some(_), None, None, None, None) => Ok(Command::Idle),
            (None, Some(_), None, None, None) => Ok(Command::Wander),
            (None, None, Some(Object(GotoLine { x_m, y_m })), None, None) => {
                Ok(Command::Goto(GotoGoal::new(x_m, y_m)?))
            }
            (None, None, None, Some(Object(line)), None) => {
                let (rpm, steering) = line.checked()?;
                Ok(Command::Teleop { rpm, steering })
            }
            (None, None, None, None, Some(Object(line))) => {
                let (rpm, steering) = line.checked()?;
                Ok(Command::Follow { rpm, steering })
            }
            _ => Err(TraceError::Commands),
        }
    }

    fn of(command: &Command) -> Self {
        let mut line = Self::default();
        match *command {
            Command::Idle => line.idle = Some(Object(NoFields {})),
            Command::Wander => line.wander = Some(Object(NoFields {})),
            Command::Goto(goal) => {
                line.goto = Some(Object(GotoLine { x_m: goal.x_m(), y_m: goal.y_m() }));
            }
            Command::Teleop { rpm, steering } => line.teleop = Some(DriveLine::of(rpm, steering)),
            Command::Follow { rpm, steering } => line.follow = Some(DriveLine::of(rpm, steering)),
        }
        line
    }
}

/// Reads the lines of a trace, in order.
#[derive(Debug, Clone, Default)]
pub struct TraceReader {
    before: u64,
}

impl TraceReader {
    /// The sample of the next line.
    ///
    /// # Errors
    /// [`TraceError`]; the line counts as not read.
    pub fn line(&mut self, text: &str) -> Result<(Stamp, Sample), TraceError> {
        let Object(line): Object<Line> = serde_json::from_str(text).map_err(|error| {
            // A trace is read line by line: the parser's own "line 1" would mislead.
            TraceError::Json(error.to_string().replace(" at line 1 column ", ", column "))
        })?;
        let t_ns = line.t_ns;
        if t_ns < self.before {
            return Err(TraceError::Backwards { t_ns, before: self.before });
        }
        let sample = line.sample()?;
        self.before = t_ns;
        Ok((Stamp::from_ns(t_ns), sample))
    }
}

/// A sample as a line, without the newline; every number in full.
#[must_use]
pub fn sample_line(t: Stamp, sample: &Sample) -> String {
    // Plain numbers and strings always serialise.
    serde_json::to_string(&Line::of(t, sample)).unwrap_or_default()
}

/// JSON Schema of the lines of samples. Each kind is a field that may be left out; a line has exactly one.
#[cfg(feature = "schema")]
#[must_use]
pub fn sample_schema(generator: schemars::SchemaGenerator) -> schemars::Schema {
    generator.into_root_schema_for::<Line>()
}

/// Which of the sample's kinds, as the trace names it.
#[must_use]
pub fn kind(sample: &Sample) -> &'static str {
    match sample {
        Sample::Gyro(_) => "gyro",
        Sample::Encoder { .. } => "encoder",
        Sample::Adc(_) => "adc",
        Sample::Remote(_) => "remote",
        Sample::Command(_) => "command",
        Sample::Obstacle { .. } => "obstacle",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        TraceReader::default().line(text).unwrap_err().to_string()
    }

    #[test]
    fn a_sample_reads_back_as_the_line_it_was_written_to() {
        for text in [
            r#"{"t_ns":1,"gyro":{"roll":-1,"pitch":2,"yaw":-32768}}"#,
            r#"{"t_ns":2,"encoder":{"pulses":23}}"#,
            r#"{"t_ns":3,"adc":{"ir_front":[0.0,1.0,2.0,3.0,4.0,1023.0],"ir_rear":[0.0,0.0,0.0,0.0,0.0,0.0],"tilt":[512.015625,3.0],"pistons":[1.0,2.0,3.0,4.0]}}"#,
            r#"{"t_ns":3,"adc":{"ir_front":[0.0,1.0,2.0,3.0,4.0,1023.0,60.0,0.0],"ir_rear":[0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0],"tilt":[512.0,3.0],"pistons":[1.0,2.0,3.0,4.0]}}"#,
            r#"{"t_ns":4,"remote":{"speed":938,"steering":null,"selector":58275}}"#,
            r#"{"t_ns":5,"command":{"idle":{}}}"#,
            r#"{"t_ns":6,"command":{"goto":{"x_m":0.1,"y_m":-2.0}}}"#,
            r#"{"t_ns":7,"command":{"teleop":{"rpm":-13.3,"steering":0.7}}}"#,
            r#"{"t_ns":8,"command":{"follow":{"rpm":40.5,"steering":-0.2}}}"#,
        ] {
            let (t, sample) = TraceReader::default().line(text).unwrap();
            assert_eq!(sample_line(t, &sample), text);
        }
    }

    #[test]
    fn what_is_malformed_is_named() {
        assert!(error("{").contains("EOF"));
        assert!(error(r#"{"t_ns":1,"gyros":{}}"#).contains("gyros"));
        assert_eq!(
            error(r#"{"t_ns":1}"#),
            "0 of gyro, encoder, adc, remote and command in one line, exactly one is allowed"
        );
        assert!(error(r#"{"t_ns":1,"encoder":{"pulses":1},"command":{"idle":{}}}"#).starts_with("2 of"));
        assert!(error(r#"{"t_ns":1,"remote":{"speed":1,"steering":2}}"#).contains("selector"));
        assert!(error(r#"{"t_ns":1,"gyro":null}"#).contains("null"));
        assert!(error(r#"{"t_ns":1,"gyro":[0,0,0]}"#).contains("an object"));
        assert!(error(r#"[1,{"roll":0,"pitch":0,"yaw":0}]"#).contains("an object"));
        assert!(error(r#"{"t_ns":1,"command":{"goto":[1,1]}}"#).contains("an object"));
        assert!(error(r#"{"t_ns":1,"command":{"idle":{},"wander":{}}}"#).contains("exactly one"));
        assert!(error(r#"{"t_ns":1,"command":{"goto":{"x_m":1e999,"y_m":0}}}"#).contains("out of range"));
        assert_eq!(
            error(r#"{"t_ns":1,"command":{"teleop":{"rpm":1,"steering":1.1}}}"#),
            "steering 1.1 is outside -1..=1 of full lock"
        );
        assert_eq!(
            error(r#"{"t_ns":1,"command":{"follow":{"rpm":354,"steering":0}}}"#),
            "wheel speed 354 is outside -353..=353 rpm"
        );
        assert!(error(r#"{"t_ns":1,"command":{"follow":{"rpm":1}}}"#).contains("steering"));
        let adc = r#"{"t_ns":1,"adc":{"ir_front":[0,0,0,0,0,1024],"ir_rear":[0,0,0,0,0,0],"tilt":[0,0],"pistons":[0,0,0,0]}}"#;
        assert_eq!(error(adc), "ADC count 1024 is outside 0..=1023 counts");
        assert_eq!(
            error(&adc.replace("0,0,1024", "0,0")),
            "a bumper with 5 range finders, a scan holds 6 or 8 of each"
        );
    }

    #[test]
    fn a_stamp_may_stand_still_but_not_go_back() {
        let mut reader = TraceReader::default();
        reader.line(r#"{"t_ns":5,"encoder":{"pulses":1}}"#).unwrap();
        reader.line(r#"{"t_ns":5,"encoder":{"pulses":1}}"#).unwrap();
        let error = reader.line(r#"{"t_ns":4,"encoder":{"pulses":1}}"#).unwrap_err();
        assert_eq!(error, TraceError::Backwards { t_ns: 4, before: 5 });
    }
}
