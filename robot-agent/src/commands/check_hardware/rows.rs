//! The table of `check-hardware`: one row a thing, with a verdict and what to do.

mod imu;

use robot_agent::config::ConfigFile;
use serde::Serialize;
use xtb_control::infrared::BumperRanges;
use xtb_control::pistons::height_m;
use xtb_control::remote::{TickReading, reading};
use xtb_control::speed::wheel_rpm;
use xtb_control::units::PWM_PERIOD_COUNTS;
use xtb_control::vehicle::{BumperFinders, Platform, SLOTS};
use xtb_control::{AdcCount, Outputs};
use xtb_protocol::board::{BoardStatus, UnknownFirmware};
use xtb_protocol::messages::{Fault, FaultState};
use xtb_robot::robot::Readings;

/// The tilt sensor is linear up to here, in degrees (§2.2).
const TILT_LINEAR_DEG: f64 = 20.0;
/// A pack of 7.2 V is empty below this, in mV.
const BATTERY_EMPTY_MV: u16 = 6600;
const ADC_MOST: f64 = 1023.0;

/// Whether a thing is as it should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Verdict {
    /// It is.
    Ok,
    /// It has not been heard.
    Missing,
    /// It has, but that cannot be right, or should not be so.
    Suspicious,
    /// The truck does without.
    NotFitted,
}

/// One thing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Row {
    what: String,
    raw: String,
    reads_as: String,
    pub(super) verdict: Verdict,
    advice: String,
}

/// What has been counted on the lines.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Counted {
    pub(super) board_frames: u64,
    pub(super) board_rejected: u64,
    pub(super) board_lost: u64,
    pub(super) refused_by_board: u16,
    pub(super) gyro_frames: u64,
    pub(super) gyro_lost: u64,
    pub(super) gyro_skipped: u64,
}

impl Counted {
    /// Since the start.
    pub(super) fn of(readings: &Readings) -> Self {
        Self {
            board_frames: readings.board_frames.frames,
            board_rejected: readings.board_frames.rejected,
            board_lost: readings.board_frames.lost,
            refused_by_board: readings.status.map_or(0, |status| status.rejected),
            gyro_frames: readings.gyro_frames,
            gyro_lost: readings.gyro_lost,
            gyro_skipped: readings.gyro_skipped,
        }
    }
}

/// Everything that the rows are made of.
pub(super) struct Evidence<'a> {
    pub(super) settings: &'a ConfigFile,
    pub(super) readings: Readings,
    pub(super) outputs: &'a Outputs,
    pub(super) faults: &'a [FaultState],
    pub(super) counted: Counted,
    pub(super) most_pulses: Option<u16>,
    /// Speed, steering, selector; `None` = no receiver.
    pub(super) remote: Option<[Option<u32>; 3]>,
}

/// A thing that has been heard; `wrong` says what to do if it cannot be right.
struct Heard {
    raw: String,
    reads_as: String,
    wrong: Option<String>,
}

fn heard(raw: impl ToString, reads_as: impl ToString, wrong: Option<&str>) -> Heard {
    Heard { raw: raw.to_string(), reads_as: reads_as.to_string(), wrong: wrong.map(str::to_owned) }
}

impl Row {
    fn new(what: impl ToString, heard: Option<Heard>, if_missing: &str) -> Self {
        let (verdict, raw, reads_as, advice) = match heard {
            None => (Verdict::Missing, "-".to_owned(), "-".to_owned(), if_missing.to_owned()),
            Some(Heard { raw, reads_as, wrong: None }) => (Verdict::Ok, raw, reads_as, String::new()),
            Some(Heard { raw, reads_as, wrong: Some(advice) }) => {
                (Verdict::Suspicious, raw, reads_as, advice)
            }
        };
        Self { what: what.to_string(), raw, reads_as, verdict, advice }
    }

    fn not_fitted(what: impl ToString, reads_as: &str) -> Self {
        let verdict = Verdict::NotFitted;
        let (raw, reads_as) = ("-".to_owned(), reads_as.to_owned());
        Self { what: what.to_string(), raw, reads_as, verdict, advice: String::new() }
    }

    /// What is wrong with it, and what to do.
    pub(super) fn trouble(&self) -> Option<String> {
        let Self { what, raw, verdict, advice, .. } = self;
        match verdict {
            Verdict::Ok | Verdict::NotFitted => None,
            Verdict::Missing => Some(format!("{what} missing: {advice}")),
            Verdict::Suspicious => Some(format!("{what} {raw}: {advice}")),
        }
    }

    /// For the table.
    pub(super) fn cells(&self) -> Vec<String> {
        let verdict = match self.verdict {
            Verdict::Ok => "ok",
            Verdict::Missing => "missing",
            Verdict::Suspicious => "suspicious",
            Verdict::NotFitted => "not fitted",
        };
        [&self.what, &self.raw, &self.reads_as, verdict, &self.advice].map(|cell| (*cell).to_owned()).to_vec()
    }
}

/// The rows, from the board's line to the gyro's, errors last.
pub(super) fn rows(evidence: &Evidence<'_>) -> Vec<Row> {
    let mut rows = evidence.board();
    rows.push(evidence.encoder());
    rows.extend(evidence.ranges());
    rows.extend(evidence.platform());
    rows.push(evidence.battery());
    rows.extend(evidence.remote_control());
    rows.extend(evidence.gyro());
    rows.extend(evidence.errors());
    rows
}

impl Evidence<'_> {
    /// What to do about a line that does not work.
    fn line_remedy(&self, place: &str) -> Option<&'static str> {
        let of_line = |fault: &Fault| fault.place() == place && *fault != Fault::BoardNotSetUp;
        self.faults.iter().map(|state| state.fault).find(of_line).map(Fault::remedy)
    }

    /// A line, unless a fault says that it is none.
    fn line(&self, place: &str, frames: u64, path: &str, baud: u32) -> Row {
        let serial = self.settings.hardware.kind == "serial";
        let reads_as = if serial { format!("{path} at {baud} baud") } else { "simulated".to_owned() };
        let remedy = self.line_remedy(place);
        let well = frames > 0 && remedy.is_none();
        let line = well.then(|| heard(format!("{frames} frames"), reads_as, None));
        Row::new(format!("{place} line"), line, remedy.unwrap_or("no frames received"))
    }

    /// Why something of the board is missing; `itself` if there is no cause further up.
    fn of_board(&self, itself: &'static str) -> &'static str {
        match (self.line_remedy("board"), self.readings.set_up) {
            (Some(_), _) => "see the board line",
            (None, false) => "see the board set-up",
            (None, true) => itself,
        }
    }

    fn board(&self) -> Vec<Row> {
        let Evidence { readings, settings, .. } = self;
        let hardware = &settings.hardware;
        let hex = |word: u16| format!("{word:#06x}");
        let set_up = readings.set_up.then(|| heard(hex(readings.setup_checksum), "confirmed", None));
        let watchdog = readings.status.filter(|status| status.ready).map(|status| {
            let (reads_as, wrong) = match (status.watchdog, status.emergency_stop) {
                (false, _) => ("pulses received", None),
                (true, Some(true)) => ("motor stopped: emergency stop", Some("see the emergency stop")),
                (true, _) => ("motor stopped: no pulses received", Some("check the wire to the board")),
            };
            heard(u8::from(status.watchdog), reads_as, wrong)
        });
        let unconfirmed = match self.line_remedy("board") {
            Some(_) => "see the board line",
            None => Fault::BoardNotSetUp.remedy(),
        };
        let no_status = self.of_board("no status received (docs/io-board.md)");
        vec![
            self.line("board", readings.board_frames.frames, &hardware.board, hardware.board_baud),
            Row::new("board firmware", readings.status.map(|status| self.firmware(status)), no_status),
            Row::new("board set-up", set_up, unconfirmed),
            Row::new("board watchdog", watchdog, no_status),
            emergency_stop(readings.status, no_status),
        ]
    }

    /// Its version, and what it says of itself when asked.
    fn firmware(&self, status: BoardStatus) -> Heard {
        let raw = format!("{:#06x}", status.firmware.0);
        let version = format!("version {}", status.firmware);
        if status.firmware.check().is_err() {
            return heard(raw, version, Some(UnknownFirmware::HINT));
        }
        let Some(identity) = self.readings.identity else {
            return heard(raw, version, None);
        };
        let wrong = identity.after_hang.then_some(
            "its program hung and its watchdog restarted it: power-cycle it; if that repeats, flash its firmware",
        );
        heard(raw, format!("{version}, {}, hash {:#010x}", identity.model_name(), identity.hash), wrong)
    }

    fn encoder(&self) -> Row {
        let encoder = &self.settings.vehicle.encoder;
        let still = self.settings.vehicle.speed.interlock_pulses;
        let window = self.readings.pulses.and(self.most_pulses).map(|pulses| {
            let moves = u32::from(pulses) > still;
            let wrong = moves.then_some("pulses at standstill: hold it still; check the encoder's wires");
            let rpm = wheel_rpm(encoder, u32::from(pulses));
            heard(format!("{pulses} pulses"), format!("{rpm:.1} rpm at the wheels"), wrong)
        });
        Row::new("encoder", window, self.of_board(Fault::EncoderSilent.remedy()))
    }

    fn ranges(&self) -> Vec<Row> {
        let (adc, if_missing) = (self.readings.adc.as_ref(), self.of_board(Fault::ConverterSilent.remedy()));
        let fitted = &self.settings.vehicle.range_finders;
        let side = |name: &'static str,
                    finders: &BumperFinders,
                    counts: Option<[AdcCount; SLOTS]>,
                    cm: BumperRanges| {
            (0..finders.0.len().min(SLOTS)).map(move |i| {
                let measured = counts.map(|counts| range(counts[i], cm[i]));
                Row::new(format!("range {name} {}", i + 1), measured, if_missing)
            })
        };
        let front = side("front", &fitted.front, adc.map(|adc| adc.ir_front), self.outputs.ir_front_cm);
        front.chain(side("rear", &fitted.rear, adc.map(|adc| adc.ir_rear), self.outputs.ir_rear_cm)).collect()
    }

    fn platform(&self) -> Vec<Row> {
        if self.settings.vehicle.platform == Platform::Off {
            return vec![Row::not_fitted("platform", "off in the settings")];
        }
        let (adc, limits) = (self.readings.adc.as_ref(), &self.settings.vehicle.pistons);
        let if_missing = self.of_board(Fault::ConverterSilent.remedy());
        let angles = [("tilt x (pitch)", self.outputs.tilt.x), ("tilt y (roll)", self.outputs.tilt.y)];
        let tilts = angles
            .into_iter()
            .enumerate()
            .map(|(i, (what, deg))| Row::new(what, adc.map(|adc| tilt(adc.tilt[i], deg)), if_missing));
        let pistons = ["FL", "FR", "RL", "RR"].into_iter().enumerate().map(|(i, name)| {
            let measured = adc.map(|adc| {
                let height_m = height_m(limits, adc.pistons[i]);
                let within = (limits.min_m..=limits.max_m).contains(&height_m);
                let wrong = (!within).then_some("beyond the end stops: check linkage and position sensor");
                heard(format!("{:.1}", adc.pistons[i].get()), format!("{:.1} mm", height_m * 1000.0), wrong)
            });
            Row::new(format!("piston {name}"), measured, if_missing)
        });
        tilts.chain(pistons).collect()
    }

    fn battery(&self) -> Row {
        if self.readings.adc.is_some() && self.readings.battery_mv.is_none() {
            return Row::not_fitted("battery", "not measured by this board");
        }
        let measured = self.readings.battery_mv.map(|mv| {
            let wrong = (mv < BATTERY_EMPTY_MV).then_some("charge or change the battery");
            heard(format!("{mv} mV"), format!("{:.2} V", f64::from(mv) / 1000.0), wrong)
        });
        Row::new("battery", measured, self.of_board(Fault::ConverterSilent.remedy()))
    }

    fn remote_control(&self) -> Vec<Row> {
        let channels = ["remote speed", "remote steering", "remote selector"];
        let Some(ticks) = self.remote else {
            let absent = |what| match self.readings.set_up {
                true => Row::not_fitted(what, "no receiver signal"),
                false => Row::new(what, None, self.of_board("")),
            };
            return channels.map(absent).to_vec();
        };
        let row = |(i, what): (usize, &'static str)| Row::new(what, Some(self.pulse(i == 2, ticks[i])), "");
        channels.into_iter().enumerate().map(row).collect()
    }

    fn pulse(&self, selector: bool, ticks: Option<u32>) -> Heard {
        let remote = &self.settings.vehicle.remote;
        let raw = ticks.map_or_else(|| "-".to_owned(), |ticks| format!("{ticks} ticks"));
        match reading(remote, ticks) {
            TickReading::Usable(duty) => {
                let below = duty * PWM_PERIOD_COUNTS < remote.selector_counts;
                let manual = below == (remote.manual == "below");
                let meaning = match (selector, manual) {
                    (false, _) => "",
                    (true, true) => ", manual",
                    (true, false) => ", automatic",
                };
                heard(raw, format!("{:.2} ms{meaning}", duty * remote.period_ms), None)
            }
            TickReading::Rejected if ticks.is_none() => {
                heard(raw, "no pulse", Some(Fault::RemoteLost.remedy()))
            }
            TickReading::Rejected => {
                heard(raw, "too short or too long", Some("check the transmitter's end points"))
            }
            TickReading::Impossible => {
                heard(raw, "longer than one period", Some("the board ignores channel resets (0x19)"))
            }
        }
    }

    fn errors(&self) -> Vec<Row> {
        let (counted, unit) = (&self.counted, self.unit());
        let row = |what: String, any: u64, raw: String, frames: u64| {
            let wrong = (any > 0).then_some("check the cable, its ground and the baud rate");
            let counted = heard(raw, format!("in {frames} frames"), wrong);
            Row::new(what, (frames > 0).then_some(counted), "cannot be counted without frames")
        };
        let Counted { board_rejected, board_lost, gyro_lost, gyro_skipped, .. } = *counted;
        let refused = u64::from(counted.refused_by_board);
        let from_board = format!("{board_rejected} bad, {board_lost} lost");
        let skipped = format!("{gyro_skipped} bytes skipped");
        vec![
            row(format!("{unit} frames lost"), gyro_lost, gyro_lost.to_string(), counted.gyro_frames),
            row(format!("{unit} check sums"), gyro_skipped, skipped, counted.gyro_frames),
            row(
                "CRC errors from board".into(),
                board_rejected + board_lost,
                from_board,
                counted.board_frames,
            ),
            row("CRC errors to board".into(), refused, format!("{refused} refused"), counted.board_frames),
        ]
    }
}

/// The switch at the board, as far as the board reports it.
fn emergency_stop(status: Option<BoardStatus>, no_status: &str) -> Row {
    let what = "emergency stop";
    let Some(status) = status else { return Row::new(what, None, no_status) };
    match status.emergency_stop {
        None => Row::not_fitted(what, "not reported by this firmware"),
        Some(false) => Row::new(what, Some(heard(0, "released", None)), ""),
        Some(true) => {
            let wrong = "release it, or check the wire of its contact; nothing drives meanwhile";
            Row::new(what, Some(heard(1, "pressed", Some(wrong))), "")
        }
    }
}

fn range(counts: AdcCount, cm: Option<f64>) -> Heard {
    let wrong = match counts.get() {
        c if c <= 0.0 => Some("no signal: check this range finder's wire and its 5 V"),
        c if c >= ADC_MOST => Some("the signal wire touches 5 V"),
        _ => None,
    };
    let reads_as = cm.map_or_else(|| "nothing in range".to_owned(), |cm| format!("{cm:.1} cm"));
    heard(counts.get(), reads_as, wrong)
}

fn tilt(counts: AdcCount, deg: Option<f64>) -> Heard {
    let raw = format!("{:.1}", counts.get());
    match deg {
        None => heard(raw, "no angle", Some(Fault::TiltOutOfRange.remedy())),
        Some(deg) => {
            let beyond = deg.abs() > TILT_LINEAR_DEG;
            let wrong = beyond.then_some("not linear beyond ±20°: level the truck, or check the wires");
            heard(raw, signed(deg), wrong)
        }
    }
}

/// An angle with its sign, but no sign of a zero.
fn signed(deg: f64) -> String {
    let tenths = (deg * 10.0).round() / 10.0;
    if tenths == 0.0 { "0.0°".to_owned() } else { format!("{tenths:+.1}°") }
}

#[cfg(test)]
mod tests;
