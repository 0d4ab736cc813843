//! What people read of tasks, and how long it may be; robots and reasons are in `xtb_client::text`.

pub(crate) mod task;
pub(crate) mod width;
