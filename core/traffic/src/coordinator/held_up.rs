//! What keeps a single truck from driving its released way, and is on no map: its next way leads around it.
//!
//! Most often it is right ahead of a bumper, where another truck has passed or something was put down: nearer than
//! its range finders can tell (`obstacle.foldback_latch`), so that it has to back off before it is believed that
//! nothing stands there. Nobody else is led around it: most such things are trucks, whose places are known.

use super::ReportedRobot;
use super::job::Block;
use xtb_control::Stamp;
use xtb_nav::geometry::rect::{Rect, Stand};
use xtb_nav::{Car, Gears, MapPose};

/// A thing is believed in for so long after it was reported last, in ms; chosen, not measured.
pub(super) const BELIEVED_MS: u64 = 20_000;
/// Half its side, in m: a range finder sees the middle of its front. How large it is nobody knows; chosen,
/// not measured.
pub(super) const HALF_M: f64 = 0.1;
/// What it is called.
pub(super) const NAME: &str = "an unmapped obstacle";
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
    pub(super) fn reported(now: Stamp, view: &ReportedRobot) -> Option<Self> {
        let at_m = view.blocked_at_m.filter(|at_m| at_m.iter().all(|m| m.is_finite()))?;
        Some(Self { at_m, from: view.pose, seen: now })
    }

    /// What the truck of this number, which is here now, is led around and nobody else is, if there is something.
    pub(super) fn block(self, now: Stamp, (id, car, pose): (u32, &Car, &MapPose)) -> Option<Block> {
        let Self { at_m: [x_m, y_m], from, seen } = self;
        let gone_m = libm::hypot(pose.x_m - from.x_m, pose.y_m - from.y_m);
        let off_m = Rect::body(car, pose).distance_m(x_m, y_m);
        if now.since_ms(seen) >= BELIEVED_MS || gone_m > GONE_M || off_m < TOUCHES_M {
            return None;
        }
        let half_m = HALF_M.min(PART * off_m);
        let square =
            Car { front_m: half_m, rear_m: half_m, half_width_m: half_m, radius_m: 1.0, gears: Gears::BOTH };
        let stands = vec![Stand::still(&square, &MapPose { x_m, y_m, yaw_rad: from.yaw_rad })];
        Some(Block { id: ID, only: Some(id), name: NAME.to_owned(), stands })
    }
}
