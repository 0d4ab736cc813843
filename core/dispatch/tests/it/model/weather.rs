//! How bad a world of the model is, and what people want in it.

use super::START_MS;
use xtb_nav::rooms::Draw;
use xtb_protocol::Name;
use xtb_protocol::messages::{LinkLoss, OnTakeover, TaskKind, TaskSpec, Waypoint, Who};

/// A rule that is switched off, to see that its breach is noticed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Off {
    Nothing,
    /// The ledger says *written* before it is.
    Durability,
    /// Robots take assignments in any order, and again.
    Fence,
    /// A silent robot's task is given away at once.
    Grace,
    /// Clients ask again with a new id.
    SameId,
}

/// How bad a world is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Weather {
    pub(crate) off: Off,
    pub(crate) robots: usize,
    pub(crate) tasks: usize,
    /// Share of messages that are lost, and of those that are held up.
    pub(crate) loss: f64,
    /// For how long at most, in ms.
    pub(crate) slow_ms: i64,
    /// Share of writes at which the dispatcher dies; half of them before they are durable.
    pub(crate) crash: f64,
    /// Share of writes that fail.
    pub(crate) full: f64,
    /// Dies at exactly this write: its number, and whether that is durable.
    pub(crate) crash_at: Option<(u64, bool)>,
    /// Fails exactly from this write on, for two seconds.
    pub(crate) full_at: Option<u64>,
    /// Per robot and second.
    pub(crate) partitions: f64,
    pub(crate) reboots: f64,
    pub(crate) takeovers: f64,
    pub(crate) latches: f64,
    /// Emergency stops of all robots, per second.
    pub(crate) fleet_stops: f64,
    /// Share of starts of the dispatcher at which the fleet has another map.
    pub(crate) moves: f64,
    /// Something stands in the way for a while.
    pub(crate) obstacles: f64,
    pub(crate) cancels: bool,
    /// Routes are driven once, and people add points to them.
    pub(crate) extensions: bool,
    /// How long routes stand at their points, in s; 0 = they pass them.
    pub(crate) dwell_s: f64,
}

impl Weather {
    pub(crate) const CALM: Self = Self {
        off: Off::Nothing,
        robots: 3,
        tasks: 8,
        loss: 0.0,
        slow_ms: 1500,
        crash: 0.0,
        full: 0.0,
        crash_at: None,
        full_at: None,
        partitions: 0.0,
        reboots: 0.0,
        takeovers: 0.0,
        latches: 0.0,
        fleet_stops: 0.0,
        moves: 0.0,
        obstacles: 0.0,
        cancels: false,
        extensions: false,
        dwell_s: 0.2,
    };
    pub(crate) const STORM: Self = Self {
        loss: 0.05,
        crash: 0.02,
        full: 0.02,
        partitions: 0.02,
        reboots: 0.01,
        takeovers: 0.01,
        latches: 0.01,
        fleet_stops: 0.01,
        moves: 0.3,
        obstacles: 0.03,
        cancels: true,
        ..Self::CALM
    };
}

/// Where nobody gets to.
pub(super) const DOOMED: (f64, f64) = (1.0, 1.0);

pub(super) fn point(draw: &mut Draw) -> Waypoint {
    if draw.whole(0, 15) == 0 {
        return Waypoint { x_m: DOOMED.0, y_m: DOOMED.1, yaw_rad: None };
    }
    Waypoint { x_m: draw.uniform(-3.0, 3.0), y_m: draw.uniform(-3.0, 3.0), yaw_rad: None }
}

/// A task of some kind.
pub(super) fn spec(draw: &mut Draw, weather: Weather) -> TaskSpec {
    let kind = match draw.whole(0, 5) {
        0..=2 => TaskKind::Goto { to: point(draw) },
        3 => {
            let loops = if weather.extensions { 1 } else { 2 };
            TaskKind::Route { points: (0..3).map(|_| point(draw)).collect(), loops, dwell_s: weather.dwell_s }
        }
        4 => TaskKind::Patrol {
            points: (0..2).map(|_| point(draw)).collect(),
            dwell_s: 0.0,
            for_s: Some(12.0),
        },
        _ => TaskKind::Wander { for_s: 3.0 },
    };
    let mut spec = TaskSpec::new(kind);
    spec.priority = draw.whole(0, 9) as u8;
    spec.grace_s = if weather.off == Off::Grace { 0.0 } else { draw.uniform(0.0, 8.0) };
    spec.finish_s = 20.0;
    if draw.whole(0, 2) == 0 {
        spec.on_link_loss = LinkLoss::Finish;
    }
    if draw.whole(0, 3) == 0 {
        spec.who = Who::Robot(Name::new(&format!("xtb-{}", draw.whole(1, weather.robots as i64))).unwrap());
    }
    spec.on_takeover = [OnTakeover::Requeue, OnTakeover::Resume, OnTakeover::Fail][draw.whole(0, 2) as usize];
    if draw.whole(0, 9) == 0 {
        spec.deadline_ms = Some(START_MS + draw.whole(20_000, 60_000) as u64);
    }
    spec
}
