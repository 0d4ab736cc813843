//! When has a goal ended, and how? Pure: states and events in, the end out.

use std::time::Duration;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{Event, EventKind, GoalStatus, RobotState};

/// States that were on their way when the goal was accepted still show the one before.
const OLD_STATES: Duration = Duration::from_secs(1);
/// The state may show the end before the event says why.
const REASON_WITHIN: Duration = Duration::from_millis(500);

/// How a goal ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GoalOutcome {
    /// As what.
    pub status: GoalStatus,
    /// Why, as far as the robot said.
    pub reason: Option<String>,
}

/// One goal of one boot of a robot.
#[derive(Debug, Clone)]
pub(super) struct Follow {
    goal: Uuid,
    epoch: Option<u64>,
    /// Whether a state has shown it.
    seen: bool,
    /// The robot's clock in the first state after the goal was accepted.
    first_tick_ms: Option<u64>,
    distance_m: Option<f64>,
    /// As the state shows it, and since when.
    shown: Option<(Duration, GoalStatus)>,
    /// As the event says.
    told: Option<GoalOutcome>,
}

impl Follow {
    /// A goal that is about to be sent to a robot whose boot has this epoch.
    pub(super) fn new(goal: Uuid, epoch: Option<u64>) -> Self {
        Self { goal, epoch, seen: false, first_tick_ms: None, distance_m: None, shown: None, told: None }
    }

    /// Its id.
    pub(super) fn goal(&self) -> Uuid {
        self.goal
    }

    /// What was last left to go.
    pub(super) fn distance_m(&self) -> Option<f64> {
        self.distance_m
    }

    /// A state that came in after the goal was accepted, `since` then.
    pub(super) fn state(&mut self, since: Duration, state: &RobotState) {
        if self.shown.is_some() {
            return;
        }
        let restarted = self.epoch.is_some_and(|epoch| epoch != state.epoch);
        let moved_on = state.tick_ms > *self.first_tick_ms.get_or_insert(state.tick_ms);
        match &state.goal {
            _ if restarted => self.shown = Some((since, GoalStatus::Interrupted)),
            Some(goal) if goal.id == self.goal => {
                self.seen = true;
                self.distance_m = goal.distance_m;
                if goal.status.is_final() {
                    self.shown = Some((since, goal.status));
                }
            }
            // Without having been seen it must be a state that the robot made later, not one that
            // was under way.
            _ if self.seen || (moved_on && since > OLD_STATES) => {
                self.shown = Some((since, GoalStatus::Replaced))
            }
            _ => {}
        }
    }

    /// An event of the robot; those of other goals say nothing here.
    pub(super) fn event(&mut self, event: &Event) {
        if let EventKind::Goal { id, status, reason } = &event.kind
            && *id == self.goal
            && status.is_final()
        {
            self.told = Some(GoalOutcome { status: *status, reason: reason.clone() });
        }
    }

    /// How the goal ended, once that is certain.
    pub(super) fn ended(&self, since: Duration) -> Option<GoalOutcome> {
        if self.told.is_some() {
            return self.told.clone();
        }
        let (at, status) = self.shown?;
        let complete = status == GoalStatus::Reached || since >= at + REASON_WITHIN;
        complete.then_some(GoalOutcome { status, reason: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake;
    use xtb_protocol::Name;

    const GOAL: Uuid = Uuid::from_u128(1);
    const OTHER: Uuid = Uuid::from_u128(2);

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn at_tick(tick_ms: u64, state: RobotState) -> RobotState {
        RobotState { tick_ms, ..state }
    }

    fn state(epoch: u64, goal: Option<(Uuid, GoalStatus)>) -> RobotState {
        let goal = goal.map(|(id, status)| fake::goal(id, status));
        RobotState { epoch, goal, ..fake::state("xtb-1") }
    }

    fn event(id: Uuid, status: GoalStatus, reason: &str) -> Event {
        let kind = EventKind::Goal { id, status, reason: Some(reason.into()) };
        Event { robot: Name::new("xtb-1").unwrap(), epoch: 7, seq: 0, tick_ms: 0, kind }
    }

    #[test]
    fn a_goal_is_reached_as_soon_as_the_state_says_so() {
        let mut follow = Follow::new(GOAL, Some(7));
        follow.state(ms(10), &state(7, Some((OTHER, GoalStatus::Reached))));
        follow.state(ms(60), &state(7, Some((GOAL, GoalStatus::Running))));
        assert_eq!((follow.ended(ms(60)), follow.distance_m()), (None, Some(1.5)));
        follow.state(ms(110), &state(7, Some((GOAL, GoalStatus::Reached))));
        assert_eq!(follow.ended(ms(110)).unwrap().status, GoalStatus::Reached);
    }

    #[test]
    fn any_other_end_waits_a_little_for_its_reason() {
        let mut follow = Follow::new(GOAL, Some(7));
        follow.state(ms(100), &state(7, Some((GOAL, GoalStatus::Failed))));
        assert_eq!(follow.ended(ms(200)), None);
        assert_eq!(follow.ended(ms(600)).unwrap().reason, None);
        follow.event(&event(OTHER, GoalStatus::Failed, "not mine"));
        assert_eq!(follow.ended(ms(200)), None);
        follow.event(&event(GOAL, GoalStatus::Failed, "the gyro fell silent"));
        assert_eq!(follow.ended(ms(200)).unwrap().reason.unwrap(), "the gyro fell silent");
    }

    #[test]
    fn another_goal_means_replaced_and_another_boot_interrupted() {
        let mut follow = Follow::new(GOAL, Some(7));
        follow.state(ms(900), &state(7, None));
        assert_eq!(follow.ended(ms(2000)), None);
        let mut replaced = follow.clone();
        replaced.state(ms(1100), &at_tick(200, state(7, Some((OTHER, GoalStatus::Running)))));
        assert_eq!(replaced.ended(ms(2000)).unwrap().status, GoalStatus::Replaced);
        follow.state(ms(950), &state(8, None));
        assert_eq!(follow.ended(ms(2000)).unwrap().status, GoalStatus::Interrupted);
    }

    #[test]
    fn a_state_from_before_the_goal_never_means_replaced() {
        let before = at_tick(5000, state(7, Some((OTHER, GoalStatus::Running))));
        let mut follow = Follow::new(GOAL, Some(7));
        // The only one after the acceptance, however late, may have been under way all the time.
        follow.state(ms(1500), &before);
        follow.state(ms(1600), &before);
        assert_eq!(follow.ended(ms(9000)), None);
        follow.state(ms(1700), &at_tick(5050, state(7, Some((GOAL, GoalStatus::Running)))));
        follow.state(ms(1750), &at_tick(5100, state(7, Some((GOAL, GoalStatus::Reached)))));
        assert_eq!(follow.ended(ms(1750)).unwrap().status, GoalStatus::Reached);
    }

    #[test]
    fn a_goal_that_was_seen_is_replaced_as_soon_as_another_shows() {
        let mut follow = Follow::new(GOAL, Some(7));
        follow.state(ms(10), &at_tick(100, state(7, Some((GOAL, GoalStatus::Running)))));
        follow.state(ms(60), &at_tick(150, state(7, Some((OTHER, GoalStatus::Running)))));
        assert_eq!(follow.ended(ms(600)).unwrap().status, GoalStatus::Replaced);
    }
}
