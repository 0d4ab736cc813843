//! Liveliness tokens: how rmw_zenoh says which nodes, publishers, subscriptions and services there are.
//!
//! ```text
//! node      @ros2_lv/<domain>/<zid>/<nid>/<nid>/NN/<enclave>/<namespace>/<node>
//! endpoint  @ros2_lv/<domain>/<zid>/<nid>/<eid>/<kind>/<enclave>/<namespace>/<node>/<name>/<DDS type>/<hash>/<qos>
//! ```
//! In enclave, namespace and name each `/` is written `%`. Tokens of newer releases have more chunks after these; they
//! are left aside. An endpoint's token is declared after the endpoint and undeclared before it.

use crate::gid::Gid;
use crate::key::{Key, MAX_TYPE, parse_domain};
use crate::names::{NotARosName, RosName, is_part};
use crate::qos::{NotAQos, Qos};
use crate::types::RosType;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// The first chunk. It is verbatim: `**` alone never matches it.
const ROOT: &str = "@ros2_lv";
/// Longest token that is believed, in bytes.
pub const MAX_TOKEN: usize = 2048;

/// What to watch to learn of every endpoint whose name is in this namespace.
#[must_use]
pub fn watch_namespace(domain: u32, namespace: &RosName) -> String {
    format!("{ROOT}/{domain}/*/*/*/*/*/*/*/{}%$*/**", mangled(namespace))
}

/// A text that is no token.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum TokenError {
    /// Too few chunks, too long, or of something else.
    #[error("not a liveliness token of rmw_zenoh")]
    Shape,
    /// A chunk is not what it should be.
    #[error("{0:?} in a liveliness token of rmw_zenoh")]
    Chunk(String),
    /// Namespace or name.
    #[error("{0}")]
    Name(#[from] NotARosName),
    /// QoS.
    #[error("{0}")]
    Qos(#[from] NotAQos),
}

/// What an endpoint does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Publishes a topic.
    Publisher,
    /// Hears a topic.
    Subscription,
    /// Answers a service.
    Server,
    /// Asks a service.
    Client,
}

impl Kind {
    const ALL: [(Self, &'static str); 4] =
        [(Self::Publisher, "MP"), (Self::Subscription, "MS"), (Self::Server, "SS"), (Self::Client, "SC")];

    fn chunk(self) -> &'static str {
        Self::ALL.iter().find(|(kind, _)| *kind == self).map_or("", |(_, chunk)| chunk)
    }
}

/// A node, and the session that declares it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Node {
    /// `ROS_DOMAIN_ID`.
    pub domain: u32,
    /// The Zenoh session's id as Zenoh prints it.
    pub zid: String,
    /// The node's number in its session.
    pub nid: u64,
    /// Its namespace; `/` = none.
    pub namespace: RosName,
    /// Its bare name.
    pub name: String,
}

impl Node {
    /// With its namespace.
    #[must_use]
    pub fn full_name(&self) -> String {
        match self.namespace.as_str() {
            "/" => format!("/{}", self.name),
            namespace => format!("{namespace}/{}", self.name),
        }
    }

    /// Its own token.
    #[must_use]
    pub fn token(self) -> Token {
        Token { node: self, endpoint: None }
    }

    /// The token of one of its endpoints, whose number is unique in the session, nodes included.
    #[must_use]
    pub fn endpoint(&self, id: u64, kind: Kind, name: RosName, ros_type: RosType, qos: Qos) -> Token {
        let key = Key::new(self.domain, name, ros_type);
        Token { node: self.clone(), endpoint: Some(Endpoint { id, kind, key, qos }) }
    }
}

/// A publisher, a subscription, or either end of a service.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Endpoint {
    /// Its number in its session.
    pub id: u64,
    /// What it does.
    pub kind: Kind,
    /// Of which topic or service.
    pub key: Key,
    /// How.
    pub qos: Qos,
}

/// A node, or one of its endpoints.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Token {
    /// The node.
    pub node: Node,
    /// The endpoint; `None` = the token is the node's own.
    pub endpoint: Option<Endpoint>,
}

impl Token {
    /// What marks the endpoint's samples. It is the hash of the token as it was declared: for a token that was read,
    /// use [`Gid::of_token`] with its text, which may have more chunks than these.
    #[must_use]
    pub fn gid(&self) -> Gid {
        Gid::of_token(&self.to_string())
    }
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Node { domain, zid, nid, namespace, name } = &self.node;
        let (id, kind) =
            self.endpoint.as_ref().map_or((*nid, "NN"), |endpoint| (endpoint.id, endpoint.kind.chunk()));
        write!(f, "{ROOT}/{domain}/{zid}/{nid}/{id}/{kind}/%/{}/{name}", mangled(namespace))?;
        let Some(Endpoint { key, qos, .. }) = &self.endpoint else { return Ok(()) };
        write!(f, "/{}/{}/{}/{qos}", mangled(&key.name), key.type_name, key.hash)
    }
}

impl FromStr for Token {
    type Err = TokenError;

    fn from_str(text: &str) -> Result<Self, TokenError> {
        if text.len() > MAX_TOKEN {
            return Err(TokenError::Shape);
        }
        let chunks: Vec<&str> = text.split('/').collect();
        let [ROOT, domain, zid, nid, id, kind, _enclave, namespace, name, rest @ ..] = &chunks[..] else {
            return Err(TokenError::Shape);
        };
        let node = Node {
            domain: parse_domain(domain).ok_or_else(|| bad(domain))?,
            zid: zid
                .bytes()
                .all(|b| b.is_ascii_hexdigit())
                .then(|| (*zid).to_owned())
                .ok_or_else(|| bad(zid))?,
            nid: number(nid)?,
            namespace: demangled(namespace)?,
            name: is_part(name).then(|| (*name).to_owned()).ok_or_else(|| bad(name))?,
        };
        if *kind == "NN" {
            return Ok(node.token());
        }
        let kind = Kind::ALL.iter().find(|(_, chunk)| chunk == kind).ok_or_else(|| bad(kind))?.0;
        let [name, type_name, hash, qos, ..] = rest else { return Err(TokenError::Shape) };
        if let Some(wrong) =
            [type_name, hash].into_iter().find(|text| text.is_empty() || text.len() > MAX_TYPE)
        {
            return Err(bad(wrong));
        }
        let key = Key {
            domain: node.domain,
            name: demangled(name)?,
            type_name: (*type_name).to_owned(),
            hash: (*hash).to_owned(),
        };
        Ok(Self { node, endpoint: Some(Endpoint { id: number(id)?, kind, key, qos: qos.parse()? }) })
    }
}

fn mangled(name: &RosName) -> String {
    name.as_str().replace('/', "%")
}

fn demangled(chunk: &str) -> Result<RosName, NotARosName> {
    RosName::new(&chunk.replace('%', "/"))
}

fn number(chunk: &str) -> Result<u64, TokenError> {
    let digits = chunk.bytes().all(|byte| byte.is_ascii_digit());
    digits.then(|| chunk.parse().ok()).flatten().ok_or_else(|| bad(chunk))
}

fn bad(chunk: &str) -> TokenError {
    TokenError::Chunk(chunk.chars().take(64).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::{Message, Odometry};
    use proptest::prelude::*;

    const ODOM: &str = "@ros2_lv/0/a1b2c3/2/3/MP/%/%xtb_1/xtb_agent/%xtb_1%odom/nav_msgs::msg::dds_::Odometry_/\
        RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0/::,10:,:,:,,";

    fn agent() -> Node {
        Node {
            domain: 0,
            zid: "a1b2c3".into(),
            nid: 2,
            namespace: RosName::new("/xtb_1").unwrap(),
            name: "xtb_agent".into(),
        }
    }

    #[test]
    fn tokens_are_those_of_the_table() {
        let odom = RosName::new("/xtb_1/odom").unwrap();
        let token = agent().endpoint(3, Kind::Publisher, odom, Odometry::TYPE, Qos::DEFAULT);
        assert_eq!((token.to_string(), token.gid()), (ODOM.to_owned(), Gid::of_token(ODOM)));
        assert_eq!(ODOM.parse(), Ok(token));
        let node = agent().token();
        assert_eq!(node.to_string(), "@ros2_lv/0/a1b2c3/2/2/NN/%/%xtb_1/xtb_agent");
        assert_eq!(node.to_string().parse(), Ok(node));
        let root: Token = "@ros2_lv/7/ff/0/0/NN/%/%/talker".parse().unwrap();
        assert_eq!(root.node.full_name(), "/talker");
        assert_eq!(agent().full_name(), "/xtb_1/xtb_agent");
    }

    #[test]
    fn more_chunks_than_we_know_are_left_aside() {
        let more = format!("{ODOM}/cpu/and:more");
        assert_eq!(more.parse::<Token>().unwrap().to_string(), ODOM);
    }

    #[test]
    fn what_is_no_token_says_why() {
        assert_eq!("xtb/lab/xtb-1/alive".parse::<Token>(), Err(TokenError::Shape));
        assert_eq!("@ros2_lv/0/a/1/2/MP/%/%/n".parse::<Token>(), Err(TokenError::Shape));
        assert_eq!("@ros2_lv/0/a/1/2/XX/%/%/n".parse::<Token>(), Err(TokenError::Chunk("XX".into())));
        assert_eq!("@ros2_lv/0/a/1/x/MP/%/%/n/%t/T/H/::,1:,:,:,,".parse::<Token>(), Err(bad("x")));
        assert!(matches!("@ros2_lv/0/a/1/2/NN/%/a-b/n".parse::<Token>(), Err(TokenError::Name(_))));
        assert!(format!("{ODOM}/{}", "x".repeat(MAX_TOKEN)).parse::<Token>().is_err());
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "(@ros2_lv/)?[0-9a-zA-Z_/%:,]{0,120}") {
            if let Ok(token) = text.parse::<Token>() {
                prop_assert_eq!(token.to_string().parse(), Ok(token));
            }
        }

        #[test]
        fn a_chunk_that_is_spoilt_never_panics(at in 0..13_usize, chunk in "[^/]{0,8}") {
            let mut chunks: Vec<&str> = ODOM.split('/').collect();
            chunks[at] = &chunk;
            let _ = chunks.join("/").parse::<Token>();
        }
    }
}
