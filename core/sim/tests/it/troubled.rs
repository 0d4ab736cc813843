//! A source of fixes that is wrong in ways it does not know of: frozen, another robot's, late, turned.

use crate::draw::Draw;
use std::collections::VecDeque;
use std::f64::consts::PI;
use xtb_control::frames::{MapPose, wrap_rad};
use xtb_control::units::Stamp;
use xtb_nav::localization::StampedFix;

/// What is wrong with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Trouble {
    Nothing,
    /// From time to time it repeats its last fix for so many seconds, with so much noise on it, in m.
    Frozen {
        s: f64,
        noise_m: f64,
    },
    /// From time to time it gives another robot's pose for so many seconds.
    Swapped {
        s: f64,
    },
    /// From time to time its yaw is turned about for so many seconds.
    TurnedAbout {
        s: f64,
    },
    /// Fixes come late and say that they are new.
    Undeclared,
    /// Its clock runs slow by this part.
    SlowClock(f64),
    /// Its frame is turned about the map's origin, in rad.
    Frame(f64),
}

/// The other robot is where this one was so long ago, elsewhere.
const OTHER_S: f64 = 23.0;
const OTHER_TURN_RAD: f64 = 2.1;
const OTHER_M: [f64; 2] = [1.5, -2.0];

/// The source of one truck.
pub(crate) struct Troubled {
    trouble: Trouble,
    draw: Draw,
    /// From when to when it is wrong.
    wrong: (Stamp, Stamp),
    held: Option<StampedFix>,
    past: VecDeque<(Stamp, MapPose)>,
}

impl Troubled {
    pub(crate) fn new(trouble: Trouble, seed: u64) -> Self {
        let mut troubled = Self {
            trouble,
            draw: Draw::new(seed ^ 0x7E0B_1E5E),
            wrong: (Stamp::ZERO, Stamp::ZERO),
            held: None,
            past: VecDeque::new(),
        };
        troubled.plan(Stamp::from_s(OTHER_S));
        troubled
    }

    fn plan(&mut self, now: Stamp) {
        let s = match self.trouble {
            Trouble::Frozen { s, .. } | Trouble::Swapped { s } | Trouble::TurnedAbout { s } => s,
            _ => 0.0,
        };
        let begins = now.plus_ns(Stamp::from_s(self.draw.uniform(15.0, 45.0)).ns());
        self.wrong = (begins, begins.plus_ns(Stamp::from_s(s).ns()));
    }

    /// Where the truck really is, at each step.
    pub(crate) fn step(&mut self, now: Stamp, truth: &MapPose) {
        if now >= self.wrong.1 {
            self.plan(now);
        }
        if matches!(self.trouble, Trouble::Swapped { .. }) {
            self.past.push_back((now, *truth));
            while self.past.front().is_some_and(|(at, _)| now.since_s(*at) > OTHER_S) {
                self.past.pop_front();
            }
        }
    }

    fn other(&self) -> MapPose {
        let MapPose { x_m, y_m, yaw_rad } =
            self.past.front().map_or_else(|| MapPose { x_m: 9.0, y_m: 9.0, yaw_rad: 0.0 }, |(_, pose)| *pose);
        let (sin, cos) = libm::sincos(OTHER_TURN_RAD);
        MapPose {
            x_m: x_m * cos - y_m * sin + OTHER_M[0],
            y_m: x_m * sin + y_m * cos + OTHER_M[1],
            yaw_rad: wrap_rad(yaw_rad + OTHER_TURN_RAD),
        }
    }

    /// What becomes of a fix that arrives now; `truth` is where the truck is.
    pub(crate) fn spoil(&mut self, now: Stamp, fix: StampedFix, truth: &MapPose) -> StampedFix {
        let is_wrong = (self.wrong.0..self.wrong.1).contains(&now);
        let wrong = match self.trouble {
            Trouble::Undeclared => StampedFix { stamp: now, ..fix },
            Trouble::SlowClock(part) => {
                StampedFix { stamp: Stamp::from_s(fix.stamp.s() * (1.0 - part)), ..fix }
            }
            Trouble::Frame(rad) => {
                let (sin, cos) = libm::sincos(rad);
                let (x_m, y_m) = (fix.x_m * cos - fix.y_m * sin, fix.x_m * sin + fix.y_m * cos);
                StampedFix { x_m, y_m, yaw_rad: fix.yaw_rad.map(|yaw_rad| wrap_rad(yaw_rad + rad)), ..fix }
            }
            _ if !is_wrong => fix,
            Trouble::Frozen { noise_m, .. } => {
                let StampedFix { x_m, y_m, yaw_rad, .. } = self.held.unwrap_or(fix);
                let mut noise = || self.draw.uniform(-noise_m, noise_m);
                return StampedFix { x_m: x_m + noise(), y_m: y_m + noise(), yaw_rad, ..fix };
            }
            Trouble::Swapped { .. } => {
                let (noise_x_m, noise_y_m) = (fix.x_m - truth.x_m, fix.y_m - truth.y_m);
                let MapPose { x_m, y_m, yaw_rad } = self.other();
                let yaw_rad = fix.yaw_rad.map(|own| wrap_rad(yaw_rad + own - truth.yaw_rad));
                StampedFix { x_m: x_m + noise_x_m, y_m: y_m + noise_y_m, yaw_rad, ..fix }
            }
            Trouble::TurnedAbout { .. } => {
                StampedFix { yaw_rad: fix.yaw_rad.map(|yaw_rad| wrap_rad(yaw_rad + PI)), ..fix }
            }
            Trouble::Nothing => fix,
        };
        self.held = Some(wrong);
        wrong
    }

    /// How far the pose may be off by what no filter can know, in m.
    pub(crate) fn allowance_m(&self, truth: &MapPose) -> f64 {
        match self.trouble {
            Trouble::Frame(rad) => rad * libm::hypot(truth.x_m, truth.y_m),
            _ => 0.0,
        }
    }
}
