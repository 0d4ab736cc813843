//! The dispatcher against a model: robots, a lossy network and a ledger with faults, in virtual time.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod assigning;
mod bench;
mod ground;
mod journal;
mod life;
mod model;
mod other_map;
mod pages;
mod robots;
mod soon;
mod storms;
mod suspended;
mod trouble;
