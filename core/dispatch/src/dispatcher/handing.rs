//! What is decided about tasks: what their robots show, what the clock says, and who gets which.

use super::Dispatcher;
use super::suspending::gate;
use crate::assign::{self, Candidate, Demand};
use crate::drive::{self, Eye, News};
use crate::ground::Ground;
use crate::record::{Change, Ending, Entry, Record};
use crate::robot::Robot;
use crate::soon;
use crate::task::Task;
use crate::writer::Then;
use std::collections::BTreeSet;
use xtb_protocol::Name;
use xtb_protocol::messages::{Assignment, GoalStatus, TaskId, TaskKind, TaskState};

/// How much farther a robot counts whose battery is getting low, in m.
const TIRED_M: f64 = 20.0;
/// And one on which the task has failed before.
const FAILED_M: f64 = 50.0;
/// So many busy robots are looked at, at most: those that are soonest free.
const SOON_MOST: usize = 16;

impl Dispatcher {
    /// What became of a task is proposed to the ledger.
    pub(super) fn record(&mut self, now_ms: u64, id: TaskId, news: News) {
        let Some(task) = self.book.task(id) else { return };
        let Some(assigned) = task.assigned.as_ref().or(task.last.as_ref()) else { return };
        let (seq, name) = (assigned.seq, assigned.robot.clone());
        let Some(ledger) = self.book.ledger() else { return };
        let gate = gate(self.unwritten_stop.as_ref(), self.map.as_ref(), &self.book);
        let eye =
            Eye { now_ms, ledger, me: &self.identity.me, settings: &self.settings, gate, map_due: false };
        let news = match gate.cause(task) {
            Some(cause) if news == News::Renew => News::suspended(&cause),
            _ => news,
        };
        if let Some(robot) = self.robots.get_mut(&name)
            && drive::has_to_confirm(eye, task, robot, &news)
        {
            robot.leaving = Some((seq, news));
            return;
        }
        let records = match news {
            News::Became(change, why) => vec![Record::Became { task: id, change, why }],
            News::Renew => {
                let seq = self.book.next_seq() + self.writer.new_seqs();
                vec![Record::Assigned { task: id, robot: name, seq }]
            }
            News::Reached => {
                let leg = task.legs_done;
                let mut records = vec![Record::Reached { task: id, seq, leg }];
                if task.is_all(leg + 1, now_ms) {
                    let change = Change::Ended { ending: Ending::Done };
                    records.push(Record::Became { task: id, change, why: None });
                }
                records
            }
        };
        self.writer.push(now_ms, records, Then::Nothing);
    }

    /// Deadlines, and patrols whose time is over.
    pub(super) fn watch_clock(&mut self, now_ms: u64) {
        let mut over = Vec::new();
        for task in self.book.open().filter(|task| !self.writer.has_task(task.id)) {
            if task.state == TaskState::Cancelling {
                continue;
            }
            let late = task.spec.deadline_ms.is_some_and(|deadline_ms| now_ms >= deadline_ms);
            let lasted = matches!(task.spec.kind, TaskKind::Patrol { for_s: Some(_), .. })
                && task.began_ms.is_some()
                && task.is_all(task.legs_done, now_ms);
            let (ending, why) = match (late, lasted) {
                (_, true) => (Ending::Done, None),
                (true, _) => (Ending::Failed, Some("its deadline is over".to_owned())),
                _ => continue,
            };
            over.push((task.id, end(task, ending), why));
        }
        for (task, change, why) in over {
            self.writer.push(now_ms, vec![Record::Became { task, change, why }], Then::Nothing);
        }
    }

    /// What robots show of their tasks, and of those that they had before.
    pub(super) fn watch_robots(&mut self, now_ms: u64) {
        let Some(ledger) = self.book.ledger() else { return };
        let eye = self.eye(now_ms, ledger);
        let mut news = Vec::new();
        for (name, id) in self.book.busy() {
            let (Some(task), Some(robot)) = (self.book.task(id), self.robots.get(name)) else { continue };
            if !self.writer.has_task(id)
                && let Some(what) = drive::look(eye, task, robot)
            {
                news.push((id, what));
            }
        }
        let queued = self.book.open().filter(|task| task.state == TaskState::Queued && task.last.is_some());
        for task in queued.filter(|task| !self.writer.has_task(task.id)) {
            if self.was_reached(now_ms, ledger, task) {
                news.push((task.id, News::Reached));
            }
        }
        for (id, what) in news {
            self.record(now_ms, id, what);
        }
    }

    /// A robot that had the task is back, and shows that it had done the drive.
    fn was_reached(&self, now_ms: u64, ledger: u64, task: &Task) -> bool {
        let Some(last) = &task.last else { return false };
        let Some(robot) = self.robots.get(&last.robot) else { return false };
        let leg = task.legs_done;
        let goal = Assignment { ledger, task: task.id, assign_seq: last.seq, leg }.goal_id();
        let status = robot.seen.as_ref().and_then(|seen| seen.goal(goal)).map(|goal| goal.status);
        robot.is_there(now_ms, &self.settings) && status == Some(GoalStatus::Reached)
    }

    /// Gives waiting tasks to free robots. One that a robot which is nearly done will get to sooner is
    /// saved for that one, for a while; then, any that is free and left over gets it.
    pub(super) fn hand_out(&mut self, now_ms: u64, ground: &dyn Ground) {
        self.saved.clear();
        if self.gate().stop.is_some() {
            return;
        }
        let free = self.robots.values().filter(|robot| self.is_free(now_ms, robot));
        let (mut robots, mut candidates): (Vec<&Robot>, Vec<Candidate>) =
            free.filter_map(|robot| Some((robot, candidate(robot)?))).unzip();
        let waiting: Vec<&Task> = self.book.open().filter(|task| self.waits(now_ms, task)).collect();
        if robots.is_empty() || waiting.is_empty() {
            return;
        }
        ground.begin_round();
        let free = robots.len();
        for (robot, candidate) in self.soon_free(now_ms, ground) {
            robots.push(robot);
            candidates.push(candidate);
        }
        let demands: Vec<Demand> = waiting.iter().map(|task| self.demand(now_ms, task)).collect();
        let among = |tasks: &[usize], who: &[usize]| -> Vec<(usize, usize)> {
            let some_demands: Vec<Demand> = tasks.iter().map(|&task| demands[task]).collect();
            let some_candidates: Vec<Candidate> = who.iter().map(|&robot| candidates[robot]).collect();
            let fits = |task: usize, robot: usize| fits(waiting[tasks[task]], robots[who[robot]]);
            let pairs = assign::assign(&some_demands, &some_candidates, ground, &fits);
            pairs.into_iter().map(|(task, robot)| (tasks[task], who[robot])).collect()
        };
        let all: (Vec<usize>, Vec<usize>) = ((0..waiting.len()).collect(), (0..robots.len()).collect());
        let pairs = among(&all.0, &all.1);
        let (mut chosen, saved): (Vec<_>, Vec<_>) = pairs.into_iter().partition(|(_, robot)| *robot < free);
        let (late, saved): (Vec<_>, Vec<_>) =
            saved.into_iter().partition(|(task, _)| self.waited_long(now_ms, waiting[*task]));
        if !late.is_empty() {
            let late: Vec<usize> = late.into_iter().map(|(task, _)| task).collect();
            let taken: BTreeSet<usize> = chosen.iter().map(|(_, robot)| *robot).collect();
            let left: Vec<usize> = (0..free).filter(|robot| !taken.contains(robot)).collect();
            chosen.extend(among(&late, &left));
        }
        let named = |(task, robot): (usize, usize)| (waiting[task].id, robots[robot].name.clone());
        let chosen: Vec<(TaskId, Name)> = chosen.into_iter().map(named).collect();
        self.saved = saved.into_iter().map(named).collect();
        for (task, robot) in chosen {
            let seq = self.book.next_seq() + self.writer.new_seqs();
            self.writer.push(now_ms, vec![Record::Assigned { task, robot, seq }], Then::Nothing);
        }
    }

    /// Whether a task is not to be saved for anybody any more.
    fn waited_long(&self, now_ms: u64, task: &Task) -> bool {
        now_ms.saturating_sub(task.waiting_since_ms.max(task.not_before_ms)) >= self.settings.save_ms
    }

    /// Robots that will be free soon, those first that are soonest.
    fn soon_free(&self, now_ms: u64, ground: &dyn Ground) -> Vec<(&Robot, Candidate)> {
        let busy = self.book.busy().filter_map(|(name, id)| {
            let (robot, task) = (self.robots.get(name)?, self.book.task(id)?);
            let seen = robot.seen.as_ref()?;
            let well = robot.is_there(now_ms, &self.settings)
                && seen.unfit.is_none()
                && robot.taken_by(&self.identity.me).is_none()
                && robot.blocked_ms.is_none();
            let Candidate { handicap_m, .. } = candidate(robot)?;
            let soon = soon::soon(task, seen.pose, ground).filter(|_| well)?;
            Some((robot, Candidate { handicap_m: soon.handicap_m + handicap_m, ..soon }))
        });
        let mut busy: Vec<_> = busy.collect();
        busy.sort_by(|(_, a), (_, b)| a.handicap_m.total_cmp(&b.handicap_m));
        busy.truncate(SOON_MOST);
        busy
    }

    fn is_free(&self, now_ms: u64, robot: &Robot) -> bool {
        self.book.on(&robot.name).is_none()
            && !self.writer.has_robot(&robot.name)
            && robot.flight.is_none()
            && now_ms >= robot.ask_at_ms
            && robot.fitness(now_ms, &self.settings, &self.identity.me).is_ok()
    }

    /// Whether a task may be given to a robot now. After a start, one that was on a robot before waits
    /// for that robot to be heard: it may come back with the drive done.
    fn waits(&self, now_ms: u64, task: &Task) -> bool {
        let heard = now_ms >= self.started_ms + self.settings.start_ms
            || task.last.as_ref().is_none_or(|last| {
                self.robots.get(&last.robot).is_some_and(|robot| robot.is_there(now_ms, &self.settings))
            });
        task.state == TaskState::Queued
            && now_ms >= task.not_before_ms
            && heard
            && !self.is_map_due(now_ms)
            && self.gate().cause(task).is_none()
            && !self.writer.has_task(task.id)
    }

    fn demand(&self, now_ms: u64, task: &Task) -> Demand {
        let waited_ms = now_ms.saturating_sub(task.waiting_since_ms);
        let level = u64::from(task.spec.priority) + waited_ms / self.settings.age_ms.max(1);
        Demand { id: task.id, level, first: task.point(task.legs_done).copied() }
    }

    /// What a durable entry means for what is known of the robots.
    pub(super) fn follow_up(&mut self, entry: &Entry, task: TaskId) {
        let Some(task) = self.book.task(task) else { return };
        let last = task.last.as_ref().map(|last| last.robot.clone());
        match &entry.record {
            Record::Became { change: Change::Queued { not_before_ms, failed }, why, .. } => {
                let (why, for_ms) = (why.clone().unwrap_or_default(), self.settings.refused_ms);
                if let Some(robot) = last.and_then(|last| self.robots.get_mut(&last)) {
                    robot.idle_since_ms = entry.at_ms;
                    if !failed && *not_before_ms > 0 {
                        robot.shun(entry.at_ms, for_ms, why);
                    }
                }
            }
            Record::Became { change: Change::Ended { .. }, .. } => {
                let id = task.id;
                self.robots.values_mut().for_each(|robot| {
                    robot.cannot.remove(&id);
                });
                if let Some(robot) = last.and_then(|last| self.robots.get_mut(&last)) {
                    robot.idle_since_ms = entry.at_ms;
                }
            }
            _ => {}
        }
    }

    /// Why a task waits, in words: what keeps the robots that may do it.
    #[must_use]
    pub fn why_queued(&self, now_ms: u64, id: TaskId) -> Option<String> {
        const NAMED: usize = 3;
        let task = self.book.task(id).filter(|task| task.state == TaskState::Queued)?;
        if let Some(cause) = self.gate().cause(task) {
            return Some(format!("{}; {}", cause.text(), cause.remedy()));
        }
        if now_ms < task.not_before_ms {
            return Some(format!("it is begun again in {} s", (task.not_before_ms - now_ms) / 1000 + 1));
        }
        if let Some(robot) = self.saved.get(&id) {
            return Some(format!("{robot} is nearly done, and will be there before any other"));
        }
        let mut may = self.robots.values().filter(|robot| robot.is_one_of(&task.spec.who)).peekable();
        if may.peek().is_none() {
            return Some("no robot that is there may do it".to_owned());
        }
        let reasons = may.filter_map(|robot| {
            let busy = self.book.on(&robot.name).map(|other| format!("it does {}", other.id));
            let unfit = || robot.fitness(now_ms, &self.settings, &self.identity.me).err();
            let reason = busy.or_else(|| robot.cannot.get(&id).cloned()).or_else(unfit)?;
            Some(format!("{}: {reason}", robot.name))
        });
        let mut reasons: Vec<String> = reasons.collect();
        let more = reasons.len().saturating_sub(NAMED);
        reasons.truncate(NAMED);
        if more > 0 {
            reasons.push(format!("and {more} more"));
        }
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }
}

/// How a task ends: at once, or when its robot has confirmed.
pub(super) fn end(task: &Task, ending: Ending) -> Change {
    if task.assigned.is_some() { Change::Cancelling { then: ending } } else { Change::Ended { ending } }
}

fn candidate(robot: &Robot) -> Option<Candidate> {
    let seen = robot.seen.as_ref()?;
    Some(Candidate { pose: seen.pose, handicap_m: if seen.tired { TIRED_M } else { 0.0 } })
}

/// How much more than the way it costs, in m; `None` = it may not be.
fn fits(task: &Task, robot: &Robot) -> Option<f64> {
    let may = robot.is_one_of(&task.spec.who) && !robot.cannot.contains_key(&task.id);
    let failed_here = task.failures > 0 && task.last.as_ref().is_some_and(|last| last.robot == robot.name);
    may.then_some(if failed_here { FAILED_M } else { 0.0 })
}
