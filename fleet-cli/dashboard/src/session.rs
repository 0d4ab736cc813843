//! What goes to one page and when. Pure: ticks and the page's words in, messages out.
//!
//! Latest wins: at most [`MOST_OUT`] frames are out that the page has not answered; what happens
//! meanwhile is left out and counted, not queued. The frame after that shows the present.

use super::frames::{Known, Moment, ToPage};
use std::collections::VecDeque;
use xtb_client::scene::{AtMs, Scene};
use xtb_protocol::Name;

/// Frames that may be out without an answer.
pub(super) const MOST_OUT: u64 = 2;
/// Frames whose times are remembered: at 20 Hz for 1.6 s.
const REMEMBERED: usize = 32;

/// One page's stream of frames.
#[derive(Debug, Default)]
pub(super) struct Session {
    known: Known,
    watch: Option<Name>,
    /// Number of the last frame.
    sent: u64,
    seen: u64,
    skipped: u64,
    rewinds: u64,
    /// When frames were made, by a clock that never stands.
    times: VecDeque<(u64, u64)>,
}

impl Session {
    /// The page has this frame.
    pub(super) fn seen(&mut self, n: u64) {
        if n <= self.sent {
            self.seen = self.seen.max(n);
        }
    }

    /// The page shows this robot's details.
    pub(super) fn watch(&mut self, robot: Option<Name>) {
        self.watch = robot;
    }

    /// Whether there is room for a frame; if not, it is counted.
    pub(super) fn is_due(&mut self) -> bool {
        let is_due = self.sent - self.seen < MOST_OUT;
        self.skipped += u64::from(!is_due);
        is_due
    }

    /// What goes out now: `now_ms` is the scene's clock, `clock_ms` one that never stands; `link` says whether
    /// there is a router.
    pub(super) fn tick(&mut self, scene: &Scene, now_ms: AtMs, clock_ms: u64, link: bool) -> Vec<ToPage> {
        self.sent += 1;
        if self.times.len() == REMEMBERED {
            self.times.pop_front();
        }
        self.times.push_back((self.sent, clock_ms));
        let moment = Moment { n: self.sent, now_ms, skipped: self.skipped, link };
        self.known.news(scene, moment, self.watch.as_ref())
    }

    /// The age of a frame in ms; `None` = it was never sent, or long ago.
    pub(super) fn picture_ms(&self, n: u64, clock_ms: u64) -> Option<u64> {
        let (_, at_ms) = self.times.iter().find(|(sent, _)| *sent == n)?;
        Some(clock_ms.saturating_sub(*at_ms))
    }

    /// The scene was wound back: the page has nothing of it yet.
    pub(super) fn rewound(&mut self, rewinds: u64) {
        if std::mem::replace(&mut self.rewinds, rewinds) != rewinds {
            self.known = Known::default();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;

    fn frames(news: &[ToPage]) -> Vec<u64> {
        let number = |message: &ToPage| match message {
            ToPage::Frame(frame) => Some(frame.n),
            _ => None,
        };
        news.iter().filter_map(number).collect()
    }

    #[test]
    fn two_frames_are_out_at_most_and_the_others_are_counted() {
        let (mut session, scene) = (Session::default(), Scene::new(name("lab")));
        let tick = |session: &mut Session, ms| match session.is_due() {
            true => frames(&session.tick(&scene, ms, ms, true)),
            false => Vec::new(),
        };
        assert_eq!((tick(&mut session, 0), tick(&mut session, 50)), (vec![1], vec![2]));
        for ms in 2..100 {
            assert_eq!(tick(&mut session, 50 * ms), Vec::<u64>::new());
        }
        assert_eq!(session.skipped, 98);
        session.seen(1);
        assert_eq!(tick(&mut session, 5000), [3]);
        assert!(!session.is_due());
        session.seen(3);
        assert_eq!((tick(&mut session, 5050), tick(&mut session, 5100)), (vec![4], vec![5]));
    }

    #[test]
    fn a_page_cannot_have_seen_what_was_never_sent() {
        let (mut session, scene) = (Session::default(), Scene::new(name("lab")));
        session.seen(u64::MAX);
        for _ in 0..MOST_OUT {
            assert!(session.is_due());
            session.tick(&scene, 0, 0, true);
        }
        session.seen(1000);
        assert!(!session.is_due());
    }

    #[test]
    fn the_age_of_a_picture_is_known_for_those_that_were_sent() {
        let (mut session, scene) = (Session::default(), Scene::new(name("lab")));
        for n in 1..=100 {
            session.tick(&scene, 0, 50 * n, true);
        }
        assert_eq!(session.picture_ms(100, 5070), Some(70));
        assert_eq!((session.picture_ms(1, 5070), session.picture_ms(101, 5070)), (None, None));
        assert_eq!(session.picture_ms(0, 5070), None);
    }
}
