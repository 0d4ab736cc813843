//! A line that may come and go, and the thread that opens it.

use super::PortSettings;
use super::port::{Port, PortError};
use std::io::{self, ErrorKind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

/// A closed line is tried this often.
const RETRY: Duration = Duration::from_millis(100);

/// "Open it": what has to be closed first, if anything.
type Job = Option<Port>;
type Answer = Result<Port, PortError>;

/// One line: open, or closed for a reason and about to be opened by its thread.
///
/// At most one job and one answer are under way: a job is given when the line closes, and the
/// answers to it end with the port.
#[derive(Debug)]
pub(super) struct Line {
    state: Result<Port, PortError>,
    delimiter: Option<u8>,
    jobs: SyncSender<Job>,
    answers: Receiver<Answer>,
}

impl Line {
    /// Tries to open the line, then leaves it to a thread that ends with the line.
    ///
    /// The `delimiter` goes before a frame that follows one cut off.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub(super) fn start(name: &str, settings: PortSettings, delimiter: Option<u8>) -> io::Result<Self> {
        let (jobs, jobs_taken) = sync_channel(1);
        let (answers_given, answers) = sync_channel(1);
        let state = Port::open(&settings);
        if state.is_err() {
            // There is room: it is the first.
            let _ = jobs.try_send(None);
        }
        thread::Builder::new()
            .name(format!("open-{name}"))
            .spawn(move || open_when_asked(&settings, &jobs_taken, &answers_given))?;
        Ok(Self { state, delimiter, jobs, answers })
    }

    /// Why it is closed.
    pub(super) fn closed(&self) -> Option<&PortError> {
        self.state.as_ref().err()
    }

    /// See [`Hardware`](super::Hardware): 0 = nothing now.
    pub(super) fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let result = self.port().and_then(|port| port.read(buffer));
        self.close_if_broken(result)
    }

    /// See [`Hardware`](super::Hardware).
    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let delimiter = self.delimiter;
        let result = self.port().and_then(|port| port.write(bytes, delimiter));
        self.close_if_broken(result)
    }

    /// The port, if it is open or has been opened in the meantime.
    fn port(&mut self) -> Result<&mut Port, PortError> {
        if self.state.is_err()
            && let Ok(answer) = self.answers.try_recv()
        {
            self.state = answer;
        }
        self.state.as_mut().map_err(|why| why.clone())
    }

    fn close_if_broken<T>(&mut self, result: Result<T, PortError>) -> io::Result<T> {
        if let Err(why) = &result
            && why.kind != ErrorKind::TimedOut
            && self.state.is_ok()
            && let Ok(port) = std::mem::replace(&mut self.state, Err(why.clone()))
        {
            // There is room: this line's thread waits for a job since it gave the port.
            let _ = self.jobs.try_send(Some(port));
        }
        result.map_err(io::Error::from)
    }
}

/// The opener thread: answers each job with failures until it has opened the port. At once, but never
/// more than every 100 ms, also if a port opens and breaks again. Ends when the line is dropped.
fn open_when_asked(settings: &PortSettings, jobs: &Receiver<Job>, answers: &SyncSender<Answer>) {
    let mut tried: Option<Instant> = None;
    while let Ok(broken) = jobs.recv() {
        drop(broken);
        let mut open = false;
        while !open {
            let pause = tried.map_or(Duration::ZERO, |at| RETRY.saturating_sub(at.elapsed()));
            // No job comes before the answer: this is a pause that the line's end cuts short.
            if !matches!(jobs.recv_timeout(pause), Err(RecvTimeoutError::Timeout)) {
                return;
            }
            tried = Some(Instant::now());
            let answer = Port::open(settings);
            open = answer.is_ok();
            if answers.send(answer).is_err() {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_thread_ends_with_the_line() {
        let settings = PortSettings { path: "/nonexistent/port".into(), baud: 115_200 };
        let (jobs, jobs_taken) = sync_channel(1);
        let (answers_given, answers) = sync_channel(1);
        let opener = thread::spawn(move || open_when_asked(&settings, &jobs_taken, &answers_given));
        jobs.send(None).expect("a thread that listens");
        for _ in 0..2 {
            let answer = answers.recv().expect("a thread that answers");
            assert_eq!(answer.expect_err("no such port").kind, ErrorKind::NotFound);
        }
        drop((jobs, answers));
        opener.join().expect("no panic"); // or the test hangs
    }

    #[test]
    fn attempts_keep_their_distance() {
        let settings = PortSettings { path: "/nonexistent/port".into(), baud: 115_200 };
        let (jobs, jobs_taken) = sync_channel(1);
        let (answers_given, answers) = sync_channel(1);
        thread::spawn(move || open_when_asked(&settings, &jobs_taken, &answers_given));
        let began = Instant::now();
        jobs.send(None).expect("a thread that listens");
        for _ in 0..3 {
            answers.recv().expect("a thread that answers").expect_err("no such port");
        }
        assert!(began.elapsed() >= 2 * RETRY, "three attempts within {:?}", began.elapsed());
    }
}
