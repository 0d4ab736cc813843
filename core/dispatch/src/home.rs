//! Where robots go by themselves: to a dock when the battery gets low, to a parking place when nothing is to be done.
//!
//! ```text
//!   working ── `warn`: after the present task ──────────► on the way ──► at a dock, charging ── resume ──► working
//!           ── go-now level: at once, its task waits ──►  (reserved)     no rise: another dock
//!   idle for `park_after_s` ──► parking  ◄── charged, and another robot needs the dock
//! ```
//! Rules and what they are decided from; the decisions are in `dispatcher/homes.rs`. Drives home are the dispatcher's
//! own tasks, in the ledger like all others, so that a restart neither forgets nor doubles one.

use std::collections::BTreeMap;
use xtb_control::config::Allowed::Range;
use xtb_control::config::DefaultOrigin::Ours;
use xtb_control::frames::MapPose;
use xtb_control::vehicle::BatteryLevels;
use xtb_protocol::Name;
use xtb_protocol::messages::{About, BatteryLevel, MapPlace, PlaceKind, Waypoint};

/// A robot that stands so near to a place's point is at it, in m: planned goals end within a few cm of their point.
pub const AT_M: f64 = 0.3;
/// A robot that stands so near to a place's point leaves no room there for another one, in m: about a truck's length.
pub(crate) const OCCUPIED_M: f64 = 0.7;
/// Points so near to each other are one, in m: a task's point is a copy of its place's.
pub(crate) const SAME_M: f64 = 0.05;
/// A voltage has to be low for so long, in ms: the sag of a start is shorter (`battery.hold_s` of robots).
const HOLD_MS: u64 = 2_000;
/// It is not low any more from so far above, in V (`battery.hysteresis_v` of robots).
const HYSTERESIS_V: f64 = 0.2;
/// After a drive the voltage recovers for so long, in ms; what it is then says nothing of the dock.
const SETTLE_MS: u64 = 10_000;
/// Within this a charged battery's voltage rises by [`RISE_V`], in ms: the simulated pack takes a tenth of it.
const RISE_MS: u64 = 120_000;
/// The least rise that counts as charging, in V: some steps of the converter.
const RISE_V: f64 = 0.01;
/// A robot that has not come so far, in m …
const WAY_M: f64 = 0.5;
/// … within this does not get on, in ms; others that stand in its way may be waiting for it.
const STUCK_MS: u64 = 90_000;
/// A place to which it did not get is left out for it for so long, in ms.
const NO_WAY_MS: u64 = 300_000;
/// A dock that does not charge a robot is left out for it for so long, in ms.
const NO_CHARGE_MS: u64 = 1_800_000;

xtb_control::config_section! {
    /// When robots go to a dock or to a parking place.
    HomeSettings "home" {
        now_margin_v: f64 = 0.1, "V", Range(0.0, 10.0), Ours, "So far above its own battery.finish_v a robot goes to a dock at once: below that it begins no drive. The simulated pack then has 4 min of driving left.";
        resume_margin_v: f64 = 0.8, "V", Range(0.0, 20.0), Ours, "So far above its own battery.warn_v a robot at a dock works again, measured while it is charged. The simulated pack is three quarters full then.";
        park_after_s: f64 = 0.0, "s", Range(0.0, 86_400.0), Ours, "A robot goes to a parking place after so long without a task; 0 = it stays where it is.";
    }
}

/// Where robots go by themselves, and when.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HomeRules {
    /// When.
    pub settings: HomeSettings,
    /// Robots with a place of their own; all others go to the nearest dock that is free.
    pub homes: BTreeMap<Name, Name>,
}

impl HomeRules {
    /// After so long without a task a robot goes to a parking place, in ms; `None` = never.
    pub(crate) fn park_after_ms(&self) -> Option<u64> {
        let after_s = self.settings.park_after_s;
        (after_s > 0.0).then_some((after_s * 1000.0) as u64)
    }
}

/// How urgently a robot needs a dock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Need {
    /// At once.
    Now,
    /// When its task is done.
    AfterTask,
}

/// A robot at a dock.
#[derive(Debug, Clone, PartialEq)]
pub struct Visit {
    /// Which.
    pub place: Name,
    /// Since when, in ms since 1970, as far as this run of ours has seen.
    pub since_ms: u64,
    /// Whether the voltage rises; `None` = not known yet.
    pub charging: Option<bool>,
    /// When the rise is measured from, and the voltage then.
    mark: Option<(u64, f64)>,
}

/// What is known of a robot's battery, learned from its states.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Charge {
    /// The robot's own levels, from its factsheet.
    pub levels: BatteryLevels,
    /// What it measures, in V; `None` = it does not.
    pub volts: Option<f64>,
    /// How urgently it needs a dock.
    pub need: Option<Need>,
    /// The dock that it stands at.
    pub visit: Option<Visit>,
    /// Whether it ever measured its voltage: one that does not any more may be empty.
    measured: bool,
    below_since_ms: Option<u64>,
    is_below: bool,
    /// Where it was when it last had come on, and when, in ms since 1970.
    from: Option<(MapPose, u64)>,
    /// Docks that did not charge it and places that it did not get to, and until when they are left out, in ms since
    /// 1970.
    useless: BTreeMap<Name, u64>,
}

impl Charge {
    /// From here on, in V, a robot at a dock works again.
    #[must_use]
    pub fn resume_v(&self, rules: &HomeRules) -> f64 {
        self.levels.warn_v + rules.settings.resume_margin_v
    }

    /// Whether it has been charged enough to work.
    #[must_use]
    pub fn is_enough(&self, rules: &HomeRules) -> bool {
        self.volts.map_or(!self.measured, |volts| volts >= self.resume_v(rules))
    }

    /// Whether it has to stay at the dock where it stands.
    #[must_use]
    pub fn is_charging(&self, rules: &HomeRules) -> bool {
        let charged = self.visit.as_ref().is_some_and(|visit| visit.charging != Some(false));
        charged && !self.is_enough(rules)
    }

    /// Whether it has come nowhere since this and for long, in ms since 1970.
    pub(crate) fn is_stuck(&self, now_ms: u64, since_ms: u64) -> bool {
        self.from.is_some_and(|(_, at_ms)| now_ms.saturating_sub(at_ms.max(since_ms)) >= STUCK_MS)
    }

    /// It did not get there.
    pub(crate) fn avoid(&mut self, now_ms: u64, place: &Name) {
        self.useless.insert(place.clone(), now_ms + NO_WAY_MS);
    }

    /// Where it is now.
    pub(crate) fn moved(&mut self, now_ms: u64, pose: &MapPose) {
        let far = |from: &MapPose| libm::hypot(from.x_m - pose.x_m, from.y_m - pose.y_m) >= WAY_M;
        if self.from.as_ref().is_none_or(|(from, _)| far(from)) {
            self.from = Some((*pose, now_ms));
        }
    }

    /// Whether this dock may charge it.
    pub(crate) fn may_use(&self, now_ms: u64, dock: &Name) -> bool {
        self.useless.get(dock).is_none_or(|until_ms| now_ms >= *until_ms)
    }

    /// What its state says, and at which dock it stands, if so.
    pub(crate) fn look(
        &mut self,
        now_ms: u64,
        rules: &HomeRules,
        (volts, level): (Option<f64>, BatteryLevel),
        dock: Option<&Name>,
    ) {
        self.volts = volts;
        self.measured |= volts.is_some();
        let now_v = self.levels.finish_v + rules.settings.now_margin_v;
        self.below_since_ms = match volts {
            Some(volts) if volts < now_v => self.below_since_ms.or(Some(now_ms)),
            _ => None,
        };
        let held = self.below_since_ms.is_some_and(|since_ms| now_ms.saturating_sub(since_ms) >= HOLD_MS);
        self.is_below = held || (self.is_below && volts.is_some_and(|volts| volts < now_v + HYSTERESIS_V));
        self.need = match level {
            BatteryLevel::Finish | BatteryLevel::Critical => Some(Need::Now),
            BatteryLevel::Ok | BatteryLevel::Warn if self.is_below => Some(Need::Now),
            BatteryLevel::Warn => Some(Need::AfterTask),
            BatteryLevel::Ok | BatteryLevel::Unknown => None,
        };
        let before = self.visit.take().filter(|visit| dock == Some(&visit.place));
        self.visit = dock.map(|dock| {
            before.unwrap_or_else(|| Visit {
                place: dock.clone(),
                since_ms: now_ms,
                charging: None,
                mark: None,
            })
        });
        self.watch_rise(now_ms, rules);
        self.useless.retain(|_, until_ms| now_ms < *until_ms);
    }

    /// Whether the voltage rises. A full battery's does not, and need not.
    fn watch_rise(&mut self, now_ms: u64, rules: &HomeRules) {
        let is_enough = self.is_enough(rules);
        let (Some(visit), Some(volts)) = (&mut self.visit, self.volts) else { return };
        match visit.mark {
            _ if now_ms < visit.since_ms + SETTLE_MS => {}
            None => visit.mark = Some((now_ms, volts)),
            Some((since_ms, from_v)) if now_ms >= since_ms + RISE_MS => {
                let rises = volts >= from_v + RISE_V;
                visit.charging = Some(rises || is_enough);
                visit.mark = Some((now_ms, volts));
                if !rises && !is_enough {
                    self.useless.insert(visit.place.clone(), now_ms + NO_CHARGE_MS);
                }
            }
            Some(_) => {}
        }
    }
}

/// The battery levels that a robot's factsheet names; what it does not name is the usual one.
#[must_use]
pub fn levels_of(about: &About) -> BatteryLevels {
    let value = |name: &str, usual: f64| {
        let found = about.vehicle.iter().find(|parameter| parameter.name == name);
        found
            .and_then(|parameter| parameter.value.parse().ok())
            .filter(|v: &f64| v.is_finite())
            .unwrap_or(usual)
    };
    let usual = BatteryLevels::default();
    BatteryLevels {
        warn_v: value("battery.warn_v", usual.warn_v),
        finish_v: value("battery.finish_v", usual.finish_v),
        ..usual
    }
}

/// How far a pose is from a place's point, in m.
pub(crate) fn distance_m(place: &MapPlace, pose: &MapPose) -> f64 {
    libm::hypot(place.x_m - pose.x_m, place.y_m - pose.y_m)
}

/// Whether a task's point is this place's.
pub(crate) fn is_same(place: &MapPlace, point: &Waypoint) -> bool {
    libm::hypot(place.x_m - point.x_m, place.y_m - point.y_m) <= SAME_M
}

/// The point that robots are sent to.
pub(crate) fn waypoint(place: &MapPlace) -> Waypoint {
    Waypoint { x_m: place.x_m, y_m: place.y_m, yaw_rad: place.yaw_rad }
}

/// Whether this place is where this robot is charged.
pub(crate) fn is_dock_of(rules: &HomeRules, place: &MapPlace, robot: &Name) -> bool {
    match rules.homes.get(robot) {
        Some(home) => place.name == *home,
        None => place.kind == PlaceKind::Dock,
    }
}
