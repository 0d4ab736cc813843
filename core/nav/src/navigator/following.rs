//! A path under way: how far it may be driven, how fast, and how far the body may swing.

use super::right_of_way::Hold;
use crate::geometry::Path;
use crate::path_follower::PathFollower;
use xtb_control::Stamp;

/// A bend is tight from this part of the tightest one's curvature on: less than twice the smallest radius.
/// Chosen, not measured.
pub(super) const TIGHT: f64 = 0.5;
/// Speed in it, and where something thin that is not on the map has been met, in m/s: a little over the
/// slowest that an unsure pose leaves (0.10, `navigation.pose.least_mps`); chosen, not measured.
pub(super) const BEND_MPS: f64 = 0.12;
/// And from so far before it on, in m, half a second at that speed; chosen, not measured.
const BEFORE_BEND_M: f64 = 0.06;

/// On its own path the body swings by this to either side, 6°, so that its beams pass over the strips between
/// them and over floor beside the body: `path_follower/swing.rs` tests that for an XTB.
const SWING_RAD: f64 = 0.105;
/// On traffic control's path, which keeps the others off, half of that; chosen, not measured.
const GUIDED_SWING_RAD: f64 = 0.052;
/// A corner that swings may take this part of the room beside the body, less than half; chosen, not measured.
const SWING_ROOM: f64 = 0.45;

/// What a path is driven for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum PathPurpose {
    /// The goal, or a place to look from.
    #[default]
    Goal,
    /// The goal, through somebody who has to go away first.
    Through,
    /// Out of somebody's way.
    Retreat,
}

/// The path beyond the end of one that leads to a goal which has been passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Beyond {
    /// Nobody has looked for it.
    Unknown,
    /// A job of this number looks for it.
    Asked { job: u64, at: Stamp },
    /// There is none from there, for now.
    None,
}

/// Where a path is held by other robots.
#[derive(Debug, Clone, Default)]
pub(super) struct Held {
    pub(super) purpose: PathPurpose,
    pub(super) hold: Option<Hold>,
    /// Since when it stands because of that.
    pub(super) since: Option<Stamp>,
}

impl Held {
    /// As the rule says now.
    pub(super) fn update(&mut self, now: Stamp, hold: Option<Hold>, stands: bool) {
        let goes_on = hold.is_some() && stands;
        self.since = goes_on.then(|| self.since.unwrap_or(now));
        self.hold = hold;
    }
}

/// A path under way.
#[derive(Debug, Clone)]
pub(super) struct Following {
    pub(super) path: Path,
    pub(super) follower: PathFollower,
    /// Traffic control's number of it; 0 = its own.
    pub(super) plan: u64,
    pub(super) release_m: f64,
    /// Stands until it is said.
    pub(super) cruise_mps: f64,
    pub(super) off_m: f64,
    /// It leads to where something can be seen, not to the goal.
    pub(super) to_vantage: bool,
    /// It was planned with obstacles that were seen within this time.
    pub(super) seen_within_ms: u64,
    /// The first level has held the motor since.
    pub(super) blocked_since: Option<Stamp>,
    /// When the way ahead was looked at last.
    pub(super) looked: Option<Stamp>,
    /// Where the way ahead was found blocked: how far along, and by what.
    pub(super) obstructed: Option<(f64, [f64; 2])>,
    pub(super) obstructed_since: Option<Stamp>,
    /// Least room beside the body ahead, in m.
    pub(super) clearance_m: f64,
    /// The same around the whole body, what is not on the map with it, less what it may be off the path.
    pub(super) room_m: f64,
    /// Something thin that is not on the map has been met near by.
    pub(super) met_thin: bool,
    /// It was planned with that in mind.
    pub(super) expects_thin: bool,
    /// Progress counted so far, in m.
    pub(super) counted_m: f64,
    /// By other robots.
    pub(super) held: Held,
    /// Its end is not the goal: that lies beyond.
    pub(super) beyond: Option<Beyond>,
}

impl Following {
    /// Its own path: nobody vouches for the others, so it drives as if one came head-on.
    pub(super) fn own(path: Path, follower: PathFollower, to_vantage: bool) -> Self {
        Self { to_vantage, ..Self::new(path, follower, 0, f64::MAX) }
    }

    /// Traffic control's path.
    pub(super) fn guided(path: Path, follower: PathFollower, plan: u64) -> Self {
        Self::new(path, follower, plan, 0.0)
    }

    fn new(path: Path, follower: PathFollower, plan: u64, release_m: f64) -> Self {
        Self {
            path,
            follower,
            plan,
            release_m,
            cruise_mps: 0.0,
            off_m: 0.0,
            to_vantage: false,
            seen_within_ms: u64::MAX,
            blocked_since: None,
            looked: None,
            obstructed: None,
            obstructed_since: None,
            clearance_m: 0.0,
            room_m: 0.0,
            met_thin: false,
            expects_thin: true,
            counted_m: 0.0,
            held: Held::default(),
            beyond: None,
        }
    }

    /// On its own path: slowly where the corner that leads, the inner side or the tail gets to floor that no
    /// beam has passed over, so that a beam that sees something at last is soon enough.
    pub(super) fn bend_mps(&self, radius_m: f64) -> f64 {
        let way_m = self.follower.way_m();
        let tight = |ahead_m: f64| {
            let (_, piece) = self.path.at((way_m + ahead_m).min(self.path.length_m()));
            piece.is_some_and(|piece| piece.curvature_per_m.abs() * radius_m >= TIGHT)
        };
        let slowly = self.plan == 0 && (self.met_thin || tight(0.0) || tight(BEFORE_BEND_M));
        if slowly { BEND_MPS } else { f64::MAX }
    }

    /// How far it may swing, so that no corner takes more than a part of the room that there is.
    pub(super) fn swing_rad(&self, front_m: f64) -> f64 {
        let most_rad = match self.plan {
            0 => SWING_RAD,
            _ => GUIDED_SWING_RAD,
        };
        most_rad.min(SWING_ROOM * self.room_m / front_m)
    }
}
