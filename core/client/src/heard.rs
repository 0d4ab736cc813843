//! Who has answered a question to all robots: what a robot says there counts as much as when it is asked by itself.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_protocol::Name;

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
        let mut heard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        heard.entry(robot.clone()).or_default().send_if_modified(|most| {
            let more = answers.len() > most.len();
            if more {
                *most = answers.to_vec();
            }
            more
        });
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
