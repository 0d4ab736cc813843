//! What a process holds over hours: its memory and its file handles, and how fast that grows; and what it computes.

use rustix::param::clock_ticks_per_second;
use std::io;

/// The first part of the time in which nothing counts: queues and caches fill.
const WARM_UP: f64 = 1.0 / 6.0;
/// The last part of the time, which tells whether growth comes to an end.
const LATE: f64 = 1.0 / 4.0;

/// One look at a process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Held {
    /// When, in s.
    pub at_s: f64,
    /// Resident memory.
    pub memory_kib: u64,
    /// Open files, sockets, pipes.
    pub handles: u64,
    /// CPU time since its start.
    pub cpu_s: f64,
}

impl Held {
    /// Looks at it.
    ///
    /// # Errors
    /// It has ended.
    pub fn look(pid: u32, at_s: f64) -> io::Result<Self> {
        let ended = || io::Error::other("the process has ended");
        let status = std::fs::read_to_string(format!("/proc/{pid}/status"))?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).ok_or_else(ended)?;
        let memory_kib = line.split_whitespace().next().and_then(|kib| kib.parse().ok()).ok_or_else(ended)?;
        let handles = std::fs::read_dir(format!("/proc/{pid}/fd"))?.count() as u64;
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat"))?;
        Ok(Self { at_s, memory_kib, handles, cpu_s: cpu_s(&stat).ok_or_else(ended)? })
    }
}

/// Of a `/proc/PID/stat`: user and system time are the 12th and 13th field after the name in parentheses.
fn cpu_s(stat: &str) -> Option<f64> {
    let fields = stat.rsplit_once(')')?.1.split_whitespace();
    let ticks = fields.skip(11).take(2).map(|field| field.parse::<u64>().ok()).sum::<Option<u64>>()?;
    Some(ticks as f64 / clock_ticks_per_second() as f64)
}

/// How it grows and computes, by the line of least squares through all looks after the warm-up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Growth {
    /// Of the memory.
    pub memory_mib_per_h: f64,
    /// Of the memory in the last quarter of the time.
    pub late_mib_per_h: f64,
    /// Of the number of handles, over all that time.
    pub handles: f64,
    /// CPU time in a second.
    pub cores: f64,
}

impl Growth {
    /// Of looks in the order of their times; `None` = too few of them.
    #[must_use]
    pub fn of(looks: &[Held]) -> Option<Self> {
        let (first_s, last_s) = (looks.first()?.at_s, looks.last()?.at_s);
        let from_s = first_s + WARM_UP * (last_s - first_s);
        let line = |from_s: f64, value: fn(&Held) -> f64| {
            let looks = looks.iter().filter(|held| held.at_s >= from_s);
            slope(&looks.map(|held| (held.at_s, value(held))).collect::<Vec<_>>())
        };
        let memory = |from_s| Some(line(from_s, |held| held.memory_kib as f64)? * 3600.0 / 1024.0);
        Some(Self {
            memory_mib_per_h: memory(from_s)?,
            late_mib_per_h: memory(last_s - LATE * (last_s - first_s))?,
            handles: line(from_s, |held| held.handles as f64)? * (last_s - from_s),
            cores: line(from_s, |held| held.cpu_s)?,
        })
    }
}

/// Of the line of least squares; `None` = there is no such line.
fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let count = points.len() as f64;
    let mean = |value: fn(&(f64, f64)) -> f64| points.iter().map(value).sum::<f64>() / count;
    let (x, y) = (mean(|point| point.0), mean(|point| point.1));
    let across = points.iter().map(|point| (point.0 - x) * (point.1 - y)).sum::<f64>();
    let along = points.iter().map(|point| (point.0 - x).powi(2)).sum::<f64>();
    (along > 0.0).then(|| across / along)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An hour, a look each 10 s.
    fn hour(memory_kib: impl Fn(u64) -> u64, handles: impl Fn(u64) -> u64) -> Vec<Held> {
        let look = |n: u64| {
            let at_s = 10.0 * n as f64;
            Held { at_s, memory_kib: memory_kib(n), handles: handles(n), cpu_s: 0.25 * at_s }
        };
        (0..=360).map(look).collect()
    }

    #[test]
    fn memory_that_grows_by_three_mebibytes_an_hour_grows_by_three() {
        let growth = Growth::of(&hour(|n| 50_000 + n * 3 * 1024 / 360, |_| 20)).unwrap();
        assert!((growth.memory_mib_per_h - 3.0).abs() < 0.01 && growth.handles.abs() < 1e-6, "{growth:?}");
        assert!((growth.cores - 0.25).abs() < 1e-6, "{growth:?}");
    }

    #[test]
    fn what_comes_in_the_warm_up_is_no_growth() {
        let growth = Growth::of(&hour(|n| 50_000 + 500 * n.min(59), |n| 20 + n.min(59))).unwrap();
        assert!(growth.memory_mib_per_h.abs() < 1e-6 && growth.handles.abs() < 1e-6, "{growth:?}");
    }

    #[test]
    fn what_grew_before_the_last_quarter_is_not_in_its_growth() {
        let growth = Growth::of(&hour(|n| 50_000 + 100 * n.min(180), |_| 20)).unwrap();
        assert!(growth.memory_mib_per_h > 10.0 && growth.late_mib_per_h.abs() < 1e-6, "{growth:?}");
        let late = Growth::of(&hour(|n| 50_000 + n.saturating_sub(270) * 4 * 1024 / 360, |_| 20)).unwrap();
        assert!((late.late_mib_per_h - 4.0).abs() < 0.02 && late.memory_mib_per_h < 2.0, "{late:?}");
    }

    #[test]
    fn one_handle_in_half_an_hour_is_growth_and_a_connection_now_and_then_is_none() {
        let leak = Growth::of(&hour(|_| 50_000, |n| 20 + n / 180)).unwrap();
        let busy = Growth::of(&hour(|_| 50_000, |n| 20 + u64::from(n.is_multiple_of(7)))).unwrap();
        assert!(leak.handles >= 1.0 && busy.handles.abs() < 0.1, "{leak:?} {busy:?}");
    }

    #[test]
    fn one_look_is_too_few() {
        assert_eq!(Growth::of(&[]), None);
        assert_eq!(Growth::of(&[Held { at_s: 0.0, memory_kib: 1, handles: 1, cpu_s: 0.0 }]), None);
    }

    #[test]
    fn a_process_that_runs_holds_something_and_one_that_is_not_there_is_an_error() {
        let held = Held::look(std::process::id(), 0.0).unwrap();
        assert!(held.memory_kib > 0 && held.handles >= 1, "{held:?}");
        assert!(Held::look(u32::MAX, 0.0).is_err());
    }
}
