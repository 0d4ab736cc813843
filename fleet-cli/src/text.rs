//! What people read of tasks; robots and reasons are in `xtb_client::text`.

pub(crate) mod task;
