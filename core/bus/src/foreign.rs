//! What came in on keys that are none of ours: dropped and counted, and said once.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A session's counter. Clones share it.
#[derive(Debug, Clone, Default)]
pub(crate) struct ForeignKeys(Arc<AtomicU64>);

impl ForeignKeys {
    /// Something is dropped. Only the first is logged as a warning: a flood must not fill the log.
    pub(crate) fn dropped(&self, what: &str, key_expr: &str) {
        if self.0.fetch_add(1, Ordering::Relaxed) == 0 {
            tracing::warn!(
                "dropped {what} on {key_expr:?}, which is not a key of this project; further ones are only \
                 counted"
            );
        } else {
            tracing::debug!("dropped {what} on {key_expr:?}");
        }
    }

    pub(crate) fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    pub(crate) fn counter(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.0)
    }
}
