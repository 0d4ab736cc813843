//! What a task's robot says of it, and what to ask of the robot next.
//!
//! Both follow from the ledger and the robot's last state alone, each time anew. So it does not matter
//! which message was lost, or whether this process has restarted in between: a drive that the robot
//! shows as reached is done, one that it shows as under way goes on, one that it does not know is asked
//! for, and one that nobody wants is withdrawn.

use crate::settings::DispatcherSettings;
use crate::suspension::SuspensionState;
use crate::task::{Assigned, Task};
use crate::tracked_robot::{ObservedState, RequestPurpose, StalledGoal, TrackedRobot};
use crate::transition::{TaskEnding, TaskOutcome, TaskUpdate};
use xtb_protocol::Name;
use xtb_protocol::messages::texts::{is_client_timeout, is_withdrawn};
use xtb_protocol::messages::{
    Assignment, GoalStatus, LinkLoss, NEXT_LEG, OnTakeover, RejectCode, TaskState, Who,
};

/// What a decision about a task is made from, besides the task and its robot.
#[derive(Debug, Clone, Copy)]
pub struct Ctx<'a> {
    /// Now, in ms since 1970.
    pub now_ms: u64,
    /// Our ledger.
    pub ledger: u64,
    /// Our name as a client.
    pub me: &'a Name,
    /// Bounds and times.
    pub settings: &'a DispatcherSettings,
    /// What is suspended.
    pub suspension: SuspensionState<'a>,
    /// Nobody has said yet whether the fleet still has the ledger's map: no drive is begun.
    pub map_due: bool,
}

/// What a task's robot shows of it; `None` = nothing new.
#[must_use]
pub fn outcome(ctx: Ctx<'_>, task: &Task, robot: &TrackedRobot) -> Option<TaskOutcome> {
    let assigned = task.assigned.as_ref()?;
    if !robot.is_online(ctx.now_ms, ctx.settings) {
        return offline(ctx, task, assigned, robot);
    }
    let observed = robot.observed.as_ref()?;
    if task.wants_to_end() {
        return robot.has_released(assigned.seq).then(|| ended(task));
    }
    if let Some((_, outcome)) = robot.pending_outcome.as_ref().filter(|(seq, _)| *seq == assigned.seq) {
        let is_over = robot.has_released(assigned.seq) || has_never_answered(ctx, assigned, robot);
        return is_over.then(|| outcome.clone());
    }
    if task.state == TaskState::Held {
        return held(ctx, task, assigned, robot, observed);
    }
    let goal = observed.goal(task.assignment(ctx.ledger)?.goal_id());
    let has_reached = goal.is_some_and(|goal| goal.status == GoalStatus::Reached);
    if let Some(cause) = ctx.suspension.cause(task).filter(|_| !has_reached) {
        return Some(TaskOutcome::suspended(&cause));
    }
    let Some(goal) = goal else { return not_begun(ctx, task, assigned, robot, observed) };
    match goal.status {
        GoalStatus::Reached => Some(TaskOutcome::Reached),
        GoalStatus::Accepted | GoalStatus::Running => {
            let known = task.state == TaskState::Running;
            // What is gone for a moment may be back in the next one: the history is not to fill with that.
            let still = task.state == TaskState::Blocked && robot.stuck.is_some_and(|it| !clear(ctx, it));
            makes_no_progress(ctx, task, robot)
                .or_else(|| (!known && !still).then_some(TaskOutcome::Changed(TaskUpdate::Running, None)))
        }
        GoalStatus::Blocked => blocked(ctx, task, robot, goal.reason.as_deref()),
        // By us, and what for was not written before this process ended.
        GoalStatus::Cancelled if goal.reason.as_deref().is_some_and(is_withdrawn) => {
            let reason = goal.reason.as_deref().unwrap_or_default();
            Some(TaskOutcome::queued(ctx.now_ms, format!("{}: {reason}", robot.name)))
        }
        GoalStatus::Cancelled | GoalStatus::Replaced => Some(ended_by_others(ctx, robot, observed)),
        GoalStatus::Failed | GoalStatus::Interrupted => {
            Some(failed(ctx, task, robot, goal.reason.as_deref()))
        }
    }
}

/// Something is in its way. After a while another robot may be luckier, first of all one that is what stands
/// there.
fn blocked(ctx: Ctx<'_>, task: &Task, robot: &TrackedRobot, reason: Option<&str>) -> Option<TaskOutcome> {
    if task.state != TaskState::Blocked {
        let since_ms = robot.blocked_since_ms.unwrap_or(ctx.now_ms);
        let long = ctx.now_ms.saturating_sub(since_ms) >= ctx.settings.blocked_ms;
        return long.then(|| TaskOutcome::Changed(TaskUpdate::Blocked, reason.map(str::to_owned)));
    }
    makes_no_progress(ctx, task, robot)
}

/// Whether nothing has been in its way for long enough to say so.
fn clear(ctx: Ctx<'_>, stuck: StalledGoal) -> bool {
    stuck.clear_ms.is_some_and(|since_ms| ctx.now_ms.saturating_sub(since_ms) >= ctx.settings.blocked_ms)
}

/// It was in the way for a minute, on and off: another robot may do better.
fn makes_no_progress(ctx: Ctx<'_>, task: &Task, robot: &TrackedRobot) -> Option<TaskOutcome> {
    let only_it = matches!(task.spec.who, Who::Robot(_));
    let stuck_ms = ctx.now_ms.saturating_sub(robot.stuck?.since_ms);
    (stuck_ms >= ctx.settings.blocked_max_ms && !only_it).then(|| {
        let what = task.reason.as_deref().unwrap_or("blocked");
        TaskOutcome::queued(ctx.now_ms, format!("{}: {what} for {} s", robot.name, stuck_ms / 1000))
    })
}

/// The robot has confirmed that it does not drive for a task that is to end or to rest.
fn ended(task: &Task) -> TaskOutcome {
    match task.ending {
        Some(ending) => TaskOutcome::Changed(TaskUpdate::Ended { ending }, None),
        None => TaskOutcome::Changed(TaskUpdate::LetGo, None),
    }
}

/// It is silent. Its task goes back to the queue once it has surely stopped for it, and not before its
/// grace is over.
fn offline(ctx: Ctx<'_>, task: &Task, assigned: &Assigned, robot: &TrackedRobot) -> Option<TaskOutcome> {
    let silent_ms = robot.silent_ms(ctx.now_ms);
    if silent_ms < task.grace_ms().max(ctx.settings.silent_ms)
        || !has_surely_stopped(ctx, task, assigned, robot)
    {
        return None;
    }
    let why = format!("no message from {} for {} s", robot.name, silent_ms / 1000);
    if task.wants_to_end() {
        let what = task.reason.as_ref().map(|reason| format!("{reason}; ")).unwrap_or_default();
        let why = Some(format!("{what}{why}; its goal has ended by its link-loss policy"));
        return Some(match task.ending {
            Some(ending) => TaskOutcome::Changed(TaskUpdate::Ended { ending }, why),
            None => TaskOutcome::Changed(TaskUpdate::LetGo, why),
        });
    }
    Some(TaskOutcome::queued(ctx.now_ms, why))
}

/// Whether a silent robot's goal has ended by its own policy.
fn has_surely_stopped(ctx: Ctx<'_>, task: &Task, assigned: &Assigned, robot: &TrackedRobot) -> bool {
    let last_sent_ms = robot.last_sent_ms.max(robot.last_heard_ms);
    let over_ms = match task.spec.on_link_loss {
        LinkLoss::Halt => last_sent_ms + ctx.settings.halted_ms,
        LinkLoss::Finish => {
            // One leg after the other, if it may know the next one.
            let legs = 1.0 + f64::from(u8::from(task.next_leg(ctx.ledger, ctx.now_ms).is_some()));
            let bound_ms = (legs * task.finish_s() * 1000.0) as u64 + ctx.settings.finish_margin_ms;
            last_sent_ms.max(assigned.at_ms) + bound_ms
        }
    };
    ctx.now_ms >= over_ms
}

/// Its state does not know the drive: it has not come to it yet, or the robot has restarted.
fn not_begun(
    ctx: Ctx<'_>,
    task: &Task,
    assigned: &Assigned,
    robot: &TrackedRobot,
    observed: &ObservedState,
) -> Option<TaskOutcome> {
    if let Some(holder) = robot.other_holder(ctx.me) {
        let why = Some(format!("{} is under control of {holder}", robot.name));
        return Some(TaskOutcome::Changed(TaskUpdate::Held { by: Some(holder.clone()) }, why));
    }
    if let Some(unavailable) = &observed.unavailable {
        return Some(TaskOutcome::queued(ctx.now_ms, format!("{}: {unavailable}", robot.name)));
    }
    // States alone are no robot: anything may send them.
    if has_never_answered(ctx, assigned, robot) {
        return Some(TaskOutcome::queued(ctx.now_ms, format!("{} does not answer", robot.name)));
    }
    // Acknowledged, and a later state does not show it: it has fallen out of the robot's memory.
    let lost = robot.acked.is_some_and(|(seq, leg, state)| {
        (seq, leg) == (assigned.seq, task.legs_done) && observed.seq > state + 20
    });
    lost.then_some(TaskOutcome::Renew)
}

/// Its goal was ended by somebody else.
fn ended_by_others(ctx: Ctx<'_>, robot: &TrackedRobot, observed: &ObservedState) -> TaskOutcome {
    let name = &robot.name;
    if let Some(unavailable) = &observed.unavailable {
        return TaskOutcome::queued(ctx.now_ms, format!("{name}: {unavailable}"));
    }
    let by = robot.other_holder(ctx.me).cloned().or_else(|| {
        let newer = observed.goals.first().and_then(|goal| goal.by.clone());
        newer.filter(|by| by != ctx.me)
    });
    let why = match &by {
        Some(by) => format!("{name} is under control of {by}"),
        None => format!("{name} received a stop command"),
    };
    TaskOutcome::Changed(TaskUpdate::Held { by }, Some(why))
}

/// Its goal has failed: because of us, because of the robot, or because of the goal.
fn failed(ctx: Ctx<'_>, task: &Task, robot: &TrackedRobot, reason: Option<&str>) -> TaskOutcome {
    let (name, observed) = (&robot.name, robot.observed.as_ref());
    if let Some(unavailable) = observed.and_then(|observed| observed.unavailable.as_ref()) {
        return TaskOutcome::queued(ctx.now_ms, format!("{name}: {unavailable}"));
    }
    if let Some(holder) = robot.other_holder(ctx.me) {
        let why = Some(format!("{name} is under control of {holder}"));
        return TaskOutcome::Changed(TaskUpdate::Held { by: Some(holder.clone()) }, why);
    }
    if reason.is_some_and(is_client_timeout) {
        // Our fault: it may have the task again at once, and is the nearest.
        let why = Some(format!("{name} lost the connection to the dispatcher and stopped"));
        return TaskOutcome::Changed(TaskUpdate::Queued { not_before_ms: 0, failed: false }, why);
    }
    let why = format!("{name}: {}", reason.unwrap_or("failed"));
    count_failure(ctx, task, why)
}

/// One failure more: again after a pause, or over.
fn count_failure(ctx: Ctx<'_>, task: &Task, why: String) -> TaskOutcome {
    if task.failures >= task.spec.retries {
        return TaskOutcome::Changed(TaskUpdate::Ended { ending: TaskEnding::Failed }, Some(why));
    }
    let pause_ms = ctx.settings.retry_ms << task.failures.min(16);
    let not_before_ms = ctx.now_ms + pause_ms.min(ctx.settings.retry_max_ms);
    TaskOutcome::Changed(TaskUpdate::Queued { not_before_ms, failed: true }, Some(why))
}

/// It was taken over, or told to stop: what the task's policy says.
fn held(
    ctx: Ctx<'_>,
    task: &Task,
    assigned: &Assigned,
    robot: &TrackedRobot,
    observed: &ObservedState,
) -> Option<TaskOutcome> {
    let waited_ms = ctx.now_ms.saturating_sub(task.since_ms);
    if !robot.has_released(assigned.seq) {
        return None;
    }
    let is_released = robot.other_holder(ctx.me).is_none()
        && observed.running().is_none()
        && observed.unavailable.is_none()
        && ctx.now_ms.saturating_sub(robot.uncontested_since_ms.max(task.since_ms)) >= ctx.settings.settle_ms;
    match task.spec.on_takeover {
        OnTakeover::Fail => {
            Some(TaskOutcome::Changed(TaskUpdate::Ended { ending: TaskEnding::Failed }, task.reason.clone()))
        }
        // A person's stop is not undone by a clock of ours: only a lease that was given back is.
        OnTakeover::Resume if task.held_by.is_some() && ctx.suspension.cause(task).is_none() => {
            is_released.then_some(TaskOutcome::Renew)
        }
        OnTakeover::Resume => None,
        OnTakeover::Requeue => (waited_ms >= task.grace_ms())
            .then(|| TaskOutcome::queued(ctx.now_ms, task.reason.clone().unwrap_or_default())),
    }
}

/// Whether a task may leave a robot that is there only when that has confirmed: a request of ours may be
/// on its way yet, unless the drive has begun and ended, and there is no next one that it may have been asked
/// for. A state says so only for its own boot, and may be from before the robot's last restart: then the robot
/// may drive for the task again. Our lease is of the boot that has answered us.
#[must_use]
pub fn has_to_confirm(ctx: Ctx<'_>, task: &Task, robot: &TrackedRobot, outcome: &TaskOutcome) -> bool {
    let leaves =
        matches!(outcome, TaskOutcome::Changed(TaskUpdate::Queued { .. } | TaskUpdate::Ended { .. }, _));
    let (Some(assigned), Some(observed)) = (&task.assigned, &robot.observed) else { return false };
    let goal = task.assignment(ctx.ledger).and_then(|assignment| observed.goal(assignment.goal_id()));
    let has_answered = robot.operator.lease().is_some_and(|lease| lease.epoch == observed.epoch);
    let is_over = has_answered
        && !may_begin_next_leg(ctx, task, robot)
        && goal.is_some_and(|goal| goal.status.is_final());
    leaves
        && robot.is_online(ctx.now_ms, ctx.settings)
        && !is_over
        && !robot.has_released(assigned.seq)
        && !has_never_answered(ctx, assigned, robot)
}

/// Whether a robot may have been asked for the leg after the present one, and not have got the request yet.
fn may_begin_next_leg(ctx: Ctx<'_>, task: &Task, robot: &TrackedRobot) -> bool {
    let Some(leg) = task.next_leg(ctx.ledger, ctx.now_ms) else { return false };
    robot.capabilities.as_ref().is_none_or(|all| all.contains(NEXT_LEG)) && !robot.has_answered_for(&leg)
}

/// Whether its robot answers nothing and cannot have begun to drive for it.
fn has_never_answered(ctx: Ctx<'_>, assigned: &Assigned, robot: &TrackedRobot) -> bool {
    robot.has_never_answered(ctx.now_ms, ctx.ledger, assigned.seq, ctx.settings)
}

/// What a refusal of a drive says of its task.
#[must_use]
pub fn refused(
    ctx: Ctx<'_>,
    task: &Task,
    robot: &TrackedRobot,
    code: RejectCode,
    message: &str,
) -> Option<TaskOutcome> {
    let why = format!("{} refused: {message}", robot.name);
    match code {
        RejectCode::OutOfRange | RejectCode::KeepOut | RejectCode::GoalBlocked => {
            Some(count_failure(ctx, task, why))
        }
        RejectCode::Malformed | RejectCode::WrongVersion | RejectCode::Unsupported | RejectCode::NoMap => {
            Some(TaskOutcome::queued(ctx.now_ms, why))
        }
        RejectCode::Latched | RejectCode::BatteryLow | RejectCode::NotReady => {
            Some(TaskOutcome::queued(ctx.now_ms, why))
        }
        // Somebody said stop after we had asked: that stop was meant for us.
        RejectCode::Overtaken => {
            let why = Some(format!("{} received a stop command", robot.name));
            Some(TaskOutcome::Changed(TaskUpdate::Held { by: None }, why))
        }
        // The number is used up.
        RejectCode::UnknownGoal => Some(TaskOutcome::Renew),
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
pub fn next_purpose(ctx: Ctx<'_>, task: Option<&Task>, robot: &TrackedRobot) -> Option<RequestPurpose> {
    let observed = robot.observed.as_ref()?;
    if let Some(seq) = unwanted(ctx, task, robot, observed) {
        return Some(RequestPurpose::Withdraw { seq });
    }
    let free = observed.holder.is_none() || observed.holder.as_ref() == Some(ctx.me);
    let leaving = robot.pending_outcome.as_ref().map(|(seq, _)| *seq);
    let drives = |task: &&Task| {
        task.wants_to_drive() && leaving != task.assigned.as_ref().map(|assigned| assigned.seq)
    };
    let Some(task) = task.filter(drives) else {
        let idle_ms = ctx.now_ms.saturating_sub(robot.idle_since_ms);
        // After a stop of the fleet somebody needs the lease for a reset.
        let stopped = ctx.suspension.stop.is_some();
        let keeps_lease = task.is_none() && !stopped && idle_ms < ctx.settings.lease_idle_ms;
        return (robot.operator.lease().is_some() && !keeps_lease).then_some(RequestPurpose::Release);
    };
    let assignment = task.assignment(ctx.ledger)?;
    if observed.goal(assignment.goal_id()).is_some_and(|goal| goal.status.is_final()) || !free {
        return None; // outcome() decides
    }
    if ctx.suspension.cause(task).is_some() {
        return None; // outcome() queues it again
    }
    let Some(lease) = robot.lease(ctx.me) else { return Some(RequestPurpose::Acquire) };
    if lease.epoch != observed.epoch {
        return None; // what it shows is from before its restart
    }
    let present = observed.goal(assignment.goal_id());
    if present.is_some_and(|goal| goal.status == GoalStatus::Running && goal.is_planned) {
        return next_leg(ctx, task, robot).map(RequestPurpose::Assign);
    }
    let known = present.is_some() || robot.has_acknowledged(&assignment);
    let dwells = ctx.now_ms < task.dwells_until_ms();
    (!known && !dwells && !ctx.map_due && observed.unavailable.is_none())
        .then_some(RequestPurpose::Assign(assignment))
}

/// The leg after the one that runs, for a robot that can pass the point between without a stop.
fn next_leg(ctx: Ctx<'_>, task: &Task, robot: &TrackedRobot) -> Option<Assignment> {
    let passes = robot.capabilities.as_ref().is_some_and(|all| all.contains(NEXT_LEG));
    let leg = task.next_leg(ctx.ledger, ctx.now_ms).filter(|_| passes && !ctx.map_due)?;
    (!robot.has_answered_for(&leg)).then_some(leg)
}

/// The number of an assignment that the robot may drive for and that nobody wants.
fn unwanted(
    ctx: Ctx<'_>,
    task: Option<&Task>,
    robot: &TrackedRobot,
    observed: &ObservedState,
) -> Option<u64> {
    let assigned = task.and_then(|task| task.assigned.as_ref());
    let leaves = |seq: u64| robot.pending_outcome.as_ref().is_some_and(|(pending, _)| *pending == seq);
    let rests = task.is_some_and(Task::must_stop) || assigned.is_some_and(|assigned| leaves(assigned.seq));
    if let Some(assigned) = assigned.filter(|assigned| rests && !robot.has_released(assigned.seq)) {
        return Some(assigned.seq);
    }
    let wanted = assigned.filter(|_| !rests);
    let (seq, _) = Assignment::of_goal(ctx.ledger, observed.running()?.id)?;
    wanted.is_none_or(|assigned| assigned.seq != seq).then_some(seq)
}
