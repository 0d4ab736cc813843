//! Which node is behind a sample: the publishers and clients whose tokens have been heard.

use crate::gid::Gid;
use crate::names::RosName;
use crate::token::{Kind, Token};
use std::collections::BTreeMap;

/// Most endpoints that are remembered. One more is not, and counted: those that are there already stay known.
pub const MOST: usize = 4096;

/// Publishers and clients of a domain; a pure table, fed with the tokens that come and go.
#[derive(Debug, Clone, Default)]
pub struct Graph {
    endpoints: BTreeMap<Gid, Token>,
    overflowed: u64,
}

impl Graph {
    /// A token was declared; what is no publisher and no client changes nothing. Of a text that is no token nothing
    /// is learnt.
    pub fn declared(&mut self, token: &str) {
        let Ok(read) = token.parse::<Token>() else { return };
        let speaks = |kind| matches!(kind, Kind::Publisher | Kind::Client);
        if !read.endpoint.as_ref().is_some_and(|endpoint| speaks(endpoint.kind)) {
            return;
        }
        let gid = Gid::of_token(token);
        if self.endpoints.len() < MOST || self.endpoints.contains_key(&gid) {
            self.endpoints.insert(gid, read);
        } else {
            self.overflowed += 1;
        }
    }

    /// A token is gone: whose samples end with it.
    pub fn undeclared(&mut self, token: &str) -> Option<Gid> {
        let gid = Gid::of_token(token);
        self.endpoints.remove(&gid).map(|_| gid)
    }

    /// Whose sample it is; `None` = no token has this gid, as with implementations that choose it themselves.
    #[must_use]
    pub fn find(&self, gid: &Gid) -> Option<&Token> {
        self.endpoints.get(gid)
    }

    /// Everybody who publishes this topic, whatever the type.
    pub fn publishers<'a>(&'a self, topic: &'a RosName) -> impl Iterator<Item = (&'a Gid, &'a Token)> {
        self.endpoints.iter().filter(move |(_, token)| {
            let of_topic = |kind, name| kind == Kind::Publisher && name == topic;
            token.endpoint.as_ref().is_some_and(|endpoint| of_topic(endpoint.kind, &endpoint.key.name))
        })
    }

    /// Endpoints that there was no room for.
    #[must_use]
    pub fn overflowed(&self) -> u64 {
        self.overflowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn token(id: usize, kind: &str) -> String {
        format!("@ros2_lv/0/a1/1/{id}/{kind}/%/%/teleop/%xtb_1%cmd_vel/T/RIHS01_0/::,10:,:,:,,")
    }

    #[test]
    fn a_publisher_is_known_from_its_token_to_its_end() {
        let (mut graph, topic) = (Graph::default(), RosName::new("/xtb_1/cmd_vel").unwrap());
        for text in [&token(2, "MP"), &token(3, "MS"), &format!("{}/more", token(4, "MP")), "nonsense"] {
            graph.declared(text);
        }
        assert_eq!(graph.publishers(&topic).count(), 2);
        let gid = Gid::of_token(&token(2, "MP"));
        assert_eq!(graph.find(&gid).unwrap().node.full_name(), "/teleop");
        assert_eq!(graph.undeclared(&token(2, "MP")), Some(gid));
        assert_eq!((graph.undeclared(&token(2, "MP")), graph.find(&gid)), (None, None));
        assert!(graph.find(&Gid::of_token(&format!("{}/more", token(4, "MP")))).is_some());
    }

    #[test]
    fn what_there_is_no_room_for_is_counted() {
        let mut graph = Graph::default();
        (0..MOST + 2).for_each(|id| graph.declared(&token(id, "MP")));
        assert_eq!((graph.endpoints.len(), graph.overflowed()), (MOST, 2));
        graph.declared(&token(0, "MP"));
        assert_eq!(graph.overflowed(), 2, "known already");
    }
}
