//! The key of a topic or service: `<domain>/<name without its first slash>/<DDS type>/<type hash>`.

use crate::names::{MAX_ROS_NAME, NotARosName, RosName};
use crate::types::RosType;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Longest DDS type or hash that is believed, in bytes.
pub(crate) const MAX_TYPE: usize = 256;

/// A text that is no key.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum KeyError {
    /// Fewer than four chunks, or longer than any key.
    #[error("not a key of rmw_zenoh: <domain>/<name>/<type>/<hash>")]
    Shape,
    /// The first chunk is no number.
    #[error("{0:?} is not a ROS domain")]
    Domain(String),
    /// The middle is no name.
    #[error("{0}")]
    Name(#[from] NotARosName),
}

/// Where the samples of a topic, or the requests to a service, go.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    /// `ROS_DOMAIN_ID`.
    pub domain: u32,
    /// Of the topic or service.
    pub name: RosName,
    /// See [`RosType::dds_name`].
    pub type_name: String,
    /// `RIHS01_…`; of Humble `TypeHashNotSupported`.
    pub hash: String,
}

impl Key {
    /// Of a topic or service of this type.
    #[must_use]
    pub fn new(domain: u32, name: RosName, ros_type: RosType) -> Self {
        Self { domain, name, type_name: ros_type.dds_name(), hash: ros_type.hash.to_owned() }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}/{}/{}", self.domain, self.name.relative(), self.type_name, self.hash)
    }
}

impl FromStr for Key {
    type Err = KeyError;

    fn from_str(text: &str) -> Result<Self, KeyError> {
        let (domain, rest) = text.split_once('/').ok_or(KeyError::Shape)?;
        let (rest, hash) = rest.rsplit_once('/').ok_or(KeyError::Shape)?;
        let (name, type_name) = rest.rsplit_once('/').ok_or(KeyError::Shape)?;
        if hash.is_empty() || type_name.is_empty() || hash.len().max(type_name.len()) > MAX_TYPE {
            return Err(KeyError::Shape);
        }
        if name.is_empty() || name.len() >= MAX_ROS_NAME {
            return Err(KeyError::Shape);
        }
        Ok(Self {
            domain: parse_domain(domain)
                .ok_or_else(|| KeyError::Domain(domain.chars().take(20).collect()))?,
            name: RosName::new(&format!("/{name}"))?,
            type_name: type_name.to_owned(),
            hash: hash.to_owned(),
        })
    }
}

/// Decimal digits only: no sign.
pub(crate) fn parse_domain(text: &str) -> Option<u32> {
    text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::{Message, Odometry, SendGoal, Service, Trigger};
    use proptest::prelude::*;

    #[test]
    fn the_keys_are_those_of_the_table() {
        let table = [
            (
                "/xtb_1/odom",
                Odometry::TYPE,
                "0/xtb_1/odom/nav_msgs::msg::dds_::Odometry_/RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
            ),
            (
                "/xtb_1/estop",
                Trigger::TYPE,
                "0/xtb_1/estop/std_srvs::srv::dds_::Trigger_/RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
            ),
            (
                "/xtb_1/navigate_to_pose/_action/send_goal",
                SendGoal::TYPE,
                "0/xtb_1/navigate_to_pose/_action/send_goal/nav2_msgs::action::dds_::NavigateToPose_SendGoal_/RIHS01_a4fcb3bee1bf32e21a0e541a943b221aa0826996e2c98f079b47022b256f48b5",
            ),
        ];
        for (name, ros_type, text) in table {
            let key = Key::new(0, RosName::new(name).unwrap(), ros_type);
            assert_eq!(key.to_string(), text);
            assert_eq!(text.parse(), Ok(key));
        }
    }

    #[test]
    fn what_is_no_key_says_why() {
        assert_eq!("".parse::<Key>(), Err(KeyError::Shape));
        assert_eq!("0/t/h".parse::<Key>(), Err(KeyError::Shape));
        assert_eq!("+1/a/t/h".parse::<Key>(), Err(KeyError::Domain("+1".into())));
        assert!(matches!("1/a-b/t/h".parse::<Key>(), Err(KeyError::Name(_))));
        assert!("1/a/t/".parse::<Key>().is_err());
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "[0-9a-z_/%+-]{0,60}") {
            if let Ok(key) = text.parse::<Key>() {
                prop_assert_eq!(key.to_string().parse(), Ok(key));
            }
        }
    }
}
