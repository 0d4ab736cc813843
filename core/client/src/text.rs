//! What people read of robots: states and names in words.

pub mod event;
pub mod reasons;
pub mod robot;
