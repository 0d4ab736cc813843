//! Who is there, as far as a session's watches of presence were told.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use zenoh::key_expr::keyexpr;

/// Who is there, as far as a session's watches were told. Clones share it.
///
/// Zenoh (1.10) sends a question for presence to the router before it answers what it knows itself, and it knows
/// what the session watches. When the router's word that this was all comes in between, the question ends without
/// that part. So what the watches know is added to the answers.
#[derive(Debug, Clone, Default)]
pub(crate) struct Watched(Arc<Mutex<Vec<Weak<Keys>>>>);

/// What one watch was told: the keys that are alive.
pub(crate) type Keys = Mutex<BTreeSet<String>>;

impl Watched {
    /// What one more watch knows: nothing yet.
    pub(crate) fn begin(&self) -> Arc<Mutex<BTreeSet<String>>> {
        let there = Arc::default();
        let mut watches = lock(&self.0);
        watches.retain(|watch| watch.strong_count() > 0);
        watches.push(Arc::downgrade(&there));
        there
    }

    /// Those on `key_expr`.
    pub(crate) fn on(&self, key_expr: &str) -> BTreeSet<String> {
        let Ok(asked) = keyexpr::new(key_expr) else { return BTreeSet::new() };
        let mut found = BTreeSet::new();
        for there in lock(&self.0).iter().filter_map(Weak::upgrade) {
            let there = lock(&there);
            if !asked.is_wild() {
                found.extend(there.get(key_expr).cloned());
                continue;
            }
            let is_asked = |key: &&String| keyexpr::new(key.as_str()).is_ok_and(|key| asked.includes(key));
            found.extend(there.iter().filter(is_asked).cloned());
        }
        found
    }
}

/// A panic elsewhere does not make the keys unreadable.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
