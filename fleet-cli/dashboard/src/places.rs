//! Who may be connected: so many altogether, so many from one address, and whom a new one takes the place of.
//!
//! This machine and the proxies that stand in front bring connections of many people from one address: they
//! are not bounded each, and have places of their own, so that nobody else can take those.

use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;
use tokio::time::Instant;

/// Connections from one address, of IPv6 from one /64, which is what one customer has.
pub(super) const MOST_FROM_ONE: usize = 16;
/// Connections from this machine and from proxies, and as many from everywhere else.
pub(super) const MOST: usize = 128;

/// Where a connection comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Source {
    /// This machine, or a proxy in front.
    Near,
    /// Anywhere else: the address, or the first half of one of IPv6.
    Far(IpAddr),
}

#[derive(Debug)]
struct Entry {
    source: Source,
    /// Since when it has been waiting for a request; `None` = it has one, or is a page's socket.
    idle_since: Option<Instant>,
    close: Arc<Notify>,
}

#[derive(Debug, Default)]
struct Table {
    next: u64,
    entries: BTreeMap<u64, Entry>,
}

impl Table {
    fn count(&self, which: impl Fn(Source) -> bool) -> usize {
        self.entries.values().filter(|entry| which(entry.source)).count()
    }

    /// Makes room by closing the connection that has waited longest for a request; `false` = all are at work.
    fn close_one(&mut self, which: impl Fn(Source) -> bool) -> bool {
        let idle = self.entries.iter().filter(|(_, entry)| which(entry.source));
        let idle = idle.filter_map(|(id, entry)| Some((entry.idle_since?, *id)));
        let Some((_, id)) = idle.min() else { return false };
        if let Some(entry) = self.entries.remove(&id) {
            entry.close.notify_one();
        }
        true
    }
}

/// All places.
#[derive(Debug, Clone)]
pub(super) struct Places {
    table: Arc<Mutex<Table>>,
    proxies: Arc<[IpAddr]>,
}

impl Places {
    /// All free; these addresses are proxies in front.
    pub(super) fn new(proxies: &[IpAddr]) -> Self {
        let proxies = proxies.iter().map(IpAddr::to_canonical).collect();
        Self { table: Arc::default(), proxies }
    }

    /// A place for a connection from this address. `None` = all that it could take are at work.
    pub(super) fn take(&self, from: IpAddr) -> Option<Place> {
        let source = self.source(from.to_canonical());
        let mut table = lock(&self.table);
        let is_near = |source: Source| source == Source::Near;
        let own = |other: Source| other == source;
        if !is_near(source) && table.count(own) >= MOST_FROM_ONE && !table.close_one(own) {
            return None;
        }
        let alike = |other: Source| is_near(other) == is_near(source);
        if table.count(alike) >= MOST && !table.close_one(alike) {
            return None;
        }
        let (id, close) = (table.next, Arc::<Notify>::default());
        table.next += 1;
        let idle_since = Some(Instant::now());
        table.entries.insert(id, Entry { source, idle_since, close: Arc::clone(&close) });
        Some(Place { table: Arc::clone(&self.table), id, close })
    }

    fn source(&self, from: IpAddr) -> Source {
        match from {
            from if from.is_loopback() || self.proxies.contains(&from) => Source::Near,
            from => Source::Far(network(from)),
        }
    }
}

/// Of one customer: the address, or the first half of one of IPv6.
pub(super) fn network(from: IpAddr) -> IpAddr {
    match from.to_canonical() {
        IpAddr::V6(from) => Ipv6Addr::from_bits(from.to_bits() & (u128::MAX << 64)).into(),
        from => from,
    }
}

/// One connection's place, until it is dropped.
#[derive(Debug)]
pub(super) struct Place {
    table: Arc<Mutex<Table>>,
    id: u64,
    close: Arc<Notify>,
}

impl Place {
    /// It has a request: nobody takes its place.
    pub(super) fn at_work(&self) {
        self.set(None);
    }

    /// It waits for its next request.
    pub(super) fn idle(&self) {
        self.set(Some(Instant::now()));
    }

    fn set(&self, idle_since: Option<Instant>) {
        if let Some(entry) = lock(&self.table).entries.get_mut(&self.id) {
            entry.idle_since = idle_since;
        }
    }

    /// Resolves when another connection needs its place.
    pub(super) async fn taken(&self) {
        self.close.notified().await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        lock(&self.table).entries.remove(&self.id);
    }
}

/// A panic elsewhere does not make the table unreadable.
fn lock(table: &Mutex<Table>) -> MutexGuard<'_, Table> {
    table.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROXY: &str = "192.168.1.2";

    fn places() -> Places {
        Places::new(&[PROXY.parse().unwrap()])
    }

    fn take(places: &Places, from: &str) -> Option<Place> {
        places.take(from.parse().unwrap())
    }

    fn at_work(places: &Places, from: &str) -> Option<Place> {
        take(places, from).inspect(Place::at_work)
    }

    fn held(places: &Places) -> usize {
        lock(&places.table).entries.len()
    }

    #[test]
    fn one_address_has_so_many_places_and_leaves_the_others_to_others() {
        let places = places();
        let all: Vec<_> = (0..MOST_FROM_ONE).filter_map(|_| at_work(&places, "10.0.0.7")).collect();
        assert_eq!(all.len(), MOST_FROM_ONE);
        assert!(take(&places, "10.0.0.7").is_none() && take(&places, "::ffff:10.0.0.7").is_none());
        assert!(take(&places, "10.0.0.8").is_some());
        drop(all);
        assert!(take(&places, "10.0.0.7").is_some());
        let network: Vec<_> =
            (0..MOST_FROM_ONE).filter_map(|i| at_work(&places, &format!("2001:db8::{i:x}:1"))).collect();
        assert_eq!(network.len(), MOST_FROM_ONE);
        assert!(take(&places, "2001:db8::ffff:ffff:ffff:ffff").is_none(), "the same network");
        assert!(take(&places, "2001:db8:0:1::1").is_some());
    }

    #[test]
    fn who_waits_for_a_request_longest_makes_room() {
        let places = places();
        let all: Vec<_> = (0..MOST_FROM_ONE).filter_map(|_| take(&places, "10.0.0.7")).collect();
        all[0].at_work();
        let new = take(&places, "10.0.0.7").unwrap();
        assert_eq!(held(&places), MOST_FROM_ONE);
        let was_taken = |place: &Place| !lock(&places.table).entries.contains_key(&place.id);
        assert!(!was_taken(&all[0]) && was_taken(&all[1]) && !was_taken(&all[2]) && !was_taken(&new));
        all[0].idle();
        drop(all);
        assert_eq!(held(&places), 1);
    }

    #[test]
    fn this_machine_and_proxies_have_places_of_their_own() {
        let places = places();
        let far: Vec<_> = (0..MOST).filter_map(|i| at_work(&places, &format!("10.0.0.{i}"))).collect();
        assert_eq!(far.len(), MOST);
        assert!(take(&places, "10.0.1.1").is_none());
        let near: Vec<_> = (0..MOST)
            .filter_map(|i| at_work(&places, ["127.0.0.1", "127.0.0.2", "::1", PROXY][i % 4]))
            .collect();
        assert_eq!(near.len(), MOST);
        assert!(take(&places, "127.0.0.1").is_none() && take(&places, PROXY).is_none());
        drop(far);
        assert!(take(&places, "10.0.1.1").is_some());
    }
}
