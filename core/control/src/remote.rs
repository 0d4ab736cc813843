//! Remote control (§4.2.2, §4.3, Fig. 10): three duty cycles, read by NITC at each 22.2 ms frame.
//!
//! ```text
//!   ticks ─► duty = ticks · 1.6 µs / 22.2 ms ─┬─ > 1      impossible ("420 %"): reject, ask for a channel reset
//!                                             ├─ > 0.5    the other edge first: 1 − duty
//!                                             └─ outside 4.2..9.5 %: reject
//!   rejected or missing: the channel keeps its last command; ten in a row: the channel is lost
//!
//!   selector:  Absent ──first frame──► Automatic ◄──► Manual      lost: Lost, until a usable one
//! ```
//! Printed: the formula, the complement, the reset, that a duty over 9.5 % keeps the previous
//! command. Ours: a lower limit by §4.1's 4.2 %, and the loss of a channel after ten frames: speed →
//! neutral, steering → centred, selector → mode `fault`.

use crate::tpu::ResetMask;
use crate::units::PWM_PERIOD_COUNTS;
use crate::vehicle::Remote;

/// One frame of the receiver in time counts of 1.6 µs; `None` = no pulse seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RemoteSample {
    /// Speed stick.
    pub speed: Option<u32>,
    /// Steering stick.
    pub steering: Option<u32>,
    /// Manual or automatic.
    pub selector: Option<u32>,
}

/// What NITC's tick count means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TickReading {
    /// A duty cycle within the limits.
    Usable(f64),
    /// No pulse, or one outside the limits.
    Rejected,
    /// Longer than the period: the channel needs a reset.
    Impossible,
}

/// Reads one channel (§4.2.2).
#[must_use]
pub fn reading(config: &Remote, ticks: Option<u32>) -> TickReading {
    let Some(ticks) = ticks else { return TickReading::Rejected };
    let measured = f64::from(ticks) * config.tick_us / (config.period_ms * 1000.0);
    if measured > 1.0 {
        return TickReading::Impossible;
    }
    let duty = if measured > 0.5 { 1.0 - measured } else { measured };
    let usable = (config.min_duty_pct / 100.0..=config.max_duty_pct / 100.0).contains(&duty);
    if usable { TickReading::Usable(duty) } else { TickReading::Rejected }
}

/// One channel's memory.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Channel {
    /// Of the last frame; `None` where it was missing or rejected.
    duty: Option<f64>,
    /// Frames without a usable reading, in a row.
    missed: u32,
}

impl Channel {
    /// Takes a reading in; true if it asks for a reset.
    fn take(&mut self, reading: TickReading) -> bool {
        self.duty = match reading {
            TickReading::Usable(duty) => Some(duty),
            TickReading::Rejected | TickReading::Impossible => None,
        };
        self.missed = if self.duty.is_some() { 0 } else { self.missed.saturating_add(1) };
        reading == TickReading::Impossible
    }

    fn is_lost(&self, config: &Remote) -> bool {
        self.missed >= config.lost_after
    }

    fn counts(&self) -> Option<f64> {
        self.duty.map(|duty| duty * PWM_PERIOD_COUNTS)
    }
}

/// What the selector says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Selector {
    /// No frame has come yet: there is no remote control.
    #[default]
    Absent,
    /// The controller's own modes.
    Automatic,
    /// The transmitter drives.
    Manual,
    /// Ten frames without a usable reading.
    Lost,
}

/// What a stick of the manual mode commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stick {
    /// This count.
    Counts(f64),
    /// The last usable one.
    Keep,
    /// Nothing any more: neutral, or centred.
    Lost,
}

/// Duty cycles as the last frame gave them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Duties {
    /// Speed; `None` where it was missing or rejected.
    pub speed: Option<f64>,
    /// Steering.
    pub steering: Option<f64>,
    /// Selector.
    pub selector: Option<f64>,
}

/// The stage's memory.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RemoteStage {
    speed: Channel,
    steering: Channel,
    selector: Channel,
    state: Selector,
    rejected: u64,
}

impl RemoteStage {
    /// One frame. Returns which channels ask for a reset.
    pub fn step(&mut self, config: &Remote, sample: &RemoteSample) -> ResetMask {
        let reset = ResetMask {
            speed: self.speed.take(reading(config, sample.speed)),
            steering: self.steering.take(reading(config, sample.steering)),
            selector: self.selector.take(reading(config, sample.selector)),
        };
        let missed = [self.speed, self.steering, self.selector].iter().filter(|c| c.duty.is_none()).count();
        self.rejected += missed as u64;
        self.state = match self.selector.counts() {
            Some(counts) if (counts < config.selector_counts) == (config.manual == "below") => {
                Selector::Manual
            }
            Some(_) => Selector::Automatic,
            None if self.selector.is_lost(config) => Selector::Lost,
            None if self.state == Selector::Absent => Selector::Automatic,
            None => self.state,
        };
        reset
    }

    /// What the selector says.
    #[must_use]
    pub fn selector(&self) -> Selector {
        self.state
    }

    /// What the speed stick commands, in PWM counts.
    #[must_use]
    pub fn speed(&self, config: &Remote) -> Stick {
        stick(&self.speed, config)
    }

    /// What the steering stick commands, in PWM counts of the front servo.
    #[must_use]
    pub fn steering(&self, config: &Remote) -> Stick {
        stick(&self.steering, config)
    }

    /// Duty cycles of the last frame.
    #[must_use]
    pub fn duties(&self) -> Duties {
        Duties { speed: self.speed.duty, steering: self.steering.duty, selector: self.selector.duty }
    }

    /// Readings that were missing or rejected since the start.
    #[must_use]
    pub fn rejected(&self) -> u64 {
        self.rejected
    }
}

fn stick(channel: &Channel, config: &Remote) -> Stick {
    match channel.counts() {
        Some(counts) => Stick::Counts(counts),
        None if channel.is_lost(config) => Stick::Lost,
        None => Stick::Keep,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(ticks: u32) -> TickReading {
        reading(&Remote::default(), Some(ticks))
    }

    #[test]
    fn a_pulse_a_complement_and_the_420_percent() {
        let centre = read(938);
        assert!(matches!(centre, TickReading::Usable(duty) if (duty - 0.067_603_6).abs() < 1e-6));
        let complement = read(13_875 - 938);
        assert!(matches!(complement, TickReading::Usable(duty) if (duty - 0.067_603_6).abs() < 1e-6));
        assert_eq!(read(58_275), TickReading::Impossible);
        assert_eq!(read(13_875), TickReading::Rejected, "the whole period is no pulse, but possible");
        assert_eq!(read(13_876), TickReading::Impossible);
    }

    #[test]
    fn the_limits_of_a_pulse() {
        assert_eq!(read(582), TickReading::Rejected);
        assert!(matches!(read(583), TickReading::Usable(_)));
        assert!(matches!(read(1318), TickReading::Usable(_)));
        assert_eq!(read(1319), TickReading::Rejected);
        assert_eq!(reading(&Remote::default(), None), TickReading::Rejected);
    }

    #[test]
    fn every_usable_reading_is_a_pulse_that_the_servos_take() {
        for ticks in 0..70_000 {
            if let TickReading::Usable(duty) = read(ticks) {
                assert!((2331.0..=5272.5).contains(&(duty * PWM_PERIOD_COUNTS)), "{ticks}");
            }
        }
    }

    #[test]
    fn a_channel_is_lost_with_the_tenth_frame_and_back_with_the_next_usable_one() {
        let (config, mut stage) = (Remote::default(), RemoteStage::default());
        let good = RemoteSample { speed: Some(1000), steering: Some(938), selector: Some(750) };
        stage.step(&config, &good);
        assert_eq!(stage.selector(), Selector::Manual);
        for _ in 0..9 {
            stage.step(&config, &RemoteSample::default());
            assert_eq!((stage.selector(), stage.speed(&config)), (Selector::Manual, Stick::Keep));
        }
        stage.step(&config, &RemoteSample::default());
        assert_eq!((stage.selector(), stage.speed(&config)), (Selector::Lost, Stick::Lost));
        stage.step(&config, &good);
        assert_eq!((stage.selector(), stage.speed(&config)), (Selector::Manual, Stick::Counts(4000.0)));
        assert_eq!(stage.rejected(), 30);
    }

    #[test]
    fn a_transmitter_with_its_selector_the_other_way_round() {
        let config = Remote { manual: "above".into(), ..Remote::default() };
        let mut stage = RemoteStage::default();
        stage.step(&config, &RemoteSample { selector: Some(750), ..RemoteSample::default() });
        assert_eq!(stage.selector(), Selector::Automatic);
        stage.step(&config, &RemoteSample { selector: Some(1125), ..RemoteSample::default() });
        assert_eq!(stage.selector(), Selector::Manual);
    }
}
