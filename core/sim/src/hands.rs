//! What a person does to a truck with their hands: push it, turn it, lift it; what they hold before its range
//! finders is in `simulation/held.rs`.
//!
//! For a truck that is brought up: nothing of this happens unless it is asked for.

use crate::step::STEP_S;

/// The wheels are turned so fast, in m/s of the tyre, and the truck so fast, in °/s.
const ROLL_MPS: f64 = 0.2;
const TURN_DPS: f64 = 45.0;

/// What hands do to a truck; what they turn, they let go when it is done.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Hands {
    /// The wheels are turned as if the truck rolled by so much, in m, + = ahead.
    pub roll_m: f64,
    /// The whole truck is turned on the spot by so much, in °, + = clockwise seen from above.
    pub turn_deg: f64,
    /// Its nose is lifted by so much, in °.
    pub nose_up_deg: f64,
    /// Its left side is lifted by so much, in °.
    pub left_up_deg: f64,
}

impl Hands {
    /// The speed at which they turn the wheels in this step, in m/s.
    pub(crate) fn roll(&mut self) -> Option<f64> {
        part(&mut self.roll_m, ROLL_MPS * STEP_S).map(|way_m| way_m / STEP_S)
    }

    /// By how much they turn the truck in this step, in °.
    pub(crate) fn turn(&mut self) -> Option<f64> {
        part(&mut self.turn_deg, TURN_DPS * STEP_S)
    }
}

/// What of the rest is done in a step, which leaves less of it.
fn part(rest: &mut f64, most: f64) -> Option<f64> {
    let done = rest.clamp(-most, most);
    *rest -= done;
    (done != 0.0).then_some(done)
}
