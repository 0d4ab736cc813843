//! What traffic control hears of robots, and what it tells them.

use xtb_nav::{Car, MapPose, Path};

/// A goal that a robot goes for by a planned way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedGoal {
    /// The request's id.
    pub id: u128,
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// Heading there; `None` = any.
    pub yaw_rad: Option<f64>,
}

/// The route by which a robot goes, as it says itself.
#[derive(Debug, Clone, PartialEq)]
pub struct RouteReport {
    /// Number of the coordinator's plan.
    pub plan: u64,
    /// The path.
    pub path: Path,
    /// Driven along it, in m.
    pub done_m: f64,
    /// Released along it as far as it knows, in m.
    pub release_m: f64,
}

/// What a robot says of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportedRobot {
    /// Its name.
    pub name: String,
    /// Its boot.
    pub epoch: u64,
    /// Its body and turning circle; `None` = it has not said: it is driven around and not led.
    pub car: Option<Car>,
    /// Where it is.
    pub pose: MapPose,
    /// Standard deviation of the position, in m.
    pub sigma_m: f64,
    /// Speed, negative astern, in m/s.
    pub speed_mps: f64,
    /// The running goal that is reached by a planned way.
    pub goal: Option<PlannedGoal>,
    /// Its route for that goal, if traffic control gave it one.
    pub route: Option<RouteReport>,
    /// Where something that is not on the map keeps it standing, (x, y) in m.
    pub blocked_at_m: Option<[f64; 2]>,
    /// Whether it may move: not latched, failed, taken over or driven by hand.
    pub drives: bool,
    /// How old all this is.
    pub age_ms: u64,
}

/// What a robot is told, each tick. A plan continues the one before (the same start, the same pieces
/// up to its release: what has been driven still counts) or begins where the robot stands; one that
/// begins farther than 10 cm from where it is must not be taken up.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// Boot and goal for which it is.
    pub goal: Option<(u64, u128)>,
    /// Number of the plan; 0 = none yet.
    pub plan: u64,
    /// The path; `None` = none yet, stand.
    pub path: Option<Path>,
    /// Released along the path, in m: stand there.
    pub release_m: f64,
    /// At most so fast, in m/s.
    pub cruise_mps: f64,
    /// Who has to pass first, or is in the way.
    pub waits_for: Option<String>,
    /// Why there is no path, or no way on. A robot that is told so for
    /// [`NO_WAY_MS`](xtb_nav::navigator::NO_WAY_MS) gives its goal up; so one that only has to wait hears none.
    pub reason: Option<String>,
}

/// What has happened so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CoordinatorCounters {
    /// Joint plans that were used.
    pub plans: u64,
    /// Joint plans that left someone without a way.
    pub without_way: u64,
    /// Times that everybody stood for nothing.
    pub deadlocks: u64,
    /// Passing orders that turned out to block each other.
    pub cyclic: u64,
    /// Trucks that did not use their released way.
    pub stalls: u64,
    /// Reports of trucks beyond [`MOST_TRUCKS`](super::MOST_TRUCKS).
    pub ignored: u64,
    /// Joint plans for which no order of priorities worked, but conflict-based search did.
    pub grouped: u64,
    /// Joint plans in which one was served while others only made room.
    pub in_turn: u64,
    /// New ways that were not used, as somebody else had been led across them meanwhile.
    pub outdated: u64,
    /// Times that the whole fleet stood, or some that wait for each other did for long, and one was told that there is
    /// no way.
    pub given_up: u64,
}
