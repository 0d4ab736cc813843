//! The network between people and robots: a router in the middle, one link to each of them.
//!
//! ```text
//!   person ──link──► router ──link──► robot      requests, setpoints, emergency stops
//!   person ◄──link── router ◄──link── robot      replies, states
//! ```
//! A link delays; it stalls, and what waited arrives at once (as TCP does); it is cut off silently, which
//! both sides notice after two seconds, or closed, which they notice at once. On one channel of one link
//! the order stays; between channels it does not. What may be dropped is dropped where too much of it
//! waits. Time is counted in turns of 5 ms.

use crate::change::{End, Sender};
use crate::time::Turn;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{Reply, Request, Setpoint};
use xtb_sim::rng::Rng;

/// A silent link is noticed after two seconds (the lease that both sides announce).
const NOTICED: Turn = 400;
/// A new session after a link has come back: up to so much later.
const RECONNECT: u64 = 200;
/// Nothing is scheduled farther ahead than this.
const WHEEL: usize = 2048;
const FARTHEST: Turn = WHEEL as Turn - 1;
/// Messages of a channel that may be dropped wait on a link up to this number.
const WAITING: u32 = 16;

/// What a robot's state shows to the people; small enough to be sent in thousands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Seen {
    pub(crate) epoch: u64,
    pub(crate) tick_ms: u64,
    pub(crate) seq: u64,
    pub(crate) latched: bool,
}

/// What travels. States travel most, so what is much larger is in a box.
#[derive(Debug, Clone)]
pub(crate) enum Message {
    Ask(Box<Request>),
    Setpoint(Setpoint),
    Estop(Uuid),
    /// The get that wants an acknowledgement.
    AskEstop(Uuid),
    /// Bytes that say they are a request.
    Bytes(Vec<u8>),
    Reply(Box<Reply>),
    Estopped(Uuid, bool),
    State(Seen),
}

impl Message {
    /// Its channel: what keeps its order.
    fn channel(&self) -> usize {
        match self {
            Self::Ask(_) | Self::Bytes(_) | Self::Reply(_) => 0,
            Self::Setpoint(_) | Self::State(_) => 1,
            Self::Estop(_) | Self::AskEstop(_) | Self::Estopped(..) => 2,
        }
    }

    fn may_be_dropped(&self) -> bool {
        matches!(self, Self::Setpoint(_) | Self::State(_))
    }
}

const CHANNELS: usize = 3;

/// A message on its way.
#[derive(Debug, Clone)]
pub(crate) struct Parcel {
    pub(crate) by: Sender,
    pub(crate) robot: u8,
    pub(crate) message: Message,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Session {
    Up,
    /// Nothing passes, and nobody knows yet.
    Silent {
        until: Turn,
        noticed: Turn,
    },
    Closed {
        until: Turn,
    },
}

#[derive(Debug, Clone)]
struct Link {
    session: Session,
    /// Raised when a session ends: what was under way in it is lost.
    number: u32,
    held_until: Turn,
    latency: u64,
    jitter: u64,
    loss: f64,
    twice: f64,
    /// Earliest arrival of the next message, by direction and channel.
    floor: [[Turn; CHANNELS]; 2],
    /// Droppable messages that wait while it is held, by direction.
    waiting: [u32; 2],
}

#[derive(Debug, Clone)]
struct Flight {
    parcel: Parcel,
    /// On the first or on the second link of its way.
    first: bool,
    session: u32,
}

/// Links and what is under way.
#[derive(Debug)]
pub(crate) struct Network {
    people: usize,
    links: Vec<Link>,
    wheel: Vec<Vec<Flight>>,
    /// Emptied lists of the wheel: few are in use at a time, and these are in the processor's cache.
    spare: Vec<Vec<Flight>>,
    rng: Rng,
    /// All sessions stand, and no link is held.
    calm: bool,
    now: Turn,
    /// Messages that arrived at the present turn.
    arrived: Vec<Parcel>,
    /// Requests, setpoints and stops that passed the router, for strangers to repeat.
    captured: Vec<Parcel>,
    next_captured: usize,
    pub(crate) lost: u64,
}

const CAPTURED: usize = 96;

impl Network {
    /// The first `rough` people have links of their own weather; those after them act in scenes and have
    /// good ones.
    pub(crate) fn new(people: usize, robots: usize, rough: usize, mut rng: Rng) -> Self {
        let roughness = if rng.chance(0.3) { 1.0 } else { rng.uniform(0.0, 0.3) };
        let mut link = || Link {
            session: Session::Up,
            number: 0,
            held_until: 0,
            latency: rng.up_to(2),
            jitter: (rng.uniform(0.0, 12.0) * roughness) as u64,
            loss: rng.uniform(0.0, 0.2) * roughness,
            twice: rng.uniform(0.0, 0.05) * roughness,
            floor: [[0; CHANNELS]; 2],
            waiting: [0; 2],
        };
        let mut links: Vec<Link> = (0..people + robots).map(|_| link()).collect();
        for link in &mut links[rough..people] {
            (link.jitter, link.loss, link.twice) = (0, 0.0, 0.0);
        }
        let wheel = (0..WHEEL).map(|_| Vec::new()).collect();
        Self {
            people,
            links,
            wheel,
            spare: Vec::new(),
            rng,
            calm: true,
            now: 0,
            arrived: Vec::new(),
            captured: Vec::with_capacity(CAPTURED),
            next_captured: 0,
            lost: 0,
        }
    }

    fn index(&self, end: End) -> usize {
        match end {
            End::Person(i) => usize::from(i),
            End::Robot(i) => self.people + usize::from(i),
        }
    }

    /// Whether the session of this end is believed to stand.
    pub(crate) fn is_up(&self, end: End) -> bool {
        !matches!(self.links[self.index(end)].session, Session::Closed { .. })
    }

    /// Nothing passes for so many turns; then all that waited arrives. Longer than two seconds, the
    /// session ends.
    pub(crate) fn hold(&mut self, end: End, turns: Turn) {
        let i = self.index(end);
        self.calm = false;
        if turns > NOTICED {
            let (until, noticed) = (self.now + turns, self.now + NOTICED);
            self.links[i].session = Session::Silent { until, noticed };
        } else {
            let link = &mut self.links[i];
            link.held_until = link.held_until.max(self.now + turns);
        }
    }

    /// The session is closed at once, for so many turns at least.
    pub(crate) fn close(&mut self, end: End, turns: Turn) {
        let (i, back) = (self.index(end), self.rng.up_to(RECONNECT) as Turn);
        let until = self.now + turns + back;
        self.calm = false;
        let link = &mut self.links[i];
        (link.session, link.held_until) = (Session::Closed { until }, 0);
        link.number += 1;
    }

    /// The router dies: every session with it, and all that was under way.
    pub(crate) fn kill_router(&mut self, turns: Turn) {
        for i in 0..self.links.len() {
            let end =
                if i < self.people { End::Person(i as u8) } else { End::Robot((i - self.people) as u8) };
            self.close(end, turns);
        }
    }

    /// Time goes on to this turn: links come back, messages arrive.
    pub(crate) fn advance(&mut self, now: Turn) {
        self.now = now;
        if !self.calm {
            self.links_go_on(now);
        }
        let slot = now as usize % WHEEL;
        let mut flights = std::mem::take(&mut self.wheel[slot]);
        flights.drain(..).for_each(|flight| self.land(flight)); // each to a later slot, or to its end
        if flights.capacity() > 0 {
            self.spare.push(flights);
        }
    }

    fn links_go_on(&mut self, now: Turn) {
        for link in &mut self.links {
            if link.held_until <= now {
                link.waiting = [0; 2];
            }
            match link.session {
                Session::Silent { until, noticed } if now >= noticed.min(until) => {
                    let until = until.max(noticed) + self.rng.up_to(RECONNECT) as Turn;
                    (link.session, link.number) = (Session::Closed { until }, link.number + 1);
                }
                Session::Closed { until } if now >= until => link.session = Session::Up,
                _ => {}
            }
        }
        self.calm = self.links.iter().all(|link| link.session == Session::Up && link.held_until <= now);
    }

    /// It goes on at this turn.
    fn schedule(&mut self, at: Turn, flight: Flight) {
        let slot = &mut self.wheel[at as usize % WHEEL];
        if slot.capacity() == 0 {
            *slot = self.spare.pop().unwrap_or_default();
        }
        slot.push(flight);
    }

    /// The messages that arrived at this turn, oldest first.
    pub(crate) fn take_arrived(&mut self) -> Vec<Parcel> {
        std::mem::take(&mut self.arrived)
    }

    /// Gives the emptied list back, so that none is allocated each turn.
    pub(crate) fn give_back(&mut self, mut parcels: Vec<Parcel>) {
        parcels.clear();
        if self.arrived.is_empty() {
            self.arrived = parcels;
        }
    }

    /// A message that a stranger has heard.
    pub(crate) fn overheard(&mut self) -> Option<Parcel> {
        let n = self.captured.len() as u64;
        (n > 0).then(|| self.captured[self.rng.up_to(n - 1) as usize].clone())
    }

    pub(crate) fn send(&mut self, parcel: Parcel) {
        let up = is_upward(&parcel.message);
        let link = self.link_of(&parcel, up);
        self.fly(link, parcel, true);
    }

    /// The person's link or the robot's.
    fn link_of(&self, parcel: &Parcel, persons: bool) -> usize {
        self.index(match persons {
            true => End::Person(parcel.by.person),
            false => End::Robot(parcel.robot),
        })
    }

    fn fly(&mut self, link: usize, parcel: Parcel, first: bool) {
        let (now, rng) = (self.now, &mut self.rng);
        let up = is_upward(&parcel.message);
        let link = &mut self.links[link];
        let droppable = parcel.message.may_be_dropped();
        let held = link.held_until > now;
        let direction = usize::from(up);
        let full = droppable && held && link.waiting[direction] >= WAITING;
        if link.session != Session::Up || full || (droppable && rng.chance(link.loss)) {
            self.lost += 1;
            return;
        }
        link.waiting[direction] += u32::from(droppable && held);
        let delay = link.latency + rng.up_to(link.jitter);
        let floor = &mut link.floor[direction][parcel.message.channel()];
        let at = (now + 1 + delay as Turn).max(link.held_until).max(*floor).min(now + FARTHEST);
        *floor = at;
        let flight = Flight { parcel, first, session: link.number };
        let again = rng
            .chance(link.twice)
            .then(|| ((at + rng.up_to(40) as Turn).min(now + FARTHEST), flight.clone()));
        self.schedule(at, flight);
        if let Some((at, flight)) = again {
            self.schedule(at, flight);
        }
    }

    fn land(&mut self, flight: Flight) {
        let Flight { parcel, first, session } = flight;
        let up = is_upward(&parcel.message);
        // Upwards the first link is the person's, downwards the robot's.
        let i = self.link_of(&parcel, up == first);
        let link = &self.links[i];
        if link.number != session || link.session != Session::Up {
            self.lost += 1;
        } else if link.held_until > self.now {
            let at = link.held_until.min(self.now + FARTHEST);
            self.schedule(at, Flight { parcel, first, session });
        } else if first {
            if up {
                self.capture(&parcel);
            }
            let next = self.link_of(&parcel, !up);
            self.fly(next, parcel, false);
        } else {
            self.arrived.push(parcel);
        }
    }

    fn capture(&mut self, parcel: &Parcel) {
        if self.captured.len() < CAPTURED {
            self.captured.push(parcel.clone());
        } else {
            self.captured[self.next_captured] = parcel.clone();
            self.next_captured = (self.next_captured + 1) % CAPTURED;
        }
    }
}

/// From a person to a robot.
fn is_upward(message: &Message) -> bool {
    !matches!(message, Message::Reply(_) | Message::Estopped(..) | Message::State(_))
}
