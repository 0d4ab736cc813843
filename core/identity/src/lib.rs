//! Who belongs to a fleet: names, roles and what each role may do; the registry, and the file that a robot, a
//! person or a service enrols with. Pure: texts, bytes and times are arguments.
//!
//! * [`Registry`]: all identities of a fleet, with generation and expiry; the router's rules follow from it
//!   (`xtb-bus`, `acl.rs`), and nothing else decides who comes in.
//! * [`Identity`]: what one of them holds: fleet, name, role, routers, CA, certificate and key.
//! * [`Role`] and [`Action`]: what the programs refuse by themselves, at once and in words.
//! * [`certificate`]: what a certificate says. `issue` (feature of the same name): the fleet's CA.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod certificate;
mod common_name;
mod identity;
#[cfg(feature = "issue")]
pub mod issue;
mod registry;
mod role;

pub use common_name::CommonName;
pub use identity::{Identity, IdentityError, Page};
pub use registry::{Registry, RegistryEntry, RegistryError, Router, token_digest};
pub use role::{Action, Role, UnknownRole};
