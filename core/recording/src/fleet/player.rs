//! Where a recording is played: position, speed, pause, seek, and what is due. Pure: how much time has
//! passed comes in as an argument, messages come from whoever reads them.
//!
//! ```text
//!            elapsed × speed               end, `repeat`
//!  paused ◄──────────────── playing ──────────────────────► at its beginning again
//!     └──────────────────────► │  end
//!                              ▼
//!                            ended (a seek plays on)
//! ```

use super::reader::TimeSpan;
use std::time::Duration;
use xtb_protocol::keys::Channel;

const NS_PER_MS: u64 = 1_000_000;
/// A scene at a place far from the present one is built from this much before it: a whole trail.
const LEAD_IN_NS: u64 = 30_000 * NS_PER_MS;

/// How a recording is played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaySettings {
    /// Times as fast as it was; finite and above 0.
    pub speed: f64,
    /// Where it begins, from the first message.
    pub from_ms: u64,
    /// Whether it begins anew at its end.
    pub repeat: bool,
}

impl Default for PlaySettings {
    fn default() -> Self {
        Self { speed: 1.0, from_ms: 0, repeat: false }
    }
}

/// What to do next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Move {
    /// Take in what is due.
    On,
    /// Read from the beginning again, and build the scene anew at the position.
    Again,
}

/// The place in a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Player {
    span: TimeSpan,
    position_ns: u64,
    speed: f64,
    repeat: bool,
    paused: bool,
    again: bool,
}

impl Player {
    /// At the place that the settings name.
    #[must_use]
    pub fn new(span: TimeSpan, settings: PlaySettings) -> Self {
        let mut player = Self {
            span,
            position_ns: 0,
            speed: settings.speed,
            repeat: settings.repeat,
            paused: false,
            again: false,
        };
        player.seek(settings.from_ms);
        player
    }

    /// Time has passed.
    pub fn advance(&mut self, elapsed: Duration) -> Move {
        if std::mem::take(&mut self.again) {
            return Move::Again;
        }
        if self.paused || self.ended() && !self.repeat {
            return Move::On;
        }
        if self.ended() {
            self.position_ns = 0;
            return Move::Again;
        }
        let passed_ns = (elapsed.as_secs_f64() * self.speed * 1e9).max(0.0) as u64;
        self.position_ns = self.position_ns.saturating_add(passed_ns).min(self.span.duration_ns());
        Move::On
    }

    /// Goes to another place, at most to the end.
    pub fn seek(&mut self, position_ms: u64) {
        self.position_ns = position_ms.saturating_mul(NS_PER_MS).min(self.span.duration_ns());
        self.again = true;
    }

    /// Stands, or goes on.
    pub fn pause(&mut self, paused: bool) {
        self.paused = paused;
    }

    /// Plays this many times as fast as it was.
    pub fn set_speed(&mut self, speed: f64) {
        if speed.is_finite() && speed > 0.0 {
            self.speed = speed;
        }
    }

    /// Whether a message of this time is due.
    #[must_use]
    pub fn is_due(&self, log_ns: u64) -> bool {
        log_ns.saturating_sub(self.span.began_ns) <= self.position_ns
    }

    /// When a message came, by the recording's clock.
    #[must_use]
    pub fn at_ms(&self, log_ns: u64) -> u64 {
        log_ns.saturating_sub(self.span.began_ns) / NS_PER_MS
    }

    /// Whether a scene that is built anew at the position needs this message.
    #[must_use]
    pub fn is_needed(&self, log_ns: u64, channel: &Channel) -> bool {
        let before_ns = self.position_ns.saturating_sub(log_ns.saturating_sub(self.span.began_ns));
        before_ns <= LEAD_IN_NS || outlives(channel)
    }

    /// Where it is, from the first message.
    #[must_use]
    pub fn position_ms(&self) -> u64 {
        self.position_ns / NS_PER_MS
    }

    /// How long the recording is.
    #[must_use]
    pub fn duration_ms(&self) -> u64 {
        self.span.duration_ns() / NS_PER_MS
    }

    /// When its first message came, in ms since 1970.
    #[must_use]
    pub fn began_ms(&self) -> u64 {
        self.span.began_ns / NS_PER_MS
    }

    /// Times as fast as it was.
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Whether it stands because somebody wants that.
    #[must_use]
    pub fn paused(&self) -> bool {
        self.paused
    }

    /// Whether it is at its end.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.position_ns == self.span.duration_ns()
    }
}

/// Whether what a channel says still holds when it has said nothing for long.
fn outlives(channel: &Channel) -> bool {
    !matches!(
        channel,
        Channel::State
            | Channel::StateJson
            | Channel::Sensors
            | Channel::Route
            | Channel::Near(_)
            | Channel::Fix
            | Channel::Teleop(_)
            | Channel::TrafficState
            | Channel::SimTruth
            | Channel::SimStats
            | Channel::DispatchTasks
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEGAN_NS: u64 = 1_700_000_000_000_000_000;

    fn player(settings: PlaySettings) -> Player {
        let span = TimeSpan { began_ns: BEGAN_NS, ended_ns: BEGAN_NS + 100_000 * NS_PER_MS };
        let mut player = Player::new(span, settings);
        assert_eq!(player.advance(Duration::ZERO), Move::Again);
        player
    }

    fn at(ms: u64) -> u64 {
        BEGAN_NS + ms * NS_PER_MS
    }

    #[test]
    fn what_is_due_goes_with_time_and_speed() {
        let mut player = player(PlaySettings { speed: 4.0, ..Default::default() });
        assert_eq!(player.advance(Duration::from_millis(250)), Move::On);
        assert_eq!((player.position_ms(), player.at_ms(at(900))), (1000, 900));
        assert!(player.is_due(at(1000)) && !player.is_due(at(1001)));
    }

    #[test]
    fn it_stands_while_it_is_paused() {
        let mut player = player(PlaySettings { from_ms: 5000, ..Default::default() });
        player.pause(true);
        assert_eq!(player.advance(Duration::from_secs(9)), Move::On);
        assert_eq!(player.position_ms(), 5000);
        player.pause(false);
        player.advance(Duration::from_secs(1));
        assert_eq!(player.position_ms(), 6000);
    }

    #[test]
    fn it_ends_at_its_end_or_begins_anew() {
        let mut once = player(PlaySettings::default());
        once.advance(Duration::from_secs(1000));
        assert!(once.ended() && once.advance(Duration::from_secs(1)) == Move::On && once.ended());
        once.seek(7);
        assert_eq!((once.advance(Duration::from_secs(1)), once.position_ms()), (Move::Again, 7));
        let mut looped = player(PlaySettings { repeat: true, ..Default::default() });
        looped.advance(Duration::from_secs(1000));
        assert_eq!((looped.advance(Duration::from_secs(1)), looped.position_ms()), (Move::Again, 0));
    }

    #[test]
    fn a_place_far_away_needs_what_holds_still_and_the_last_half_minute() {
        let player = player(PlaySettings { from_ms: 90_000, ..Default::default() });
        assert!(
            player.is_needed(at(61_000), &Channel::State) && !player.is_needed(at(59_000), &Channel::State)
        );
        assert!(player.is_needed(at(0), &Channel::Map) && player.is_needed(at(0), &Channel::Alive));
        assert!(player.is_needed(at(0), &Channel::Event));
    }

    #[test]
    fn no_speed_stops_or_turns_time() {
        let mut player = player(PlaySettings::default());
        for speed in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            player.set_speed(speed);
        }
        assert_eq!(player.speed(), 1.0);
    }
}
