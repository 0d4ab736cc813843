//! What the agents of one program share, so that many fit into it.

use crate::map_reader::MapShelf;
use std::sync::Arc;

/// What they share. A robot's own agent has one for itself.
#[derive(Debug, Clone, Default)]
pub struct Shared {
    /// Maps that are prepared already: a large one takes megabytes.
    pub(crate) maps: Arc<MapShelf>,
}
