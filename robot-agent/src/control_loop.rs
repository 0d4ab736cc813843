//! The control loop: absolute deadlines, a turn every 5 ms, and on real lines one more in between for a setpoint
//! or a stop that has come; on a thread of its own, or with others of simulated robots
//! ([`loop_pool`](crate::loop_pool)).
//!
//! It owns the robot and its lines. It never waits for Zenoh or a disk; what crosses to them does so
//! through the bounded queues of [`mailbox`](crate::mailbox).

use crate::clock::Clock;
use crate::fast_path::{ESTOPS, EstopCall, Response};
use crate::hardware::Hardware;
use crate::hardware::lines::Lines;
use crate::mailbox::{LineNote, LoopEnds, NAV_INPUTS, NavInput, ParamJob, Waiting};
use crate::planner_worker::PlannerWorker;
use crate::recorder::Recorder;
use crate::snapshot::Snapshot;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use xtb_control::Stamp;
use xtb_protocol::messages::{Estopped, Latch, ParamBody, ParamOutcome};
use xtb_robot::Robot;
use xtb_robot::robot::TURN_NS;

/// Requests answered in one turn at most, so that a flood cannot stretch it.
const REQUESTS_A_TURN: usize = 8;
/// State goes out at 20 Hz.
const SNAPSHOT_NS: u64 = 50_000_000;
/// After this delay the missed turns are given up rather than made up for.
const GIVE_UP_NS: u64 = 100_000_000;

/// A robot's loop.
pub(crate) struct ControlLoop {
    robot: Robot,
    lines: Lines,
    ends: LoopEnds,
    recorder: Option<Recorder>,
    planning: PlannerWorker,
    clock: Clock,
    stop: Arc<AtomicBool>,
    /// The present turn.
    next: Stamp,
    next_snapshot: Stamp,
}

impl ControlLoop {
    /// Of a robot on its hardware. It turns until `stop`, then sends a neutral frame.
    pub(crate) fn new(
        (robot, hardware, clock): (Robot, Box<dyn Hardware>, Clock),
        ends: LoopEnds,
        recorder: Option<Recorder>,
        stop: Arc<AtomicBool>,
        planning: PlannerWorker,
    ) -> Self {
        let lines = Lines::new(hardware);
        let (next, next_snapshot) = (Stamp::ZERO, Stamp::ZERO);
        Self { robot, lines, ends, recorder, planning, clock, stop, next, next_snapshot }
    }

    /// Its first turn is the next one. To be told on the thread on which it turns, unless the clock is simulated.
    pub(crate) fn begin(&mut self) {
        self.next = self.clock.now();
        self.next_snapshot = self.next;
        self.clock.rest_until(self.next_turn());
    }

    /// Turns on this thread to its end.
    pub(crate) fn run(mut self) {
        self.ends.wake.wakes_me();
        self.begin();
        while self.turn() {}
    }

    /// When its next turn is due.
    pub(crate) fn next_turn(&self) -> Stamp {
        self.next.plus_ns(TURN_NS)
    }

    /// Waits for the next turn and takes it. False = it was told to end, and the truck has been told to stand.
    pub(crate) fn turn(&mut self) -> bool {
        if self.stop.load(Ordering::Relaxed) {
            self.lines.stand(&mut self.robot, self.clock.now(), &mut logging(&self.ends.notes));
            self.record();
            return false;
        }
        self.next = self.next_turn();
        // One at most, so that no flood can make the loop turn all the time.
        if self.clock.wait_until_called(self.next, &self.ends.wake) {
            self.act(self.clock.now());
            self.clock.wait_until(self.next);
        }
        let now = self.clock.now();
        self.robot.turn_was_late(now.ns().saturating_sub(self.next.ns()));
        if now.ns() > self.next.ns() + GIVE_UP_NS {
            self.next = now;
        }
        self.act(now);
        self.clock.rest_until(self.next_turn());
        true
    }

    /// Everything that a turn does.
    fn act(&mut self, now: Stamp) {
        // What calls from here on may come too late for this turn.
        self.ends.wake.take_call();
        self.lines.read(&mut self.robot, now, &mut logging(&self.ends.notes));
        self.take_orders(now);
        self.take_nav_inputs(now);
        self.lines.write(&mut self.robot, now, &mut logging(&self.ends.notes));
        self.plan(now);
        self.record();
        self.report(now);
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
        while let Ok(values) = ends.saved.try_recv() {
            self.robot.agent_mut().params_saved(&values);
        }
        // One a turn is plenty.
        if let Ok(room) = ends.replies.try_reserve()
            && let Ok(ParamJob { client, request, answer }) = ends.params.try_recv()
        {
            let reply = self.robot.param(now, &client, &request);
            let saves = matches!((&request.body, &reply.result), (ParamBody::Save {}, ParamOutcome::Ok(_)));
            let response = match saves {
                true => Response::Save(reply, self.robot.agent().params_to_save()),
                false => Response::Param(reply),
            };
            room.send((answer, response));
        }
        if let Some(Waiting { at, arrival, client, setpoint }) = ends.setpoint.take() {
            self.robot.agent_mut().setpoint(now, at, arrival, &client, &setpoint);
        }
        ends.fast_path.follow(self.robot.agent());
    }

    /// What the second level has to know: other robots, poses, paths, maps.
    fn take_nav_inputs(&mut self, now: Stamp) {
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
    fn report(&mut self, now: Stamp) {
        let due = now >= self.next_snapshot;
        if due {
            // In step with the clock, not with the turn: else 20 Hz would be 19.
            self.next_snapshot = self.next_snapshot.plus_ns(SNAPSHOT_NS).max(now);
        }
        if due || self.robot.agent().has_events() {
            let mut rejected = self.ends.counters.rejected_so_far();
            rejected.record_dropped = self.recorder.as_ref().map_or(0, Recorder::dropped);
            let state = self.robot.state(now, rejected);
            let (sensors, motion) = (self.robot.sensors(now), self.robot.motion(now));
            self.ends.snapshot.send_replace(Some(Snapshot { state, sensors, motion }));
        }
        while let Some(change) = self.robot.agent_mut().next_param_change() {
            if let Some(recorder) = &self.recorder {
                recorder.push_param(now, change);
            }
        }
        while let Some(event) = self.robot.agent_mut().next_event() {
            if let Some(recorder) = &self.recorder {
                recorder.push_event(now, &event);
            }
            if self.ends.events.try_send(event).is_err() {
                self.ends.counters.events_dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

/// Tells the log when a line breaks and when it works again. A full queue is no reason to wait: the
/// state shows what matters.
fn logging(notes: &tokio::sync::mpsc::Sender<LineNote>) -> impl FnMut(&'static str, Option<String>) + '_ {
    |line, error| {
        let _ = notes.try_send(LineNote { line, error });
    }
}
