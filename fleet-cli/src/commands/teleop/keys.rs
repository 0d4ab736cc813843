//! Keys to setpoints, hold-to-run. Pure: key events with their time in, what to send out.
//!
//! Two kinds of terminals:
//! * those that **report releases**: a key acts for exactly as long as it is held (and is heard of:
//!   a held key repeats, so 1.5 s of silence means that the line to the terminal is frozen);
//! * all others: each press is a **pulse** of 250 ms that key repeats extend; steering goes in steps
//!   and stays.
//!
//! ```text
//!   standing ──press──► driving ──released, pulse over, space, focus lost──► ending (zeros, 300 ms) ──► standing
//! ```
//! While it stands nothing is sent, so that watching is not commanding.

use super::deadman::{Deadman, Pad};
use xtb_client::teleop::StickPosition;
use xtb_control::Stamp;

/// How long a press acts where releases are not reported.
pub(crate) const PULSE_MS: u64 = 250;
/// A held key repeats; after this long without a word from the terminal its release may be lost.
const SILENT_MS: u64 = 1500;
/// Zeros are sent for this long after the last motion: one of them gets through.
const ENDING_MS: u64 = 300;
/// Of full steering.
const STEERING_STEP: f64 = 0.25;

/// What the terminal tells of keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reporting {
    /// Presses, repeats and releases.
    Releases,
    /// Presses only; a repeat looks like one.
    Presses,
}

/// A key with a meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Key {
    /// Drive ahead.
    Ahead,
    /// Drive astern.
    Astern,
    /// Steer left.
    Left,
    /// Steer right.
    Right,
    /// Stand, steering straight.
    Stop,
}

/// What happened to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Action {
    /// It went down.
    Press,
    /// It is still down.
    Repeat,
    /// It went up.
    Release,
}

/// The keyboard's state.
#[derive(Debug, Clone)]
pub(crate) struct Keyboard {
    reporting: Reporting,
    /// Ahead, astern, left, right.
    held: [bool; 4],
    /// Direction and end of the present pulse.
    pulse: Option<(f64, Stamp)>,
    steps: f64,
    /// Until when zeros are sent.
    ending: Option<Stamp>,
    moving: bool,
    /// When the terminal last told of a key.
    heard: Stamp,
    /// The hand on a gamepad.
    pad: Deadman,
}

impl Keyboard {
    /// No key touched.
    pub(crate) fn new(reporting: Reporting) -> Self {
        Self {
            reporting,
            held: [false; 4],
            pulse: None,
            steps: 0.0,
            ending: None,
            moving: false,
            heard: Stamp::ZERO,
            pad: Deadman::default(),
        }
    }

    /// A key event.
    pub(crate) fn key(&mut self, now: Stamp, key: Key, action: Action) {
        self.heard = now;
        match (self.reporting, action) {
            _ if key == Key::Stop => {
                if action != Action::Release {
                    self.let_go();
                    self.steps = 0.0;
                }
            }
            (Reporting::Releases, Action::Press) => self.held[place(key)] = true,
            (Reporting::Releases, Action::Release) => self.held[place(key)] = false,
            // A key that is still down after space or a lost focus must be pressed anew.
            (Reporting::Releases, Action::Repeat) => {}
            (Reporting::Presses, Action::Press | Action::Repeat) => self.pulse(now, key),
            (Reporting::Presses, Action::Release) => {}
        }
    }

    /// What the gamepad says; `None` = there is none. While its deadman button is held, it drives instead of keys.
    pub(super) fn pad(&mut self, now: Stamp, pad: Option<Pad>) {
        self.pad.read(now, pad);
    }

    fn pulse(&mut self, now: Stamp, key: Key) {
        match key {
            Key::Ahead => self.pulse = Some((1.0, now.plus_ms(PULSE_MS))),
            Key::Astern => self.pulse = Some((-1.0, now.plus_ms(PULSE_MS))),
            Key::Left => self.steps = (self.steps - STEERING_STEP).max(-1.0),
            Key::Right => self.steps = (self.steps + STEERING_STEP).min(1.0),
            Key::Stop => {}
        }
    }

    /// The hand is gone, or may be: focus lost, leaving.
    pub(crate) fn let_go(&mut self) {
        self.let_go_of_keys();
        self.pad.let_go();
    }

    fn let_go_of_keys(&mut self) {
        self.held = [false; 4];
        self.pulse = None;
    }

    /// What is asked for at `now`.
    pub(crate) fn drive(&self, now: Stamp) -> StickPosition {
        if let Some(drive) = self.pad.drive() {
            return drive;
        }
        let [ahead, astern, left, right] = self.held.map(|held| f64::from(u8::from(held)));
        match self.reporting {
            Reporting::Releases => StickPosition { throttle: ahead - astern, steering: right - left },
            Reporting::Presses => {
                let throttle = self.pulse.filter(|(_, until)| now < *until).map_or(0.0, |(way, _)| way);
                StickPosition { throttle, steering: self.steps }
            }
        }
    }

    /// What to send at `now`; `None` = nothing, the truck's silence is its own.
    pub(crate) fn send(&mut self, now: Stamp) -> Option<StickPosition> {
        if now.since_ms(self.heard) >= SILENT_MS {
            self.let_go_of_keys();
        }
        let drive = self.drive(now);
        let steering = self.reporting == Reporting::Releases && drive.steering != 0.0;
        if drive.throttle != 0.0 || steering {
            self.moving = true;
            self.ending = None;
            return Some(drive);
        }
        if std::mem::take(&mut self.moving) {
            self.ending = Some(now.plus_ms(ENDING_MS));
        }
        self.ending = self.ending.filter(|until| now < *until);
        self.ending.map(|_| StickPosition { throttle: 0.0, ..drive })
    }
}

fn place(key: Key) -> usize {
    match key {
        Key::Ahead => 0,
        Key::Astern => 1,
        Key::Left => 2,
        // Stop is never held.
        Key::Right | Key::Stop => 3,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AHEAD: StickPosition = StickPosition { throttle: 1.0, steering: 0.0 };
    const ZERO: StickPosition = StickPosition { throttle: 0.0, steering: 0.0 };

    fn at(ms: u64) -> Stamp {
        Stamp::from_ms(ms)
    }

    #[test]
    fn a_release_means_zero_at_once_then_silence() {
        let mut keys = Keyboard::new(Reporting::Releases);
        assert_eq!(keys.send(at(0)), None);
        keys.key(at(0), Key::Ahead, Action::Press);
        for ms in (0..=5000).step_by(500) {
            keys.key(at(ms), Key::Ahead, Action::Repeat);
            assert_eq!(keys.send(at(ms)), Some(AHEAD));
        }
        keys.key(at(5001), Key::Ahead, Action::Release);
        assert_eq!(keys.send(at(5001)), Some(ZERO));
        assert_eq!(keys.send(at(5300)), Some(ZERO));
        assert_eq!(keys.send(at(5301)), None);
    }

    #[test]
    fn a_terminal_that_falls_silent_is_a_released_key() {
        let mut keys = Keyboard::new(Reporting::Releases);
        keys.key(at(0), Key::Ahead, Action::Press);
        assert_eq!(keys.send(at(1499)), Some(AHEAD));
        assert_eq!(keys.send(at(1500)), Some(ZERO));
        keys.key(at(1600), Key::Ahead, Action::Repeat);
        assert_eq!(keys.send(at(1601)), Some(ZERO), "it must be pressed anew");
    }

    #[test]
    fn held_keys_combine() {
        let mut keys = Keyboard::new(Reporting::Releases);
        keys.key(at(0), Key::Astern, Action::Press);
        keys.key(at(0), Key::Left, Action::Press);
        assert_eq!(keys.send(at(1)), Some(StickPosition { throttle: -1.0, steering: -1.0 }));
        keys.key(at(2), Key::Ahead, Action::Press);
        keys.key(at(2), Key::Left, Action::Release);
        assert_eq!(keys.send(at(2)), Some(ZERO));
    }

    #[test]
    fn after_space_or_lost_focus_a_held_key_must_be_pressed_anew() {
        for lose in [
            |keys: &mut Keyboard| keys.key(at(10), Key::Stop, Action::Press),
            |keys: &mut Keyboard| keys.let_go(),
        ] {
            let mut keys = Keyboard::new(Reporting::Releases);
            keys.key(at(0), Key::Ahead, Action::Press);
            assert_eq!(keys.send(at(0)), Some(AHEAD));
            lose(&mut keys);
            keys.key(at(20), Key::Ahead, Action::Repeat);
            assert_eq!(keys.send(at(20)), Some(ZERO));
            keys.key(at(30), Key::Ahead, Action::Press);
            assert_eq!(keys.send(at(30)), Some(AHEAD));
        }
    }

    #[test]
    fn without_releases_a_press_is_a_pulse_that_repeats_extend() {
        let mut keys = Keyboard::new(Reporting::Presses);
        keys.key(at(0), Key::Ahead, Action::Press);
        assert_eq!(keys.send(at(249)), Some(AHEAD));
        keys.key(at(249), Key::Ahead, Action::Press);
        assert_eq!(keys.send(at(498)), Some(AHEAD));
        assert_eq!(keys.send(at(499)), Some(ZERO));
        assert_eq!(keys.send(at(798)), Some(ZERO));
        assert_eq!(keys.send(at(799)), None);
    }

    #[test]
    fn without_releases_steering_is_stepped_and_stays() {
        let mut keys = Keyboard::new(Reporting::Presses);
        for _ in 0..6 {
            keys.key(at(0), Key::Right, Action::Press);
        }
        keys.key(at(0), Key::Left, Action::Press);
        assert_eq!(keys.send(at(0)), None);
        assert_eq!(keys.drive(at(9000)).steering, 0.75);
        keys.key(at(9000), Key::Astern, Action::Press);
        assert_eq!(keys.send(at(9000)), Some(StickPosition { throttle: -1.0, steering: 0.75 }));
        keys.key(at(9001), Key::Stop, Action::Press);
        assert_eq!(keys.send(at(9001)), Some(ZERO));
    }

    #[test]
    fn a_gamepad_drives_while_its_button_is_held_and_its_end_means_zero_at_once() {
        let mut keys = Keyboard::new(Reporting::Presses);
        let pad = |deadman, changes| Some(Pad { id: 0, deadman, x: 0.0, y: 1.0, changes });
        keys.pad(at(0), pad(false, 0));
        assert_eq!(keys.send(at(10)), None);
        for n in 1..=200 {
            keys.pad(at(20 * n), pad(true, n));
            assert_eq!(keys.send(at(20 * n)), Some(AHEAD));
        }
        keys.pad(at(4020), None);
        assert_eq!((keys.send(at(4020)), keys.send(at(4400))), (Some(ZERO), None), "unplugged");
        keys.pad(at(5000), pad(false, 500));
        keys.pad(at(5020), pad(true, 501));
        assert_eq!(keys.send(at(5020)), Some(AHEAD));
        keys.key(at(5030), Key::Stop, Action::Press);
        keys.pad(at(5040), pad(true, 502));
        assert_eq!(keys.send(at(5040)), Some(ZERO), "space takes the hand off the gamepad too");
    }

    #[test]
    fn the_other_direction_takes_over_at_once() {
        let mut keys = Keyboard::new(Reporting::Presses);
        keys.key(at(0), Key::Ahead, Action::Press);
        keys.key(at(50), Key::Astern, Action::Press);
        assert_eq!(keys.send(at(50)).unwrap().throttle, -1.0);
    }
}
