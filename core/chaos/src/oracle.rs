//! The oracle of one robot: knows what reached it and what it answered, never what it thinks, and
//! says at every turn whether the motor may be driven.
//!
//! ```text
//!   in (requests, setpoints, stops) ─┐
//!   replies, events, states ───────────┼─► leases, goals, setpoints, stops as they must be ─┐
//!   the day's changes (lines, sticks) ─┘                                                   ├─► violation?
//!   what the board gives the motor ────────────────────────────────────────────────────────┘
//! ```
//! All limits here are the longest that the design allows, with the reasons beside them.

mod devices;
mod replies;
mod states;

pub(crate) use devices::Truth;

use crate::change::Sender;
use crate::event_log::Answer;
pub(crate) use crate::report::Invariant;
use crate::time::{Turn, ms};
use devices::{Demand, Devices, STICKS};
use std::collections::VecDeque;
use xtb_control::PwmCount;
use xtb_control::units::Stamp;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{Body, GoalStatus, Latch, Lease, LinkLoss, Request, Setpoint};
use xtb_robot::agent::Arrival;

/// From the moment that nothing allows it any more until the motor is neutral, in turns that the agent
/// takes: the turn that notices it, a PWM period of 22.2 ms, and the step that shows it, doubled.
const REACTION: u32 = 10;
/// Without turns the board goes neutral by itself: 100 ms after the last frame, which may be 20 ms older
/// than the last turn, at the end of a PWM period.
const WATCHDOG: Turn = ms(130);
/// A loop that was held up for longer than the watchdog's time has stood for certain.
const HELD_UP: Turn = ms(150);
/// Later than this a turn is one after a pause.
const LATE: Turn = ms(80);
/// A setpoint's life, and the turn that it waits for.
const SETPOINT: Turn = ms(205);
/// The echoed tick may be so old, with the turn's rounding.
const ECHO_MS: u64 = 305;
/// A halting goal outlives its client's last message by 500 ms; that message may have waited in the queue
/// (40 ms) and for a loop that was held up for less than the watchdog's time (100 ms).
const HALT: Turn = ms(650);
/// A lease is certainly free after this, and certainly held before that.
const LEASE_GONE: Turn = ms(1100);
const LEASE_SURE: Turn = ms(850);
/// A loop that runs again has seen everything after this.
const SETTLED: Turn = ms(50);
/// What a turning truck touches with its side no sensor can see; this long it must have gone straight.
const STRAIGHT: Turn = ms(1500);
/// Pulses within the ESC's dead band (§4.7: ± 30 µs) do not drive; a receiver's neutral stick is never quite
/// neutral.
const DEAD_BAND: u16 = 75;

/// A broken rule, in words.
pub(crate) type Broken = (Invariant, String);

#[derive(Debug, Clone, Copy)]
struct Held {
    name: u8,
    lease: Lease,
    heard: Turn,
    granted: Turn,
}

#[derive(Debug, Clone, Copy)]
struct Goal {
    id: u128,
    by: u8,
    lease: Option<Lease>,
    policy: LinkLoss,
    heard: Turn,
    /// Its end by the clock.
    until: Turn,
}

/// Why nothing of the network may drive, as far as the oracle knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cut {
    Boot,
    Stop,
    Estop,
    Latch,
    Reset,
    Device(&'static str),
    HeldUp,
    LeaseTaken,
    GoalEnded,
}

/// How a truck moves, as far as walls go.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motion {
    /// As the agent commands it.
    pub(crate) steering: f64,
    /// Before the step.
    pub(crate) speed_mps: f64,
    pub(crate) contacts: u64,
    /// Its range finders work.
    pub(crate) sees: bool,
    /// It stands at a wall of the room, which no ray can miss.
    pub(crate) at_wall: bool,
    /// Another truck or a box may be what it touches.
    pub(crate) near_others: bool,
}

/// See the module's documentation.
#[derive(Debug)]
pub(crate) struct Oracle {
    held: Option<Held>,
    /// The grant of this turn, if the robot has told since that its lease is free: of it, or of the one before.
    freed: Option<Held>,
    granted: Vec<(Lease, u8)>,
    goal: Option<Goal>,
    /// Goals of this boot, and whether they have ended.
    begun: Vec<(u128, Option<GoalStatus>)>,
    acknowledged: Option<u128>,
    answers: Vec<VecDeque<(u128, Answer)>>,
    setpoint: Option<Turn>,
    last_setpoint: Option<Turn>,
    last_seq: Option<(Lease, u64)>,
    armed: bool,
    cut: Cut,
    stopped_by: Arrival,
    estopped: bool,
    estopped_by: Arrival,
    estops_known: Vec<Uuid>,
    /// Of these, those since the last reset.
    estops_standing: Vec<Uuid>,
    published: Published,
    idle_turns: u32,
    last_turn: Turn,
    turning_since: Turn,
    /// At the last turn.
    driven: bool,
    last_frame: Turn,
    devices: Devices,
    demand: Demand,
    silent_since: Option<Turn>,
    neutral_since: Option<Turn>,
    stands_since: Option<Turn>,
    straight_since: Option<Turn>,
    contacts: u64,
}

/// What the last state said of latches.
#[derive(Debug, Clone, Copy, Default)]
struct Published {
    any: bool,
    holds_transmitter: bool,
    estop: bool,
    /// A bit for each.
    latches: u32,
}

fn bit(latch: Latch) -> u32 {
    1 << latch as u32
}

impl Oracle {
    pub(crate) fn new(names: usize) -> Self {
        Self {
            held: None,
            freed: None,
            granted: Vec::new(),
            goal: None,
            begun: Vec::new(),
            acknowledged: None,
            answers: vec![VecDeque::new(); names],
            setpoint: None,
            last_setpoint: None,
            last_seq: None,
            armed: false,
            cut: Cut::Boot,
            stopped_by: 0,
            estopped: false,
            estopped_by: 0,
            estops_known: Vec::new(),
            estops_standing: Vec::new(),
            published: Published::default(),
            idle_turns: 0,
            last_turn: 0,
            turning_since: 0,
            driven: false,
            last_frame: 0,
            devices: Devices::default(),
            demand: Demand::default(),
            silent_since: None,
            neutral_since: None,
            stands_since: None,
            straight_since: None,
            contacts: 0,
        }
    }

    /// A new agent: nothing of the one before counts.
    pub(crate) fn booted(&mut self) {
        let devices = self.devices.anew();
        let Self { last_turn, last_frame, contacts, .. } = *self;
        *self = Self { devices, last_turn, last_frame, contacts, ..Self::new(self.answers.len()) };
    }

    /// The agent was killed.
    pub(crate) fn killed(&mut self) {
        self.cut(Cut::Boot);
        self.devices.stick_free = false;
    }

    /// The board lost its power.
    pub(crate) fn board_lost(&mut self) {
        self.devices.stick_free = false;
    }

    /// The agent's clock went back.
    pub(crate) fn clock_went_back(&mut self, now: Turn) {
        self.devices.clock_went_back(now);
    }

    fn cut(&mut self, why: Cut) {
        (self.goal, self.setpoint, self.armed, self.cut) = (None, None, false, why);
    }

    /// Whether a message bears the present lease.
    fn bears(&self, now: Turn, name: u8, lease: Option<Lease>) -> bool {
        let (Some(lease), Some(held)) = (lease, self.held) else { return false };
        held.name == name && held.lease == lease && !self.gone(now, held)
    }

    fn hears(&mut self, now: Turn, name: u8, lease: Option<Lease>) -> bool {
        let Some(lease) = lease else { return false };
        let Some(held) = self.held else { return false };
        let present = self.bears(now, name, Some(lease));
        if present {
            self.held = Some(Held { heard: now, ..held });
            if let Some(goal) = &mut self.goal
                && goal.by == name
                && goal.lease == Some(lease)
            {
                goal.heard = now;
            }
        }
        present
    }

    /// A request arrives.
    pub(crate) fn asked(&mut self, now: Turn, by: Sender, arrival: Arrival, request: &Request) {
        self.hears(now, by.name, request.lease);
        if matches!(request.body, Body::Stop {}) {
            self.stopped_by = arrival;
            self.cut(Cut::Stop);
        }
    }

    /// An emergency stop arrives. True if it is news.
    pub(crate) fn estop(&mut self, arrival: Arrival, id: Uuid) -> bool {
        if self.estops_known.contains(&id) {
            return false; // held up: it was reset since, or it is latched anyway
        }
        self.estops_known.push(id);
        self.estops_standing.push(id);
        (self.estopped, self.estopped_by, self.stopped_by) = (true, arrival, arrival);
        self.cut(Cut::Estop);
        true
    }

    /// The robot acknowledged this emergency stop, or not: it need not if it was reset since, though another one
    /// may wait behind it.
    pub(crate) fn estop_acknowledged(&self, id: Uuid, latched: bool) -> Result<(), Broken> {
        match latched || !self.estops_standing.contains(&id) {
            true => Ok(()),
            false => Err((Invariant::Requests, "an emergency stop arrived, but its state shows none".into())),
        }
    }

    /// The robot told that its lease is free, or held. What it tells of a turn comes in its order, after the
    /// answers of that turn: of several the last one counts.
    pub(crate) fn lease(&mut self, now: Turn, held: bool) {
        match held {
            true => self.held = self.held.or(self.freed.take().filter(|freed| freed.granted == now)),
            false => {
                self.freed = self.held.take().filter(|held| held.granted == now);
                if self.freed.is_none() {
                    (self.setpoint, self.armed) = (None, false);
                }
            }
        }
    }

    /// A setpoint arrives. Whether it may be obeyed.
    pub(crate) fn setpoint(&mut self, now: Turn, tick: Stamp, by: Sender, setpoint: &Setpoint) -> bool {
        if !self.bears(now, by.name, setpoint.lease) {
            return false;
        }
        self.armed |= setpoint.rpm == 0.0;
        let echoed =
            setpoint.echo_tick_ms.is_some_and(|echo| echo <= tick.ms() && tick.ms() - echo <= ECHO_MS);
        let lease = setpoint.lease.unwrap_or(Lease { epoch: 0, root: 0 });
        let newer = self.last_seq.is_none_or(|(of, seq)| of != lease || setpoint.seq > seq);
        if !echoed || !newer {
            return false;
        }
        self.hears(now, by.name, setpoint.lease);
        self.armed |= self.last_setpoint.is_none();
        (self.last_seq, self.last_setpoint) = (Some((lease, setpoint.seq)), Some(now));
        if self.armed {
            self.setpoint = Some(now);
        }
        self.armed
    }

    /// What the truck does in its world, after each step.
    pub(crate) fn moved(&mut self, now: Turn, motion: &Motion) -> Result<(), Broken> {
        let straight = motion.steering.abs() < 0.02 && motion.sees && !self.demand.sticks;
        self.straight_since = straight.then(|| self.straight_since.unwrap_or(now));
        let new = motion.contacts > std::mem::replace(&mut self.contacts, motion.contacts);
        let guarded = self.straight_since.is_some_and(|since| now - since > STRAIGHT);
        match new && guarded && motion.at_wall && !motion.near_others {
            true => Err((Invariant::Contact, format!("straight at {:.2} m/s", motion.speed_mps))),
            false => Ok(()),
        }
    }

    /// The end of a turn.
    pub(crate) fn turn(&mut self, now: Turn, truth: &Truth<'_>) -> Result<(), Broken> {
        if truth.turned {
            // The board's watchdog has stopped it meanwhile: it must not drive on by itself.
            let stood = self.driven && truth.motor == PwmCount::NEUTRAL.get();
            if now - self.last_turn > HELD_UP || (now - self.last_turn > LATE && stood) {
                self.cut(Cut::HeldUp);
            }
            if now - self.last_turn > 1 {
                self.turning_since = now;
            }
            self.last_turn = now;
            self.driven = truth.motor != PwmCount::NEUTRAL.get();
        }
        let owned = self.held.is_some_and(|held| now - held.heard < LEASE_SURE);
        self.demand = self.devices.update(now, truth, owned);
        if let Some(why) = self.demand.network {
            self.cut(Cut::Device(why));
        }
        if !(PwmCount::MIN.get()..=PwmCount::MAX.get()).contains(&truth.motor) {
            return Err((Invariant::Range, format!("the motor gets {} counts", truth.motor)));
        }
        let counts = truth.motor.abs_diff(PwmCount::NEUTRAL.get());
        let network = self.network_may(now);
        let sticks = self.sticks_may(now, counts);
        if network || sticks {
            self.idle_turns = 0;
        } else if truth.reaches() {
            self.idle_turns += 1;
        }
        let latches = self.published.latches;
        self.devices.check(now, truth, sticks && !network, |latch| latches & bit(latch) != 0)?;
        if truth.reaches() {
            self.last_frame = now;
        }
        let stands = counts <= DEAD_BAND && truth.turned && truth.speed_mps == 0.0;
        self.stands_since = stands.then(|| self.stands_since.unwrap_or(now));
        self.neutral_since = (stands && counts == 0).then(|| self.neutral_since.unwrap_or(now));
        if counts == 0 {
            return Ok(());
        }
        let asleep = now.saturating_sub(self.last_frame) > WATCHDOG;
        if self.idle_turns > REACTION || asleep {
            let latched = self.estopped || self.published.any;
            let invariant = if latched { Invariant::Latched } else { Invariant::Authority };
            let why = if asleep { "no frame of an agent reaches its board".to_owned() } else { self.why() };
            return Err((invariant, format!("the motor gets {} counts, but {why}", truth.motor)));
        }
        Ok(())
    }

    fn why(&self) -> String {
        format!(
            "nothing allows it for {} turns: goal {}, setpoint {}, lease {}, last cut {:?}",
            self.idle_turns,
            if self.goal.is_some() { "silent or over" } else { "none" },
            if self.setpoint.is_some() { "expired" } else { "none" },
            self.held.map_or_else(|| "free".to_owned(), |held| format!("of person-{}", held.name)),
            self.cut,
        )
    }

    fn network_may(&self, now: Turn) -> bool {
        if self.estopped || self.published.any {
            return false;
        }
        let driven = self.setpoint.is_some_and(|at| now - at <= SETPOINT);
        let sent = self.goal.is_some_and(|goal| match goal.policy {
            LinkLoss::Halt => now - goal.heard <= HALT && now <= goal.until,
            LinkLoss::Finish => now <= goal.until,
        });
        driven || sent
    }

    /// Whether the transmitter may write this many counts. One that is at rest need not be let go first.
    fn sticks_may(&self, now: Turn, counts: u16) -> bool {
        let held = self.estopped || self.published.holds_transmitter || self.demand.sticks;
        let Devices { stick_free, manual_last, .. } = self.devices;
        !held && (stick_free || counts <= DEAD_BAND) && manual_last.is_some_and(|last| now - last <= STICKS)
    }
}
