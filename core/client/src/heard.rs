//! Who has answered a question to all robots: what a robot says there counts as much as when it is asked by itself.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_protocol::Name;

/// Robots at most, twice those of the largest fleet: who answers for more has invented them. Those who are asked by
/// name have their place.
const MOST_ROBOTS: usize = 2048;
/// Answers of a robot at most: the second one tells all.
const MOST_ANSWERS: usize = 2;

/// By robot, the most answers to one question: more than one if several programs answer in its name.
#[derive(Debug)]
pub(crate) struct Heard<A>(Arc<Mutex<BTreeMap<Name, watch::Sender<Vec<A>>>>>);

impl<A> Clone for Heard<A> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<A> Default for Heard<A> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<A: Clone> Heard<A> {
    /// All that has come for it to one question until now.
    pub(crate) fn says(&self, robot: &Name, answers: &[A]) {
        self.change(robot, |most| {
            let more = answers.len().min(MOST_ANSWERS) > most.len();
            if more {
                *most = answers.iter().take(MOST_ANSWERS).cloned().collect();
            }
            more
        });
    }

    /// Another one has come for it to the only question.
    pub(crate) fn adds(&self, robot: &Name, answer: A) {
        self.change(robot, |all| {
            let more = all.len() < MOST_ANSWERS;
            if more {
                all.push(answer);
            }
            more
        });
    }

    fn change(&self, robot: &Name, change: impl FnOnce(&mut Vec<A>) -> bool) {
        let mut heard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if heard.len() < MOST_ROBOTS || heard.contains_key(robot) {
            heard.entry(robot.clone()).or_default().send_if_modified(change);
        }
    }

    /// What it says, as it comes; none yet: it has not answered.
    pub(crate) fn answers(&self, robot: &Name) -> watch::Receiver<Vec<A>> {
        let mut heard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        heard.entry(robot.clone()).or_default().subscribe()
    }

    /// Who has answered.
    pub(crate) fn robots(&self) -> Vec<Name> {
        let heard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        heard.iter().filter(|(_, said)| !said.borrow().is_empty()).map(|(robot, _)| robot.clone()).collect()
    }
}

/// A task that ends with its owner.
pub(crate) struct AbortOnDrop(pub(crate) JoinHandle<()>);

impl Drop for AbortOnDrop {
    fn drop(&mut self) {
        self.0.abort();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::name;

    #[test]
    fn who_answers_in_thousands_of_names_or_without_end_is_not_kept_and_takes_nobodys_place() {
        let heard = Heard::default();
        let asked = heard.answers(&name("xtb-1"));
        for n in 0..3000 {
            heard.adds(&name(&format!("ghost-{n}")), ());
            heard.adds(&name("ghost-1"), ());
        }
        heard.adds(&name("xtb-1"), ());
        assert_eq!(asked.borrow().len(), 1);
        assert_eq!(heard.robots().len(), MOST_ROBOTS);
        assert_eq!(heard.answers(&name("ghost-1")).borrow().len(), MOST_ANSWERS);
        heard.says(&name("xtb-1"), &[(); 9]);
        assert_eq!(asked.borrow().len(), MOST_ANSWERS);
    }
}
