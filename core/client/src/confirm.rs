//! Whether a robot did what somebody answered in its name: its own state has to show it.
//!
//! An answer alone proves little: whoever declares a queryable on a robot's key can give one, for robots that are
//! not there too. So a robot counts as stopped only if it is present, exactly one program answers for it, and a
//! state that it made after the answer shows the stop.

use crate::client::Client;
use crate::crowd::Crowd;
use crate::multi_robot::StopOutcome;
use std::collections::BTreeSet;
use std::time::Duration;
use tokio::task::JoinSet;
use tokio::time::Instant;
use xtb_protocol::Name;
use xtb_protocol::messages::RobotState;

/// Between two questions for the state at first: a robot makes one each 50 ms.
const AGAIN_FIRST: Duration = Duration::from_millis(60);
/// And later.
const AGAIN_MOST: Duration = Duration::from_millis(500);
/// Questions on their way at most.
const IN_FLIGHT: usize = 16;
/// A state that shows it comes within this, or within some round trips.
const SHOWS_WITHIN: Duration = Duration::from_millis(1500);

/// What a robot's states say, as they come in. Pure.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Confirmation {
    /// The first state that came after the answer: it may have been made before it.
    first: Option<(u64, u64)>,
    shown: bool,
    /// Boots that said something.
    epochs: BTreeSet<u64>,
    /// The most states that one question brought.
    voices: usize,
}

impl Confirmation {
    /// The answers to one question for the state; `so` = it shows what was asked for.
    fn heard(&mut self, states: &[RobotState], so: impl Fn(&RobotState) -> bool) {
        self.voices = self.voices.max(states.len());
        for state in states {
            self.epochs.insert(state.epoch);
            let (epoch, seq) = *self.first.get_or_insert((state.epoch, state.seq));
            self.shown |= state.epoch == epoch && state.seq > seq && so(state);
        }
    }

    /// `None` = nothing is certain yet.
    fn verdict(&self) -> Option<StopOutcome> {
        match self {
            Self { voices: 2.., .. } => Some(StopOutcome::Ambiguous),
            Self { epochs, .. } if epochs.len() > 1 => Some(StopOutcome::Ambiguous),
            Self { shown: true, .. } => Some(StopOutcome::Stopped),
            _ => None,
        }
    }
}

/// Asks a robot that was answered for whether it is there, and for its state until that shows `so`; of many robots
/// a look at all of them can tell it sooner.
pub(crate) async fn confirm(
    client: &Client,
    robot: &Name,
    crowd: &Crowd,
    so: fn(&RobotState) -> bool,
) -> StopOutcome {
    tokio::select! {
        outcome = seen(robot, crowd, so) => outcome,
        outcome = asked(client, robot, crowd, so) => outcome,
    }
}

/// As looks at all robots show it.
async fn seen(robot: &Name, crowd: &Crowd, so: fn(&RobotState) -> bool) -> StopOutcome {
    let (mut looks, mut confirmation) = (crowd.looks(), Confirmation::default());
    loop {
        let look = looks.next().await;
        confirmation.heard(look.states(robot), so);
        match (confirmation.verdict(), &look.alive) {
            (Some(_), Ok(there)) if !there.contains(robot) => return StopOutcome::Absent,
            (Some(verdict), Ok(_)) => return verdict,
            _ => {}
        }
    }
}

/// As it says when it is asked by itself.
async fn asked(client: &Client, robot: &Name, crowd: &Crowd, so: fn(&RobotState) -> bool) -> StopOutcome {
    tokio::time::sleep(crowd.head_start(AGAIN_FIRST)).await;
    let (there, shown) = tokio::join!(client.is_alive(robot), shows(client, robot, crowd, so));
    match there {
        // Nobody of this name is there: whoever answered is somebody else.
        Ok(false) => StopOutcome::Absent,
        Ok(true) => shown,
        Err(failure) => {
            tracing::debug!("whether {robot} is there: {failure}");
            StopOutcome::Unconfirmed
        }
    }
}

/// The questions are sent without waiting for the answers of those before: a slow link costs one round trip.
async fn shows(client: &Client, robot: &Name, crowd: &Crowd, so: fn(&RobotState) -> bool) -> StopOutcome {
    let within = client
        .round_trip()
        .patience(SHOWS_WITHIN + crowd.pause(AGAIN_FIRST) + 4 * crowd.head_start(AGAIN_FIRST));
    let give_up = Instant::now() + within;
    let (mut confirmation, mut asking) = (Confirmation::default(), JoinSet::new());
    let (mut next, mut pause) = (Instant::now(), AGAIN_FIRST);
    loop {
        tokio::select! {
            biased;
            Some(states) = asking.join_next() => {
                let states: Vec<RobotState> = states.unwrap_or_default();
                confirmation.heard(&states, so);
                if let Some(verdict) = confirmation.verdict() {
                    return verdict;
                }
            }
            () = tokio::time::sleep_until(give_up) => return StopOutcome::Unconfirmed,
            () = tokio::time::sleep_until(next), if asking.len() < IN_FLIGHT => {
                asking.spawn(states(client.clone(), robot.clone(), within));
                next = Instant::now() + crowd.pause(pause);
                pause = (pause * 3 / 2).min(AGAIN_MOST);
            }
        }
    }
}

async fn states(client: Client, robot: Name, within: Duration) -> Vec<RobotState> {
    let key = client.keys().robot(&robot).state();
    match client.bus().get(&key, within).await {
        Ok(answers) => {
            let states = answers.iter().filter_map(|answer| answer.decode::<RobotState>().ok());
            states.filter(|state| state.robot == robot).collect()
        }
        Err(error) => {
            tracing::debug!("{error}");
            Vec::new()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{self, FakeRobot, name};
    use xtb_protocol::messages::Latch;

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn looks_at_all_of_many_show_who_stands_and_who_drives_on() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robots = [FakeRobot::start(&client, "xtb-1").await, FakeRobot::start(&client, "xtb-2").await];
        robots[0].lock().state.latches.push(fake::latch(Latch::Estop, "me", false));
        let crowd = Crowd::default();
        let _many = vec![crowd.clone(); 100];
        let _looking = crowd.together(&client);
        let latched = |state: &RobotState| !state.latches.is_empty();
        assert_eq!(seen(&name("xtb-1"), &crowd, latched).await, StopOutcome::Stopped);
        let another = client.another().await;
        let _second = FakeRobot::start(&another, "xtb-1").await; // of the same name
        assert_eq!(seen(&name("xtb-1"), &crowd, latched).await, StopOutcome::Ambiguous);
        let other = name("xtb-2");
        tokio::select! {
            outcome = seen(&other, &crowd, latched) => panic!("it drives on: {outcome:?}"),
            () = async { let mut looks = crowd.looks(); for _ in 0..4 { looks.next().await; } } => {}
        }
    }

    fn state(epoch: u64, seq: u64) -> RobotState {
        RobotState { epoch, seq, ..fake::state("xtb-1") }
    }

    fn verdict(questions: &[&[RobotState]]) -> Option<StopOutcome> {
        let mut confirmation = Confirmation::default();
        questions.iter().for_each(|states| confirmation.heard(states, |state| state.goal.is_none()));
        confirmation.verdict()
    }

    #[test]
    fn only_a_state_made_after_the_first_one_proves_something() {
        assert_eq!(verdict(&[]), None);
        assert_eq!(verdict(&[&[state(7, 5)], &[state(7, 5)], &[]]), None);
        assert_eq!(verdict(&[&[state(7, 5)], &[state(7, 6)]]), Some(StopOutcome::Stopped));
        let goal = Some(fake::goal(xtb_protocol::Uuid::nil(), xtb_protocol::messages::GoalStatus::Running));
        let drives = RobotState { goal, ..state(7, 6) };
        assert_eq!(verdict(&[&[state(7, 5)], &[drives]]), None);
    }

    #[test]
    fn two_who_answer_are_neither_believed() {
        assert_eq!(verdict(&[&[state(7, 5), state(7, 6)]]), Some(StopOutcome::Ambiguous));
        assert_eq!(verdict(&[&[state(7, 5)], &[state(8, 6)]]), Some(StopOutcome::Ambiguous));
    }
}
