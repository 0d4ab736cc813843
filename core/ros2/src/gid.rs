//! The sixteen bytes that mark an endpoint in its samples.

use std::fmt;
use xxhash_rust::xxh3::xxh3_128;

/// Whose sample it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Gid(pub [u8; 16]);

impl Gid {
    /// The gid that rmw_zenoh gives the endpoint of this liveliness token: its XXH3-128, low half first. Other
    /// implementations (hiroz, zenoh-ros2-sdk) give theirs other ones.
    #[must_use]
    pub fn of_token(token: &str) -> Self {
        Self(xxh3_128(token.as_bytes()).to_le_bytes())
    }
}

impl fmt::Display for Gid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the package `xxhash` of Python, 3.6.
    #[test]
    fn a_gid_is_the_hash_of_the_token() {
        assert_eq!(Gid::of_token("").to_string(), "7f498d4624c30160d8984701d306aa99");
        let token = "@ros2_lv/0/a1b2c3/2/3/MP/%/%xtb_1/xtb_agent/%xtb_1%odom/nav_msgs::msg::dds_::Odometry_/\
            RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0/::,10:,:,:,,";
        assert_eq!(Gid::of_token(token).to_string(), "e424dd1eb91858a2dc7f41f4d6bdffca");
    }
}
