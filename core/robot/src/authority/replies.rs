//! Idempotency: the same request id again gets the same reply and does nothing twice.

use std::collections::VecDeque;
use xtb_protocol::messages::Reply;
use xtb_protocol::{Name, Uuid};

/// Replies kept for each client; chosen, not measured.
pub const REPLIES_PER_CLIENT: usize = 64;
/// Clients whose replies are kept; the one that was silent longest is forgotten first. Chosen, not measured.
pub const CLIENTS: usize = 64;

/// The last replies, by client; bounded both ways.
#[derive(Debug, Clone, Default)]
pub struct ReplyBook {
    clients: VecDeque<(Name, VecDeque<Reply>)>,
}

impl ReplyBook {
    /// The reply that this request got before.
    #[must_use]
    pub fn find(&self, client: &Name, id: Uuid) -> Option<&Reply> {
        let (_, replies) = self.clients.iter().find(|(name, _)| name == client)?;
        replies.iter().find(|reply| reply.id == id)
    }

    /// Remembers a reply. The entry of `holder` is never the one that is forgotten: strangers with many
    /// names cannot make the robot do twice what it did for the one who drives it.
    pub fn remember(&mut self, client: &Name, reply: Reply, holder: Option<&Name>) {
        let known = self.clients.iter().position(|(name, _)| name == client);
        let mut entry =
            known.and_then(|i| self.clients.remove(i)).unwrap_or_else(|| (client.clone(), VecDeque::new()));
        if entry.1.len() == REPLIES_PER_CLIENT {
            entry.1.pop_front();
        }
        entry.1.push_back(reply);
        if self.clients.len() == CLIENTS
            && let Some(oldest) = self.clients.iter().position(|(name, _)| Some(name) != holder)
        {
            self.clients.remove(oldest);
        }
        self.clients.push_back(entry);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::messages::Done;

    #[test]
    fn the_last_64_replies_of_each_of_the_last_64_clients_are_kept() {
        let mut book = ReplyBook::default();
        let name = |i: usize| Name::new(&format!("c-{i}")).unwrap();
        let id = |i: usize| Uuid::from_u128(i as u128);
        for client in 0..=CLIENTS {
            for request in 0..=REPLIES_PER_CLIENT {
                book.remember(&name(client), Reply::done(id(request), Done::default()), None);
            }
        }
        assert!(book.find(&name(0), id(5)).is_none());
        assert!(book.find(&name(1), id(0)).is_none());
        assert!(book.find(&name(1), id(1)).is_some());
        assert!(book.find(&name(64), id(64)).is_some());
    }

    #[test]
    fn strangers_do_not_make_it_forget_the_holder() {
        let mut book = ReplyBook::default();
        let name = |i: usize| Name::new(&format!("c-{i}")).unwrap();
        for client in 0..1000 {
            let reply = Reply::done(Uuid::from_u128(client as u128), Done::default());
            book.remember(&name(client), reply, Some(&name(0)));
        }
        assert!(book.find(&name(0), Uuid::from_u128(0)).is_some());
        assert_eq!(book.clients.len(), CLIENTS);
    }
}
