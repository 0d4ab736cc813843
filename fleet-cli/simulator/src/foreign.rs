//! Robots of the same world that another simulator moves: bodies here, from its ground truth.
//!
//! Each simulator moves its own robots and tells where they are; what one of them drives into is its own
//! simulator's business, and its contact. So a meeting of two is as true as the truth is fresh: 20 times a second,
//! and forgotten [`FRESH`] after it was sent. The computers' clocks may differ: how long a message took is measured
//! beside the quickest ones ([`Lateness`]).

use crate::stats::LatestStats;
use robot_agent::hardware::simulated::WorldOrders;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::watch;
use xtb_bus::{Bus, Incoming, Subscription};
use xtb_client::Result;
use xtb_control::frames::MapPose;
use xtb_protocol::Name;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{Roster, Truth};
use xtb_sim::parameters::Body;
use xtb_sim::{MOST_FOREIGN, Simulation};

/// Where a robot was is true for so long, in real time.
const FRESH: Duration = Duration::from_millis(100);
/// The quickest message of the last one to two of these says how two clocks stand to each other; by how much they
/// drift apart meanwhile is far below [`FRESH`].
const WINDOW: Duration = Duration::from_secs(30);
/// Simulators that are told apart; of more, all are measured anew.
const MOST_SIMULATORS: usize = 64;
/// Late messages are reported again after so long.
const REPORT_EVERY: Duration = Duration::from_secs(10);

/// Where the others are, and until when that is true, until the world takes it: at most [`MOST_FOREIGN`] of them.
type Waiting = Arc<Mutex<BTreeMap<Name, (MapPose, Instant)>>>;

/// Takes in the truth of other simulators until it is dropped. Their robots are taken to be as large as `body`.
///
/// # Errors
/// Zenoh would not.
pub(super) async fn listen(
    bus: &Bus,
    keys: &FleetKeys,
    own: &Roster,
    body: Body,
    world: WorldOrders,
    stats: watch::Receiver<LatestStats>,
) -> Result<Subscription> {
    let own: BTreeSet<Name> = own.robots.iter().map(|robot| robot.name.clone()).collect();
    let (waiting, senders) = (Waiting::default(), Mutex::new(Senders::default()));
    let each = move |incoming: Incoming| {
        let truth = match incoming.decode::<Truth>() {
            Ok(truth) => truth,
            Err(error) => return tracing::debug!("the truth of another simulator cannot be read: {error}"),
        };
        let now = Instant::now();
        let Some(until) = senders.lock().unwrap_or_else(PoisonError::into_inner).until(&own, &truth, now)
        else {
            return;
        };
        if put(&waiting, &own, truth, until) {
            let (waiting, body, stats) = (waiting.clone(), body.clone(), stats.borrow().stats);
            let pace = stats.real_time_factor.unwrap_or(stats.speed).min(stats.speed);
            world.change(move |simulation| meet(simulation, &waiting, &body, pace, Instant::now()));
        }
    };
    Ok(bus.subscribe_remote(&keys.sim_truth(), each).await?)
}

/// The other simulators, by the name of the first robot of each.
#[derive(Default)]
struct Senders(BTreeMap<Name, Sender>);

#[derive(Default)]
struct Sender {
    lateness: Lateness,
    reported: Option<Instant>,
}

impl Senders {
    /// Until when this truth holds that comes now; `None` = it is too old, or of none but `own` robots.
    fn until(&mut self, own: &BTreeSet<Name>, truth: &Truth, now: Instant) -> Option<Instant> {
        let first = truth.robots.keys().find(|name| !own.contains(*name))?;
        let Some(real_s) = truth.real_s else { return Some(now + FRESH) };
        if self.0.len() >= MOST_SIMULATORS && !self.0.contains_key(first) {
            self.0.clear();
        }
        let sender = self.0.entry(first.clone()).or_default();
        let late = sender.lateness.of(real_s, now);
        let left = FRESH.checked_sub(late);
        if left.is_none() && sender.reported.is_none_or(|at| now - at >= REPORT_EVERY) {
            sender.reported = Some(now);
            let late_ms = late.as_millis();
            tracing::warn!(
                "the truth of {first}'s simulator comes {late_ms} ms late: such robots are no bodies here"
            );
        }
        Some(now + left?)
    }
}

/// How much later than its quickest ones the messages of a program come, whatever its clock says.
#[derive(Default)]
struct Lateness {
    last_s: f64,
    /// When the first one came.
    origin: Option<Instant>,
    /// When the window began, and the least time from sending to arrival in it, in s, plus what the clocks differ by.
    window: Option<(Instant, f64)>,
    /// The same of the window before.
    before_s: Option<f64>,
}

impl Lateness {
    /// Of a message that was sent at `real_s` by the sender's clock and comes now. A sender whose clock goes back has
    /// been started again.
    fn of(&mut self, real_s: f64, now: Instant) -> Duration {
        if real_s < self.last_s {
            *self = Self::default();
        }
        self.last_s = real_s;
        let took_s = (now - *self.origin.get_or_insert(now)).as_secs_f64() - real_s;
        if let Some((began, least_s)) = self.window.filter(|(began, _)| now - *began >= WINDOW) {
            self.before_s = (now - began < 2 * WINDOW).then_some(least_s);
            self.window = None;
        }
        let (_, least_s) = self.window.get_or_insert((now, took_s));
        *least_s = least_s.min(took_s);
        let quickest_s = self.before_s.map_or(*least_s, |before_s| least_s.min(before_s));
        Duration::from_secs_f64((took_s - quickest_s).max(0.0))
    }
}

/// Keeps where the others are. True: the world has to be told that something waits.
fn put(waiting: &Waiting, own: &BTreeSet<Name>, truth: Truth, until: Instant) -> bool {
    let mut waiting = waiting.lock().unwrap_or_else(PoisonError::into_inner);
    let was_empty = waiting.is_empty();
    for (name, robot) in truth.robots {
        if own.contains(&name) || (waiting.len() >= MOST_FOREIGN && !waiting.contains_key(&name)) {
            continue;
        }
        waiting.insert(name, (MapPose { x_m: robot.x_m, y_m: robot.y_m, yaw_rad: robot.yaw_rad }, until));
    }
    was_empty && !waiting.is_empty()
}

/// Puts them into a world that runs at `pace` × real time.
fn meet(simulation: &mut Simulation, waiting: &Waiting, body: &Body, pace: f64, now: Instant) {
    let taken = std::mem::take(&mut *waiting.lock().unwrap_or_else(PoisonError::into_inner));
    for (name, (pose, until)) in taken {
        let left_ms = until.saturating_duration_since(now).as_secs_f64() * 1e3 * pace;
        if left_ms >= 1.0 {
            simulation.put_foreign(name.as_str(), &pose, body, simulation.now().plus_ms(left_ms as u64));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::messages::TruthRobot;
    use xtb_sim::{TruckParameters, World};

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    fn truth(robots: &[(&str, f64)]) -> Truth {
        let robot = |x_m| TruthRobot {
            x_m,
            y_m: 5.0,
            yaw_rad: 0.0,
            speed_mps: 0.0,
            motor_counts: 3750,
            neutral_since_s: Some(0.0),
            contacts: 0,
        };
        let robots = robots.iter().map(|(text, x_m)| (name(text), robot(*x_m))).collect();
        Truth { t_s: 1.0, real_s: None, robots }
    }

    fn sent(real_s: f64) -> Truth {
        Truth { real_s: Some(real_s), ..truth(&[("xtb-2", 1.0)]) }
    }

    #[test]
    fn the_world_is_told_once_of_the_latest_of_each_robot_but_its_own() {
        let (waiting, own) = (Waiting::default(), BTreeSet::from([name("xtb-1")]));
        let now = Instant::now();
        let put = |robots: &[(&str, f64)]| put(&waiting, &own, truth(robots), now + FRESH);
        assert!(!put(&[("xtb-1", 9.0)]), "nobody else");
        assert!(put(&[("xtb-1", 9.0), ("xtb-2", 1.0)]));
        assert!(!put(&[("xtb-2", 2.0), ("xtb-3", 3.0)]), "it is told already");
        let parameters = TruckParameters::default();
        let mut simulation = Simulation::new(World::default(), &parameters, &["xtb-1"], 1).unwrap();
        meet(&mut simulation, &waiting, &parameters.body, 1.0, now);
        simulation.step();
        assert_eq!(simulation.foreign().collect::<Vec<_>>(), ["xtb-2", "xtb-3"]);
        assert!(put(&[("xtb-2", 2.0)]), "it has been taken");
    }

    #[test]
    fn they_are_bodies_for_100_ms_of_real_time_however_fast_the_world_runs() {
        let parameters = TruckParameters::default();
        let now = Instant::now();
        for (pace, waited_ms, steps) in [(1.0, 0, 20), (0.4, 0, 8), (4.0, 0, 80), (1.0, 60, 8), (1.0, 100, 0)]
        {
            let mut simulation = Simulation::new(World::default(), &parameters, &["xtb-1"], 1).unwrap();
            let waiting = Waiting::default();
            put(&waiting, &BTreeSet::new(), sent(0.0), now + FRESH);
            meet(&mut simulation, &waiting, &parameters.body, pace, now + Duration::from_millis(waited_ms));
            let mut there = 0;
            while simulation.foreign().next().is_some() {
                simulation.step();
                there += 1;
            }
            // It is looked for at the beginning of a step.
            assert_eq!(there, if steps == 0 { 0 } else { steps + 2 }, "pace {pace}, {waited_ms} ms old");
        }
    }

    #[test]
    fn a_truth_that_took_longer_than_others_holds_for_less_and_beyond_100_ms_not_at_all() {
        let (mut senders, own, began) = (Senders::default(), BTreeSet::new(), Instant::now());
        let mut left_ms = |real_ms: u64, arrives_ms: u64| {
            let now = began + Duration::from_millis(arrives_ms);
            let until = senders.until(&own, &sent(real_ms as f64 / 1e3), now)?;
            Some((until - now).as_secs_f64() * 1e3)
        };
        let near = |got: Option<f64>, ms: f64| got.is_some_and(|got| (got - ms).abs() < 0.01);
        // The sender has been there for an hour, by its clock.
        let hour = 3_600_000;
        assert!(near(left_ms(hour, 0), 100.0), "nothing to compare with");
        assert!(near(left_ms(hour + 50, 90), 60.0));
        assert!(near(left_ms(hour + 100, 98), 100.0), "quicker than the first one");
        assert!(near(left_ms(hour + 150, 158), 90.0), "beside the quickest");
        assert_eq!(left_ms(hour + 200, 400), None, "198 + 2 ms late");
        assert_eq!(left_ms(hour + 5000, 5200), None, "as long as nothing comes in time");
        assert!(near(left_ms(hour + 6000, 5998), 100.0));
        // The clocks drift apart: after two windows that is the scale.
        for n in 1..=1500 {
            assert!(left_ms(hour + 6000 + 50 * n, 5998 + 50 * n + n / 50).is_some(), "{n}");
        }
        assert!(near(left_ms(7, 100_000), 100.0), "it was started again");
        assert!(near(left_ms(57, 100_060), 90.0));
    }

    #[test]
    fn programs_that_do_not_say_when_they_sent_are_taken_as_they_come_and_own_robots_are_not() {
        let (mut senders, own, now) = (Senders::default(), BTreeSet::from([name("xtb-1")]), Instant::now());
        assert_eq!(senders.until(&own, &truth(&[("xtb-2", 1.0)]), now), Some(now + FRESH));
        assert_eq!(senders.until(&own, &truth(&[("xtb-1", 1.0)]), now), None);
        for n in 0..1000 {
            let truth = Truth { real_s: Some(1.0), ..truth(&[(format!("far-{n}").as_str(), 1.0)]) };
            assert!(senders.until(&own, &truth, now).is_some());
        }
        assert!(senders.0.len() <= MOST_SIMULATORS);
    }
}
