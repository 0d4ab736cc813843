//! Whose velocity commands drive the robot: one publisher's at a time.
//!
//! ```text
//!  fresh command ─► of the driver ──────────────────────────────► Drive
//!                   of another while there is a driver ─────────► fenced
//!                   nobody drives: asks for motion, let go ─────► Ask for the lease ─► granted: it is the driver
//!                                                                                   └► refused: has to let go
//! ```
//! Who was fenced, refused or has lost the lease has to let go before it may ask, and so has who was commanding
//! before it was heard here (its numbers do not begin near 1): a stick that is still held must not set a robot in
//! motion that has just become free, or has just started. Letting go is a command to stand, or half a second without
//! commands by the publisher's own clock; a gap in the network alone is none. A command to stand counts however late
//! it comes, but not again.

use crate::attachment::Attachment;
use crate::drive::{Drive, Notice, VelocityLimits};
use crate::freshness::{Counts, Freshness, MOST, Sources};
use crate::gid::Gid;
use crate::graph::Graph;
use crate::types::Twist;
use std::collections::BTreeMap;
use xtb_control::{VehicleConfig, WheelRpm};

/// A pause of this length at the source is letting go; shorter than the 900 ms after which the robot's lease is free,
/// so that who types commands with pauses is not held back. Chosen, not measured.
pub const LET_GO_MS: i64 = 500;
/// An unanswered question for the lease is forgotten after this.
const ASKED_MS: i64 = 1000;
/// What was held back this long ago is told no more.
const TOLD_MS: i64 = 2000;
/// A publisher that is first heard with a higher number was commanding before. The first ones of a new publisher may
/// be lost before the subscription has reached it: a second of ten commands. Chosen, not measured.
const FIRST_NUMBERS: i64 = 10;
const NS_PER_MS: i64 = 1_000_000;

/// What to do about a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Advice {
    /// Nothing.
    Ignore,
    /// Ask the robot for the lease, for this publisher; then say [`Commands::granted`] or [`Commands::refused`].
    Ask,
    /// Drive so.
    Drive(Drive),
}

/// Why a publisher does not drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum HeldBack {
    /// Another one drives.
    Fenced,
    /// It has to let go first.
    MustLetGo,
}

#[derive(Debug, Clone, Copy, Default)]
struct Publisher {
    last_arrival_ns: i64,
    /// When the newest command was made.
    newest_ns: i64,
    must_let_go: bool,
    held_back: Option<(HeldBack, i64)>,
    notice: Option<Notice>,
}

/// The publishers of `cmd_vel` of one robot.
#[derive(Debug, Clone)]
pub struct Commands {
    car: VelocityLimits,
    sources: Sources,
    publishers: BTreeMap<Gid, Publisher>,
    driver: Option<Gid>,
    asked: Option<i64>,
}

impl Commands {
    /// For a robot of these settings.
    #[must_use]
    pub fn of(vehicle: &VehicleConfig) -> Self {
        Self {
            car: VelocityLimits::of(vehicle),
            sources: Sources::default(),
            publishers: BTreeMap::new(),
            driver: None,
            asked: None,
        }
    }

    /// A command that came at `arrival_ns` (of a monotonic clock here); when it was made, whose it is and its number
    /// are in what was attached.
    pub fn command(&mut self, attachment: &Attachment, arrival_ns: i64, twist: &Twist) -> Advice {
        let Attachment { sequence, source_ns, gid } = *attachment;
        if !self.publishers.contains_key(&gid) && self.publishers.len() >= MOST {
            let others = self.publishers.iter().filter(|(gid, _)| Some(**gid) != self.driver);
            let silent = others.min_by_key(|(_, publisher)| publisher.last_arrival_ns).map(|(gid, _)| *gid);
            silent.map(|gid| self.publishers.remove(&gid));
        }
        let freshness = self.sources.judge(gid, arrival_ns, source_ns);
        let publisher = self.publishers.entry(gid).or_insert(Publisher {
            newest_ns: source_ns.saturating_sub(1),
            must_let_go: sequence > FIRST_NUMBERS,
            ..Publisher::default()
        });
        publisher.last_arrival_ns = arrival_ns;
        let newer_ns = source_ns.saturating_sub(publisher.newest_ns);
        publisher.newest_ns = publisher.newest_ns.max(source_ns);
        if freshness == Freshness::Old {
            return Advice::Ignore;
        }
        let drive = self.car.drive(twist);
        let stands = drive.rpm == WheelRpm::ZERO;
        // However late it comes: it was let go before whatever follows, and to stand is never wrong.
        let let_go = newer_ns > 0 && (stands || newer_ns >= LET_GO_MS * NS_PER_MS);
        publisher.must_let_go &= !let_go;
        if freshness != Freshness::Fresh && !stands {
            return Advice::Ignore;
        }
        publisher.notice = drive.notice;
        match self.driver {
            Some(driver) if driver == gid => return Advice::Drive(drive),
            _ if stands => return Advice::Ignore,
            Some(_) => {
                publisher.must_let_go = true;
                publisher.held_back = Some((HeldBack::Fenced, arrival_ns));
                return Advice::Ignore;
            }
            None if publisher.must_let_go => {
                publisher.held_back = Some((HeldBack::MustLetGo, arrival_ns));
                return Advice::Ignore;
            }
            None => {}
        }
        let asked = self.asked.is_some_and(|at| arrival_ns.saturating_sub(at) < ASKED_MS * NS_PER_MS);
        if asked {
            return Advice::Ignore;
        }
        self.asked = Some(arrival_ns);
        Advice::Ask
    }

    /// The robot has given this publisher's node the lease.
    pub fn granted(&mut self, gid: Gid) {
        (self.driver, self.asked) = (Some(gid), None);
    }

    /// It has not.
    pub fn refused(&mut self, gid: &Gid) {
        self.asked = None;
        if let Some(publisher) = self.publishers.get_mut(gid) {
            publisher.must_let_go = true;
        }
    }

    /// The driver has lost the lease, or is to leave it: it has to let go before it may drive again.
    pub fn end(&mut self) {
        if let Some(driver) = self.driver.take() {
            self.refused(&driver);
        }
    }

    /// Somebody has taken control for ROS: whoever commands next drives, but for the one who drove until now.
    pub fn open(&mut self) {
        let driver = self.driver;
        self.end();
        for (gid, publisher) in &mut self.publishers {
            publisher.must_let_go &= Some(*gid) == driver;
        }
    }

    /// This publisher's token is gone: whether the robot has to stand. If the driver's own token is not known, as it
    /// chose its gid itself, any that nobody else has used may have been its token.
    pub fn vanished(&mut self, gid: &Gid, graph: &Graph) -> bool {
        let Some(driver) = self.driver else {
            self.forget(gid);
            return false;
        };
        let unknown = graph.find(&driver).is_none() && !self.publishers.contains_key(gid);
        let gone = driver == *gid || unknown;
        if gone {
            self.end();
        }
        self.forget(gid);
        gone
    }

    fn forget(&mut self, gid: &Gid) {
        self.publishers.remove(gid);
        self.sources.forget(gid);
    }

    /// Who drives.
    #[must_use]
    pub fn driver(&self) -> Option<Gid> {
        self.driver
    }

    /// What of the driver's last velocity is not driven as it was asked for.
    #[must_use]
    pub fn notice(&self) -> Option<Notice> {
        self.driver.and_then(|driver| self.publishers.get(&driver)).and_then(|publisher| publisher.notice)
    }

    /// Who asks for motion now and does not get it.
    pub fn held_back(&self, now_ns: i64) -> impl Iterator<Item = (Gid, HeldBack)> {
        self.publishers.iter().filter_map(move |(gid, publisher)| {
            let (why, at_ns) = publisher.held_back?;
            (now_ns.saturating_sub(at_ns) < TOLD_MS * NS_PER_MS).then_some((*gid, why))
        })
    }

    /// How many commands were fresh, late and so on.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.sources.counts()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Vector3;

    const A: Gid = Gid([1; 16]);
    const B: Gid = Gid([2; 16]);

    fn ahead(mps: f64) -> Twist {
        Twist { linear: Vector3 { x: mps, ..Vector3::default() }, ..Twist::default() }
    }

    /// Publishers that send on time, every 100 ms.
    struct Trial {
        commands: Commands,
        ms: i64,
        sequence: i64,
    }

    impl Trial {
        fn new() -> Self {
            Self { commands: Commands::of(&VehicleConfig::default()), ms: 1000, sequence: 0 }
        }

        fn say(&mut self, gid: Gid, mps: f64) -> Advice {
            let now = self.ms * NS_PER_MS;
            self.say_at(gid, now, now, mps)
        }

        fn say_at(&mut self, gid: Gid, arrival_ns: i64, source_ns: i64, mps: f64) -> Advice {
            self.sequence += 1;
            let attachment = Attachment { sequence: self.sequence, source_ns, gid };
            self.commands.command(&attachment, arrival_ns, &ahead(mps))
        }

        /// So many rounds in which each of these says its speed; the last round's advice.
        fn rounds(&mut self, rounds: usize, said: &[(Gid, f64)]) -> Vec<Advice> {
            let mut advice = Vec::new();
            for _ in 0..rounds {
                advice = said.iter().map(|(gid, mps)| self.say(*gid, *mps)).collect();
                self.ms += 100;
            }
            advice
        }

        fn driven_by_a() -> Self {
            let mut trial = Self::new();
            assert_eq!(trial.rounds(3, &[(A, 0.2)]), [Advice::Ask]);
            trial.commands.granted(A);
            assert!(matches!(trial.rounds(1, &[(A, 0.2)])[..], [Advice::Drive(_)]));
            trial
        }
    }

    #[test]
    fn who_only_says_stand_never_asks_for_the_lease() {
        assert_eq!(Trial::new().rounds(20, &[(A, 0.0)]), [Advice::Ignore]);
    }

    #[test]
    fn a_second_publisher_is_fenced_and_does_not_follow_when_the_first_one_leaves() {
        let mut trial = Trial::driven_by_a();
        let advice = trial.rounds(5, &[(A, 0.2), (B, 0.5)]);
        assert!(matches!(advice[..], [Advice::Drive(_), Advice::Ignore]), "{advice:?}");
        let held: Vec<_> = trial.commands.held_back(trial.ms * NS_PER_MS).collect();
        assert_eq!(held, [(B, HeldBack::Fenced)]);
        trial.commands.end();
        assert_eq!(trial.rounds(10, &[(B, 0.5)]), [Advice::Ignore], "its stick is still held");
        trial.rounds(1, &[(B, 0.0)]);
        assert_eq!(trial.rounds(1, &[(B, 0.5)]), [Advice::Ask]);
    }

    #[test]
    fn who_was_refused_or_has_lost_the_lease_lets_go_by_a_pause_at_the_source() {
        let mut trial = Trial::new();
        trial.rounds(3, &[(A, 0.2)]);
        trial.commands.refused(&A);
        assert_eq!(trial.rounds(20, &[(A, 0.2)]), [Advice::Ignore]);
        trial.ms += LET_GO_MS;
        assert_eq!(trial.rounds(1, &[(A, 0.2)]), [Advice::Ask]);
    }

    #[test]
    fn a_command_to_stand_counts_however_late_it_comes() {
        let mut trial = Trial::driven_by_a();
        let late_ns = (trial.ms - 50) * NS_PER_MS;
        trial.ms += 1000;
        let advice = trial.say_at(A, trial.ms * NS_PER_MS, late_ns, 0.0);
        assert!(matches!(advice, Advice::Drive(drive) if drive.rpm == WheelRpm::ZERO), "{advice:?}");
        let old = trial.say_at(A, trial.ms * NS_PER_MS, late_ns - 1, 0.0);
        assert_eq!(old, Advice::Ignore, "made before the last one");
        let late_ns = late_ns + 100 * NS_PER_MS;
        assert_eq!(trial.say_at(A, trial.ms * NS_PER_MS, late_ns, 0.2), Advice::Ignore);
    }

    #[test]
    fn a_gap_in_the_network_is_no_letting_go() {
        let mut trial = Trial::driven_by_a();
        trial.commands.end();
        // Made every 100 ms, held up for 2 s, then on time again.
        for made in 0..20 {
            let (now, made) = ((trial.ms + 2000) * NS_PER_MS, (trial.ms + made * 100) * NS_PER_MS);
            assert_eq!(trial.say_at(A, now + made / 1000, made, 0.2), Advice::Ignore);
        }
        trial.ms += 2100;
        assert_eq!(trial.rounds(20, &[(A, 0.2)]), [Advice::Ignore]);
    }

    #[test]
    fn who_was_commanding_before_it_was_heard_has_to_let_go() {
        let mut trial = Trial::new();
        trial.sequence = FIRST_NUMBERS;
        assert_eq!(trial.rounds(20, &[(A, 0.2)]), [Advice::Ignore]);
        trial.rounds(1, &[(A, 0.0)]);
        assert_eq!(trial.rounds(1, &[(A, 0.2)]), [Advice::Ask]);
    }

    #[test]
    fn what_comes_again_is_no_letting_go() {
        let mut trial = Trial::new();
        trial.rounds(3, &[(A, 0.0)]);
        let zero_ns = (trial.ms - 100) * NS_PER_MS;
        trial.rounds(3, &[(A, 0.2)]);
        trial.commands.refused(&A);
        // Old ones, then the zero of before, then a gap that only they have made.
        for ns in [zero_ns - 600 * NS_PER_MS, zero_ns] {
            trial.say_at(A, trial.ms * NS_PER_MS, ns, 0.0);
        }
        assert_eq!(trial.rounds(20, &[(A, 0.2)]), [Advice::Ignore]);
    }

    #[test]
    fn the_robot_stands_when_the_drivers_token_goes_and_not_with_others() {
        let graph = Graph::default();
        let mut trial = Trial::driven_by_a();
        trial.rounds(1, &[(A, 0.2), (B, 0.0)]);
        assert!(!trial.commands.vanished(&B, &graph), "B has spoken itself");
        assert!(trial.commands.vanished(&A, &graph) && trial.commands.driver().is_none());
        let mut trial = Trial::driven_by_a();
        assert!(trial.commands.vanished(&Gid([9; 16]), &graph), "it may have been A's");
    }

    #[test]
    fn after_control_was_taken_whoever_commands_next_drives_but_for_the_last_driver() {
        let mut trial = Trial::driven_by_a();
        trial.rounds(5, &[(A, 0.2), (B, 0.5)]);
        trial.commands.open();
        let advice = trial.rounds(1, &[(A, 0.2), (B, 0.5)]);
        assert_eq!(advice, [Advice::Ignore, Advice::Ask]);
    }

    #[test]
    fn a_hundred_publishers_do_not_displace_the_driver() {
        let mut trial = Trial::driven_by_a();
        for other in 0..100 {
            trial.say(Gid([100 + other; 16]), 0.5);
        }
        assert!(trial.commands.publishers.len() <= MOST);
        assert!(matches!(trial.say(A, 0.2), Advice::Drive(_) | Advice::Ignore));
        assert_eq!(trial.commands.driver(), Some(A));
    }
}
