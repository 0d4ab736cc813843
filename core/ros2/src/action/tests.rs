//! The life of goals, and who is told of it.

use super::*;
use proptest::prelude::*;

fn at(sec: i32) -> Time {
    Time { sec, nanosec: 0 }
}

fn id(number: u8) -> GoalId {
    [number; 16]
}

fn request(goal_id: GoalId, stamp: Time) -> CancelGoalRequest {
    CancelGoalRequest { goal_info: GoalInfo { goal_id, stamp } }
}

fn statuses<W>(goals: &Goals<W>) -> Vec<i8> {
    goals.status().status_list.iter().map(|entry| entry.status).collect()
}

/// Goals with one that runs, accepted at 10 s.
fn running() -> Goals<&'static str> {
    let mut goals = Goals::default();
    assert!(goals.accept(&at(10), id(1)).unwrap().is_empty());
    assert_eq!(statuses(&goals), [1]);
    assert!(goals.progress(&at(11), &id(1), GoalStatus::Running, "").is_empty());
    assert_eq!(statuses(&goals), [2]);
    goals
}

#[test]
fn all_who_wait_are_told_when_it_is_reached_and_those_who_ask_later_at_once() {
    let mut goals = running();
    assert!(goals.wait(&id(1), "a").is_none() && goals.wait(&id(1), "b").is_none());
    let answers = goals.progress(&at(120), &id(1), GoalStatus::Reached, "");
    let told: Vec<_> = answers.iter().map(|it| (it.to, it.response.status, it.response.error_code)).collect();
    assert_eq!(told, [("a", 4, 0), ("b", 4, 0)]);
    assert_eq!(goals.wait(&id(1), "c").unwrap().response.status, 4);
    assert!(goals.progress(&at(121), &id(1), GoalStatus::Failed, "").is_empty(), "it has ended");
    assert_eq!(statuses(&goals), [4]);
    assert_eq!(goals.wait(&id(9), "d").unwrap().response.status, 0, "no such goal");
}

#[test]
fn a_second_goal_aborts_the_first() {
    let mut goals = running();
    assert!(goals.wait(&id(1), "a").is_none());
    let answers = goals.accept(&at(20), id(2)).unwrap();
    assert_eq!((answers[0].to, answers[0].response.status), ("a", 6));
    assert_eq!(answers[0].response.error_msg, "replaced by a newer goal");
    assert_eq!((statuses(&goals), goals.active()), (vec![6, 1], Some((id(2), Status::Accepted))));
    assert!(goals.accept(&at(20), id(2)).is_err() && goals.accept(&at(20), NO_GOAL).is_err());
    assert!(goals.progress(&at(21), &id(1), GoalStatus::Replaced, "").is_empty(), "the robot says so too");
    assert_eq!(statuses(&goals), [6, 1]);
}

#[test]
fn a_goal_that_is_cancelled_ends_cancelled_and_one_that_somebody_stopped_aborted() {
    let mut goals = running();
    let (response, cancelled) = goals.cancel(&request(id(1), Time::default()));
    assert_eq!((response.return_code, cancelled, statuses(&goals)), (0, Some(id(1)), vec![3]));
    goals.progress(&at(12), &id(1), GoalStatus::Running, "");
    assert_eq!(statuses(&goals), [3], "still on its way to standing");
    goals.progress(&at(13), &id(1), GoalStatus::Cancelled, "");
    assert_eq!(statuses(&goals), [5]);
    let mut goals = running();
    assert!(goals.wait(&id(1), "a").is_none());
    let answers = goals.progress(&at(13), &id(1), GoalStatus::Cancelled, "ended by `stop` of alice");
    assert_eq!((answers[0].response.status, answers[0].response.error_code), (6, 9000));
    assert_eq!(answers[0].response.error_msg, "ended by `stop` of alice");
}

#[test]
fn a_goal_may_be_reached_while_it_is_cancelled() {
    let mut goals = running();
    assert!(goals.cancel(&request(NO_GOAL, Time::default())).1.is_some());
    goals.progress(&at(12), &id(1), GoalStatus::Reached, "");
    assert_eq!(statuses(&goals), [4]);
}

#[test]
fn id_and_stamp_say_which_goals_are_cancelled() {
    // Accepted at 10 s: id, stamp, return code, whether it is cancelled.
    let table = [
        (NO_GOAL, at(0), 0, true),
        (NO_GOAL, at(9), 0, false),
        (NO_GOAL, at(10), 0, true),
        (id(1), at(0), 0, true),
        (id(1), at(9), 0, true),
        (id(2), at(0), 2, false),
        (id(2), at(10), 0, true),
        (id(2), at(9), 0, false),
    ];
    for (goal, stamp, code, cancelled) in table {
        let mut goals = running();
        let (response, ended) = goals.cancel(&request(goal, stamp.clone()));
        let expected = (code, cancelled.then_some(id(1)), usize::from(cancelled));
        let found = (response.return_code, ended, response.goals_canceling.len());
        assert_eq!(found, expected, "{goal:?} {stamp:?}");
    }
    let mut goals = running();
    goals.progress(&at(12), &id(1), GoalStatus::Reached, "");
    assert_eq!(goals.cancel(&request(id(1), at(0))).0.return_code, 3);
    assert_eq!(goals.cancel(&request(NO_GOAL, at(0))).0, CancelGoalResponse::default());
}

#[test]
fn what_is_remembered_is_bounded() {
    let mut goals = Goals::default();
    for number in 1..=100 {
        goals.accept(&at(number.into()), id(number)).unwrap();
        assert!(goals.status().status_list.len() <= MOST_GOALS);
    }
    let told = (0..MOST_WAITING + 3).filter_map(|_| goals.wait(&id(100), ())).count();
    assert_eq!((told, goals.turned_away()), (3, 3));
    assert_eq!(goals.shut_down(&at(101)).len(), MOST_WAITING);
    goals.accept(&at(101 + KEPT_S as i32 + 1), id(101)).unwrap();
    assert_eq!(goals.status().status_list.len(), 1, "the others are too long ago");
}

proptest! {
    /// Whatever happens: one goal at most runs, everybody who asked is answered once, and nothing ends twice.
    #[test]
    fn everybody_is_answered_once(steps in prop::collection::vec((0..5_u8, 1..6_u8, 0..8_usize), 0..200)) {
        let (mut goals, mut asked, mut told) = (Goals::default(), 0_usize, Vec::new());
        for (i, (step, number, status)) in steps.into_iter().enumerate() {
            let now = at(i as i32);
            match step {
                0 => told.extend(goals.accept(&now, id(number)).unwrap_or_default()),
                1 => told.extend(goals.progress(&now, &id(number), GoalStatus::ALL[status], "")),
                2 => drop(goals.cancel(&request(id(number % 3), at(status as i32 * 20)))),
                3 => {
                    told.extend(goals.wait(&id(number), asked));
                    asked += 1;
                }
                _ => {}
            }
            let running = goals.status().status_list.iter().filter(|entry| entry.status < 4).count();
            prop_assert!(running <= 1);
        }
        told.extend(goals.shut_down(&at(1000)));
        let mut tickets: Vec<usize> = told.iter().map(|answer| answer.to).collect();
        tickets.sort_unstable();
        prop_assert_eq!(tickets, (0..asked).collect::<Vec<_>>());
    }
}
