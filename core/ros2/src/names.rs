//! Names: ROS's own rules, a robot's name as a namespace, a node's name as one of our clients'.

use std::fmt;
use thiserror::Error;
use xtb_protocol::Name;
use xtb_protocol::keys::MAX_NAME;
use xxhash_rust::xxh3::xxh3_64;

/// Longest fully qualified name of ROS that is believed, in bytes; ROS itself stops at about as many.
pub const MAX_ROS_NAME: usize = 256;

/// A text that is no fully qualified name of ROS.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0:?} is not a name of ROS: /a/b, each part of A-Z, a-z, 0-9 and _, not beginning with a digit")]
pub struct NotARosName(String);

/// A fully qualified name: `/xtb_1/odom`, or `/` alone (the root namespace).
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RosName(String);

impl RosName {
    /// # Errors
    /// [`NotARosName`].
    pub fn new(text: &str) -> Result<Self, NotARosName> {
        let parts = || text.strip_prefix('/').is_some_and(|rest| rest.split('/').all(is_part));
        if text == "/" || (text.len() <= MAX_ROS_NAME && parts()) {
            Ok(Self(text.to_owned()))
        } else {
            Err(NotARosName(text.chars().take(64).collect()))
        }
    }

    /// The namespace of a robot: `xtb-1` is `/xtb_1`. Names of ours have no `_`, so no two robots share one. A digit
    /// must not come first: `7` is `/r_7` (and so is a robot called `r-7`: [`RosName::robots_collide`]).
    #[must_use]
    pub fn robot(robot: &Name) -> Self {
        let name = robot.as_str().replace('-', "_");
        let prefix = if name.starts_with(|first: char| first.is_ascii_digit()) { "r_" } else { "" };
        Self(format!("/{prefix}{name}"))
    }

    /// Whether two robots of a fleet would share a namespace.
    #[must_use]
    pub fn robots_collide(a: &Name, b: &Name) -> bool {
        a != b && Self::robot(a) == Self::robot(b)
    }

    /// A name of this namespace: `odom` becomes `/xtb_1/odom`; one that begins with `/` stays what it is.
    ///
    /// # Errors
    /// [`NotARosName`].
    pub fn resolve(&self, name: &str) -> Result<Self, NotARosName> {
        match (name.starts_with('/'), self.0.as_str()) {
            (true, _) => Self::new(name),
            (false, "/") => Self::new(&format!("/{name}")),
            (false, namespace) => Self::new(&format!("{namespace}/{name}")),
        }
    }

    /// With its first slash.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Without its first slash; empty for the root.
    #[must_use]
    pub fn relative(&self) -> &str {
        self.0.strip_prefix('/').unwrap_or(&self.0)
    }
}

impl fmt::Display for RosName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// Whether this is one part of a name: a letter or `_`, then letters, digits and `_`.
#[must_use]
pub fn is_part(text: &str) -> bool {
    text.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
        && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
}

/// What every client's name begins with that is a node of ROS.
const CLIENT_PREFIX: &str = "ros-";

/// A node of ROS as one of our clients: `teleop_twist` is `ros-teleop-twist`. A name that does not fit (capitals, too
/// long, anything that no node should be called) is made to fit, and ends in four digits of its hash, so that two
/// nodes hardly ever share one. Nodes of one name in different namespaces do: who is fenced goes by gid.
#[must_use]
pub fn client_name(node: &str) -> Name {
    const HASH: usize = 5;
    let room = MAX_NAME - CLIENT_PREFIX.len();
    let fitting = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let name = if (1..=room).contains(&node.len()) && node.chars().all(fitting) {
        node.replace('_', "-")
    } else {
        let part = node.chars().take(room - HASH).map(|c| c.to_ascii_lowercase());
        let part: String = part.map(|c| if fitting(c) && c != '_' { c } else { '-' }).collect();
        format!("{part}-{:04x}", xxh3_64(node.as_bytes()) & 0xffff)
    };
    ours(&format!("{CLIENT_PREFIX}{name}"))
}

/// A publisher whose node is not known, as one of our clients: as much of its gid as there is room for.
#[must_use]
pub fn unknown_client_name(gid: &crate::Gid) -> Name {
    ours(&format!("{CLIENT_PREFIX}{gid}").chars().take(MAX_NAME).collect::<String>())
}

/// A name that was made to follow our rules.
fn ours(text: &str) -> Name {
    match Name::new(text) {
        Ok(name) => name,
        Err(error) => unreachable!("{error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    #[test]
    fn a_robot_is_a_namespace() {
        assert_eq!(RosName::robot(&name("xtb-1")).as_str(), "/xtb_1");
        assert_eq!(RosName::robot(&name("7-of-9")).as_str(), "/r_7_of_9");
        assert!(RosName::robots_collide(&name("7"), &name("r-7")));
        assert!(!RosName::robots_collide(&name("7"), &name("7")));
    }

    #[test]
    fn names_resolve_in_their_namespace() {
        let robot = RosName::robot(&name("xtb-1"));
        assert_eq!(robot.resolve("range/front_0").unwrap().as_str(), "/xtb_1/range/front_0");
        assert_eq!(robot.resolve("/tf").unwrap().relative(), "tf");
        assert_eq!(RosName::new("/").unwrap().resolve("chatter").unwrap().as_str(), "/chatter");
        for bad in ["", "odom", "//", "/a//b", "/a/", "/1a", "/a-b", "/ä", &format!("/{}", "a".repeat(256))]
        {
            assert!(RosName::new(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_node_is_a_client() {
        assert_eq!(client_name("teleop_twist_keyboard").as_str(), "ros-teleop-twist-keyboard");
        let capital = client_name("RViz");
        assert!(capital.as_str().starts_with("ros-rviz-") && capital.as_str().len() == 13, "{capital}");
        assert_ne!(capital, client_name("rviz"));
        let long = "a".repeat(40);
        assert_ne!(client_name(&long), client_name(&format!("{long}b")));
        assert_eq!(client_name(&long).as_str().len(), MAX_NAME);
    }

    proptest! {
        #[test]
        fn whatever_a_node_is_called_it_has_a_client_name(node in ".{0,80}", gid: [u8; 16]) {
            prop_assert!(client_name(&node).as_str().starts_with("ros-"));
            prop_assert!(unknown_client_name(&crate::Gid(gid)).as_str().len() == MAX_NAME);
        }

        #[test]
        fn nodes_that_fit_never_share_one(a in "[a-z_][a-z0-9_]{0,27}", b in "[a-z_][a-z0-9_]{0,27}") {
            prop_assert_eq!(a == b, client_name(&a) == client_name(&b));
        }

        #[test]
        fn every_robot_has_a_valid_namespace(robot in "[a-z0-9-]{1,32}") {
            let namespace = RosName::robot(&name(&robot));
            prop_assert!(RosName::new(namespace.as_str()).is_ok());
        }
    }
}
