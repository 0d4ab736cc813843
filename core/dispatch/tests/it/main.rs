//! The dispatcher against a model: robots, a lossy network and a ledger with faults, in virtual time.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod alerts;
mod assigning;
mod bench;
mod dialogues;
mod extend;
mod homes;
mod journal;
mod life;
mod model;
mod other_map;
mod pages;
mod predicted_free;
mod robots;
mod standby;
mod storms;
mod suspended;
mod travel_cost;
mod trouble;
