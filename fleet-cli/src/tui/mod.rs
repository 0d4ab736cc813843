//! Pictures and screens in the terminal.

pub mod picture;
pub(crate) mod top;
