//! One world of a seed: a dispatcher that crashes, its ledger, robots, a bad network, and people.
//!
//! Checked at every step: what is acknowledged is durable, no robot drives for an assignment that is not
//! in the ledger, no two robots drive for one task, nothing drives for a task whose end was confirmed.
//! Checked at the end: every acknowledged task has ended, once, and what is called done was driven.

mod checks;
mod trouble;
mod weather;

pub(crate) use weather::{Off, Weather};

use crate::robots::FakeRobot;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use weather::{DOOMED, spec};
use xtb_dispatch::dispatcher::DispatcherIdentity;
use xtb_dispatch::{Dispatcher, DispatcherSettings, Effect, LedgerEntry, OpenTravelCost, Write};
use xtb_nav::rooms::Draw;
use xtb_protocol::messages::{
    Body, DispatchBody, DispatchCode, DispatchOutcome, DispatchReply, DispatchRequest, MapHash, NEXT_LEG,
    Reply, Request, RobotState, TaskId, TaskSpec, TaskState,
};
use xtb_protocol::{Name, Uuid};

pub(crate) const LEDGER: u64 = 0x1234_5678_9abc;
const START_MS: u64 = 1_800_000_000_000;
const STEP_MS: u64 = 10;
const MAPS: [&str; 2] = ["lab", "hall"];

enum Mail {
    Ask(usize, Name, Request),
    Answer { run: u64, robot: usize, reply: Reply },
    State(Box<RobotState>),
}

struct Submission {
    at_ms: u64,
    key: Uuid,
    spec: TaskSpec,
    asked_ms: Option<u64>,
    task: Option<TaskId>,
}

pub(crate) struct World {
    pub(crate) weather: Weather,
    draw: Draw,
    pub(crate) now_ms: u64,
    chaos_until_ms: u64,
    pub(crate) robots: Vec<FakeRobot>,
    /// Until when a robot hears nothing, and is not heard.
    deaf_until_ms: Vec<u64>,
    mute_until_ms: Vec<u64>,
    up_at_ms: Vec<u64>,
    outages: Vec<Vec<(u64, u64)>>,
    takeover_until_ms: Vec<u64>,
    mail: Vec<(u64, u64, Mail)>,
    sent: u64,
    pub(crate) ledger: Vec<LedgerEntry>,
    pub(crate) dispatcher: Option<Dispatcher>,
    run: u64,
    /// The fleet's map, and when the dispatcher of this run hears of it.
    map: (&'static str, u64),
    restart_ms: u64,
    write: Option<(u64, Write)>,
    pub(crate) writes: u64,
    full_until_ms: u64,
    submissions: Vec<Submission>,
    tickets: BTreeMap<u64, Ticket>,
    next_ticket: u64,
    /// Tasks whose cancellation was confirmed.
    confirmed: BTreeSet<TaskId>,
    pub(crate) crashes: u64,
    pub(crate) replies: VecDeque<DispatchReply>,
}

#[derive(Clone, Copy)]
enum Ticket {
    Submission(usize),
    Cancel(TaskId),
    Retry(TaskId),
    /// How many points it has then.
    Extend(TaskId, usize),
    Other,
}

pub(crate) fn me() -> Name {
    Name::new("dispatch").unwrap()
}

fn person() -> Name {
    Name::new("cli-7").unwrap()
}

impl World {
    pub(crate) fn new(seed: u64, weather: Weather) -> Self {
        let mut draw = Draw::new(seed);
        let robots = (1..=weather.robots).map(|i| {
            let at = (draw.uniform(-3.0, 3.0), draw.uniform(-3.0, 3.0));
            let unfenced = weather.off == Off::Fence;
            FakeRobot { unfenced, doomed: vec![DOOMED], ..FakeRobot::new(&format!("xtb-{i}"), at) }
        });
        let robots: Vec<FakeRobot> = robots.collect();
        let submissions = (0..weather.tasks).map(|i| Submission {
            at_ms: START_MS + draw.whole(0, 15_000) as u64,
            key: Uuid::from_u64_pair(seed, i as u64 + 1),
            spec: spec(&mut draw, weather),
            asked_ms: None,
            task: None,
        });
        let submissions = submissions.collect();
        let mut world = Self {
            weather,
            now_ms: START_MS,
            chaos_until_ms: START_MS + 40_000,
            deaf_until_ms: vec![0; robots.len()],
            mute_until_ms: vec![0; robots.len()],
            up_at_ms: vec![0; robots.len()],
            outages: vec![Vec::new(); robots.len()],
            takeover_until_ms: vec![0; robots.len()],
            robots,
            draw,
            mail: Vec::new(),
            sent: 0,
            ledger: Vec::new(),
            dispatcher: None,
            run: 0,
            map: (MAPS[0], 0),
            restart_ms: 0,
            write: None,
            writes: 0,
            full_until_ms: 0,
            submissions,
            tickets: BTreeMap::new(),
            next_ticket: 0,
            confirmed: BTreeSet::new(),
            crashes: 0,
            replies: VecDeque::new(),
        };
        world.start();
        world
    }

    fn settings(&self) -> DispatcherSettings {
        let usual = DispatcherSettings::default();
        if self.weather.off == Off::Grace {
            DispatcherSettings { silent_ms: 100, halted_ms: 0, ..usual }
        } else {
            usual
        }
    }

    fn start(&mut self) {
        self.run += 1;
        let read = self.ledger.iter().map(|entry| LedgerEntry::from_json(&entry.to_json().unwrap()).unwrap());
        let identity = DispatcherIdentity { me: me(), ledger: LEDGER, run: self.run };
        let dispatcher =
            Dispatcher::recover(self.now_ms, identity, self.settings(), read.collect::<Vec<_>>());
        let mut dispatcher = dispatcher.unwrap();
        // Every other robot takes the next leg while one is under way.
        for robot in self.robots.iter().step_by(2) {
            dispatcher.set_factsheet(self.now_ms, &robot.name, &[NEXT_LEG.to_owned()], None);
        }
        self.dispatcher = Some(dispatcher);
        let moves = self.chance(self.weather.moves);
        let name = if moves { MAPS[self.draw.whole(0, 1) as usize] } else { self.map.0 };
        self.map = (name, self.now_ms + self.draw.whole(0, 400) as u64);
    }

    pub(crate) fn crash(&mut self) {
        (self.dispatcher, self.write) = (None, None);
        self.tickets.clear();
        self.crashes += 1;
        self.restart_ms = self.now_ms + self.draw.whole(20, 3000) as u64;
    }

    /// Starts at once.
    pub(crate) fn restart(&mut self) {
        self.start();
    }

    fn chance(&mut self, share: f64) -> bool {
        share > 0.0 && self.now_ms < self.chaos_until_ms && self.draw.uniform(0.0, 1.0) < share
    }

    /// Until every task has ended, or the time is up.
    pub(crate) fn run(&mut self) -> Result<(), String> {
        let end_ms = self.chaos_until_ms + 400_000;
        while self.now_ms < end_ms {
            self.step()?;
            if self.now_ms > self.chaos_until_ms && self.is_over() {
                return self.check_end();
            }
        }
        let open = self.dispatcher.as_ref().map(|d| d.store().open().cloned().collect::<Vec<_>>());
        Err(format!("tasks wait for ever: {:?}", open.unwrap_or_default().first()))
    }

    fn is_over(&self) -> bool {
        let Some(dispatcher) = &self.dispatcher else { return false };
        self.submissions.iter().all(|submission| submission.task.is_some())
            && dispatcher.store().open_count() == 0
            && self.write.is_none()
    }

    pub(crate) fn step(&mut self) -> Result<(), String> {
        self.now_ms += STEP_MS;
        let now_ms = self.now_ms;
        if self.dispatcher.is_none() && now_ms >= self.restart_ms {
            self.start();
        }
        self.trouble();
        self.deliver();
        for robot in &mut self.robots {
            robot.turn(now_ms);
        }
        if now_ms.is_multiple_of(50) {
            for i in 0..self.robots.len() {
                if self.robots[i].up {
                    let state = self.robots[i].state(now_ms);
                    self.post(i, Mail::State(Box::new(state)));
                }
            }
        }
        self.people();
        if let Some(dispatcher) = &mut self.dispatcher {
            if now_ms >= self.map.1 {
                dispatcher.map(now_ms, self.map.0, MapHash::new(self.run % 2));
            }
            dispatcher.step(now_ms, &OpenTravelCost);
        }
        self.effects()?;
        self.finish_write()?;
        self.check()
    }

    fn by_person(&mut self, i: usize, body: Body) {
        let lease = self.robots[i].lease.present();
        self.sent += 1;
        let request = Request { id: Uuid::from_u64_pair(99, self.sent), lease, body };
        self.robots[i].request(self.now_ms, &person(), &request);
    }

    fn post(&mut self, robot: usize, mail: Mail) {
        let weather = self.weather;
        let to_robot = matches!(mail, Mail::Ask(..));
        let cut_ms = if to_robot { self.deaf_until_ms[robot] } else { self.mute_until_ms[robot] };
        let lost = self.chance(weather.loss) || self.now_ms < cut_ms;
        let slow = if self.chance(weather.loss) { weather.slow_ms } else { 30 };
        let at_ms = self.now_ms + self.draw.whole(1, slow) as u64;
        self.sent += 1;
        if !lost {
            self.mail.push((at_ms, self.sent, mail));
        }
    }

    fn deliver(&mut self) {
        let now_ms = self.now_ms;
        let (mut due, later): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.mail).into_iter().partition(|(at_ms, ..)| *at_ms <= now_ms);
        self.mail = later;
        due.sort_by_key(|(at_ms, n, _)| (*at_ms, *n));
        for (_, _, mail) in due {
            match mail {
                Mail::Ask(robot, client, request) => {
                    if let Some(reply) = self.robots[robot].request(now_ms, &client, &request) {
                        self.post(robot, Mail::Answer { run: self.run, robot, reply });
                    }
                }
                Mail::Answer { run, robot, reply } if run == self.run => {
                    let name = self.robots[robot].name.clone();
                    if let Some(dispatcher) = &mut self.dispatcher {
                        dispatcher.replied(now_ms, &name, &reply);
                    }
                }
                Mail::Answer { .. } => {}
                Mail::State(state) => {
                    if let Some(dispatcher) = &mut self.dispatcher {
                        dispatcher.state(now_ms, &state);
                    }
                }
            }
        }
    }

    pub(crate) fn ask(&mut self, body: DispatchBody) -> u64 {
        self.sent += 1;
        let request = DispatchRequest { id: Uuid::from_u64_pair(77, self.sent), body };
        self.ask_as(&request, Ticket::Other)
    }

    fn ask_as(&mut self, request: &DispatchRequest, what: Ticket) -> u64 {
        self.next_ticket += 1;
        self.tickets.insert(self.next_ticket, what);
        if let Some(dispatcher) = &mut self.dispatcher {
            dispatcher.request(self.now_ms, self.next_ticket, &person(), request, &OpenTravelCost);
        }
        self.next_ticket
    }

    fn effects(&mut self) -> Result<(), String> {
        while let Some(effect) = self.dispatcher.as_mut().and_then(Dispatcher::next_effect) {
            match effect {
                Effect::Write(write) => self.begin_write(write)?,
                Effect::Ask { robot, request } => {
                    self.check_ask(&request)?;
                    let i =
                        self.robots.iter().position(|other| other.name == robot).ok_or("no such robot")?;
                    self.post(i, Mail::Ask(i, me(), request));
                }
                Effect::Reply { ticket, reply } => self.replied(ticket, reply)?,
                Effect::Event(event) => {
                    if !self.ledger.iter().any(|entry| entry.n == event.entry) {
                        return Err(format!("an event of entry {} that is not durable", event.entry));
                    }
                }
            }
        }
        Ok(())
    }

    fn replied(&mut self, ticket: u64, reply: DispatchReply) -> Result<(), String> {
        match (self.tickets.remove(&ticket), &reply.result) {
            (Some(Ticket::Submission(i)), DispatchOutcome::Submitted(tasks)) => {
                let task = *tasks.first().ok_or("a submission without a task")?;
                if !self.submitted().contains_key(&task) {
                    return Err(format!("{task} was acknowledged and is not durable"));
                }
                self.submissions[i].task = Some(task);
            }
            (Some(Ticket::Submission(i)), DispatchOutcome::Error(error)) => {
                let expected = [DispatchCode::LedgerFailed, DispatchCode::Overloaded].contains(&error.code);
                if !expected {
                    return Err(format!("refused: {error:?}"));
                }
                self.submissions[i].asked_ms = Some(self.now_ms);
            }
            (Some(Ticket::Cancel(task)), DispatchOutcome::Changed(changes)) => {
                let [change] = changes.as_slice() else { return Err("not one change".into()) };
                if change.error.is_none() && change.state == Some(TaskState::Cancelled) {
                    self.confirmed.insert(task);
                }
            }
            (Some(Ticket::Extend(task, points)), DispatchOutcome::Changed(changes)) => {
                let taken = changes.iter().all(|change| change.error.is_none());
                if taken && self.points_in_ledger(task) < points {
                    return Err(format!("{task} has {points} points, was acknowledged and is not durable"));
                }
            }
            (Some(Ticket::Retry(task)), _) => {
                self.confirmed.remove(&task);
            }
            _ => self.replies.push_back(reply),
        }
        Ok(())
    }

    fn begin_write(&mut self, write: Write) -> Result<(), String> {
        if self.write.is_some() {
            return Err("two writes at once".into());
        }
        self.writes += 1;
        if self.weather.off == Off::Durability
            && let Some(dispatcher) = &mut self.dispatcher
        {
            dispatcher.written(self.now_ms, write.id).map_err(|error| error.to_string())?;
        }
        let at_ms = self.now_ms + self.draw.whole(0, 40) as u64;
        self.write = Some((at_ms, write));
        Ok(())
    }

    fn finish_write(&mut self) -> Result<(), String> {
        let Some((_, write)) = self.write.take_if(|(at_ms, _)| *at_ms <= self.now_ms) else { return Ok(()) };
        let weather = self.weather;
        if let Some((at, durable)) =
            weather.crash_at.filter(|(at, _)| *at == self.writes && self.crashes == 0)
        {
            let _ = at;
            if durable {
                self.ledger.extend(write.entries);
            }
            self.crash();
            return Ok(());
        }
        if weather.full_at == Some(self.writes) && self.full_until_ms == 0 {
            self.full_until_ms = self.now_ms + 2000;
        }
        if self.chance(weather.crash) {
            if self.draw.uniform(0.0, 1.0) < 0.5 {
                self.ledger.extend(write.entries);
            }
            self.crash();
            return Ok(());
        }
        let full = self.now_ms < self.full_until_ms || self.chance(weather.full);
        let Some(dispatcher) = &mut self.dispatcher else { return Ok(()) };
        if full && weather.off != Off::Durability {
            dispatcher.not_written(self.now_ms, write.id, "the disk is full");
        } else {
            self.ledger.extend(write.entries);
            dispatcher.written(self.now_ms, write.id).map_err(|error| error.to_string())?;
        }
        self.effects()
    }
}
