//! What happens to robots of the model, and what people do in it.

use super::weather::{Off, Weather, point};
use super::{STEP_MS, Ticket, World, person};
use xtb_protocol::Uuid;
use xtb_protocol::messages::{Body, DispatchBody, DispatchRequest, TaskId, TaskKind, TaskState};

impl World {
    pub(super) fn trouble(&mut self) {
        let per_step = STEP_MS as f64 / 1000.0;
        let Weather { partitions, reboots, takeovers, latches, obstacles, fleet_stops, .. } = self.weather;
        if self.chance(fleet_stops * per_step) {
            self.stop_fleet();
        }
        for i in 0..self.robots.len() {
            if self.chance(partitions * per_step) {
                let until_ms = self.now_ms + self.draw.whole(200, 20_000) as u64;
                let which = self.draw.whole(0, 3);
                if which != 0 {
                    self.deaf_until_ms[i] = self.deaf_until_ms[i].max(until_ms);
                }
                if which != 1 {
                    self.mute_until_ms[i] = self.mute_until_ms[i].max(until_ms);
                }
                self.outages[i].push((self.now_ms, until_ms));
            }
            if self.chance(reboots * per_step) {
                self.robots[i].reboot();
                self.robots[i].up = false;
                self.up_at_ms[i] = self.now_ms + self.draw.whole(100, 12_000) as u64;
                self.outages[i].push((self.now_ms, self.up_at_ms[i] + 1000));
            }
            if !self.robots[i].up && self.now_ms >= self.up_at_ms[i] {
                self.robots[i].up = true;
            }
            if self.chance(latches * per_step) {
                let now_ms = self.now_ms;
                self.robots[i].latch(now_ms);
            }
            if self.robots[i].latched.is_some() && self.draw.uniform(0.0, 1.0) < 0.3 * per_step {
                self.robots[i].latched = None;
            }
            if self.chance(obstacles * per_step) {
                let most_ms = if self.draw.whole(0, 9) == 0 { 90_000 } else { 8_000 };
                let until_ms = self.now_ms + self.draw.whole(200, most_ms) as u64;
                self.robots[i].obstruct(self.now_ms, until_ms);
            }
            if self.chance(takeovers * per_step) {
                self.takeover_until_ms[i] = self.now_ms + self.draw.whole(500, 8_000) as u64;
                let body = if self.draw.uniform(0.0, 1.0) < 0.3 {
                    Body::Stop {}
                } else {
                    Body::Acquire { take: true }
                };
                self.by_person(i, body);
            }
            if self.takeover_until_ms[i] > 0 {
                self.hold(i);
            }
        }
    }

    /// Somebody stops all: most robots hear it, and the dispatcher if it runs.
    fn stop_fleet(&mut self) {
        let now_ms = self.now_ms;
        for i in 0..self.robots.len() {
            if self.robots[i].up && self.draw.whole(0, 9) > 0 {
                self.robots[i].latch(now_ms);
            }
        }
        if let Some(dispatcher) = &mut self.dispatcher {
            dispatcher.fleet_stop(now_ms, Some(&person()));
        }
    }

    fn hold(&mut self, i: usize) {
        let robot = &mut self.robots[i];
        if robot.lease.holder() != Some(&person()) {
            self.takeover_until_ms[i] = 0;
        } else if self.now_ms >= self.takeover_until_ms[i] {
            self.takeover_until_ms[i] = 0;
            self.by_person(i, Body::Release {});
        } else {
            robot.lease.heard(xtb_control::Stamp::from_ms(self.now_ms));
        }
    }

    pub(super) fn people(&mut self) {
        if self.dispatcher.is_none() {
            return;
        }
        for i in 0..self.submissions.len() {
            let submission = &self.submissions[i];
            let again = submission.asked_ms.is_none_or(|asked_ms| self.now_ms > asked_ms + 2000);
            if submission.task.is_some() || self.now_ms < submission.at_ms || !again {
                continue;
            }
            let mut key = submission.key;
            if self.weather.off == Off::SameId {
                self.sent += 1;
                key = Uuid::from_u64_pair(55, self.sent);
            }
            let body = DispatchBody::Submit { tasks: vec![submission.spec.clone()] };
            self.submissions[i].asked_ms = Some(self.now_ms);
            self.ask_as(&DispatchRequest { id: key, body }, Ticket::Submission(i));
        }
        if self.weather.cancels && self.chance(0.001) {
            self.meddle();
        }
        if self.weather.extensions && self.chance(0.004) {
            self.extend();
        }
        if self.now_ms > self.chaos_until_ms && self.now_ms.is_multiple_of(5000) {
            let resting = |state| matches!(state, TaskState::Paused | TaskState::Held);
            let tasks = self.dispatcher.iter().flat_map(|d| d.store().open());
            let tasks: Vec<TaskId> = tasks.filter(|task| resting(task.state)).map(|task| task.id).collect();
            if !tasks.is_empty() {
                self.ask(DispatchBody::Resume { tasks });
            }
            self.ask(DispatchBody::Activate {});
            self.ask(DispatchBody::Adopt {});
        }
    }

    /// Somebody wants a route to go on.
    fn extend(&mut self) {
        let routes = self.dispatcher.iter().flat_map(|dispatcher| dispatcher.store().open());
        let routes = routes.filter(|task| matches!(task.spec.kind, TaskKind::Route { .. }));
        let routes: Vec<_> = routes.map(|task| (task.id, task.spec.kind.points().len())).collect();
        if routes.is_empty() {
            return;
        }
        let (task, has) = routes[self.draw.whole(0, routes.len() as i64 - 1) as usize];
        let points: Vec<_> = (0..self.draw.whole(1, 3)).map(|_| point(&mut self.draw)).collect();
        let ticket = Ticket::Extend(task, has + points.len());
        self.sent += 1;
        let body = DispatchBody::Extend { task, after: has as u32, points };
        self.ask_as(&DispatchRequest { id: Uuid::from_u64_pair(77, self.sent), body }, ticket);
    }

    /// Somebody changes their mind about a task.
    fn meddle(&mut self) {
        let all: Vec<TaskId> =
            self.dispatcher.iter().flat_map(|d| d.store().tasks().map(|task| task.id)).collect();
        if all.is_empty() {
            return;
        }
        let task = all[self.draw.whole(0, all.len() as i64 - 1) as usize];
        let tasks = vec![task];
        let (body, ticket) = match self.draw.whole(0, 6) {
            5 => (DispatchBody::Activate {}, Ticket::Other),
            6 => (DispatchBody::Adopt {}, Ticket::Other),
            0 | 1 => (DispatchBody::Cancel { tasks }, Ticket::Cancel(task)),
            2 => (DispatchBody::Pause { tasks }, Ticket::Other),
            3 => (DispatchBody::Resume { tasks }, Ticket::Other),
            _ => {
                self.confirmed.remove(&task);
                (DispatchBody::Retry { tasks }, Ticket::Retry(task))
            }
        };
        self.sent += 1;
        self.ask_as(&DispatchRequest { id: Uuid::from_u64_pair(77, self.sent), body }, ticket);
    }
}
