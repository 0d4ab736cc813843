//! The I/O board: PWM frames in, encoder and converter frames out, a watchdog in between.
//!
//! New pulses take effect when a PWM period ends. Without a good frame for 100 ms the motor goes
//! neutral and the pistons hold, while the steering keeps its angle: a truck that coasts should not
//! swerve.

use crate::line::Outbox;
use crate::noise::Noise;
use crate::parameters::{BoardTruth, EncoderTruth, SteeringTruth};
use xtb_control::PwmCount;
use xtb_control::controller::{AdcSample, PwmOutputs};
use xtb_control::units::Stamp;
use xtb_protocol::board::{FrameReader, FrameWriter, LineCounters, MAX_PULSES};

/// A counter that comes due again and again.
#[derive(Debug, Clone)]
struct Timer {
    period_ns: u64,
    next_ns: u64,
}

impl Timer {
    /// The board was switched on at a random moment.
    fn new(period_s: f64, noise: &mut Noise) -> Self {
        let period_ns = libm::round(period_s * 1e9) as u64;
        Self { period_ns, next_ns: noise.up_to(period_ns) }
    }

    /// The moment that came due until `now`, one a call.
    fn due(&mut self, now: Stamp) -> Option<Stamp> {
        if self.next_ns > now.ns() {
            return None;
        }
        let due = Stamp::from_ns(self.next_ns);
        self.next_ns += self.period_ns;
        Some(due)
    }
}

/// How far the motor shaft had turned at both ends of a step, in pulses since the start.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShaftTravel {
    pub(crate) start: Stamp,
    pub(crate) end: Stamp,
    pub(crate) from_pulses: f64,
    pub(crate) to_pulses: f64,
}

impl ShaftTravel {
    /// Whole pulses at a moment of the step; the speed is constant within it.
    fn whole_pulses_at(&self, t: Stamp) -> u64 {
        let part = t.since_s(self.start) / self.end.since_s(self.start);
        (self.from_pulses + (self.to_pulses - self.from_pulses) * part.clamp(0.0, 1.0)) as u64
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Board {
    watchdog_s: f64,
    reader: FrameReader,
    writer: FrameWriter,
    outbox: Outbox,
    requested: PwmOutputs,
    heard: Option<Stamp>,
    outputs: PwmOutputs,
    neutral_since: Option<Stamp>,
    pwm: Timer,
    encoder: Timer,
    adc: Timer,
    /// Whole pulses when the last window closed.
    counted: u64,
}

impl Board {
    pub(crate) fn new(
        truth: &BoardTruth,
        encoder: &EncoderTruth,
        steering: &SteeringTruth,
        noise: &mut Noise,
    ) -> Self {
        let neutral = PwmCount::NEUTRAL;
        let outputs = PwmOutputs {
            motor: neutral,
            steer_front: PwmCount::saturating(steering.front_centre),
            steer_rear: PwmCount::saturating(steering.rear_centre),
            bumper_front: neutral,
            bumper_rear: neutral,
            pistons: [neutral; 4],
            spare: neutral,
        };
        Self {
            watchdog_s: truth.watchdog_s,
            reader: FrameReader::default(),
            writer: FrameWriter::default(),
            outbox: Outbox::default(),
            requested: outputs,
            heard: None,
            outputs,
            neutral_since: Some(Stamp::ZERO),
            pwm: Timer::new(truth.pwm_period_s, noise),
            encoder: Timer::new(encoder.window_s, noise),
            adc: Timer::new(truth.adc_period_s, noise),
            counted: 0,
        }
    }

    /// Bytes from the agent.
    pub(crate) fn rx(&mut self, bytes: &[u8], now: Stamp) {
        let (requested, heard) = (&mut self.requested, &mut self.heard);
        // The reader counts what it rejects; the board itself has nothing else to do about it.
        self.reader.pwm(bytes, |frame| {
            if let Ok(pwm) = frame {
                *requested = pwm;
                *heard = Some(now);
            }
        });
    }

    /// Applies the pulses of every PWM period that ended until `now`.
    pub(crate) fn latch(&mut self, now: Stamp) {
        while let Some(t) = self.pwm.due(now) {
            let silent = self.heard.is_none_or(|heard| t.since_s(heard) >= self.watchdog_s);
            self.outputs = if silent {
                let neutral = PwmCount::NEUTRAL;
                PwmOutputs { motor: neutral, pistons: [neutral; 4], ..self.outputs }
            } else {
                self.requested
            };
            self.neutral_since =
                (self.outputs.motor == PwmCount::NEUTRAL).then(|| self.neutral_since.unwrap_or(t));
        }
    }

    /// Sends the encoder windows that closed during a step.
    pub(crate) fn count(&mut self, travel: &ShaftTravel) {
        while let Some(t) = self.encoder.due(travel.end) {
            let whole = travel.whole_pulses_at(t);
            let pulses = (whole - self.counted).min(u64::from(MAX_PULSES)) as u16;
            self.counted = whole;
            self.outbox.send(self.writer.encoder(pulses).as_bytes());
        }
    }

    /// Whether the converter has completed a scan; then [`Self::send_scan`] is due.
    pub(crate) fn scan_due(&mut self, now: Stamp) -> bool {
        self.adc.due(now).is_some()
    }

    pub(crate) fn send_scan(&mut self, sample: &AdcSample, battery_mv: u16) {
        self.outbox.send(self.writer.adc(sample, Some(battery_mv)).as_bytes());
    }

    pub(crate) fn outputs(&self) -> &PwmOutputs {
        &self.outputs
    }

    pub(crate) fn neutral_since(&self) -> Option<Stamp> {
        self.neutral_since
    }

    pub(crate) fn counters(&self) -> LineCounters {
        self.reader.counters()
    }

    pub(crate) fn outbox(&mut self) -> &mut Outbox {
        &mut self.outbox
    }

    pub(crate) fn dropped(&self) -> u64 {
        self.outbox.dropped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::board::FromBoard;

    fn board() -> Board {
        let (encoder, steering) = (EncoderTruth::default(), SteeringTruth::default());
        Board::new(&BoardTruth::default(), &encoder, &steering, &mut Noise::new(1, 1))
    }

    fn driving(board: &Board) -> PwmOutputs {
        let lift = [PwmCount::MAX; 4];
        let motor = PwmCount::saturating(4000.0);
        PwmOutputs { motor, steer_front: PwmCount::MIN, pistons: lift, ..*board.outputs() }
    }

    #[test]
    fn pulses_take_effect_when_a_period_ends() {
        let mut board = board();
        board.latch(Stamp::from_ms(50));
        let pwm = driving(&board);
        board.rx(FrameWriter::default().pwm(&pwm).as_bytes(), Stamp::from_ms(50));
        assert_eq!(board.outputs().motor, PwmCount::NEUTRAL);
        board.latch(Stamp::from_ms(73));
        assert_eq!(*board.outputs(), pwm);
        assert_eq!(board.neutral_since(), None);
    }

    #[test]
    fn the_watchdog_goes_neutral_100_ms_after_the_last_good_frame_and_keeps_the_steering() {
        let mut board = board();
        let pwm = driving(&board);
        board.rx(FrameWriter::default().pwm(&pwm).as_bytes(), Stamp::from_ms(50));
        let mut broken = FrameWriter::default().pwm(&pwm).as_bytes().to_vec();
        broken[4] ^= 0x40;
        let mut neutral_at = None;
        for ms in (55..400).step_by(5) {
            board.rx(&broken, Stamp::from_ms(ms));
            board.latch(Stamp::from_ms(ms));
            if ms >= 75 && board.outputs().motor == PwmCount::NEUTRAL {
                neutral_at.get_or_insert(ms);
            }
        }
        let neutral_at = neutral_at.unwrap();
        assert!((150..=180).contains(&neutral_at), "{neutral_at} ms");
        assert_eq!(board.outputs().steer_front, PwmCount::MIN);
        assert_eq!(board.outputs().pistons, [PwmCount::NEUTRAL; 4]);
        assert!(board.counters().rejected > 50);
        let since = board.neutral_since().unwrap();
        assert!(since <= Stamp::from_ms(neutral_at) && since >= Stamp::from_ms(150));
        board.rx(FrameWriter::default().pwm(&pwm).as_bytes(), Stamp::from_ms(400));
        board.latch(Stamp::from_ms(425));
        assert_eq!(board.outputs().motor, pwm.motor, "the next good frame drives again");
    }

    #[test]
    fn windows_carry_the_fraction_of_a_pulse() {
        let mut board = board();
        let step = |i: u64| ShaftTravel {
            start: Stamp::from_ms(5 * i),
            end: Stamp::from_ms(5 * (i + 1)),
            from_pulses: 2.21 * i as f64,
            to_pulses: 2.21 * (i + 1) as f64,
        };
        (0..2000).for_each(|i| board.count(&step(i)));
        let (mut bytes, mut windows) = (Vec::new(), Vec::new());
        board.outbox().take(&mut bytes);
        FrameReader::default().from_board(&bytes, |frame| match frame.unwrap() {
            FromBoard::Encoder { pulses } => windows.push(pulses),
            FromBoard::Adc { .. } => panic!("no scan was sent"),
        });
        assert!((190..=191).contains(&windows.len()), "{}", windows.len());
        // 442 pulses/s are 23.17 a window; the first one is cut short by the board's own start.
        assert!(windows[1..].iter().all(|p| (23..=24).contains(p)), "{windows:?}");
        let mean = windows[1..].iter().map(|&p| f64::from(p)).sum::<f64>() / (windows.len() - 1) as f64;
        assert!((mean - 23.173).abs() < 0.01, "{mean}");
    }
}
