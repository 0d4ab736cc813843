//! What people read of robots: states and names in words.

pub mod reasons;
pub mod robot;
