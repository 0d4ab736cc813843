//! A step on the line to the bridge, and its answer: JSON as at the top of `bridge.mjs` says.

use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use xtb_control::units::Stamp;
use xtb_control::vehicle::{SLOTS, USUAL_SLOTS};
use xtb_sim::{Pins, Pulses};

/// The dividers at the board's inputs, which make 3.3 V of the sensors' 5 V, and a quarter of the battery.
const OF_5_V: f64 = 3.3 / 5.0;
const OF_BATTERY: f64 = 0.25;

/// What the chip's pins get in a step.
#[derive(Debug, Serialize)]
pub(crate) struct Step {
    /// End of the step, in ns.
    t: u64,
    /// Bytes of the agent, in hexadecimal digits.
    rx: String,
    /// Inputs of the first multiplexer, in V.
    a: [f64; 16],
    /// Inputs 0 to 3 of the second one, in V.
    m: [f64; 4],
    /// Inputs 12 to 15 of it, in V.
    p: [f64; 4],
    /// Edges of the encoder, in ns.
    e: Vec<u64>,
    /// Pulses of the receiver, in ms.
    r: Option<[f64; 3]>,
    /// The emergency stop is pressed.
    s: bool,
    /// Bytes of the inertial unit, in hexadecimal digits.
    i: String,
}

impl Step {
    /// The first moment, when nothing has happened yet.
    pub(crate) fn power_on() -> Self {
        let (rx, i) = (String::new(), String::new());
        Self { t: 0, rx, a: [0.0; 16], m: [0.0; 4], p: [0.0; 4], e: Vec::new(), r: None, s: false, i }
    }

    pub(crate) fn of(from_agent: &[u8], pins: &Pins) -> Self {
        let mut a = [0.0; 16];
        let (front, rear) = pins.range_finders_v.split_at(SLOTS);
        a[..USUAL_SLOTS].copy_from_slice(&front[..USUAL_SLOTS]);
        a[USUAL_SLOTS..2 * USUAL_SLOTS].copy_from_slice(&rear[..USUAL_SLOTS]);
        a[12..14].copy_from_slice(&pins.tilt_v.map(|v| v * OF_5_V));
        a[14] = pins.battery_v * OF_BATTERY;
        Self {
            t: pins.now.ns(),
            rx: digits(from_agent),
            a,
            m: [front[6], front[7], rear[6], rear[7]],
            p: pins.pistons_v.map(|v| v * OF_5_V),
            e: pins.encoder_edges.iter().map(|edge| edge.ns()).collect(),
            r: pins.receiver_ms,
            s: pins.emergency_stop,
            i: digits(&pins.imu),
        }
    }

    /// As JSON; a number that is not finite, which no sensor gives, would be refused by the bridge.
    pub(crate) fn written(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// What the chip's pins gave in a step.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) bytes: Vec<u8>,
    pub(crate) pulses: Pulses,
    pub(crate) resets: u64,
}

#[derive(Debug, Deserialize)]
struct Written {
    tx: String,
    w: [u16; 10],
    at: u64,
    resets: u64,
}

impl Answer {
    /// # Errors
    /// What is wrong with it.
    pub(crate) fn read(line: &str) -> Result<Self, String> {
        let written: Written =
            serde_json::from_str(line).map_err(|error| format!("{error} in its answer {line:?}"))?;
        let bytes = bytes(&written.tx).ok_or_else(|| format!("no bytes: {:?}", written.tx))?;
        let pulses = Pulses { counts: written.w, begun: Stamp::from_ns(written.at) };
        Ok(Self { bytes, pulses, resets: written.resets })
    }
}

fn digits(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

fn bytes(digits: &str) -> Option<Vec<u8>> {
    let pair = |at: usize| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok();
    (0..digits.len()).step_by(2).map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_written_behind_the_dividers() {
        let pins = Pins {
            now: Stamp::from_ns(5_000_000),
            range_finders_v: std::array::from_fn(|i| i as f64 / 8.0),
            tilt_v: [2.5, 5.0],
            pistons_v: [0.0, 2.5, 5.0, 1.25],
            battery_v: 8.0,
            imu: vec![0xAA, 0xAA, 1],
            emergency_stop: true,
            encoder_edges: vec![Stamp::from_ns(1), Stamp::from_ns(4_999_999)],
            receiver_ms: Some([1.5, 1.25, 1.75]),
        };
        let written = Step::of(&[0, 0x1F, 0xA0], &pins).written();
        assert_eq!(
            written,
            "{\"t\":5000000,\"rx\":\"001fa0\",\
             \"a\":[0.0,0.125,0.25,0.375,0.5,0.625,1.0,1.125,1.25,1.375,1.5,1.625,1.65,3.3,2.0,0.0],\
             \"m\":[0.75,0.875,1.75,1.875],\"p\":[0.0,1.65,3.3,0.825],\"e\":[1,4999999],\"r\":[1.5,1.25,1.75],\"s\":true,\"i\":\"aaaa01\"}"
        );
    }

    #[test]
    fn an_answer_is_read_and_anything_else_refused() {
        let line = "{\"t\":5,\"tx\":\"00ff1a\",\"w\":[1,2,3,4,5,6,7,8,9,10],\"at\":4,\"resets\":2}\n";
        let answer = Answer::read(line).unwrap();
        assert_eq!((answer.bytes, answer.resets), (vec![0, 0xFF, 0x1A], 2));
        assert_eq!(answer.pulses.counts, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
        assert_eq!(answer.pulses.begun.ns(), 4);
        for wrong in ["", "{}", &line.replace("00ff1a", "0"), &line.replace("00ff1a", "0g"), &line[..40]] {
            assert!(Answer::read(wrong).is_err(), "{wrong}");
        }
    }
}
