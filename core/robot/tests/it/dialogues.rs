//! What a client and a robot of the version of the wire before said to each other: today's robot gives the same
//! answers and tells the same events, as bytes. `DIALOGUE=FILE cargo test -p xtb-robot --test it dialogues -- --ignored`
//! records one: to be done before the wire changes.

use crate::bench::*;
use std::fmt::Write as _;
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::messages::{
    Assignment, Body, Done, Estop, Event, Latch, Lease, LinkLoss, Message, Outcome, Reply, Request, Setpoint,
    TaskAction, TaskId,
};
use xtb_protocol::{Name, Uuid};

/// A line each: when, in ms; who; what; its encoding without the first part; its bytes.
const RECORDED: &str = include_str!("dialogues/wire_6.txt");
const OTHER: &str = "web-alice-1";

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn unhex(text: &str) -> Vec<u8> {
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap()).collect()
}

/// The robot's side, in bytes.
struct Robot {
    bench: Bench,
    /// What the robot has said, as lines.
    said: String,
}

impl Robot {
    fn new() -> Self {
        let mut bench = Bench::new();
        bench.retains = false; // what the client says is what is recorded
        let mut robot = Self { bench, said: String::new() };
        robot.tell_events();
        robot
    }

    fn say<M: Message>(&mut self, who: &str, what: &str, message: &M) {
        let (at, schema) = (self.bench.now.ms(), encoding::<M>(Format::Postcard));
        let schema = schema.rsplit("xtb.").next().unwrap();
        let bytes = hex(&encode(message, Format::Postcard).unwrap());
        writeln!(self.said, "{at} {who} {what} {schema} {bytes}").unwrap();
    }

    fn tell_events(&mut self) {
        while let Some(event) = self.bench.robot.agent_mut().next_event() {
            self.say::<Event>("xtb-1", "event", &event);
        }
    }

    /// Turns until then, in ms since the start.
    fn run_until(&mut self, at_ms: u64) {
        while self.bench.now.ms() < at_ms {
            self.bench.run_ms(5);
            self.tell_events();
        }
    }

    /// What came in, as it was written; the answer, if there is one, is said.
    fn hear(&mut self, who: &str, what: &str, schema: &str, bytes: &[u8]) {
        let encoding = format!("application/x-postcard;xtb.{schema}");
        self.bench.arrivals += 1;
        let (now, arrival, by) = (self.bench.now, self.bench.arrivals, Name::new(who).unwrap());
        let agent = self.bench.robot.agent_mut();
        match what {
            "put" => agent.setpoint(now, now, arrival, &by, &decode::<Setpoint>(&encoding, bytes).unwrap().0),
            "estop" => agent.estop(now, arrival, &by, decode::<Estop>(&encoding, bytes).unwrap().0.id),
            _ => {
                let request = decode::<Request>(&encoding, bytes).unwrap().0;
                // As `robot-agent`'s fast path: a heartbeat need not wait for a turn.
                if let (Body::Retain {}, Some(lease)) = (&request.body, request.lease) {
                    agent.heard(now, lease);
                }
                let reply = self.bench.robot.request(now, arrival, &by, &request);
                self.say("xtb-1", "answer", &reply);
            }
        }
        self.tell_events();
    }
}

#[test]
fn a_client_of_the_version_before_gets_the_answers_and_events_that_it_got() {
    let (mut robot, mut asked) = (Robot::new(), 0);
    let mut expected = String::new();
    for line in RECORDED.lines() {
        let [at, who, what, schema, bytes] = line.split(' ').collect::<Vec<_>>().try_into().unwrap();
        if matches!(what, "event" | "answer") {
            writeln!(expected, "{line}").unwrap();
            continue;
        }
        robot.run_until(at.parse().unwrap());
        robot.hear(who, what, schema, &unhex(bytes));
        asked += 1;
    }
    assert_eq!(robot.said, expected);
    assert!(asked > 80 && expected.lines().count() > 100, "{asked} messages");
}

/// A client and its robot, with everything said by either.
struct Recorder {
    robot: Robot,
    lines: String,
    asked: u128,
    seq: u64,
    lease: Option<Lease>,
}

impl Recorder {
    /// Hands a message to the robot, and keeps it before what the robot says to it.
    fn tell<M: Message>(&mut self, who: &str, what: &str, message: &M) {
        self.keep();
        self.robot.say(who, what, message);
        self.keep();
        let schema = encoding::<M>(Format::Postcard);
        let bytes = encode(message, Format::Postcard).unwrap();
        self.robot.hear(who, what, schema.rsplit("xtb.").next().unwrap(), &bytes);
    }

    fn keep(&mut self) {
        self.lines.push_str(&std::mem::take(&mut self.robot.said));
    }

    fn ask_as(&mut self, who: &str, lease: Option<Lease>, body: Body) -> Option<Reply> {
        self.asked += 1;
        let request = Request { id: Uuid::from_u128(0xD1A0 + self.asked), lease, body };
        self.tell(who, "ask", &request);
        let answer = self.robot.said.lines().find(|line| line.contains(" answer ")).unwrap();
        let bytes = unhex(answer.rsplit(' ').next().unwrap());
        Some(decode::<Reply>(&encoding::<Reply>(Format::Postcard), &bytes).unwrap().0)
    }

    fn ask(&mut self, body: Body) {
        let reply = self.ask_as(CLIENT, self.lease, body);
        if let Some(Reply { result: Outcome::Ok(Done { lease: Some(lease), .. }), .. }) = reply {
            self.lease = Some(lease);
        }
    }

    /// So long, with a heartbeat each 100 ms.
    fn hold_ms(&mut self, ms: u64) {
        for _ in 0..ms / 100 {
            let until = self.robot.bench.now.ms() + 100;
            self.robot.run_until(until);
            self.ask(Body::Retain {});
        }
    }

    fn drive(&mut self, rpm: f64, echo: bool) {
        self.seq += 1;
        let echo_tick_ms = echo.then(|| self.robot.bench.now.ms());
        let setpoint = Setpoint { lease: self.lease, seq: self.seq, echo_tick_ms, rpm, steering: 0.25 };
        self.tell(CLIENT, "put", &setpoint);
    }
}

/// Goal, driving by hand, stops, reset, pose, a task, and what is refused.
#[test]
#[ignore = "writes the dialogue anew, into the file that DIALOGUE names"]
fn record() {
    let path = std::env::var("DIALOGUE").expect("DIALOGUE=FILE");
    let mut it = Recorder { robot: Robot::new(), lines: String::new(), asked: 0, seq: 0, lease: None };
    let assign = |assign_seq, leg, errand| Body::Assign {
        assignment: Assignment { ledger: 77, task: TaskId::new(1), assign_seq, leg },
        errand,
        on_link_loss: LinkLoss::Finish,
        finish_s: 60.0,
    };
    let goto = |y_m| TaskAction::Goto { x_m: 0.0, y_m, yaw_rad: None, via: None };
    it.ask(ahead(5.0)); // without a lease
    it.ask(Body::Acquire { take: false });
    it.ask_as(OTHER, None, Body::Acquire { take: false });
    it.ask(ahead(5.0));
    it.hold_ms(1000);
    it.ask(Body::SetPose { x_m: 0.0, y_m: 2.0, yaw_rad: 1.5 }); // busy
    it.ask(Body::Cancel { goal: Uuid::from_u128(1) });
    it.ask(ahead(4.0)); // replaces
    it.hold_ms(500);
    it.ask_as(OTHER, None, Body::Stop {});
    it.hold_ms(500);
    it.ask(Body::SetPose { x_m: 0.0, y_m: 2.0, yaw_rad: 1.5 });
    for rpm in [0.0, 10.0, 13.0, 13.0] {
        it.drive(rpm, true);
        it.hold_ms(100);
    }
    it.drive(13.0, false); // stale
    it.hold_ms(500); // expires
    it.ask(Body::Wander { for_s: Some(1.0), on_link_loss: LinkLoss::Halt, finish_s: 300.0 });
    it.hold_ms(1500);
    it.ask(ahead(8.0));
    it.hold_ms(300);
    it.tell(OTHER, "estop", &Estop { id: Uuid::from_u128(0xE5) });
    it.hold_ms(200);
    it.ask(ahead(8.0)); // latched
    it.ask(Body::Reset { latch: Some(Latch::Runaway) });
    it.ask(Body::Reset { latch: None });
    it.ask(assign(5, 0, goto(5.0)));
    it.hold_ms(400);
    it.ask(assign(5, 0, goto(5.0))); // again
    it.ask(assign(4, 0, goto(5.0))); // of before
    it.ask(assign(6, 0, TaskAction::Wander { for_s: 20.0 }));
    it.hold_ms(400);
    it.ask(Body::Withdraw { ledger: 77, assign_seq: 6 });
    it.hold_ms(300);
    it.ask(ahead(9.0));
    it.hold_ms(200);
    let until = it.robot.bench.now.ms() + 1500;
    it.robot.run_until(until); // silence: the goal ends, the lease is free
    it.ask_as(OTHER, None, Body::Acquire { take: true });
    it.ask(Body::Retain {}); // lost
    it.ask(Body::Release {});
    it.keep();
    std::fs::write(path, it.lines).unwrap();
}
