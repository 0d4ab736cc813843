//! The two clocks a control loop can run on: the machine's, and a simulated world's.
//!
//! A simulated clock stands still until the world has computed the next step, and the world waits until
//! every robot has taken its turn, or none has for a short while of real time. So a busy machine slows the
//! whole simulation down instead of making robots miss samples.

use crate::wake::Wake;
use rustix::time::{ClockId, clock_gettime};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use xtb_control::Stamp;

/// Longest that the world waits for the next robot to take its turn, in real time. As long as one after the
/// other does, the machine is slow and no robot is stalled: however many they are, none misses a sample.
const PATIENCE: Duration = Duration::from_millis(50);

/// A monotonic clock with absolute deadlines.
#[derive(Debug, Clone)]
pub enum Clock {
    /// The machine's, since this time after its start. It counts while the machine sleeps: a robot that
    /// was suspended has to notice.
    Real(Duration),
    /// A simulated world's.
    World(Arc<Turn>),
}

impl Clock {
    /// The machine's clock, from now.
    #[must_use]
    pub fn real() -> Self {
        Self::Real(since_start())
    }

    /// The present.
    #[must_use]
    pub fn now(&self) -> Stamp {
        match self {
            Self::Real(origin) => Stamp::from_ns(since_start().saturating_sub(*origin).as_nanos() as u64),
            Self::World(turn) => turn.world.lock().now,
        }
    }

    /// Sleeps until `deadline`; returns at once if it has passed or the world has ended.
    pub fn wait_until(&self, deadline: Stamp) {
        match self {
            Self::Real(_) => {
                let ahead = deadline.ns().saturating_sub(self.now().ns());
                if ahead > 0 {
                    std::thread::sleep(Duration::from_nanos(ahead));
                }
            }
            Self::World(turn) => turn.wait_until(deadline),
        }
    }

    /// The same, but on the machine's clock a call of `wake` ends the wait: then true. A simulated clock
    /// stands still between two steps, so there is nothing to wake up for.
    pub(crate) fn wait_until_called(&self, deadline: Stamp, wake: &Wake) -> bool {
        let Self::Real(_) = self else {
            self.wait_until(deadline);
            return false;
        };
        loop {
            let ahead = deadline.ns().saturating_sub(self.now().ns());
            if ahead == 0 {
                return false;
            }
            if wake.take_call() {
                return true;
            }
            std::thread::park_timeout(Duration::from_nanos(ahead));
        }
    }

    /// Tells a simulated world that there is nothing to do before `deadline`, without waiting for that: who takes
    /// the turns of several robots tells it for each of them before it waits for the first.
    pub(crate) fn rest_until(&self, deadline: Stamp) {
        if let Self::World(turn) = self {
            turn.rest_until(deadline);
        }
    }
}

/// Time since the machine was started, asleep or not.
fn since_start() -> Duration {
    #[cfg(target_os = "linux")]
    let clock = ClockId::Boottime;
    #[cfg(not(target_os = "linux"))]
    let clock = ClockId::Monotonic;
    let now = clock_gettime(clock);
    Duration::new(now.tv_sec.unsigned_abs(), u32::try_from(now.tv_nsec).unwrap_or(0))
}

#[derive(Debug, Default)]
struct WorldState {
    now: Stamp,
    /// What each robot waits for; `None` = it has left.
    waiting: Vec<Option<Stamp>>,
    /// How many of them have not taken the present turn yet.
    due: usize,
    ended: bool,
}

impl WorldState {
    fn is_due(&self, until: Option<Stamp>) -> bool {
        until.is_some_and(|until| until <= self.now)
    }

    /// The robot with this index waits for something else now. True if it was the last that was due: the
    /// world is woken once a turn, not once for each robot.
    fn wait_for(&mut self, index: usize, until: Option<Stamp>) -> bool {
        let (was, is) = (self.is_due(self.waiting[index]), self.is_due(until));
        self.waiting[index] = until;
        self.due = self.due + usize::from(is) - usize::from(was);
        was && self.due == 0
    }

    fn advance(&mut self, now: Stamp) {
        self.now = now;
        self.due = self.waiting.iter().filter(|until| self.is_due(**until)).count();
    }
}

/// Time in a simulated world, shared by the world and its robots.
#[derive(Debug, Default)]
pub struct WorldTime {
    state: Mutex<WorldState>,
    advanced: Condvar,
    turned: Condvar,
}

impl WorldTime {
    /// At zero, without robots.
    #[must_use]
    pub fn new() -> Arc<Self> {
        Arc::new(Self::default())
    }

    /// A clock for one more robot, which the world will wait for.
    #[must_use]
    pub fn join(self: &Arc<Self>) -> Clock {
        let mut state = self.lock();
        state.waiting.push(Some(Stamp::ZERO));
        state.due += 1;
        Clock::World(Arc::new(Turn { world: self.clone(), index: state.waiting.len() - 1 }))
    }

    /// The present.
    #[must_use]
    pub fn now(&self) -> Stamp {
        self.lock().now
    }

    /// The world has computed everything up to `now`: lets the robots take their turns and waits
    /// for them. False if some did not take it while nobody else did either.
    pub fn advance(&self, now: Stamp) -> bool {
        self.advance_within(now, PATIENCE)
    }

    pub(crate) fn advance_within(&self, now: Stamp, patience: Duration) -> bool {
        let mut state = self.lock();
        state.advance(now);
        self.advanced.notify_all();
        loop {
            let due = state.due;
            state = self
                .turned
                .wait_timeout_while(state, patience, |state| state.due > 0)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
            if state.due == 0 || state.due >= due {
                return state.due == 0;
            }
        }
    }

    /// Ends the world: nobody waits any more.
    pub fn end(&self) {
        self.lock().ended = true;
        self.advanced.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, WorldState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One robot's place in [`WorldTime`]; given up when dropped.
#[derive(Debug)]
pub struct Turn {
    world: Arc<WorldTime>,
    index: usize,
}

impl Turn {
    fn rest_until(&self, deadline: Stamp) {
        if self.world.lock().wait_for(self.index, Some(deadline)) {
            self.world.turned.notify_one();
        }
    }

    fn wait_until(&self, deadline: Stamp) {
        let mut state = self.world.lock();
        if state.wait_for(self.index, Some(deadline)) {
            self.world.turned.notify_one();
        }
        while state.now < deadline && !state.ended {
            state = self.world.advanced.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        if self.world.lock().wait_for(self.index, None) {
            self.world.turned.notify_one();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn a_world_and_its_robots_take_turns() {
        let world = WorldTime::new();
        let turns = Arc::new(AtomicU64::new(0));
        let robots: Vec<_> = (0..3)
            .map(|_| {
                let (clock, turns) = (world.join(), turns.clone());
                std::thread::spawn(move || {
                    for step in 1..=100 {
                        clock.wait_until(Stamp::from_ms(5 * step));
                        assert_eq!(clock.now(), Stamp::from_ms(5 * step));
                        turns.fetch_add(1, Ordering::SeqCst);
                    }
                })
            })
            .collect();
        for step in 1..=100 {
            world.advance(Stamp::from_ms(5 * step));
        }
        for robot in robots {
            robot.join().unwrap();
        }
        assert_eq!(turns.load(Ordering::SeqCst), 300);
    }

    #[test]
    fn one_thread_takes_the_turns_of_several_robots() {
        let world = WorldTime::new();
        let clocks: Vec<_> = (0..3).map(|_| world.join()).collect();
        let machine = std::thread::spawn(move || {
            for step in 1..=100 {
                for clock in &clocks {
                    clock.wait_until(Stamp::from_ms(5 * step));
                    assert_eq!(clock.now(), Stamp::from_ms(5 * step));
                    clock.rest_until(Stamp::from_ms(5 * (step + 1)));
                }
            }
        });
        for step in 1..=100 {
            assert!(world.advance_within(Stamp::from_ms(5 * step), Duration::from_secs(20)));
        }
        machine.join().unwrap();
    }

    #[test]
    fn robots_that_come_late_leave_or_stall_are_counted_once() {
        let world = WorldTime::new();
        let clocks: Vec<_> = (0..3).map(|_| world.join()).collect();
        let Clock::World(turn) = &clocks[0] else { panic!() };
        let due = || world.lock().due;
        assert_eq!(due(), 3, "a robot that has just joined has not taken its turn");
        world.lock().advance(Stamp::from_ms(5));
        assert!(!world.lock().wait_for(turn.index, Some(Stamp::from_ms(10))));
        assert!(!world.lock().wait_for(turn.index, Some(Stamp::from_ms(15))), "again");
        assert_eq!(due(), 2);
        let late = world.join();
        assert_eq!(due(), 3);
        drop(late);
        drop(clocks);
        assert_eq!(due(), 0);
        assert!(world.advance(Stamp::from_ms(20)), "nobody is waited for");
    }

    #[test]
    fn robots_that_take_their_turns_one_after_the_other_are_waited_for_however_long_it_takes() {
        const PATIENCE: Duration = Duration::from_millis(1000);
        const TURN: Duration = Duration::from_millis(700);
        let world = WorldTime::new();
        let clocks: Vec<_> = (0..2).map(|_| world.join()).collect();
        let machine = std::thread::spawn(move || {
            for clock in &clocks {
                // Its work, on a machine that is far too slow.
                std::thread::sleep(TURN);
                let Clock::World(turn) = clock else { panic!() };
                let mut state = turn.world.lock();
                if state.wait_for(turn.index, Some(Stamp::from_ms(10))) {
                    turn.world.turned.notify_one();
                }
            }
            clocks
        });
        assert!(world.advance_within(Stamp::from_ms(5), PATIENCE), "it went on without one of them");
        drop(machine.join());
    }

    #[test]
    fn a_call_ends_the_wait_on_the_machines_clock_and_no_other() {
        let (clock, wake) = (Clock::real(), Arc::new(Wake::default()));
        let hour = clock.now().plus_ms(3_600_000);
        wake.call();
        assert!(clock.wait_until_called(hour, &wake), "a call from before the wait is heard");
        let caller = {
            let wake = wake.clone();
            wake.wakes_me();
            std::thread::spawn(move || wake.call())
        };
        assert!(clock.wait_until_called(hour, &wake)); // or the test hangs
        caller.join().unwrap();
        assert!(!clock.wait_until_called(clock.now().plus_ms(1), &wake), "one call, one turn");
        let world = WorldTime::new();
        wake.call();
        assert!(!world.join().wait_until_called(Stamp::ZERO, &wake));
    }

    #[test]
    fn a_robot_that_stalls_does_not_stop_the_world() {
        let world = WorldTime::new();
        let _stalled = world.join();
        assert!(!world.advance(Stamp::from_ms(5)));
        assert_eq!(world.now(), Stamp::from_ms(5));
    }
}
