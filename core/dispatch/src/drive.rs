//! What a task's robot says of it, and what to ask of the robot next.
//!
//! Both are read off the book and the robot's last state alone, each time anew. So it does not matter
//! which message was lost, or whether this process has restarted in between: a drive that the robot
//! shows as reached is done, one that it shows as under way goes on, one that it does not know is asked
//! for, and one that nobody wants is withdrawn.

use crate::record::{Change, Ending};
use crate::robot::{Purpose, Robot, Seen, Stuck};
use crate::settings::Settings;
use crate::suspend::Gate;
use crate::task::{Assigned, Task};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Assignment, GoalStatus, LinkLoss, OnTakeover, RejectCode, SuspensionCause, TaskState, Who,
};

/// What became of a task, as its robot shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum News {
    /// Its drive is done.
    Reached,
    /// Its state changes.
    Became(Change, Option<String>),
    /// It needs a new number on the same robot: the old one will not begin any more.
    Renew,
}

impl News {
    fn queued(now_ms: u64, why: String) -> Self {
        Self::Became(Change::Queued { not_before_ms: now_ms, failed: false }, Some(why))
    }

    /// No fault of the robot: it may have the task again at once.
    pub(crate) fn suspended(cause: &SuspensionCause) -> Self {
        Self::Became(Change::Queued { not_before_ms: 0, failed: false }, Some(cause.text()))
    }
}

/// Who looks, and when.
#[derive(Debug, Clone, Copy)]
pub struct Eye<'a> {
    /// Now, in ms since 1970.
    pub now_ms: u64,
    /// Our ledger.
    pub ledger: u64,
    /// Our name as a client.
    pub me: &'a Name,
    /// Bounds and times.
    pub settings: &'a Settings,
    /// What is suspended.
    pub gate: Gate<'a>,
    /// Nobody has said yet whether the fleet still has the ledger's map: no drive is begun.
    pub map_due: bool,
}

/// What a task's robot shows of it; `None` = nothing new.
#[must_use]
pub fn look(eye: Eye<'_>, task: &Task, robot: &Robot) -> Option<News> {
    let assigned = task.assigned.as_ref()?;
    if !robot.is_there(eye.now_ms, eye.settings) {
        return gone(eye, task, assigned, robot);
    }
    let seen = robot.seen.as_ref()?;
    if task.wants_to_end() {
        return robot.has_let_go(assigned.seq).then(|| ended(task));
    }
    if let Some((_, news)) = robot.leaving.as_ref().filter(|(seq, _)| *seq == assigned.seq) {
        return robot.has_let_go(assigned.seq).then(|| news.clone());
    }
    if task.state == TaskState::Held {
        return held(eye, task, assigned, robot, seen);
    }
    let goal = seen.goal(task.assignment(eye.ledger)?.goal_id());
    let has_reached = goal.is_some_and(|goal| goal.status == GoalStatus::Reached);
    if let Some(cause) = eye.gate.cause(task).filter(|_| !has_reached) {
        return Some(News::suspended(&cause));
    }
    let Some(goal) = goal else { return not_begun(eye, task, assigned, robot, seen) };
    match goal.status {
        GoalStatus::Reached => Some(News::Reached),
        GoalStatus::Accepted | GoalStatus::Running => {
            let known = task.state == TaskState::Running;
            // What is gone for a moment may be back in the next one: the history is not to fill with that.
            let still = task.state == TaskState::Blocked && robot.stuck.is_some_and(|it| !clear(eye, it));
            gets_nowhere(eye, task, robot)
                .or_else(|| (!known && !still).then_some(News::Became(Change::Running, None)))
        }
        GoalStatus::Blocked => blocked(eye, task, robot, goal.reason.as_deref()),
        GoalStatus::Cancelled | GoalStatus::Replaced => Some(interfered(eye, robot, seen)),
        GoalStatus::Failed | GoalStatus::Interrupted => {
            Some(failed(eye, task, robot, goal.reason.as_deref()))
        }
    }
}

/// Something is in its way. After a while another robot may be luckier, first of all one that is what stands
/// there.
fn blocked(eye: Eye<'_>, task: &Task, robot: &Robot, reason: Option<&str>) -> Option<News> {
    if task.state != TaskState::Blocked {
        let since_ms = robot.blocked_ms.unwrap_or(eye.now_ms);
        let long = eye.now_ms.saturating_sub(since_ms) >= eye.settings.blocked_ms;
        return long.then(|| News::Became(Change::Blocked, reason.map(str::to_owned)));
    }
    gets_nowhere(eye, task, robot)
}

/// Whether nothing has been in its way for long enough to say so.
fn clear(eye: Eye<'_>, stuck: Stuck) -> bool {
    stuck.clear_ms.is_some_and(|since_ms| eye.now_ms.saturating_sub(since_ms) >= eye.settings.blocked_ms)
}

/// It was in the way for a minute, on and off: another robot may do better.
fn gets_nowhere(eye: Eye<'_>, task: &Task, robot: &Robot) -> Option<News> {
    let only_it = matches!(task.spec.who, Who::Robot(_));
    let stuck_ms = eye.now_ms.saturating_sub(robot.stuck?.since_ms);
    (stuck_ms >= eye.settings.blocked_most_ms && !only_it).then(|| {
        let what = task.reason.as_deref().unwrap_or("blocked");
        News::queued(eye.now_ms, format!("{}: {what}, for {} s", robot.name, stuck_ms / 1000))
    })
}

/// The robot has confirmed that it does not drive for a task that is to end or to rest.
fn ended(task: &Task) -> News {
    match task.ending {
        Some(ending) => News::Became(Change::Ended { ending }, None),
        None => News::Became(Change::LetGo, None),
    }
}

/// It is silent. Its task goes back to the queue once it has surely stopped for it, and not before its
/// grace is over.
fn gone(eye: Eye<'_>, task: &Task, assigned: &Assigned, robot: &Robot) -> Option<News> {
    let silent_ms = robot.silent_ms(eye.now_ms);
    if silent_ms < task.grace_ms().max(eye.settings.silent_ms) || !surely_stands(eye, task, assigned, robot) {
        return None;
    }
    let why = format!("{} was not heard for {} s", robot.name, silent_ms / 1000);
    if task.wants_to_end() {
        let what = task.reason.as_ref().map(|reason| format!("{reason}; ")).unwrap_or_default();
        let why = Some(format!("{what}{why}, and its goal has ended by its own policy"));
        return Some(match task.ending {
            Some(ending) => News::Became(Change::Ended { ending }, why),
            None => News::Became(Change::LetGo, why),
        });
    }
    Some(News::queued(eye.now_ms, why))
}

/// Whether a silent robot's goal has ended by its own policy.
fn surely_stands(eye: Eye<'_>, task: &Task, assigned: &Assigned, robot: &Robot) -> bool {
    let spoke_ms = robot.spoke_ms.max(robot.heard_ms);
    let over_ms = match task.spec.on_link_loss {
        LinkLoss::Halt => spoke_ms + eye.settings.halted_ms,
        LinkLoss::Finish => {
            let bound_ms = (task.finish_s() * 1000.0) as u64 + eye.settings.finish_margin_ms;
            spoke_ms.max(assigned.at_ms) + bound_ms
        }
    };
    eye.now_ms >= over_ms
}

/// Its state does not know the drive: it has not come to it yet, or the robot has restarted.
fn not_begun(eye: Eye<'_>, task: &Task, assigned: &Assigned, robot: &Robot, seen: &Seen) -> Option<News> {
    if let Some(holder) = robot.taken_by(eye.me) {
        let why = Some(format!("{} was taken over by {holder}", robot.name));
        return Some(News::Became(Change::Held { by: Some(holder.clone()) }, why));
    }
    if let Some(unfit) = &seen.unfit {
        return Some(News::queued(eye.now_ms, format!("{}: {unfit}", robot.name)));
    }
    // Acknowledged, and a later state does not show it: it has fallen out of the robot's memory.
    let lost = robot.acked.is_some_and(|(seq, leg, state)| {
        (seq, leg) == (assigned.seq, task.legs_done) && seen.seq > state + 20
    });
    lost.then_some(News::Renew)
}

/// Its goal was ended by somebody else.
fn interfered(eye: Eye<'_>, robot: &Robot, seen: &Seen) -> News {
    let name = &robot.name;
    if let Some(unfit) = &seen.unfit {
        return News::queued(eye.now_ms, format!("{name}: {unfit}"));
    }
    let by = robot.taken_by(eye.me).cloned().or_else(|| {
        let newer = seen.goals.first().and_then(|goal| goal.by.clone());
        newer.filter(|by| by != eye.me)
    });
    let why = match &by {
        Some(by) => format!("{name} was taken over by {by}"),
        None => format!("{name} was told to stop"),
    };
    News::Became(Change::Held { by }, Some(why))
}

/// Its goal has failed: because of us, because of the robot, or because of the goal.
fn failed(eye: Eye<'_>, task: &Task, robot: &Robot, reason: Option<&str>) -> News {
    let (name, seen) = (&robot.name, robot.seen.as_ref());
    if let Some(unfit) = seen.and_then(|seen| seen.unfit.as_ref()) {
        return News::queued(eye.now_ms, format!("{name}: {unfit}"));
    }
    if let Some(holder) = robot.taken_by(eye.me) {
        let why = Some(format!("{name} was taken over by {holder}"));
        return News::Became(Change::Held { by: Some(holder.clone()) }, why);
    }
    if reason.is_some_and(|reason| reason.contains("fell silent")) {
        // Our fault: it may have the task again at once, and is the nearest.
        let why = Some(format!("{name} heard nothing from the dispatcher, and stopped"));
        return News::Became(Change::Queued { not_before_ms: 0, failed: false }, why);
    }
    let why = format!("{name}: {}", reason.unwrap_or("failed"));
    tried(eye, task, why)
}

/// One failure more: again after a pause, or over.
fn tried(eye: Eye<'_>, task: &Task, why: String) -> News {
    if task.failures >= task.spec.retries {
        return News::Became(Change::Ended { ending: Ending::Failed }, Some(why));
    }
    let pause_ms = eye.settings.retry_ms << task.failures.min(16);
    let not_before_ms = eye.now_ms + pause_ms.min(eye.settings.retry_max_ms);
    News::Became(Change::Queued { not_before_ms, failed: true }, Some(why))
}

/// It was taken over, or told to stop: what the task's policy says.
fn held(eye: Eye<'_>, task: &Task, assigned: &Assigned, robot: &Robot, seen: &Seen) -> Option<News> {
    let waited_ms = eye.now_ms.saturating_sub(task.since_ms);
    if !robot.has_let_go(assigned.seq) {
        return None;
    }
    let given_back = robot.taken_by(eye.me).is_none()
        && seen.running().is_none()
        && seen.unfit.is_none()
        && eye.now_ms.saturating_sub(robot.ours_since_ms.max(task.since_ms)) >= eye.settings.calm_ms;
    match task.spec.on_takeover {
        OnTakeover::Fail => Some(News::Became(Change::Ended { ending: Ending::Failed }, task.reason.clone())),
        // A person's stop is not undone by a clock of ours: only a lease that was given back is.
        OnTakeover::Resume if task.held_by.is_some() && eye.gate.cause(task).is_none() => {
            given_back.then_some(News::Renew)
        }
        OnTakeover::Resume => None,
        OnTakeover::Requeue => (waited_ms >= task.grace_ms())
            .then(|| News::queued(eye.now_ms, task.reason.clone().unwrap_or_default())),
    }
}

/// Whether a task may leave a robot that is there only when that has confirmed: a request of ours may be
/// on its way yet, unless the drive has begun and ended.
#[must_use]
pub fn has_to_confirm(eye: Eye<'_>, task: &Task, robot: &Robot, news: &News) -> bool {
    let leaves = matches!(news, News::Became(Change::Queued { .. } | Change::Ended { .. }, _));
    let (Some(assigned), Some(seen)) = (&task.assigned, &robot.seen) else { return false };
    let goal = task.assignment(eye.ledger).and_then(|assignment| seen.goal(assignment.goal_id()));
    leaves
        && robot.is_there(eye.now_ms, eye.settings)
        && !goal.is_some_and(|goal| goal.status.is_final())
        && !robot.has_let_go(assigned.seq)
}

/// What a refusal of a drive says of its task.
#[must_use]
pub fn refused(eye: Eye<'_>, task: &Task, robot: &Robot, code: RejectCode, message: &str) -> Option<News> {
    let why = format!("{} refused: {message}", robot.name);
    match code {
        RejectCode::OutOfRange | RejectCode::KeepOut | RejectCode::GoalBlocked => Some(tried(eye, task, why)),
        RejectCode::Malformed | RejectCode::WrongVersion | RejectCode::Unsupported | RejectCode::NoMap => {
            Some(News::queued(eye.now_ms, why))
        }
        RejectCode::Latched | RejectCode::BatteryLow | RejectCode::NotReady => {
            Some(News::queued(eye.now_ms, why))
        }
        // Somebody said stop after we had asked: that stop was meant for us.
        RejectCode::Overtaken => {
            let why = Some(format!("{} was told to stop", robot.name));
            Some(News::Became(Change::Held { by: None }, why))
        }
        // The number is used up.
        RejectCode::UnknownGoal => Some(News::Renew),
        RejectCode::LeaseHeld
        | RejectCode::LeaseLost
        | RejectCode::LeaseRequired
        | RejectCode::Busy
        | RejectCode::Overloaded
        | RejectCode::Oversized
        | RejectCode::CausePresent => None,
    }
}

/// What to ask of a robot next; `None` = nothing.
#[must_use]
pub fn duty(eye: Eye<'_>, task: Option<&Task>, robot: &Robot) -> Option<Purpose> {
    let seen = robot.seen.as_ref()?;
    if let Some(seq) = unwanted(eye, task, robot, seen) {
        return Some(Purpose::Withdraw { seq });
    }
    let free = seen.holder.is_none() || seen.holder.as_ref() == Some(eye.me);
    let leaving = robot.leaving.as_ref().map(|(seq, _)| *seq);
    let drives = |task: &&Task| {
        task.wants_to_drive() && leaving != task.assigned.as_ref().map(|assigned| assigned.seq)
    };
    let Some(task) = task.filter(drives) else {
        let idle_ms = eye.now_ms.saturating_sub(robot.idle_since_ms);
        // After a stop of the fleet somebody needs the lease for a reset.
        let stopped = eye.gate.stop.is_some();
        let lingers = task.is_none() && !stopped && idle_ms < eye.settings.linger_ms;
        return (robot.operator.lease().is_some() && !lingers).then_some(Purpose::Release);
    };
    let assignment = task.assignment(eye.ledger)?;
    if seen.goal(assignment.goal_id()).is_some_and(|goal| goal.status.is_final()) || !free {
        return None; // look() has the word
    }
    if eye.gate.cause(task).is_some() {
        return None; // look() queues it again
    }
    if robot.lease(eye.me).is_none() {
        return Some(Purpose::Acquire);
    }
    let known = seen.goal(assignment.goal_id()).is_some()
        || robot.acked.is_some_and(|(seq, leg, _)| (seq, leg) == (assignment.assign_seq, assignment.leg));
    let dwells = eye.now_ms < task.dwells_until_ms();
    (!known && !dwells && !eye.map_due && seen.unfit.is_none()).then_some(Purpose::Assign(assignment))
}

/// The number of an assignment that the robot may drive for and that nobody wants.
fn unwanted(eye: Eye<'_>, task: Option<&Task>, robot: &Robot, seen: &Seen) -> Option<u64> {
    let assigned = task.and_then(|task| task.assigned.as_ref());
    let leaves = |seq: u64| robot.leaving.as_ref().is_some_and(|(leaving, _)| *leaving == seq);
    let rests = task.is_some_and(Task::shall_rest) || assigned.is_some_and(|assigned| leaves(assigned.seq));
    if let Some(assigned) = assigned.filter(|assigned| rests && !robot.has_let_go(assigned.seq)) {
        return Some(assigned.seq);
    }
    let wanted = assigned.filter(|_| !rests);
    let (seq, _) = Assignment::of_goal(eye.ledger, seen.running()?.id)?;
    wanted.is_none_or(|assigned| assigned.seq != seq).then_some(seq)
}
