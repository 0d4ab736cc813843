//! `--realtime`: the control loop's thread runs before all ordinary programs (`SCHED_FIFO`), and no memory of
//! the process is paged out (`mlockall`).
//!
//! What the system does not permit is no reason not to start: it is logged, and the factsheet says it
//! ([`REALTIME`]). Only this one thread is prioritized: planner, recorder and Zenoh have no deadline of 5 ms.

use std::io;
use std::sync::mpsc;
use std::thread::{Builder, JoinHandle};
use thiserror::Error;
use xtb_protocol::messages::{ParameterInfo, REALTIME, REALTIME_OFF, REALTIME_ON, REALTIME_REMEDY};

/// Of the control loop, from 1 to 99. Any would do against ordinary programs. It is below 50, which the
/// kernel's threads for interrupts have: they bring the bytes of the serial lines that the loop works on.
pub const PRIORITY: u8 = 20;

/// What has become of it.
#[derive(Debug)]
pub(crate) enum Realtime {
    /// Not asked for, or a loop that shares its thread.
    Off,
    /// In effect.
    On,
    /// Not permitted, or not all of it.
    Refused(Vec<Refusal>),
}

/// What the system has refused.
#[derive(Debug, Error)]
pub(crate) enum Refusal {
    /// The priority.
    #[error("SCHED_FIFO refused: {0}")]
    Priority(io::Error),
    /// Locked memory. With a finite limit the allocation that exceeds it would fail, at any time later.
    #[error("memory not locked: RLIMIT_MEMLOCK is {0} KiB and must be unlimited")]
    MemoryLimit(u64),
    /// Locked memory.
    #[error("memory not locked: {0}")]
    Memory(io::Error),
}

impl Realtime {
    fn of(refusals: Vec<Refusal>) -> Self {
        if refusals.is_empty() { Self::On } else { Self::Refused(refusals) }
    }

    fn words(&self) -> String {
        match self {
            Self::Off => REALTIME_OFF.to_owned(),
            Self::On => REALTIME_ON.to_owned(),
            Self::Refused(all) => all.iter().map(Refusal::to_string).collect::<Vec<_>>().join("; "),
        }
    }

    /// For the factsheet.
    pub(crate) fn parameter(&self) -> ParameterInfo {
        ParameterInfo {
            name: REALTIME.to_owned(),
            value: self.words(),
            unit: String::new(),
            origin: "ours".to_owned(),
        }
    }

    /// For the log.
    pub(crate) fn log(&self) {
        match self {
            Self::Off => {}
            Self::On => tracing::info!("control loop: SCHED_FIFO, priority {PRIORITY}; memory locked"),
            Self::Refused(_) => tracing::warn!("--realtime: {}; {REALTIME_REMEDY}", self.words()),
        }
    }
}

/// Starts `run` on a thread, with everything above if it is `wanted`.
///
/// # Errors
/// The system cannot start a thread.
pub(crate) fn spawn(
    thread: Builder,
    wanted: bool,
    run: impl FnOnce() + Send + 'static,
) -> io::Result<(JoinHandle<()>, Realtime)> {
    if !wanted {
        return Ok((thread.spawn(run)?, Realtime::Off));
    }
    // Before there are turns that this could hold up.
    let memory = lock_memory().err();
    let (told, heard) = mpsc::sync_channel(1);
    let thread = thread.spawn(move || {
        let _ = told.send(prioritize_this_thread(PRIORITY));
        run();
    })?;
    let priority = heard.recv().unwrap_or_else(|gone| Err(io::Error::other(gone)));
    let refusals = priority.err().map(Refusal::Priority).into_iter().chain(memory);
    Ok((thread, Realtime::of(refusals.collect())))
}

/// Gives the calling thread this priority of `SCHED_FIFO`, from 1 to 99.
///
/// # Errors
/// The system does not permit it, or has no such policy.
#[cfg(target_os = "linux")]
pub fn prioritize_this_thread(priority: u8) -> io::Result<()> {
    use thread_priority::{
        Error, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
        set_thread_priority_and_policy, thread_native_id,
    };
    let value = ThreadPriorityValue::try_from(priority).map_err(io::Error::other)?;
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let set =
        set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy);
    set.map_err(|error| match error {
        Error::OS(code) => io::Error::from_raw_os_error(code),
        other => io::Error::other(other),
    })
}

/// Locks what the process has in memory now, and what it will have as soon as it is used. (All of what is
/// reserved later would be much more: each new thread's whole stack.)
#[cfg(target_os = "linux")]
fn lock_memory() -> Result<(), Refusal> {
    use rustix::mm::{MlockAllFlags, mlockall};
    use rustix::process::{Resource, getrlimit};
    use rustix::thread::{CapabilitySet, capabilities};
    let unlimited = capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
    let limit = getrlimit(Resource::Memlock).current.filter(|_| !unlimited);
    if let Some(bytes) = limit {
        return Err(Refusal::MemoryLimit(bytes / 1024));
    }
    let locked = mlockall(MlockAllFlags::CURRENT)
        .and_then(|()| mlockall(MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT));
    locked.map_err(|error| Refusal::Memory(error.into()))
}

/// Gives the calling thread a real-time priority.
///
/// # Errors
/// Always: only Linux has it here.
#[cfg(not(target_os = "linux"))]
pub fn prioritize_this_thread(_: u8) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(not(target_os = "linux"))]
fn lock_memory() -> Result<(), Refusal> {
    Err(Refusal::Memory(io::ErrorKind::Unsupported.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factsheet_says_what_was_refused_and_why() {
        let said = |realtime: Realtime| realtime.parameter().value;
        assert_eq!((said(Realtime::Off), said(Realtime::of(Vec::new()))), ("off".into(), "on".into()));
        let denied = || Refusal::Priority(io::Error::new(io::ErrorKind::PermissionDenied, "not permitted"));
        assert_eq!(said(Realtime::of(vec![denied()])), "SCHED_FIFO refused: not permitted");
        assert_eq!(
            said(Realtime::of(vec![denied(), Refusal::MemoryLimit(8192)])),
            "SCHED_FIFO refused: not permitted; \
             memory not locked: RLIMIT_MEMLOCK is 8192 KiB and must be unlimited"
        );
    }

    #[test]
    fn a_loop_that_does_not_ask_for_it_gets_none() {
        let (told, heard) = mpsc::channel();
        let run = move || told.send(std::thread::current().name().map(str::to_owned)).unwrap();
        let (thread, realtime) = spawn(Builder::new().name("loop".into()), false, run).unwrap();
        thread.join().unwrap();
        assert!(matches!(realtime, Realtime::Off), "{realtime:?}");
        assert_eq!(heard.recv().unwrap().as_deref(), Some("loop"));
    }

    #[test]
    fn a_priority_that_does_not_exist_is_an_error() {
        for priority in [0, 100, 255] {
            assert!(prioritize_this_thread(priority).is_err(), "{priority}");
        }
    }

    #[test]
    fn the_remedy_and_the_setting_name_the_priority() {
        assert!(REALTIME_REMEDY.contains(&format!("LimitRTPRIO={PRIORITY} ")), "{REALTIME_REMEDY}");
        let about = crate::config::ControlSection::default().parameters().remove(0).about;
        assert!(about.contains(&format!("priority {PRIORITY})")), "{about}");
    }
}
