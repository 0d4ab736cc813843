//! Key expressions, compared as Zenoh compares them.

use zenoh::key_expr::keyexpr;

/// Whether there are keys that both expressions name; what is no key expression names none.
#[must_use]
pub fn intersect(a: &str, b: &str) -> bool {
    match (keyexpr::new(a), keyexpr::new(b)) {
        (Ok(a), Ok(b)) => a.intersects(b),
        _ => false,
    }
}
