//! A robot towards a master control, with a dispatcher that is played; every message against the official schemas.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod acceptance;
mod bench;
mod instant;
mod messages;
mod orders;
mod schema;
mod storms;
