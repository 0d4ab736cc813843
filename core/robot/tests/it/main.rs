//! The tests of a whole robot without its lines and links, one program.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod assignments;
mod authority;
mod bench;
mod board;
mod dialogues;
mod hardware;
mod lines;
mod params;
mod robot;
mod unseen;
