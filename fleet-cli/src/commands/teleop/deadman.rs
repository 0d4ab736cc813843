//! A gamepad as a hand on the wheel: where its stick is while its deadman button is held. Pure: what the pad says with
//! its time in, the drive out. The page's `gamepad.js` says the same.
//!
//! ```text
//!   up ──deadman pressed──► held ──► a drive
//!    ▲                       │
//!    └── deadman released, pad gone, silent for 3 s, hand taken off ──► spent ──deadman released──► up
//! ```
//! Another pad whose button is held hands nothing over. A button that is held at first, or still held after the hand was taken off (space, a lost focus, a reset), is spent:
//! it has to be released and pressed anew.

use xtb_client::teleop::StickPosition;
use xtb_control::Stamp;

/// Sticks do not return to just 0; of full deflection.
const DEAD_ZONE: f64 = 0.12;
/// No value has changed for so long: a hand is never that still, a lost radio is.
const SILENT_MS: u64 = 3000;

/// What a gamepad says.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(not(feature = "gamepad"), allow(dead_code))] // nobody makes one then
pub(super) struct Pad {
    /// Which one.
    pub(super) id: usize,
    /// Whether a deadman button is held.
    pub(super) deadman: bool,
    /// −1..=1, + = right.
    pub(super) x: f64,
    /// −1..=1, + = ahead.
    pub(super) y: f64,
    /// Counts the changes of all its values.
    pub(super) changes: u64,
}

/// The deadman button's state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
enum State {
    /// It has to be released first.
    #[default]
    Spent,
    Up,
    /// On the pad of this id.
    Held(usize, StickPosition),
}

/// The hand on the gamepad.
#[derive(Debug, Clone, Default)]
pub(super) struct Deadman {
    state: State,
    /// The changes that there were, and since when.
    heard: Option<(u64, Stamp)>,
}

impl Deadman {
    /// What the gamepad says at `now`; `None` = there is none.
    pub(super) fn read(&mut self, now: Stamp, pad: Option<Pad>) {
        let Some(pad) = pad else { return *self = Self::default() };
        if self.heard.is_none_or(|(changes, _)| changes != pad.changes) {
            self.heard = Some((pad.changes, now));
        }
        let silent = self.heard.is_some_and(|(_, since)| now.since_ms(since) > SILENT_MS);
        self.state = match self.state {
            _ if !pad.deadman => State::Up,
            State::Spent => State::Spent,
            State::Held(id, _) if silent || id != pad.id => State::Spent,
            State::Up | State::Held(..) => {
                drive(pad).map_or(State::Spent, |drive| State::Held(pad.id, drive))
            }
        };
    }

    /// What is held counts no more until the deadman button was up.
    pub(super) fn let_go(&mut self) {
        if matches!(self.state, State::Held(..)) {
            self.state = State::Spent;
        }
    }

    /// What is asked for; `None` = nobody holds the deadman button.
    pub(super) fn drive(&self) -> Option<StickPosition> {
        match self.state {
            State::Held(_, drive) => Some(drive),
            State::Spent | State::Up => None,
        }
    }
}

/// The dead zone is round, and what lies beyond it begins at 0. `None` = the stick says no number.
fn drive(Pad { x, y, .. }: Pad) -> Option<StickPosition> {
    if !(x.is_finite() && y.is_finite()) {
        return None;
    }
    let length = x.hypot(y);
    let share =
        if length <= DEAD_ZONE { 0.0 } else { ((length - DEAD_ZONE) / (1.0 - DEAD_ZONE)).min(1.0) / length };
    Some(StickPosition { throttle: y * share, steering: x * share })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Stamp {
        Stamp::from_ms(ms)
    }

    fn pad(deadman: bool, y: f64, changes: u64) -> Option<Pad> {
        Some(Pad { id: 0, deadman, x: 0.0, y, changes })
    }

    fn throttle(hand: &Deadman) -> Option<f64> {
        hand.drive().map(|drive| drive.throttle)
    }

    #[test]
    fn the_button_counts_when_it_is_pressed_and_not_when_it_is_found_held() {
        let mut hand = Deadman::default();
        hand.read(at(0), pad(true, 1.0, 0));
        assert_eq!(throttle(&hand), None, "stuck");
        hand.read(at(20), pad(false, 1.0, 1));
        assert_eq!(throttle(&hand), None);
        hand.read(at(40), pad(true, 1.0, 2));
        assert_eq!(throttle(&hand), Some(1.0));
        hand.read(at(60), pad(true, 0.05, 3));
        assert_eq!(throttle(&hand), Some(0.0), "dead zone");
        hand.let_go();
        hand.read(at(80), pad(true, 1.0, 4));
        assert_eq!(throttle(&hand), None, "it has to be pressed anew");
    }

    #[test]
    fn another_pad_whose_button_is_held_takes_nothing_over() {
        let other = |y, changes| Some(Pad { id: 1, deadman: true, x: 0.0, y, changes });
        let mut hand = Deadman::default();
        hand.read(at(0), pad(false, 1.0, 0));
        hand.read(at(20), pad(true, 1.0, 1));
        assert_eq!(throttle(&hand), Some(1.0));
        hand.read(at(40), other(-1.0, 7));
        assert_eq!(throttle(&hand), None);
        hand.read(at(60), other(-1.0, 8));
        assert_eq!(throttle(&hand), None, "until none is held");
        hand.read(at(80), pad(false, 0.0, 2));
        hand.read(at(100), other(-1.0, 9));
        assert_eq!(throttle(&hand), Some(-1.0));
    }

    #[test]
    fn a_pad_that_is_gone_or_silent_or_says_no_number_drives_nobody() {
        let held = || {
            let mut hand = Deadman::default();
            hand.read(at(0), pad(false, 1.0, 0));
            hand.read(at(20), pad(true, 1.0, 1));
            assert_eq!(throttle(&hand), Some(1.0));
            hand
        };
        let mut hand = held();
        hand.read(at(40), None);
        hand.read(at(60), pad(true, 1.0, 1));
        assert_eq!(throttle(&hand), None, "it was gone");
        let mut hand = held();
        hand.read(at(3020), pad(true, 1.0, 1));
        assert_eq!(throttle(&hand), Some(1.0));
        hand.read(at(3021), pad(true, 1.0, 1));
        assert_eq!(throttle(&hand), None, "silent");
        hand.read(at(3040), pad(true, 1.0, 2));
        assert_eq!(throttle(&hand), None, "until it was released");
        let mut hand = held();
        hand.read(at(40), pad(true, f64::NAN, 2));
        assert_eq!(throttle(&hand), None);
    }
}
