//! Maps from outside: files, messages, queries and what a check finds.

#![allow(clippy::unwrap_used)]

mod any;
mod check;
mod drawing;
mod hash;
mod ros;
mod wire;
mod zones;
