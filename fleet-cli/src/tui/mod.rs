//! Pictures in the terminal.

pub mod picture;
