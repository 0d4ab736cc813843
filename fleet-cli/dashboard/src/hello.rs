//! What a page is told first: who serves it, who it is, and what that one may do.

use super::people::{By, Person};
use serde::Serialize;
use xtb_identity::Role;
use xtb_protocol::Name;

/// Who serves the page, and what it may do.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Hello {
    /// The fleet.
    pub(super) fleet: Name,
    /// The name under which this page's commands go out.
    pub(super) client: Name,
    /// The program's.
    pub(super) version: &'static str,
    /// Whether commands are taken.
    pub(super) writable: bool,
    /// Why they are not.
    pub(super) why_not: Option<String>,
    /// Whether an emergency stop is taken; so it is from those who may do nothing else.
    pub(super) estop: bool,
    /// Who has signed in; `None` = nobody is asked to.
    pub(super) who: Option<Who>,
    /// False: a recording is played.
    pub(super) live: bool,
}

/// Who has signed in.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Who {
    name: Name,
    role: Role,
    /// What the role may do.
    may: &'static str,
    /// With a certificate: there is nothing to sign out of.
    certificate: bool,
}

impl From<&Person> for Who {
    fn from(Person { name, role, by }: &Person) -> Self {
        let certificate = matches!(by, By::Certificate(_));
        Self { name: name.clone(), role: *role, may: role.allows(), certificate }
    }
}
