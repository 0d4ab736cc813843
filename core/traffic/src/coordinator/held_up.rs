//! What keeps a single truck from driving its released way, and is on no map: its next way leads around it.
//!
//! Most often it is right ahead of a bumper, where another truck has passed or something was put down: nearer than
//! its range finders can tell (`obstacle.foldback_latch`), so that it has to back off before it is believed that
//! nothing stands there. Nobody else is led around it: most such things are trucks, whose places are known.

use super::RobotView;
use super::job::Block;
use super::truck::Truck;
use super::unknown::{BELIEVED_MS, HALF_M, NAME};
use xtb_control::Stamp;
use xtb_nav::geometry::rect::{Rect, Stand};
use xtb_nav::{Car, Gears, MapPose};

/// A truck that has gone so far since has looked again, in m: twice what its range finders have to back off
/// (`obstacle.foldback_retreat_m`).
const GONE_M: f64 = 0.1;
/// Half its side is no more than this part of its distance from the body, which must not stand in it.
const PART: f64 = 0.6;
/// What is nearer to the body than this is left to the truck, in m; chosen, not measured.
const TOUCHES_M: f64 = 0.02;
/// No truck has this number.
const ID: u32 = 0;

/// Something that a stalled truck has reported.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeldUp {
    at_m: [f64; 2],
    /// Where the truck stood.
    from: MapPose,
    /// When it was reported last.
    seen: Stamp,
}

impl HeldUp {
    /// What this report says of it.
    pub(super) fn reported(now: Stamp, view: &RobotView) -> Option<Self> {
        let at_m = view.blocked_at_m.filter(|at_m| at_m.iter().all(|m| m.is_finite()))?;
        Some(Self { at_m, from: view.pose, seen: now })
    }
}

impl Truck {
    /// What it is led around and nobody else is, if there is something.
    pub(super) fn own_block(&self, now: Stamp) -> Option<Block> {
        let HeldUp { at_m: [x_m, y_m], from, seen } = self.held_up?;
        let gone_m = libm::hypot(self.view.pose.x_m - from.x_m, self.view.pose.y_m - from.y_m);
        let off_m = Rect::body(&self.car(), &self.view.pose).distance_m(x_m, y_m);
        if now.since_ms(seen) >= BELIEVED_MS || gone_m > GONE_M || off_m < TOUCHES_M {
            return None;
        }
        let half_m = HALF_M.min(PART * off_m);
        let square =
            Car { front_m: half_m, rear_m: half_m, half_width_m: half_m, radius_m: 1.0, gears: Gears::BOTH };
        let stands = vec![Stand::still(&square, &MapPose { x_m, y_m, yaw_rad: from.yaw_rad })];
        Some(Block { id: ID, only: Some(self.id), name: NAME.to_owned(), stands })
    }
}
