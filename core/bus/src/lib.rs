//! The only crate that opens Zenoh: sessions, typed publishers, queries, presence.
//!
//! Everything else names channels by [`keys`](xtb_protocol::keys) and messages by their types; what
//! Zenoh needs to know (quality of service, targets, time-outs, its traps) stays in here.
//!
//! Nothing comes in on a key that is not exactly one of ours (see
//! [`received`](xtb_protocol::keys::received)): it is dropped here, and counted. The `_raw` functions are for
//! tools that show what is really on the network.
//!
//! Rules that hold for every callback given to this crate: it runs on one of Zenoh's threads, so it
//! must not block; a callback that blocks hurts every session of the process.

mod acl;
mod attached;
mod channel;
mod enrolled;
mod foreign;
mod key_expr;
pub mod link_problem;
mod links;
mod presence;
pub mod private_file;
mod query;
mod session;
mod tls;
mod watched;

pub use acl::{AccessControl, Ros2Domain};
pub use attached::{Attached, AttachedPublisher, AttachedQuestion};
pub use channel::{EventPublisher, Incoming, Publisher, Subscription};
pub use enrolled::{EnrolError, Enrolled};
pub use key_expr::intersect;
pub use link_problem::LinkProblem;
pub use links::{Link, Links};
pub use presence::{PresenceToken, PresenceWatch};
pub use query::{Question, Service};
pub use session::{Bus, BusError, LINK_LEASE, LinkWatch, Opening, SessionRole, open};
pub use tls::Tls;
