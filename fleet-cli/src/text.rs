//! What people read: reasons, robots and tasks in words.

pub(crate) mod reasons;
pub(crate) mod robot;
pub(crate) mod task;
