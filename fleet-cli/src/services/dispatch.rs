//! The dispatcher as a service.

pub mod store;
