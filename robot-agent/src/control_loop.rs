//! The control loop: one thread, absolute deadlines, a turn every 5 ms, and one more in between for a setpoint
//! or a stop that has come.
//!
//! It owns the robot and its lines. It never waits for Zenoh or a disk; what crosses to them does so
//! through the bounded queues of [`mailbox`](crate::mailbox).

use crate::clock::Clock;
use crate::fast_path::{ESTOPS, EstopCall};
use crate::hardware::Hardware;
use crate::hardware::lines::Lines;
use crate::mailbox::{LineNote, LoopEnds, NAV_INPUTS, NavInput, Response, Snapshot, Waiting};
use crate::planner_worker::PlannerWorker;
use crate::recorder::Recorder;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use tokio::sync::mpsc;
use xtb_control::Stamp;
use xtb_protocol::messages::{Estopped, Latch};
use xtb_robot::Robot;
use xtb_robot::robot::TURN_NS;

/// Requests answered in one turn at most, so that a flood cannot stretch it.
const REQUESTS_A_TURN: usize = 8;
/// State goes out at 20 Hz.
const SNAPSHOT_NS: u64 = 50_000_000;
/// After this delay the missed turns are given up rather than made up for.
const GIVE_UP_NS: u64 = 100_000_000;

/// Starts the loop on a thread of its own. It runs until `stop`, then sends a neutral frame.
///
/// # Errors
/// The system cannot start a thread.
pub(crate) fn start(
    robot: Robot,
    hardware: Box<dyn Hardware>,
    clock: Clock,
    ends: LoopEnds,
    recorder: Option<Recorder>,
    stop: Arc<AtomicBool>,
) -> io::Result<JoinHandle<()>> {
    let name = format!("control-{}", robot.agent().identity().robot);
    let planning = PlannerWorker::start(&robot.agent().identity().robot)?;
    let control = ControlLoop { robot, lines: Lines::new(hardware), ends, recorder, planning };
    std::thread::Builder::new().name(name).spawn(move || control.run(&clock, &stop))
}

struct ControlLoop {
    robot: Robot,
    lines: Lines,
    ends: LoopEnds,
    recorder: Option<Recorder>,
    planning: PlannerWorker,
}

impl ControlLoop {
    fn run(mut self, clock: &Clock, stop: &AtomicBool) {
        let mut next = clock.now();
        let mut next_snapshot = next;
        self.ends.wake.wakes_me();
        while !stop.load(Ordering::Relaxed) {
            next = next.plus_ns(TURN_NS);
            // One at most, so that no flood can make the loop turn all the time.
            if clock.wait_until_called(next, &self.ends.wake) {
                self.turn(clock.now(), &mut next_snapshot);
                clock.wait_until(next);
            }
            let now = clock.now();
            self.robot.turn_was_late(now.ns().saturating_sub(next.ns()));
            if now.ns() > next.ns() + GIVE_UP_NS {
                next = now;
            }
            self.turn(now, &mut next_snapshot);
        }
        self.lines.stand(&mut self.robot, clock.now(), &mut logging(&self.ends.notes));
        self.record();
    }

    fn turn(&mut self, now: Stamp, next_snapshot: &mut Stamp) {
        // What calls from here on may come too late for this turn.
        self.ends.wake.take_call();
        self.lines.read(&mut self.robot, now, &mut logging(&self.ends.notes));
        self.take_orders(now);
        self.take_tidings(now);
        self.lines.write(&mut self.robot, now, &mut logging(&self.ends.notes));
        self.plan(now);
        self.record();
        self.report(now, next_snapshot);
    }

    /// The turn's steps, for the recorder.
    fn record(&mut self) {
        let Some(recorder) = &self.recorder else { return };
        while let Some(step) = self.robot.take_step() {
            recorder.push(step);
        }
        self.robot.set_recording_failed(recorder.failed());
    }

    /// Stops first, then requests in their order, then the setpoint.
    fn take_orders(&mut self, now: Stamp) {
        self.take_estops(now);
        let ends = &mut self.ends;
        ends.fast_path.tell(self.robot.agent_mut());
        self.robot.agent_mut().set_link(ends.link_up.load(Ordering::Relaxed));
        self.robot.agent_mut().stop(now, ends.arrivals.latest_stop());
        for _ in 0..REQUESTS_A_TURN {
            // Without room for its reply a request stays where it is: to drop its question here
            // could wait for Zenoh.
            let Ok(room) = ends.replies.try_reserve() else { break };
            let Ok(job) = ends.requests.try_recv() else { break };
            let reply = self.robot.request(now, job.arrival, &job.client, &job.request);
            room.send((job.answer, Response::Reply(reply)));
        }
        if let Some(Waiting { at, arrival, client, setpoint }) = ends.setpoint.take() {
            self.robot.agent_mut().setpoint(now, at, arrival, &client, &setpoint);
        }
        ends.fast_path.follow(self.robot.agent());
    }

    /// What the second level has to know: other robots, poses, paths, maps.
    fn take_tidings(&mut self, now: Stamp) {
        let alone = self.robot.agent().goes_alone(now);
        self.ends.listens.send_if_modified(|listens| std::mem::replace(listens, alone) != alone);
        for (at, said) in self.ends.neighbours.take() {
            self.robot.agent_mut().neighbour(at, said);
        }
        for _ in 0..NAV_INPUTS {
            let Ok(input) = self.ends.nav_inputs.try_recv() else { return };
            let agent = self.robot.agent_mut();
            match input {
                NavInput::Fix(at, fix) => agent.fix(now, at, &fix),
                NavInput::Route(route) => agent.route(now, &route),
                NavInput::Floor(floor) => agent.set_floor(floor),
                NavInput::FleetMap(hash) => agent.set_fleet_map(hash),
            }
        }
    }

    /// Plans that are done, and one to make.
    fn plan(&mut self, now: Stamp) {
        while let Some(done) = self.planning.done() {
            self.robot.agent_mut().planned(now, done);
        }
        if let Some(job) = self.robot.agent_mut().take_plan_job() {
            self.planning.ask(job);
        }
    }

    /// All that have arrived; who asked is told that the robot stands.
    fn take_estops(&mut self, now: Stamp) {
        let ends = &self.ends;
        for _ in 0..ESTOPS {
            let Some(mut call) = ends.fast_path.next_estop() else { return };
            self.robot.agent_mut().estop(now, call.arrival, &call.by, call.id);
            let Some(answer) = call.answer.take() else { continue };
            // As with requests: without room for its answer the call stays where it is, for to drop its
            // question here could wait for Zenoh. The robot stands already.
            let Ok(room) = ends.replies.try_reserve() else {
                return ends.fast_path.put_back(EstopCall { answer: Some(answer), ..call });
            };
            let agent = self.robot.agent();
            let robot = agent.identity().robot.clone();
            room.send((
                answer,
                Response::Estopped(Estopped { robot, latched: agent.is_latched(Latch::Estop) }),
            ));
        }
    }

    /// The state, 20 times a second and before each event (who hears of a goal's end and asks for
    /// the state must not get an older one), and the events.
    fn report(&mut self, now: Stamp, next_snapshot: &mut Stamp) {
        let due = now >= *next_snapshot;
        if due {
            // In step with the clock, not with the turn: else 20 Hz would be 19.
            *next_snapshot = next_snapshot.plus_ns(SNAPSHOT_NS).max(now);
        }
        if due || self.robot.agent().has_events() {
            let mut rejected = self.ends.counters.rejected_so_far();
            rejected.record_dropped = self.recorder.as_ref().map_or(0, Recorder::dropped);
            let state = self.robot.state(now, rejected);
            let sensors = self.robot.sensors(now);
            self.ends.snapshot.send_replace(Some(Snapshot { state, sensors }));
        }
        while let Some(event) = self.robot.agent_mut().next_event() {
            if self.ends.events.try_send(event).is_err() {
                self.ends.counters.events_dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

/// Tells the log when a line breaks and when it works again. A full queue is no reason to wait: the
/// state shows what matters.
fn logging(notes: &mpsc::Sender<LineNote>) -> impl FnMut(&'static str, Option<String>) + '_ {
    |line, error| {
        let _ = notes.try_send(LineNote { line, error });
    }
}
