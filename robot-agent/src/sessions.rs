//! The Zenoh sessions of the agents of one program: one each, or one for several where there are hundreds, whose
//! links would cost more than their controllers.

use std::sync::{Arc, Mutex, PoisonError, Weak};
use tokio::sync::{OnceCell, Semaphore};
use xtb_bus::{Bus, BusError, Opening};

/// So many sessions are being opened at once: of hundreds each would take longer than Zenoh waits for an answer.
const OPENED_AT_ONCE: usize = 16;

/// What agents of one program open their sessions with. All name the same routers.
#[derive(Debug, Clone)]
pub(crate) struct Sessions(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    robots_each: usize,
    opening: Semaphore,
    /// The session that takes more robots, and how many it has taken.
    filling: Mutex<(Weak<OnceCell<Bus>>, usize)>,
}

/// One agent's part of a session.
#[derive(Debug)]
pub(crate) struct Part {
    /// The session, with counters of its own.
    pub(crate) bus: Bus,
    whole: Arc<OnceCell<Bus>>,
}

impl Sessions {
    /// One for so many robots each.
    pub(crate) fn of(robots_each: usize) -> Self {
        let (opening, filling) = (Semaphore::new(OPENED_AT_ONCE), Mutex::new((Weak::new(), 0)));
        Self(Arc::new(Inner { robots_each, opening, filling }))
    }

    /// Opens one, or joins one that has room; tries until it stands.
    ///
    /// # Errors
    /// As [`Opening::patiently`].
    pub(crate) async fn open(
        &self,
        opening: &Opening,
        failing: impl FnMut(&BusError),
    ) -> Result<Part, BusError> {
        let whole = self.0.next();
        let bus = whole.get_or_try_init(async || {
            let _room = self.0.opening.acquire().await; // nobody closes it
            opening.patiently(failing).await
        });
        Ok(Part { bus: bus.await?.part(), whole })
    }
}

impl Inner {
    fn next(&self) -> Arc<OnceCell<Bus>> {
        let mut filling = self.filling.lock().unwrap_or_else(PoisonError::into_inner);
        if filling.1 < self.robots_each
            && let Some(whole) = filling.0.upgrade()
        {
            filling.1 += 1;
            return whole;
        }
        let whole = Arc::new(OnceCell::new());
        *filling = (Arc::downgrade(&whole), 1);
        whole
    }
}

impl Part {
    /// Ends this agent's part; who is the last closes the session.
    pub(crate) async fn close(self) {
        drop(self.bus);
        if let Some(bus) = Arc::into_inner(self.whole).and_then(OnceCell::into_inner) {
            bus.close().await;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_takes_as_many_robots_as_it_should_and_none_when_it_has_ended() {
        let sessions = Sessions::of(2);
        let [a, b, c] = std::array::from_fn(|_| sessions.0.next());
        assert!(Arc::ptr_eq(&a, &b) && !Arc::ptr_eq(&b, &c));
        let ended = Arc::downgrade(&c);
        drop(c);
        let d = sessions.0.next();
        assert!(ended.upgrade().is_none() && !Arc::ptr_eq(&a, &d));
        assert!(Arc::ptr_eq(&d, &sessions.0.next()));

        let alone = Sessions::of(1);
        let (a, b) = (alone.0.next(), alone.0.next());
        assert!(!Arc::ptr_eq(&a, &b));
    }
}
