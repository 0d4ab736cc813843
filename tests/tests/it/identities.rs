//! Who may come in, and what each may do there: over real Zenoh with TLS.

mod attacks;
mod keys;
mod matrix;
mod oracle;
mod registry;
pub(crate) mod robot;
mod session;

use fleet_tests::identities::Pki;
use xtb_identity::Role;

/// One identity of each role, by name.
const EVERYBODY: [(&str, Role); 11] = [
    ("xtb-1", Role::Robot),
    ("vera", Role::Viewer),
    ("alice", Role::Operator),
    ("page", Role::Dashboard),
    ("tasks", Role::Dispatcher),
    ("lights", Role::Traffic),
    ("atlas", Role::Map),
    ("tracker", Role::Tracker),
    ("archive", Role::Recorder),
    ("world", Role::Simulator),
    ("lab-2", Role::Router),
];
/// One who was an operator.
const REVOKED: &str = "eve";

/// A PKI with all of them.
fn everybody() -> Pki {
    let mut pki = Pki::new(&EVERYBODY);
    pki.add(REVOKED, Role::Operator);
    pki.change(REVOKED, |entry| entry.revoked = true);
    pki.write();
    pki
}
