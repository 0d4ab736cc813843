//! Things that stand around a path, as near as a planner with given margins would pass them.

use crate::draw::Draw;
use std::f64::consts::PI;
use xtb_control::frames::MapPose;
use xtb_nav::{Car, Gears, Path};
use xtb_sim::BoxSpec;

const PILLARS: usize = 12;
const CANDIDATES: usize = 400;
/// Between two poses at which the body is checked.
const STEP_M: f64 = 0.02;
/// The obstacle rule's beams reach to 17.5 cm either side; a little more, for a heading that is off.
const HALF_LOOK_OUT_M: f64 = 0.20;

/// A bumper that was nearer than 14 cm to something lets go only 5 cm farther on: so near it should not be …
const LATCH_M: f64 = 0.17;
/// … on the last centimetres before the gear in which it leads.
const LATCH_WAY_M: f64 = 0.10;

/// What a planner keeps free.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Margins {
    /// Around the body.
    pub(crate) body_m: f64,
    /// Beyond the bumper of the direction that is driven, 20 cm to either side.
    pub(crate) look_out_m: f64,
}

/// A pose of a path.
struct Passing {
    pose: MapPose,
    is_ahead: bool,
    /// The gear changes within [`LATCH_WAY_M`].
    near_cusp: bool,
}

/// Everything that the truck covers and looks at along a path.
struct Swept {
    body: Car,
    /// Ahead and astern.
    look_outs: [Car; 2],
    /// What may keep a bumper's latch, ahead and astern.
    latches: [Car; 2],
    passings: Vec<Passing>,
}

/// The strips beyond both bumpers.
fn strips(car: &Car, length_m: f64) -> [Car; 2] {
    let half_width_m = HALF_LOOK_OUT_M;
    let ahead = Car { front_m: car.front_m + length_m, rear_m: -car.front_m, half_width_m, ..*car };
    [ahead, Car { front_m: -car.rear_m, rear_m: car.rear_m + length_m, ..ahead }]
}

impl Swept {
    fn new(path: &Path, car: &Car, margins: &Margins) -> Self {
        let (mut passings, mut start) = (Vec::new(), path.start);
        for (number, piece) in path.pieces.iter().enumerate() {
            let gear = piece.gear();
            let rest = path.pieces[number + 1..].iter();
            let rest_m: f64 =
                rest.clone().take_while(|next| next.gear() == gear).map(|next| next.length_m.abs()).sum();
            let cusp_follows = rest.clone().any(|next| next.gear() != gear);
            let steps = libm::ceil(piece.length_m.abs() / STEP_M);
            for step in 0..=steps as usize {
                let way_m = piece.length_m * step as f64 / steps;
                let left_m = piece.length_m.abs() - way_m.abs() + rest_m;
                let near_cusp = cusp_follows && left_m <= LATCH_WAY_M;
                passings.push(Passing { pose: piece.after(&start, way_m), is_ahead: gear > 0.0, near_cusp });
            }
            start = piece.end(&start);
        }
        let (look_outs, latches) = (strips(car, margins.look_out_m), strips(car, LATCH_M));
        Self { body: car.grown(margins.body_m), look_outs, latches, passings }
    }

    fn is_clear_of(&self, pillar: &Car, place: &MapPose) -> bool {
        !self.passings.iter().any(|Passing { pose, is_ahead, near_cusp }| {
            let (look_out, latch) =
                (&self.look_outs[usize::from(!is_ahead)], &self.latches[usize::from(*is_ahead)]);
            self.body.overlaps(pose, pillar, place)
                || look_out.overlaps(pose, pillar, place)
                || (*near_cusp && latch.overlaps(pose, pillar, place))
        })
    }
}

/// Boxes of 10 to 30 cm near the path, none of them in its way.
pub(crate) fn pillars(seed: u64, path: &Path, car: &Car, margins: &Margins) -> Vec<BoxSpec> {
    let (swept, mut draw) = (Swept::new(path, car, margins), Draw::new(seed ^ 0x0B0C5));
    let mut found = Vec::new();
    for _ in 0..CANDIDATES {
        let (near, _) = path.at(draw.uniform(0.0, path.length_m()));
        let (bearing_rad, away_m) = (draw.uniform(-PI, PI), draw.uniform(0.25, 0.9));
        let (width_m, depth_m) = (draw.uniform(0.1, 0.3), draw.uniform(0.1, 0.3));
        let place = MapPose {
            x_m: near.x_m + away_m * libm::cos(bearing_rad),
            y_m: near.y_m + away_m * libm::sin(bearing_rad),
            yaw_rad: draw.uniform(-PI, PI),
        };
        let half_m = width_m / 2.0;
        let pillar = Car {
            front_m: half_m,
            rear_m: half_m,
            half_width_m: depth_m / 2.0,
            radius_m: 1.0,
            gears: Gears::BOTH,
        };
        if found.len() < PILLARS && swept.is_clear_of(&pillar, &place) {
            let MapPose { x_m, y_m, yaw_rad } = place;
            found.push(BoxSpec { x_m, y_m, width_m, depth_m, yaw_rad });
        }
    }
    found
}
