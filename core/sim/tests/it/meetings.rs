//! Scenes for several robots and traffic control, and what comes of them by ground truth.

use crate::drive::Drive;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_nav::Car;
use xtb_protocol::messages::{GoalStatus, Outcome, RobotState};
use xtb_sim::World;
use xtb_sim::lockstep::Traffic;

const CORRIDOR: &str = include_str!("../../../../worlds/corridor.toml");
/// A turn of the witness, in s.
const STEP_S: f64 = 0.2;
/// A truck that has moved so lately is a moving truck, in s.
const MOVING_S: f64 = 3.0;

/// What came of a meeting.
#[derive(Debug, Clone, Default)]
pub(crate) struct Meeting {
    pub(crate) reached: usize,
    pub(crate) contacts: u64,
    pub(crate) took_s: f64,
    /// Longest standstill of one with an open goal that does not wait for a named moving truck.
    pub(crate) stood_s: f64,
    /// What it said at the end of it.
    pub(crate) stood_for: String,
    /// Longest standstill of one with an open goal, whatever for.
    pub(crate) waited_s: f64,
    /// Of those that neither died nor were latched.
    pub(crate) ends: Vec<(GoalStatus, Option<String>)>,
    /// Who touched what, and what they were doing.
    pub(crate) touched: Vec<String>,
    /// Where each truck truly was, each 0.2 s.
    pub(crate) tracks: Vec<Vec<MapPose>>,
}

impl Meeting {
    /// Whether everybody has arrived or says who is in the way.
    pub(crate) fn is_told(&self) -> bool {
        let told = |(status, reason): &(GoalStatus, Option<String>)| {
            *status == GoalStatus::Reached
                || reason.as_ref().is_some_and(|words| words.contains("blocked by xtb-"))
        };
        self.ends.iter().all(told)
    }

    /// Nobody stood too long: 15 s, or 60 s for a named moving truck.
    pub(crate) fn is_brisk(&self) -> bool {
        self.stood_s <= 15.0 && self.waited_s < 60.0
    }
}

/// Robots at these places of a world, and traffic control.
pub(crate) fn fleet(world: &str, starts: &[MapPose], seed: u64) -> Drive {
    let world = World::from_toml(world).unwrap();
    let map = world.chart(0.05).unwrap();
    let mut drive = Drive::at(world, starts, seed);
    let car = Car::of(&VehicleConfig::default());
    drive.lockstep.set_traffic(Some(Traffic::new(&map, car, seed)));
    drive
}

/// A robot as the witness sees it.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    stood_s: f64,
    /// Of this standstill, without waiting for a moving truck.
    idle_s: f64,
    contacts: u64,
}

/// All go to their goals at once; `meddle` may do what it likes with them, each 0.2 s.
pub(crate) fn meet(
    drive: &mut Drive,
    goals: &[MapPose],
    within_s: f64,
    meddle: &mut dyn FnMut(&mut Drive, f64),
) -> Meeting {
    let mut seen: Vec<Seen> =
        (0..goals.len()).map(|index| Seen { contacts: contacts(drive, index), ..Seen::default() }).collect();
    for (index, goal) in goals.iter().enumerate() {
        let asked = drive.goto(index, goal.x_m, goal.y_m, Some(goal.yaw_rad));
        assert!(matches!(asked, Outcome::Ok(_)), "{asked:?}");
    }
    let begun = drive.lockstep.now();
    let mut made = Meeting { tracks: vec![Vec::new(); goals.len()], ..Meeting::default() };
    let mut told_s = 0.0;
    while made.took_s < within_s && told_s < 20.0 {
        drive.run_s(STEP_S);
        made.took_s = drive.lockstep.now().since_s(begun);
        let states: Vec<RobotState> =
            (0..goals.len()).map(|index| drive.lockstep.state(index).unwrap()).collect();
        watch(drive, &states, &mut seen, &mut made);
        meddle(drive, made.took_s);
        if made.ends.iter().all(|(status, _)| status.is_final()) {
            break;
        }
        told_s = if made.ends.len() < goals.len() && made.is_told() { told_s + STEP_S } else { 0.0 };
    }
    made.reached = made.ends.iter().filter(|(status, _)| *status == GoalStatus::Reached).count();
    made
}

fn contacts(drive: &Drive, index: usize) -> u64 {
    drive.lockstep.simulation().trucks()[index].truth().contacts
}

fn watch(drive: &Drive, states: &[RobotState], seen: &mut [Seen], made: &mut Meeting) {
    made.ends.clear();
    let is_out = |index: usize| drive.lockstep.is_dead(index) || !states[index].latches.is_empty();
    let stood: Vec<f64> = seen.iter().map(|one| one.stood_s).collect();
    for (index, state) in states.iter().enumerate() {
        if is_out(index) {
            continue;
        }
        let (truth, one) = (drive.lockstep.simulation().trucks()[index].truth(), &mut seen[index]);
        made.tracks[index].push(MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad });
        let words = || words(state, &truth_pose(drive, index));
        if truth.contacts > one.contacts {
            made.contacts += truth.contacts - one.contacts;
            one.contacts = truth.contacts;
            made.touched.push(format!("{:.1} s {}", made.took_s, words()));
        }
        let goal = state.goal.as_ref().unwrap();
        made.ends.push((goal.status, goal.reason.clone()));
        let blocked = (0..states.len()).any(is_out)
            && goal.reason.as_ref().is_some_and(|words| words.contains("blocked by xtb-"));
        if goal.status.is_final() || truth.speed_mps.abs() > 0.01 || blocked {
            (one.stood_s, one.idle_s) = (0.0, 0.0);
            continue;
        }
        one.stood_s += STEP_S;
        one.idle_s += if waits_for_moving(states, &stood, index) { 0.0 } else { STEP_S };
        made.waited_s = made.waited_s.max(one.stood_s);
        if one.idle_s > made.stood_s {
            (made.stood_s, made.stood_for) = (one.idle_s, words());
        }
    }
}

/// Whether it waits for somebody who moves, or who waits for somebody who moves.
fn waits_for_moving(states: &[RobotState], stood: &[f64], index: usize) -> bool {
    let mut at = index;
    for _ in 0..states.len() {
        let waits_for = states[at].nav.route.as_ref().and_then(|route| route.waits_for.as_ref());
        let Some(name) = waits_for else { return false };
        let Some(next) = states.iter().position(|state| state.robot == *name) else { return false };
        let open = states[next].goal.as_ref().is_some_and(|goal| !goal.status.is_final());
        if open && stood[next] < MOVING_S {
            return true;
        }
        at = next;
    }
    false
}

fn truth_pose(drive: &Drive, index: usize) -> MapPose {
    let truth = drive.lockstep.simulation().trucks()[index].truth();
    MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad }
}

/// What a robot is at, in a line.
fn words(state: &RobotState, truth: &MapPose) -> String {
    let off_m = (state.pose.x_m - truth.x_m).hypot(state.pose.y_m - truth.y_m);
    let goal = state.goal.as_ref().and_then(|goal| goal.reason.clone());
    let route = state.nav.route.as_ref().map_or_else(String::new, |route| {
        let length_m =
            route.track.as_ref().map_or(0.0, |t| t.arcs.iter().map(|arc| arc.length_m.abs()).sum::<f64>());
        format!(
            "plan {} {:?} at {:.2} of {:.2} of {length_m:.2} m, {:.2} off, waits for {:?}, blocked at {:?}",
            route.plan,
            route.phase,
            route.done_m,
            route.release_m,
            route.off_m,
            route.waits_for,
            route.blocked_at_m
        )
    });
    format!(
        "{} ({:.2}, {:.2}, {:.2}) {:.2} m/s pose {off_m:.3} off, {:?} {goal:?} {route}",
        state.robot,
        truth.x_m,
        truth.y_m,
        truth.yaw_rad,
        state.speed_mps.unwrap_or(0.0),
        state.stopped_because,
    )
}

/// All robots, a line each.
#[allow(dead_code)] // for the example
pub(crate) fn scene(drive: &mut Drive) -> String {
    let mut lines = String::new();
    let mut index = 0;
    while let Some(state) = drive.lockstep.state(index) {
        lines += &(words(&state, &truth_pose(drive, index)) + "\n");
        index += 1;
    }
    lines
}

/// Many on a circle, each to the place opposite, in 8 × 8 m.
pub(crate) fn circle(robots: usize, seed: u64, meddle: &mut dyn FnMut(&mut Drive, f64)) -> Meeting {
    let place = |n: usize, turned: f64, facing: f64| {
        let angle = TAU * n as f64 / robots as f64 + turned;
        let yaw_rad = xtb_nav::path::wrap_rad(angle + facing);
        MapPose { x_m: 3.0 * angle.cos(), y_m: 3.0 * angle.sin(), yaw_rad }
    };
    let starts: Vec<_> = (0..robots).map(|n| place(n, 0.0, PI)).collect();
    let goals: Vec<_> = (0..robots).map(|n| place(n, PI, 0.0)).collect();
    let mut drive = fleet("[room]\nwidth_m = 8.0\ndepth_m = 8.0", &starts, seed);
    meet(&mut drive, &goals, 300.0, meddle)
}

/// Before and behind the door.
fn side(n: usize, north: bool) -> MapPose {
    let x_m = (n as f64 - 2.0) * 1.3;
    match north {
        true => MapPose { x_m, y_m: 5.6, yaw_rad: -FRAC_PI_2 },
        false => MapPose { x_m, y_m: 2.4, yaw_rad: FRAC_PI_2 },
    }
}

/// Five swap places through a door of 1.5 m, three from one side, two from the other; and back.
pub(crate) struct Door {
    pub(crate) drive: Drive,
    round: usize,
}

impl Door {
    pub(crate) fn new(seed: u64) -> Self {
        const ROOM: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0\ny_m = 4.0\n\
            [[walls]]\npoints = [[-4.0, 4.0], [-0.75, 4.0]]\n[[walls]]\npoints = [[0.75, 4.0], [4.0, 4.0]]";
        let starts: Vec<_> = (0..5).map(|n| side(n, n % 2 == 0)).collect();
        Self { drive: fleet(ROOM, &starts, seed), round: 0 }
    }

    /// All change sides once.
    pub(crate) fn round(&mut self, meddle: &mut dyn FnMut(&mut Drive, f64)) -> Meeting {
        self.round += 1;
        let goals: Vec<_> = (0..5).map(|n| side(n, (n + self.round).is_multiple_of(2))).collect();
        meet(&mut self.drive, &goals, 300.0, meddle)
    }
}

/// Nose to nose in the corridor's narrow place, with a third one behind: one must back out.
pub(crate) fn narrow(seed: u64, meddle: &mut dyn FnMut(&mut Drive, f64)) -> Meeting {
    let pose = |x_m, y_m, yaw_rad| MapPose { x_m, y_m, yaw_rad };
    let starts = [pose(0.6, 7.1, FRAC_PI_2), pose(0.6, 8.1, -FRAC_PI_2), pose(0.6, 5.8, FRAC_PI_2)];
    let goals = [pose(0.3, 10.8, FRAC_PI_2), pose(0.0, 0.0, -FRAC_PI_2), pose(-0.4, 9.6, FRAC_PI_2)];
    let mut drive = fleet(CORRIDOR, &starts, seed);
    meet(&mut drive, &goals, 300.0, meddle)
}

/// What goes wrong on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Trouble {
    /// Nothing.
    None,
    /// The agent of the first truck in the doorway dies.
    Death,
    /// The drive of the first truck in the doorway is latched.
    Latch,
    /// Traffic control dies after 8 s and comes back, knowing nothing, 5 s later.
    Restart,
    /// One message of ten gets lost.
    Loss,
}

impl Trouble {
    /// As [`meet`] takes it.
    pub(crate) fn meddle(self) -> impl FnMut(&mut Drive, f64) {
        let (mut done, mut back) = (false, false);
        move |drive, at_s| {
            let Some(traffic) = drive.lockstep.traffic_mut() else { return };
            match self {
                Self::Loss => traffic.lost = 0.1,
                Self::Restart if at_s > 8.0 && !done => {
                    done = true;
                    traffic.kill();
                }
                Self::Restart if at_s > 13.0 && !back => {
                    back = true;
                    traffic.restart();
                }
                Self::Death | Self::Latch if !done => {
                    let trucks = drive.lockstep.simulation().trucks().len();
                    let Some(index) = (0..trucks).find(|&index| is_in_doorway(&truth_pose(drive, index)))
                    else {
                        return;
                    };
                    done = true;
                    match self {
                        Self::Death => drive.lockstep.kill(index),
                        _ => drive.estop(index),
                    }
                }
                _ => {}
            }
        }
    }
}

fn is_in_doorway(pose: &MapPose) -> bool {
    pose.x_m.abs() < 0.75 && (pose.y_m - 4.0).abs() < 0.2
}
