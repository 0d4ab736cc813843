//! A dispatcher and its stand-by as processes on two ledgers, either of which may be killed.

use super::{Asker, Serve};
use crate::processes::{Process, Signal};
use crate::{PATIENCE, eventually};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use xtb_protocol::messages::StandbyReply;

/// Both of them.
pub struct ServePair {
    endpoint: String,
    ledgers: [PathBuf; 2],
    processes: [Process; 2],
    active: usize,
    /// How long it took until the first one was ready.
    pub ready_within: Duration,
}

impl ServePair {
    /// Starts both in this folder, and waits until nothing is acknowledged that only one has.
    ///
    /// # Panics
    /// If they do not start.
    pub async fn start(endpoint: &str, folder: &Path, asker: &Asker) -> Self {
        let ledgers = ["a.ledger", "b.ledger"].map(|name| folder.join(name));
        let began = Instant::now();
        let first = begin(endpoint, &ledgers[0], false);
        eventually("a dispatcher", || asker.standby()).await;
        let ready_within = began.elapsed();
        let processes = [first, begin(endpoint, &ledgers[1], true)];
        let pair = Self { endpoint: endpoint.to_owned(), ledgers, processes, active: 0, ready_within };
        pair.paired().await;
        pair
    }

    /// Waits until the stand-by says that the dispatcher acknowledges nothing that it lacks.
    ///
    /// # Panics
    /// If it never does.
    pub async fn paired(&self) {
        let standby = 1 - self.active;
        eventually("a pair", || async { self.says_paired(standby).then_some(()) }).await;
    }

    fn says_paired(&self, number: usize) -> bool {
        let output = std::fs::read_to_string(self.ledgers[number].with_extension("out"));
        output.is_ok_and(|text| text.lines().last().is_some_and(|line| line.contains("\"paired\"")))
    }

    /// `kill -9` of the dispatcher: how long it took until the stand-by had taken over. What was killed starts
    /// again as the stand-by, and both are a pair again.
    ///
    /// # Panics
    /// If nobody takes over.
    pub async fn kill_active(&mut self, asker: &Asker) -> Duration {
        let term = eventually("a dispatcher", || asker.standby()).await.term;
        let began = Instant::now();
        kill(&mut self.processes[self.active]);
        self.until_taken_over(asker, term).await;
        let took = began.elapsed();
        self.restart_standby().await;
        took
    }

    /// Waits until the stand-by has taken over from the one of `term`.
    ///
    /// # Panics
    /// If it does not.
    pub async fn until_taken_over(&mut self, asker: &Asker, term: u32) {
        let later = |reply: &StandbyReply| reply.term > term;
        eventually("a take-over", || async { asker.standby().await.filter(later) }).await;
        self.active = 1 - self.active;
    }

    /// `kill -9` of whoever is not the dispatcher, if it still runs; it starts again, as the stand-by.
    ///
    /// # Panics
    /// If it does not follow.
    pub async fn restart_standby(&mut self) {
        let other = 1 - self.active;
        kill(&mut self.processes[other]);
        self.processes[other] = begin(&self.endpoint, &self.ledgers[other], true);
        self.paired().await;
    }

    /// `kill -9` of the stand-by, and, so long after it has been started again, perhaps before both are a pair, of the
    /// dispatcher or of the stand-by once more. The dispatcher starts as one; who ends, because the other one had
    /// taken over, as the stand-by.
    ///
    /// # Panics
    /// If they are no pair then.
    pub async fn kill_before_paired(&mut self, of_active: bool, after: Duration) {
        let standby = 1 - self.active;
        let victim = self.number(of_active);
        kill(&mut self.processes[standby]);
        self.processes[standby] = begin(&self.endpoint, &self.ledgers[standby], true);
        tokio::time::sleep(after).await;
        kill(&mut self.processes[victim]);
        self.processes[victim] = begin(&self.endpoint, &self.ledgers[victim], !of_active);
        let give_up = Instant::now() + PATIENCE;
        loop {
            for number in 0..2 {
                if !self.processes[number].runs() {
                    self.processes[number] = begin(&self.endpoint, &self.ledgers[number], true);
                }
            }
            if let Some(standby) = (0..2).find(|&number| self.says_paired(number)) {
                self.active = 1 - standby;
                return;
            }
            assert!(Instant::now() < give_up, "no pair");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    /// Sends the dispatcher, or its stand-by, a signal.
    pub fn signal(&self, to_active: bool, signal: Signal) {
        self.processes[self.number(to_active)].signal(signal);
    }

    /// Whether it has not ended.
    pub fn runs(&mut self, active: bool) -> bool {
        let number = self.number(active);
        self.processes[number].runs()
    }

    /// The ledger of the dispatcher, or of its stand-by.
    #[must_use]
    pub fn ledger(&self, of_active: bool) -> &Path {
        &self.ledgers[self.number(of_active)]
    }

    /// Kills both.
    pub fn kill_both(&mut self) {
        self.processes.iter_mut().for_each(kill);
    }

    fn number(&self, active: bool) -> usize {
        if active { self.active } else { 1 - self.active }
    }
}

fn kill(process: &mut Process) {
    if process.runs() {
        process.signal(Signal::Kill);
    }
    let _ = process.0.wait();
}

/// What it prints goes to a file: a stand-by prints another line when it takes over.
fn begin(endpoint: &str, ledger: &Path, standby: bool) -> Process {
    let mut command = Serve::command(endpoint, ledger);
    if standby {
        command.arg("--standby");
    }
    let output = File::create(ledger.with_extension("out")).unwrap_or_else(|error| panic!("{error}"));
    Process::start(command.stdout(output))
}
