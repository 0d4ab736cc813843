//! What clients and a dispatcher of the version of the wire before said to each other, and the dispatcher to its
//! robots: today's gives the same answers and asks the same of robots, as bytes.
//! `DIALOGUE=FILE cargo test -p xtb-dispatch --test it -- --ignored record_a_dialogue` records one: to be done before
//! the wire changes.

use crate::bench::{Bench, goto, name, point};
use std::fmt::Write as _;
use xtb_protocol::Uuid;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{
    DispatchBody, DispatchRequest, LinkLoss, Message, Request, TaskId, TaskKind, TaskSpec, Who,
};

/// A line each: when, in ms since the start; who; what; its encoding without the first part; its bytes.
const RECORDED: &str = include_str!("dialogues/wire_6.txt");
/// Of wire 5, whose questions (`DispatchRequest` 2) are read still and answered in their version.
const RECORDED_IN_5: &str = include_str!("dialogues/wire_5.txt");

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn unhex(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect()
}

/// The dispatcher's side, in bytes.
struct Rig {
    bench: Bench,
    began_ms: u64,
    format: Format,
    said: String,
    asks: usize,
}

impl Rig {
    fn new() -> Self {
        let bench = Bench::new(2);
        Self { began_ms: bench.now_ms, bench, format: Format::Postcard, said: String::new(), asks: 0 }
    }

    fn say<M: Message>(&mut self, who: &str, what: &str, message: &M) {
        let (at, schema) = (self.bench.now_ms - self.began_ms, encoding::<M>(self.format));
        let schema = schema.rsplit("xtb.").next().unwrap();
        let bytes = hex(&encode(message, self.format).unwrap());
        writeln!(self.said, "{at} {who} {what} {schema} {bytes}").unwrap();
    }

    /// Answers, and what was asked of robots but for heartbeats.
    fn tell(&mut self) {
        for (_, reply) in std::mem::take(&mut self.bench.answers) {
            self.say("dispatch", "answer", &reply);
        }
        for (robot, body) in self.bench.asks.split_off(0) {
            // Its own numbers, as ids and leases are random elsewhere.
            self.asks += 1;
            let id = Uuid::from_u128(self.asks as u128);
            self.say(robot.as_str(), "hears", &Request { id, lease: None, body });
        }
    }

    fn run_until(&mut self, at_ms: u64) {
        while self.bench.now_ms - self.began_ms < at_ms {
            self.bench.run_ms(10);
            self.tell();
        }
    }

    fn hear(&mut self, who: &str, schema: &str, bytes: &[u8]) {
        let encoding = format!("application/x-postcard;xtb.{schema}");
        let (request, format) = decode::<DispatchRequest>(&encoding, bytes).unwrap();
        self.format = format;
        self.bench.asked += 1;
        let Bench { now_ms, asked, dispatcher, travel_cost, .. } = &mut self.bench;
        dispatcher.request(*now_ms, *asked, &name(who), &request, travel_cost.as_ref());
        self.bench.effects();
        self.tell();
    }
}

#[test]
fn a_client_of_the_version_before_gets_the_answers_that_it_got_and_robots_are_asked_the_same() {
    assert_eq!(answered_as(RECORDED), Format::Postcard);
    assert_eq!(answered_as(RECORDED_IN_5), Format::Previous);
}

/// The format that the dispatcher answers in, as it did then.
fn answered_as(recorded: &str) -> Format {
    let (mut rig, mut expected, mut asked) = (Rig::new(), String::new(), 0);
    for line in recorded.lines() {
        let [at, who, what, schema, bytes] = line.split(' ').collect::<Vec<_>>().try_into().unwrap();
        rig.run_until(at.parse().unwrap());
        if what == "ask" {
            rig.hear(who, schema, &unhex(bytes));
            asked += 1;
        } else {
            writeln!(expected, "{line}").unwrap();
        }
    }
    assert_eq!(rig.said, expected);
    assert!(asked > 12 && expected.lines().count() > 20, "{asked} questions");
    rig.format
}

struct Recorder {
    rig: Rig,
    lines: String,
    asked: u128,
}

impl Recorder {
    fn keep(&mut self) {
        self.lines.push_str(&std::mem::take(&mut self.rig.said));
    }

    fn ask(&mut self, body: DispatchBody) {
        self.asked += 1;
        let request = DispatchRequest { id: Uuid::from_u128(0xD1A0 + self.asked), body };
        self.keep();
        self.rig.say("cli-7", "ask", &request);
        self.keep();
        let schema = encoding::<DispatchRequest>(Format::Postcard);
        let bytes = encode(&request, Format::Postcard).unwrap();
        self.rig.hear("cli-7", schema.rsplit("xtb.").next().unwrap(), &bytes);
        let until = self.rig.bench.now_ms - self.rig.began_ms + 100;
        self.rig.run_until(until);
    }

    fn wait_ms(&mut self, ms: u64) {
        let until = self.rig.bench.now_ms - self.rig.began_ms + ms;
        self.rig.run_until(until);
    }
}

/// Every question, with tasks of every kind, and what is refused.
#[test]
#[ignore = "writes the dialogue anew, into the file that DIALOGUE names"]
fn record_a_dialogue() {
    let path = std::env::var("DIALOGUE").expect("DIALOGUE=FILE");
    let mut it = Recorder { rig: Rig::new(), lines: String::new(), asked: 0 };
    let only = |number| vec![TaskId::new(number)];
    it.ask(DispatchBody::Status {});
    it.ask(DispatchBody::Submit { tasks: vec![goto(3.0, 1.0)] });
    let points = vec![point(1.0, 2.0), point(2.0, 2.0)];
    let route = TaskKind::Route { points: points.clone(), loops: 2, dwell_s: 0.5 };
    let patrol = TaskKind::Patrol { points, dwell_s: 0.0, for_s: Some(5.0) };
    let finish = TaskSpec { on_link_loss: LinkLoss::Finish, ..TaskSpec::new(route) };
    let of_one = TaskSpec { who: Who::Robot(name("xtb-2")), ..TaskSpec::new(patrol) };
    it.ask(DispatchBody::Submit {
        tasks: vec![finish, of_one, TaskSpec::new(TaskKind::Wander { for_s: 2.0 })],
    });
    let nobody = TaskSpec { who: Who::Robot(name("xtb-9")), ..goto(1.0, 1.0) };
    it.ask(DispatchBody::Submit { tasks: vec![nobody] });
    it.wait_ms(2000);
    it.ask(DispatchBody::Pause { tasks: only(2) });
    it.wait_ms(1000);
    it.ask(DispatchBody::Show { task: TaskId::new(2) });
    it.ask(DispatchBody::Resume { tasks: only(2) });
    it.wait_ms(2000);
    it.ask(DispatchBody::Cancel { tasks: only(3) });
    it.wait_ms(1000);
    it.ask(DispatchBody::Retry { tasks: only(3) });
    it.ask(DispatchBody::Show { task: TaskId::new(99) });
    it.ask(DispatchBody::Activate {});
    it.ask(DispatchBody::Adopt {});
    it.wait_ms(3000);
    it.ask(DispatchBody::Show { task: TaskId::new(1) });
    it.ask(DispatchBody::CancelAll {});
    it.wait_ms(2000);
    it.ask(DispatchBody::Status {});
    it.keep();
    std::fs::write(path, it.lines).unwrap();
}
