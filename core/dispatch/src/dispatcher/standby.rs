//! A dispatcher with a stand-by: who else has to have what is acknowledged, and when nothing may be done.

use super::Dispatcher;
use crate::task_store::record::Record;
use crate::write_queue::OnWritten;
use std::collections::BTreeSet;
use xtb_protocol::Name;

impl Dispatcher {
    /// From now on this copy has to have what is acknowledged, or nobody; it goes to the ledger if that says
    /// otherwise.
    pub fn pair(&mut self, now_ms: u64, copy: Option<u64>) {
        let known = self.writes.pair().unwrap_or(self.store.pair());
        if known != copy && self.store.ledger().is_some() && self.writes.may_try(now_ms) {
            self.writes.push(now_ms, vec![Record::Pair { copy }], OnWritten::Nothing);
        }
    }

    /// Nothing is written, and no robot is asked for anything, for this reason: as if the dispatcher had been
    /// killed, until `None` is said.
    pub fn hold(&mut self, why: Option<String>) {
        self.writes.hold(why);
    }

    /// Robots whose states come in.
    #[must_use]
    pub fn online(&self, now_ms: u64) -> BTreeSet<Name> {
        let online = self.robots.iter().filter(|(_, robot)| robot.is_online(now_ms, &self.settings));
        online.map(|(name, _)| name.clone()).collect()
    }
}
