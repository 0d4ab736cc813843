//! The people: each with the client's side of authority and a manner of their own.
//!
//! ```text
//!   pause ─► asking (acquire, goto, wander, stop, cancel, reset, set_pose, release) ─► pause
//!        └─► driving with the joystick                                               ─► pause
//!        └─► calling an emergency stop, again and again until it is acknowledged      ─► pause
//! ```
//! Whoever holds a lease retains it all the while. Dead people do nothing any more, frozen ones go on later.

use crate::change::{ROBOTS, Sender};
use crate::network::{Message, Parcel, Seen};
use crate::scripts::Act;
use crate::time::{Turn, stamp, turns};
use std::collections::VecDeque;
use std::f64::consts::PI;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{Body, Lease, LinkLoss, Outcome, RejectCode, Reply, Request, Setpoint};
use xtb_robot::Operator;
use xtb_robot::operator::{Call, CallStep};
use xtb_sim::rng::Rng;

/// A joystick sends at 20 Hz.
const SETPOINT_TURNS: Turn = 10;
/// An emergency stop is repeated this often until it is acknowledged.
const ESTOP_TURNS: Turn = 10;
const RETAINED: usize = 2;

#[derive(Debug, Clone)]
enum Doing {
    Pause,
    Asking { call: Box<Call>, id: Uuid },
    Driving { rpm: f64, steering: f64, until: Turn, next: Turn },
    Estopping { robot: u8, id: Uuid, until: Turn, next: Turn },
}

/// One operator.
#[derive(Debug)]
pub(crate) struct Person {
    index: u8,
    rng: Rng,
    robot: u8,
    operator: Operator,
    doing: Doing,
    pause_until: Turn,
    views: [Seen; ROBOTS as usize],
    last_goal: Option<Uuid>,
    /// A request that may be repeated much later under its old id.
    last_asked: Option<Request>,
    retains: [u128; RETAINED],
    last_setpoint: Option<Setpoint>,
    asked: u64,
    /// Joystick held on whatever happens.
    stubborn: bool,
    alive: bool,
    frozen_until: Turn,
    flood: Option<(u8, u8, Turn)>,
    /// What an actor has to do; others decide for themselves.
    script: Option<VecDeque<(Turn, Act)>>,
    first_lease: Option<Lease>,
}

impl Person {
    pub(crate) fn new(index: u8, robots: usize, mut rng: Rng) -> Self {
        let robot = rng.up_to(robots as u64 - 1) as u8;
        Self {
            index,
            robot,
            operator: Operator::default(),
            doing: Doing::Pause,
            pause_until: turns(rng.uniform(0.2, 1.5)),
            views: [Seen::default(); ROBOTS as usize],
            last_goal: None,
            last_asked: None,
            retains: [0; RETAINED],
            last_setpoint: None,
            asked: 0,
            stubborn: rng.chance(0.4),
            alive: true,
            frozen_until: 0,
            flood: None,
            script: None,
            first_lease: None,
            rng,
        }
    }

    pub(crate) fn die(&mut self) {
        self.alive = false;
    }

    pub(crate) fn freeze(&mut self, until: Turn) {
        self.frozen_until = until;
    }

    pub(crate) fn flood(&mut self, robot: u8, a_turn: u8, until: Turn) {
        self.flood = Some((robot, a_turn, until));
    }

    /// Plays a script on this robot instead of deciding.
    pub(crate) fn play(&mut self, robot: u8, script: Vec<(Turn, Act)>) {
        (self.robot, self.script, self.stubborn) = (robot, Some(script.into()), true);
    }

    /// Something came.
    pub(crate) fn receive(&mut self, now: Turn, robot: u8, message: &Message) {
        match message {
            Message::State(seen) => {
                let view = &mut self.views[usize::from(robot)];
                if seen.epoch != view.epoch || seen.seq >= view.seq {
                    *view = *seen;
                    if robot == self.robot {
                        self.operator.saw(seen.tick_ms);
                    }
                }
            }
            Message::Reply(reply) if robot == self.robot => self.replied(now, reply),
            Message::Estopped(id, true) => {
                if matches!(self.doing, Doing::Estopping { id: called, .. } if called == *id) {
                    self.pause(now, 0.3, 3.0);
                }
            }
            _ => {}
        }
    }

    fn replied(&mut self, now: Turn, reply: &Reply) {
        let waiting = matches!(self.doing, Doing::Asking { id, .. } if id == reply.id);
        if !waiting && !self.retains.contains(&reply.id.as_u128()) && self.script.is_none() {
            return; // an old one
        }
        self.operator.replied(stamp(now), reply);
        self.first_lease = self.first_lease.or(self.operator.lease());
        if !waiting {
            return;
        }
        match &reply.result {
            Outcome::Ok(done) => {
                self.last_goal = done.goal.or(self.last_goal);
                self.pause(now, 0.05, 3.0);
            }
            Outcome::Error(error) if error.code == RejectCode::Overloaded => {} // asked again
            Outcome::Error(_) => self.pause(now, 0.2, 1.0),
        }
    }

    fn pause(&mut self, now: Turn, from_s: f64, to_s: f64) {
        self.doing = Doing::Pause;
        self.pause_until = now + turns(self.rng.uniform(from_s, to_s));
    }

    fn new_id(&mut self) -> Uuid {
        self.asked += 1;
        Uuid::from_u128(u128::from(self.index) << 64 | u128::from(self.asked))
    }

    /// One turn.
    pub(crate) fn turn(&mut self, now: Turn, robots: usize, out: &mut Vec<Parcel>) {
        if !self.alive || now < self.frozen_until {
            return;
        }
        if let Some(body) = self.operator.retain(stamp(now)) {
            let id = self.new_id();
            self.retains = [id.as_u128(), self.retains[0]];
            let request = Request { id, lease: self.operator.lease(), body };
            self.send(self.robot, Message::Ask(Box::new(request)), out);
        }
        self.pour(now, out);
        self.act(now, out);
        if self.waits(now) {
            return;
        }
        let mut doing = std::mem::replace(&mut self.doing, Doing::Pause);
        match &mut doing {
            Doing::Pause if self.script.is_none() && now >= self.pause_until => {
                return self.decide(now, robots, out);
            }
            Doing::Pause => {}
            Doing::Asking { call, .. } => match call.step(stamp(now)) {
                CallStep::Ask(request) => {
                    self.last_asked = Some(request.clone());
                    self.send(self.robot, Message::Ask(Box::new(request)), out);
                }
                CallStep::Wait(_) => {}
                CallStep::GiveUp { .. } => return self.pause(now, 0.0, 1.0),
            },
            Doing::Driving { until, .. } if now >= *until => return self.pause(now, 0.0, 1.0),
            Doing::Driving { rpm, steering, next, .. } if now >= *next => {
                *next = now + SETPOINT_TURNS;
                let (rpm, steering) = (*rpm, *steering);
                self.steer(rpm, steering, out);
            }
            Doing::Estopping { robot, id, until, next } if now >= *next && now < *until => {
                *next = now + ESTOP_TURNS;
                let (robot, id) = (*robot, *id);
                self.send(robot, Message::Estop(id), out);
                self.send(robot, Message::AskEstop(id), out);
            }
            Doing::Estopping { until, .. } if now >= *until => return self.pause(now, 0.0, 1.0),
            Doing::Driving { .. } | Doing::Estopping { .. } => {}
        }
        self.doing = doing;
    }

    /// Whether there is nothing to do at this turn.
    fn waits(&self, now: Turn) -> bool {
        match &self.doing {
            Doing::Pause => self.script.is_some() || now < self.pause_until,
            Doing::Driving { until, next, .. } | Doing::Estopping { until, next, .. } => {
                now < (*until).min(*next)
            }
            Doing::Asking { .. } => false,
        }
    }

    fn steer(&mut self, rpm: f64, steering: f64, out: &mut Vec<Parcel>) {
        let view = self.views[usize::from(self.robot)];
        let rpm = if view.latched && !self.stubborn { 0.0 } else { rpm };
        let Some(setpoint) = self.operator.setpoint(rpm, steering) else { return };
        self.last_setpoint = Some(setpoint);
        self.send(self.robot, Message::Setpoint(setpoint), out);
    }

    /// What the script says for now.
    fn act(&mut self, now: Turn, out: &mut Vec<Parcel>) {
        while let Some(script) = &mut self.script
            && let Some((at, _)) = script.front()
            && *at <= now
            && let Some((_, act)) = script.pop_front()
        {
            match act {
                Act::Ask(body) => self.say(self.operator.lease(), body, out),
                Act::AskBare(body) => self.say(None, body, out),
                Act::AskOld(body) => self.say(self.first_lease, body, out),
                Act::Again => {
                    if let Some(request) = self.last_asked.clone() {
                        self.send(self.robot, Message::Ask(Box::new(request)), out);
                    }
                }
                Act::Stick { rpm, steering } => {
                    self.doing = Doing::Driving { rpm, steering, until: Turn::MAX, next: now };
                }
                Act::LetGo => self.doing = Doing::Pause,
                Act::Repeat => {
                    if let Some(setpoint) = self.last_setpoint {
                        self.send(self.robot, Message::Setpoint(setpoint), out);
                    }
                }
                Act::Estop => {
                    let id = self.new_id();
                    self.send(self.robot, Message::Estop(id), out);
                }
                Act::Die => self.alive = false,
            }
        }
    }

    fn say(&mut self, lease: Option<Lease>, body: Body, out: &mut Vec<Parcel>) {
        let goal = matches!(body, Body::Goto { .. } | Body::Wander { .. });
        let request = Request { id: self.new_id(), lease, body };
        if goal {
            self.last_asked = Some(request.clone());
        }
        self.send(self.robot, Message::Ask(Box::new(request)), out);
    }

    /// A flood, while it lasts: requests and setpoints of nobody's.
    fn pour(&mut self, now: Turn, out: &mut Vec<Parcel>) {
        let Some((robot, a_turn, until)) = self.flood else { return };
        if now >= until {
            self.flood = None;
        }
        for i in 0..a_turn {
            let message = if i % 3 == 0 {
                Message::Setpoint(Setpoint {
                    lease: None,
                    seq: 0,
                    echo_tick_ms: None,
                    rpm: 20.0,
                    steering: 0.0,
                })
            } else {
                Message::Ask(Box::new(Request { id: self.new_id(), lease: None, body: Body::Retain {} }))
            };
            self.send(robot, message, out);
        }
    }

    fn send(&self, robot: u8, message: Message, out: &mut Vec<Parcel>) {
        let by = Sender { person: self.index, name: self.index };
        out.push(Parcel { by, robot, message });
    }

    /// What next.
    fn decide(&mut self, now: Turn, robots: usize, out: &mut Vec<Parcel>) {
        let view = self.views[usize::from(self.robot)];
        let holds = self.operator.lease().is_some();
        if self.rng.chance(0.06) {
            let robot = self.rng.up_to(robots as u64 - 1) as u8;
            let id = self.new_id();
            self.doing = Doing::Estopping { robot, id, until: now + turns(3.0), next: now };
            return;
        }
        if self.rng.chance(0.05) {
            return self.ask(now, Body::Stop {});
        }
        if self.rng.chance(0.05)
            && let Some(request) = self.last_asked.clone()
        {
            // A retry that comes much too late.
            return self.send(self.robot, Message::Ask(Box::new(request)), out);
        }
        if !holds {
            if self.rng.chance(0.2) {
                (self.robot, self.operator) = (self.rng.up_to(robots as u64 - 1) as u8, Operator::default());
            }
            let take = self.rng.chance(0.3);
            return self.ask(now, Body::Acquire { take });
        }
        if view.latched && self.rng.chance(0.7) {
            return self.ask(now, Body::Reset { latch: None });
        }
        self.drive(now);
    }

    fn drive(&mut self, now: Turn) {
        let policy = if self.rng.chance(0.5) { LinkLoss::Halt } else { LinkLoss::Finish };
        let finish_s = self.rng.uniform(1.0, 20.0);
        let body = match self.rng.up_to(9) {
            0..=2 => Body::Goto {
                x_m: self.rng.uniform(-4.0, 4.0),
                y_m: self.rng.uniform(-4.0, 4.0),
                yaw_rad: None,
                via: None,
                on_link_loss: policy,
                finish_s,
            },
            3 => {
                let for_s = self.rng.chance(0.5).then(|| self.rng.uniform(0.5, 8.0));
                Body::Wander { for_s, on_link_loss: policy, finish_s }
            }
            4..=6 => {
                let rpm = self.rng.uniform(-25.0, 25.0);
                let until = now + turns(self.rng.uniform(0.3, 5.0));
                let steering = if self.rng.chance(0.3) { 0.0 } else { self.rng.uniform(-1.0, 1.0) };
                self.doing = Doing::Driving { rpm, steering, until, next: now };
                return;
            }
            7 => match self.last_goal {
                Some(goal) => Body::Cancel { goal },
                None => Body::Stop {},
            },
            8 => Body::SetPose {
                x_m: self.rng.uniform(-4.0, 4.0),
                y_m: self.rng.uniform(-4.0, 4.0),
                yaw_rad: self.rng.uniform(-PI, PI),
            },
            _ => Body::Release {},
        };
        self.ask(now, body);
    }

    fn ask(&mut self, now: Turn, body: Body) {
        let id = self.new_id();
        let released = matches!(body, Body::Release {});
        let give_up = stamp(now).plus_ms(3000);
        let call = self.operator.call(id, body, stamp(now), give_up);
        if released {
            self.operator = Operator::default();
        }
        self.doing = Doing::Asking { call: Box::new(call), id };
    }
}
