//! The R/C receiver and how the TPU's NITC function reads its three channels (§4.2.2, §4.3).
//!
//! ```text
//!   sticks ─► pulse of 1.0 to 2.0 ms each 22.2 ms ─► ticks of the time count register
//!                                                     │
//!             right edge     pulse                    │   e.g.    937 ticks
//!             wrong edge     period − pulse           │        12,938
//!             "420 %"        4.2 · period             ▼        58,275, until the channel is reset
//! ```
//! NITC cannot be told which edge to start on, so a channel may measure the gap between pulses
//! instead; and now and then one gets into a state with an impossible reading.

use crate::parameters::ReceiverTruth;
use crate::rng::Rng;
use xtb_control::controller::RemoteSample;
use xtb_control::tpu::{ResetMask, SYSTEM_CLOCK_HZ};

/// What a channel reads in its impossible state, in periods (§4.2.2: "420 %").
const IMPOSSIBLE_DUTY: f64 = 4.2;

/// The hand-held transmitter, as somebody holds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transmitter {
    /// Switched on and in range; otherwise the receiver gives no pulses.
    pub on: bool,
    /// Speed stick, −1 (astern) to 1 (ahead).
    pub speed: f64,
    /// Steering stick, −1 (left) to 1 (right).
    pub steering: f64,
    /// Selector on manual; otherwise automatic.
    pub selector_manual: bool,
}

impl Default for Transmitter {
    /// On, sticks centred, automatic.
    fn default() -> Self {
        Self { on: true, speed: 0.0, steering: 0.0, selector_manual: false }
    }
}

/// State of one NITC channel.
#[derive(Debug, Clone, Copy, Default)]
struct Nitc {
    wrong_edge: bool,
    impossible: bool,
}

/// Receiver and its three TPU channels: speed, steering, selector.
#[derive(Debug, Clone)]
pub(crate) struct Receiver {
    truth: ReceiverTruth,
    transmitter: Transmitter,
    channels: [Nitc; 3],
    /// Per reading.
    glitch_probability: f64,
    tick_s: f64,
}

impl Receiver {
    pub(crate) fn new(truth: &ReceiverTruth) -> Self {
        Self {
            truth: truth.clone(),
            transmitter: Transmitter::default(),
            channels: [Nitc::default(); 3],
            glitch_probability: truth.period_s / truth.glitch_every_s,
            tick_s: 64.0 / SYSTEM_CLOCK_HZ,
        }
    }

    /// Takes over the sticks; what is not a number counts as centred.
    pub(crate) fn set_transmitter(&mut self, transmitter: Transmitter) {
        let stick = |value: f64| if value.is_finite() { value.clamp(-1.0, 1.0) } else { 0.0 };
        let (speed, steering) = (stick(transmitter.speed), stick(transmitter.steering));
        self.transmitter = Transmitter { speed, steering, ..transmitter };
    }

    /// All channels start, each on an edge of its own choice.
    pub(crate) fn set_up(&mut self, tcr_prescaler: u16, noise: &mut Rng) {
        self.tick_s = f64::from(tcr_prescaler.max(1)) / SYSTEM_CLOCK_HZ;
        self.reset(ResetMask { speed: true, steering: true, selector: true }, noise);
    }

    /// These channels start again (Fig. 9).
    pub(crate) fn reset(&mut self, mask: ResetMask, noise: &mut Rng) {
        for (channel, reset) in self.channels.iter_mut().zip([mask.speed, mask.steering, mask.selector]) {
            if reset {
                let wrong_edge = noise.chance(self.truth.wrong_edge);
                *channel = Nitc { wrong_edge, impossible: false };
            }
        }
    }

    /// One reading of all channels.
    pub(crate) fn read(&mut self, noise: &mut Rng) -> RemoteSample {
        if !self.transmitter.on {
            return RemoteSample { speed: None, steering: None, selector: None };
        }
        let [speed_ms, steering_ms, selector_ms] = self.pulses_ms();
        RemoteSample {
            speed: self.channel(0, speed_ms, noise),
            steering: self.channel(1, steering_ms, noise),
            selector: self.channel(2, selector_ms, noise),
        }
    }

    /// Pulses of speed, steering and selector at its pins; `None` = the transmitter is off.
    pub(crate) fn at_pins_ms(&self) -> Option<[f64; 3]> {
        self.transmitter.on.then(|| self.pulses_ms())
    }

    /// Pulses of speed, steering and selector.
    fn pulses_ms(&self) -> [f64; 3] {
        let (truth, sticks) = (&self.truth, &self.transmitter);
        let speed_ms = truth.centre_ms + truth.stroke_ms * sticks.speed;
        // A shorter pulse turns the wheels to the right (Table 4).
        let steering_ms = truth.centre_ms - truth.stroke_ms * sticks.steering;
        let selector_ms = if sticks.selector_manual { truth.manual_ms } else { truth.automatic_ms };
        [speed_ms, steering_ms, selector_ms]
    }

    fn channel(&mut self, index: usize, pulse_ms: f64, noise: &mut Rng) -> Option<u32> {
        if noise.chance(self.truth.interference) {
            return None;
        }
        let channel = &mut self.channels[index];
        channel.impossible |= noise.chance(self.glitch_probability);
        let period = self.truth.period_s / self.tick_s;
        let pulse = pulse_ms * 1e-3 / self.tick_s;
        let jitter = self.truth.jitter_ticks;
        // The register runs free of the pulses: the same length is sometimes a tick more.
        let error = noise.uniform(-jitter, jitter) + noise.uniform(0.0, 1.0);
        let seen = match channel {
            Nitc { impossible: true, .. } => IMPOSSIBLE_DUTY * period,
            Nitc { wrong_edge: true, .. } => period - pulse,
            Nitc { .. } => pulse,
        };
        Some((seen + error) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn receiver(truth: ReceiverTruth) -> (Receiver, Rng) {
        let (mut receiver, mut noise) = (Receiver::new(&truth), Rng::new(6, 0));
        receiver.set_up(64, &mut noise);
        (receiver, noise)
    }

    /// Always on the right edge and never in the impossible state.
    fn clean() -> ReceiverTruth {
        ReceiverTruth { wrong_edge: 0.0, glitch_every_s: 1.0e9, ..ReceiverTruth::default() }
    }

    fn read(receiver: &mut Receiver, noise: &mut Rng) -> [Option<u32>; 3] {
        let RemoteSample { speed, steering, selector } = receiver.read(noise);
        [speed, steering, selector]
    }

    fn near(ticks: Option<u32>, expected: f64) -> bool {
        ticks.is_some_and(|ticks| (f64::from(ticks) - expected).abs() <= 2.0)
    }

    #[test]
    fn sticks_and_selector_become_pulses_of_1_to_2_ms() {
        let (mut receiver, mut noise) = receiver(clean());
        let mut ticks = |transmitter| {
            receiver.set_transmitter(transmitter);
            read(&mut receiver, &mut noise)
        };
        let default = Transmitter::default();
        let [speed, steering, selector] = ticks(default);
        assert!(near(speed, 937.5) && near(steering, 937.5) && near(selector, 1125.0));
        let [speed, steering, selector] =
            ticks(Transmitter { speed: 1.0, steering: 1.0, selector_manual: true, ..default });
        assert!(near(speed, 1250.0), "ahead is long: {speed:?}");
        assert!(near(steering, 625.0), "right is short: {steering:?}");
        assert!(near(selector, 750.0), "manual: {selector:?}");
        let [speed, steering, _] = ticks(Transmitter { speed: -7.0, steering: f64::NAN, ..default });
        assert!(near(speed, 625.0) && near(steering, 937.5), "{speed:?} {steering:?}");
    }

    #[test]
    fn the_same_pulse_is_read_with_a_jitter_of_a_tick_or_two() {
        let (mut receiver, mut noise) = receiver(clean());
        let mut seen: Vec<u32> = (0..500).filter_map(|_| receiver.read(&mut noise).speed).collect();
        seen.sort_unstable();
        seen.dedup();
        assert!((2..=5).contains(&seen.len()), "{seen:?}");
    }

    #[test]
    fn without_the_transmitter_there_are_no_pulses() {
        let (mut receiver, mut noise) = receiver(ReceiverTruth::default());
        receiver.set_transmitter(Transmitter { on: false, ..Transmitter::default() });
        assert_eq!(read(&mut receiver, &mut noise), [None; 3]);
    }

    #[test]
    fn interference_swallows_single_readings() {
        let (mut receiver, mut noise) = receiver(ReceiverTruth { interference: 0.2, ..clean() });
        let missing = (0..1000).filter(|_| receiver.read(&mut noise).steering.is_none()).count();
        assert!((150..250).contains(&missing), "{missing}");
    }

    #[test]
    fn a_channel_on_the_wrong_edge_reads_the_complement_and_a_reset_draws_again() {
        let (mut receiver, mut noise) =
            receiver(ReceiverTruth { glitch_every_s: 1.0e9, ..ReceiverTruth::default() });
        let (mut right, mut wrong) = (0, 0);
        for _ in 0..100 {
            receiver.reset(ResetMask { selector: true, ..ResetMask::default() }, &mut noise);
            let selector = receiver.read(&mut noise).selector;
            right += usize::from(near(selector, 1125.0));
            wrong += usize::from(near(selector, 13_875.0 - 1125.0));
        }
        assert!(right + wrong == 100 && right > 25 && wrong > 25, "{right} {wrong}");
    }

    #[test]
    fn a_channel_gets_stuck_at_420_percent_until_it_is_reset() {
        let (mut receiver, mut noise) =
            receiver(ReceiverTruth { wrong_edge: 0.0, ..ReceiverTruth::default() });
        let (mut stuck, mut glitches, minutes) = (false, 0, 30);
        for _ in 0..minutes * 60 * 45 {
            let speed = receiver.read(&mut noise).speed;
            let impossible = near(speed, 58_275.0);
            assert!(impossible || near(speed, 937.5), "{speed:?}");
            assert!(impossible || !stuck, "it stays so");
            stuck = impossible;
            glitches += usize::from(impossible);
            if impossible && noise.chance(0.1) {
                receiver.reset(ResetMask { steering: true, selector: true, speed: false }, &mut noise);
                assert!(near(receiver.read(&mut noise).speed, 58_275.0), "another channel's reset");
                receiver.reset(ResetMask { speed: true, ..ResetMask::default() }, &mut noise);
                stuck = false;
            }
        }
        assert!((100..900).contains(&glitches), "about {minutes} times for ten readings: {glitches}");
    }
}
