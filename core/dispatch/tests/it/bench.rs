//! A dispatcher on a bench, for tests that tell a story one event at a time.

use crate::model::{LEDGER, me};
use crate::robots::FakeRobot;
use xtb_dispatch::dispatcher::DispatcherIdentity;
use xtb_dispatch::{Dispatcher, DispatcherSettings, Effect, LedgerEntry, OpenTravelCost, TravelCost};
use xtb_protocol::messages::{
    Assignment, Body, DispatchBody, DispatchError, DispatchOutcome, DispatchReply, DispatchRequest, NEXT_LEG,
    Request, TaskChange, TaskId, TaskKind, TaskSpec, TaskState, Waypoint,
};
use xtb_protocol::{Name, Uuid};

pub(crate) const START_MS: u64 = 1_800_000_000_000;

/// A dispatcher, its ledger and its robots, with nothing in between that could go wrong by itself.
pub(crate) struct Bench {
    pub(crate) now_ms: u64,
    pub(crate) dispatcher: Dispatcher,
    pub(crate) ledger: Vec<LedgerEntry>,
    pub(crate) robots: Vec<FakeRobot>,
    /// Robots that neither hear nor are heard.
    pub(crate) cut: Vec<bool>,
    pub(crate) full: bool,
    pub(crate) travel_cost: Box<dyn TravelCost>,
    /// The network holds assignments up: here they are.
    pub(crate) held_up: Option<Vec<Request>>,
    pub(crate) asked: u64,
    pub(crate) answers: Vec<(u64, DispatchReply)>,
    /// Requests to robots but for retains.
    pub(crate) asks: Vec<(Name, Body)>,
}

pub(crate) fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

pub(crate) fn point(x_m: f64, y_m: f64) -> Waypoint {
    Waypoint { x_m, y_m, yaw_rad: None }
}

pub(crate) fn goto(x_m: f64, y_m: f64) -> TaskSpec {
    TaskSpec::new(TaskKind::Goto { to: point(x_m, y_m) })
}

pub(crate) fn identity(run: u64) -> DispatcherIdentity {
    DispatcherIdentity { me: me(), ledger: LEDGER, run }
}

impl Bench {
    pub(crate) fn new(robots: usize) -> Self {
        Self::with(robots, DispatcherSettings::default())
    }

    pub(crate) fn with(robots: usize, settings: DispatcherSettings) -> Self {
        let mut bench = Self {
            now_ms: START_MS,
            dispatcher: Dispatcher::recover(START_MS, identity(1), settings, []).unwrap(),
            ledger: Vec::new(),
            robots: (1..=robots).map(|i| FakeRobot::new(&format!("xtb-{i}"), (i as f64, 0.0))).collect(),
            cut: vec![false; robots],
            full: false,
            travel_cost: Box::new(OpenTravelCost),
            held_up: None,
            asked: 0,
            answers: Vec::new(),
            asks: Vec::new(),
        };
        bench.run_ms(500);
        bench
    }

    pub(crate) fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms / 10 {
            self.now_ms += 10;
            for (robot, _) in self.robots.iter_mut().zip(&self.cut).filter(|(robot, cut)| robot.up && !**cut)
            {
                if self.now_ms.is_multiple_of(50) {
                    let state = robot.state(self.now_ms);
                    self.dispatcher.state(self.now_ms, &state);
                }
            }
            self.robots.iter_mut().for_each(|robot| robot.turn(self.now_ms));
            self.dispatcher.step(self.now_ms, self.travel_cost.as_ref());
            self.effects();
        }
    }

    pub(crate) fn effects(&mut self) {
        while let Some(effect) = self.dispatcher.next_effect() {
            match effect {
                Effect::Write(write) if self.full => {
                    self.dispatcher.not_written(self.now_ms, write.id, "the disk is full");
                }
                Effect::Write(write) => {
                    self.ledger.extend(write.entries);
                    self.dispatcher.written(self.now_ms, write.id).unwrap();
                }
                Effect::Ask { robot, request } => self.ask_robot(&robot, &request),
                Effect::Reply { ticket, reply } => self.answers.push((ticket, reply)),
                Effect::Event(_) => {}
            }
        }
    }

    pub(crate) fn ask_robot(&mut self, name: &Name, request: &Request) {
        if !matches!(request.body, Body::Retain {}) {
            self.asks.push((name.clone(), request.body.clone()));
        }
        let i = self.robots.iter().position(|robot| robot.name == *name).unwrap();
        if self.cut[i] {
            return;
        }
        if let (Body::Assign { .. }, Some(held_up)) = (&request.body, &mut self.held_up) {
            return held_up.push(request.clone());
        }
        if let Some(reply) = self.robots[i].request(self.now_ms, &me(), request) {
            self.dispatcher.replied(self.now_ms, name, &reply);
        }
    }

    pub(crate) fn ask(&mut self, body: DispatchBody) -> u64 {
        self.asked += 1;
        let request = DispatchRequest { id: Uuid::from_u128(u128::from(self.asked)), body };
        self.dispatcher.request(self.now_ms, self.asked, &name("cli-7"), &request, self.travel_cost.as_ref());
        self.effects();
        self.asked
    }

    pub(crate) fn answer(&self, ticket: u64) -> Option<&DispatchOutcome> {
        self.reply(ticket).map(|reply| &reply.result)
    }

    pub(crate) fn reply(&self, ticket: u64) -> Option<&DispatchReply> {
        self.answers.iter().find(|(of, _)| *of == ticket).map(|(_, reply)| reply)
    }

    pub(crate) fn submit(&mut self, spec: TaskSpec) -> TaskId {
        let ticket = self.ask(DispatchBody::Submit { tasks: vec![spec] });
        self.run_ms(20);
        match self.answer(ticket) {
            Some(DispatchOutcome::Submitted(tasks)) => tasks[0],
            other => panic!("{other:?}"),
        }
    }

    pub(crate) fn refused(&mut self, tasks: Vec<TaskSpec>) -> DispatchError {
        let ticket = self.ask(DispatchBody::Submit { tasks });
        self.run_ms(20);
        match self.answer(ticket) {
            Some(DispatchOutcome::Error(error)) => error.clone(),
            other => panic!("{other:?}"),
        }
    }

    pub(crate) fn change(&self, ticket: u64) -> Option<TaskChange> {
        match self.answer(ticket)? {
            DispatchOutcome::Changed(changes) => Some(changes[0].clone()),
            other => panic!("{other:?}"),
        }
    }

    pub(crate) fn state(&self, id: TaskId) -> TaskState {
        self.dispatcher.store().task(id).unwrap().state
    }

    pub(crate) fn reason(&self, id: TaskId) -> String {
        self.dispatcher.store().task(id).unwrap().reason.clone().unwrap_or_default()
    }

    pub(crate) fn robot_of(&self, id: TaskId) -> Option<usize> {
        let task = self.dispatcher.store().task(id)?;
        let name = &task.assigned.as_ref()?.robot;
        self.robots.iter().position(|robot| robot.name == *name)
    }

    pub(crate) fn by_person(&mut self, i: usize, body: Body) {
        self.asked += 1;
        let id = Uuid::from_u64_pair(9, self.asked);
        let lease = self.robots[i].lease.present();
        self.robots[i].request(self.now_ms, &name("cli-9"), &Request { id, lease, body });
    }

    /// This robot takes the next leg while one is under way.
    pub(crate) fn passes(&mut self, i: usize) {
        let capabilities = [NEXT_LEG.to_owned()];
        self.dispatcher.set_factsheet(self.now_ms, &self.robots[i].name, &capabilities, None);
    }

    pub(crate) fn restart(&mut self) {
        let entries = self.ledger.clone();
        self.dispatcher =
            Dispatcher::recover(self.now_ms, identity(2), DispatcherSettings::default(), entries).unwrap();
    }

    pub(crate) fn begun(&self) -> Vec<(u64, u32)> {
        let begun = self.asks.iter().filter_map(|(_, body)| match body {
            Body::Assign { assignment: Assignment { assign_seq, leg, .. }, .. } => Some((*assign_seq, *leg)),
            _ => None,
        });
        begun.collect()
    }
}
