//! ROS 2 over rmw_zenoh, without a bridge: what goes over the wire, and what it means for a robot of ours. Pure:
//! bytes, texts, ids and times are arguments; opening sessions is `xtb-bus`' part.
//!
//! From the wire inwards:
//!
//! 1. [`names`], [`key`], [`qos`], [`token`], [`attachment`], [`gid`]: how rmw_zenoh names a topic, says who is
//!    there, and marks each sample. [`graph`]: which node publishes what.
//! 2. [`cdr`] and [`types`]: messages as bytes. [`offer`]: the one table of what a robot offers, with types and QoS.
//! 3. [`convert`]: a robot's state as messages of ROS, its URDF, the fleet's map; a pose of ROS as ours.
//! 4. [`freshness`], [`drive`], [`command`]: which velocity command counts, what it asks of a car, and whose drive the
//!    robot. [`action`]: the goals of NavigateToPose.
//!
//! Whatever comes in is bounded and checked here; nothing panics on any bytes. Who may drive is not decided here:
//! a ROS node is a client with a name ([`names::client_name`]), and needs the lease as everybody does.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod action;
pub mod attachment;
pub mod cdr;
pub mod command;
pub mod convert;
pub mod drive;
pub mod freshness;
pub mod gid;
pub mod graph;
pub mod key;
pub mod names;
pub mod offer;
pub mod qos;
pub mod token;
pub mod types;

pub use attachment::Attachment;
pub use gid::Gid;
pub use graph::Graph;
pub use key::Key;
pub use names::RosName;
pub use qos::Qos;
pub use token::Token;
