//! Two computers with a disk each, robots, and a network between them, in virtual time: whoever is killed starts
//! again, whatever is acknowledged is remembered.

mod disk;

pub(crate) use disk::Counts;

use disk::{Disk, Row};
use std::collections::{BTreeMap, BTreeSet};
use xtb_dispatch::replication::{Active, Follow, Follower, Observed, StandbyDecision, Times};
use xtb_protocol::Name;
use xtb_protocol::messages::Witnesses;

const STEP_MS: u64 = 50;
const ROBOTS: usize = 5;
/// Storm, and then peace in which all has to be found again.
const STORM_MS: u64 = 120_000;
const PEACE_MS: u64 = 30_000;
/// A network that is whole again stays so for this long: what cannot be excluded otherwise is told in the docs.
const WHOLE_MS: u64 = 2_500;
/// A question without an answer is asked again after this.
const ASK_AGAIN_MS: u64 = 1_000;
const CONSULT_MS: u64 = 5_000;

enum Role {
    Down {
        until_ms: u64,
    },
    Consults {
        until_ms: u64,
    },
    Active {
        active: Active,
        run: u64,
        pending: Vec<(u64, u64)>,
        /// The last row that has taken effect.
        applied: u64,
    },
    Standby {
        follower: Follower,
        question: u64,
        ask_ms: u64,
    },
    TakingOver {
        follower: Follower,
        until_ms: u64,
    },
    /// A person has to decide.
    Ended,
}

struct Question {
    number: u64,
    asked_ms: u64,
    follow: Follow,
    copied: bool,
    term: u32,
    last: Option<Row>,
}

struct Answer {
    question: u64,
    asked_ms: u64,
    run: u64,
    paired: bool,
    witnesses: Option<Witnesses>,
    after: u64,
    term: u32,
    /// `None` = diverged.
    rows: Option<Vec<Row>>,
}

enum Mail {
    Question(Question),
    Answer(Answer),
}

struct Node {
    disk: Disk,
    role: Role,
}

pub(super) struct Pair {
    pub(super) counts: Counts,
    times: Times,
    random: u64,
    now_ms: u64,
    nodes: [Node; 2],
    /// When it comes, to whom, what.
    mail: Vec<(u64, usize, Mail)>,
    /// On which side each robot is, while the network is split.
    split: Option<Vec<usize>>,
    changes_ms: u64,
    /// Until when a presence is still shown that is gone, for each one who looks.
    ghost_ms: [u64; 2],
    acknowledged: BTreeSet<u64>,
    /// Who has assigned in which term.
    drives: BTreeMap<u32, usize>,
    next_id: u64,
}

impl Pair {
    pub(super) fn new(seed: u64, times: Times) -> Self {
        let node = |until_ms| Node { disk: Disk::default(), role: Role::Down { until_ms } };
        Self {
            counts: Counts::default(),
            times,
            random: seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1,
            now_ms: 0,
            nodes: [node(0), node(500)],
            mail: Vec::new(),
            split: None,
            changes_ms: 8_000,
            ghost_ms: [0; 2],
            acknowledged: BTreeSet::new(),
            drives: BTreeMap::new(),
            next_id: 1,
        }
    }

    fn below(&mut self, bound: u64) -> u64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 11) % bound
    }

    fn id(&mut self) -> u64 {
        self.next_id += 1;
        self.next_id
    }

    pub(super) fn run(&mut self) -> Result<(), String> {
        while self.now_ms < STORM_MS + PEACE_MS {
            self.now_ms += STEP_MS;
            self.weather();
            self.deliver()?;
            for who in [0, 1] {
                self.step(who)?;
            }
        }
        self.counts.acknowledged = self.acknowledged.len();
        let actives = self.nodes.iter().filter(|node| matches!(node.role, Role::Active { .. }));
        match actives.max_by_key(|node| node.disk.term()) {
            Some(node) => self.has_all(&node.disk, "at the end"),
            // It may need a person, but hardly ever does.
            None => {
                self.counts.left_alone += 1;
                Ok(())
            }
        }
    }

    fn has_all(&self, disk: &Disk, when: &str) -> Result<(), String> {
        let held: BTreeSet<u64> = disk
            .rows
            .iter()
            .filter_map(|row| if let Row::Task(id) = row { Some(*id) } else { None })
            .collect();
        match self.acknowledged.difference(&held).next() {
            Some(lost) => Err(format!("{} ms: task {lost} is lost {when}", self.now_ms)),
            None => Ok(()),
        }
    }

    /// Kills, splits, and their ends.
    fn weather(&mut self) {
        if self.now_ms > STORM_MS {
            self.split = None;
            return;
        }
        for who in [0, 1] {
            if self.below(300) == 0 {
                self.kill(who);
            }
        }
        if self.now_ms < self.changes_ms {
            return;
        }
        if self.split.take().is_some() {
            self.changes_ms = self.now_ms + WHOLE_MS + self.below(8_000);
            // A split often ends as somebody is restarted.
            if self.below(2) == 0 {
                let who = self.below(2) as usize;
                self.kill(who);
            }
        } else {
            self.split = Some((0..ROBOTS).map(|_| self.below(2) as usize).collect());
            self.changes_ms = self.now_ms + 300 + self.below(7_000);
            self.ghost_ms = [self.now_ms + self.below(2_000), self.now_ms + self.below(2_000)];
        }
    }

    fn kill(&mut self, who: usize) {
        let until_ms = self.now_ms + 300 + self.below(6_000);
        if !matches!(self.nodes[who].role, Role::Ended) {
            self.nodes[who].role = Role::Down { until_ms };
        }
    }

    fn visible(&self, who: usize) -> BTreeSet<Name> {
        let robots = (0..ROBOTS).filter(|robot| self.split.as_ref().is_none_or(|split| split[*robot] == who));
        robots.map(|robot| Name::new(&format!("xtb-{robot}")).unwrap()).collect()
    }

    fn is_present(&self, who: usize) -> bool {
        matches!(self.nodes[who].role, Role::Active { .. } | Role::Consults { .. })
    }

    fn send(&mut self, to: usize, more_ms: u64, mail: Mail) {
        let at_ms = self.now_ms + more_ms + 1 + self.below(120);
        if self.split.is_none() {
            self.mail.push((at_ms, to, mail));
        }
    }

    fn deliver(&mut self) -> Result<(), String> {
        let now_ms = self.now_ms;
        let (due, later): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.mail).into_iter().partition(|(at_ms, ..)| *at_ms <= now_ms);
        self.mail = later;
        if self.split.is_some() {
            return Ok(()); // It is lost.
        }
        for (_, to, mail) in due {
            match mail {
                Mail::Question(question) => self.asked(to, question)?,
                Mail::Answer(answer) => self.answered(to, answer),
            }
        }
        Ok(())
    }

    fn asked(&mut self, who: usize, question: Question) -> Result<(), String> {
        let now_ms = self.now_ms;
        let disk = &self.nodes[who].disk;
        let own = (question.follow.last as usize).checked_sub(1).map(|index| disk.rows.get(index).copied());
        let is_ours = own.is_none_or(|own| own.is_some() && own == question.last);
        let term = disk.term();
        if matches!(self.nodes[who].role, Role::Consults { .. }) {
            let pair = disk.pair(disk.last());
            if !question.copied && question.term > term {
                self.kill(who);
            } else if question.copied && pair == Some(question.follow.copy) {
                let after = question.follow.last;
                if is_ours && after == disk.last() {
                    self.begin(who, pair)?;
                } else {
                    let rows = is_ours.then(|| disk.next(after));
                    let answer = Answer {
                        question: question.number,
                        asked_ms: question.asked_ms,
                        run: 0,
                        paired: false,
                        witnesses: None,
                        after,
                        term,
                        rows,
                    };
                    self.send(1 - who, 0, Mail::Answer(answer));
                }
            }
        }
        let node = &mut self.nodes[who];
        let Role::Active { active, run, applied, .. } = &mut node.role else { return Ok(()) };
        if !question.copied {
            active.saw_term(question.term);
        }
        let copy = question.follow.copy;
        if is_ours {
            active.follows(now_ms, question.follow);
        }
        *applied = (*applied).max(active.acknowledged());
        let is_paired = active.view(now_ms).is_some_and(|view| view.copy == copy && view.paired);
        let paired = is_paired && node.disk.pair(*applied) == Some(copy);
        let after = question.follow.last;
        let answer = Answer {
            question: question.number,
            asked_ms: question.asked_ms,
            run: *run,
            paired: paired && is_ours,
            witnesses: active.witnesses_for(question.follow.witnesses),
            after,
            term,
            rows: is_ours.then(|| node.disk.next(after)),
        };
        let is_news = answer.rows.as_ref().is_none_or(|rows| !rows.is_empty());
        let more_ms = if is_news { 0 } else { self.times.answer_ms };
        self.send(1 - who, more_ms, Mail::Answer(answer));
        Ok(())
    }

    fn answered(&mut self, who: usize, answer: Answer) {
        let node = &mut self.nodes[who];
        let Role::Standby { follower, question, ask_ms } = &mut node.role else { return };
        if answer.question != *question {
            return;
        }
        *ask_ms = 0;
        if answer.term < node.disk.term() && !node.disk.copied {
            return; // From one that this one has replaced.
        }
        let Some(rows) = answer.rows else {
            self.counts.begun_anew += 1;
            (node.disk.rows, node.disk.copied) = (Vec::new(), true);
            return;
        };
        assert_eq!(node.disk.last(), answer.after);
        node.disk.rows.extend(rows);
        node.disk.copied = true;
        follower.answered(answer.asked_ms, answer.run, answer.paired, answer.witnesses);
    }

    /// It becomes active, and has to have everything.
    fn begin(&mut self, who: usize, pair: Option<u64>) -> Result<(), String> {
        self.has_all(&self.nodes[who].disk, &format!("as {who} begins"))?;
        let run = self.id();
        let node = &mut self.nodes[who];
        node.disk.copied = false;
        let active = Active::new(self.times, self.now_ms, node.disk.last(), node.disk.term(), pair);
        node.role = Role::Active { active, run, pending: Vec::new(), applied: node.disk.last() };
        Ok(())
    }

    fn restart(&mut self, who: usize) -> Result<(), String> {
        let other_is_seen = self.split.is_none() && self.is_present(1 - who);
        let copy = self.id();
        let disk = &mut self.nodes[who].disk;
        if other_is_seen || disk.copied || (who == 1 && disk.rows.is_empty()) {
            if !disk.copied {
                disk.copy = copy;
            }
            let follower = Follower::new(self.times, self.now_ms);
            self.nodes[who].role = Role::Standby { follower, question: 0, ask_ms: 0 };
            return Ok(());
        }
        if disk.pair(disk.last()).is_some() {
            self.nodes[who].role = Role::Consults { until_ms: self.now_ms + CONSULT_MS };
            return Ok(());
        }
        self.begin(who, None)
    }

    fn step(&mut self, who: usize) -> Result<(), String> {
        let now_ms = self.now_ms;
        match &self.nodes[who].role {
            Role::Down { until_ms } if now_ms >= *until_ms => self.restart(who),
            Role::Consults { until_ms } if now_ms >= *until_ms => {
                self.kill(who);
                Ok(())
            }
            Role::Active { .. } => {
                self.lead(who);
                self.drive(who)
            }
            Role::Standby { .. } => self.follow(who),
            Role::TakingOver { follower, until_ms } if now_ms >= *until_ms => {
                if follower.is_in_time(now_ms) {
                    self.counts.taken_over += 1;
                    return self.begin(who, None);
                }
                self.nodes[who].role = Role::Ended;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Writes, acknowledges, looks for another one.
    fn lead(&mut self, who: usize) {
        let (now_ms, visible) = (self.now_ms, self.visible(who));
        let (id, row_id, submits) = (self.id(), self.id(), self.below(4) == 0);
        let other_term = match &self.nodes[1 - who].role {
            Role::Active { .. } if self.split.is_none() => self.nodes[1 - who].disk.term(),
            _ => 0,
        };
        let node = &mut self.nodes[who];
        let Role::Active { active, pending, applied, .. } = &mut node.role else { return };
        if now_ms.is_multiple_of(1_000) {
            active.saw_term(other_term);
        }
        let (was_paired, was_held) = (active.paired().is_some(), active.held().is_some());
        active.step(now_ms, &visible);
        self.counts.alone += usize::from(was_paired && active.paired().is_none());
        self.counts.held += usize::from(!was_held && active.held().is_some());
        if active.held().is_none() {
            if node.disk.pair(node.disk.last()) != active.paired() {
                node.disk.rows.push(Row::Pair(active.paired(), row_id));
            }
            if submits {
                node.disk.rows.push(Row::Task(id));
                pending.push((node.disk.last(), id));
            }
            active.wrote(node.disk.last());
        }
        let acknowledged = active.acknowledged();
        *applied = (*applied).max(acknowledged);
        let done: Vec<u64> = pending.iter().filter(|(n, _)| *n <= acknowledged).map(|(_, id)| *id).collect();
        pending.retain(|(n, _)| *n > acknowledged);
        self.acknowledged.extend(done);
        if active.superseded().is_some() {
            self.kill(who);
        }
    }

    /// In each term one of them assigns.
    fn drive(&mut self, who: usize) -> Result<(), String> {
        let Role::Active { active, .. } = &self.nodes[who].role else { return Ok(()) };
        if active.held().is_some() {
            return Ok(());
        }
        let term = self.nodes[who].disk.term();
        match *self.drives.entry(term).or_insert(who) {
            by if by == who => Ok(()),
            by => Err(format!("{} ms: {by} and {who} assign in term {term}", self.now_ms)),
        }
    }

    /// Asks, and takes over if it may.
    fn follow(&mut self, who: usize) -> Result<(), String> {
        let (now_ms, number, row_id, fsync_ms) = (self.now_ms, self.id(), self.id(), self.below(300));
        let shown = match self.split {
            None => self.is_present(1 - who),
            Some(_) => now_ms < self.ghost_ms[who],
        };
        let seen = Observed { present: shown, robots: self.visible(who), hears: None };
        let node = &mut self.nodes[who];
        let Role::Standby { follower, question, ask_ms } = &mut node.role else { return Ok(()) };
        let decision = follower.step(now_ms, &seen);
        let is_own = !node.disk.copied && node.disk.last() > 0 && node.disk.pair(node.disk.last()).is_none();
        if decision == StandbyDecision::Stale && is_own && !shown {
            return self.begin(who, None);
        }
        if decision == StandbyDecision::TakeOver {
            let term = node.disk.term() + 1;
            node.disk.rows.push(Row::Term(term, row_id));
            let follower = follower.clone();
            node.role = Role::TakingOver { follower, until_ms: now_ms + fsync_ms };
            return Ok(());
        }
        if now_ms < *ask_ms {
            return Ok(());
        }
        (*question, *ask_ms) = (number, now_ms + ASK_AGAIN_MS);
        let follow = Follow { copy: node.disk.copy, last: node.disk.last(), witnesses: follower.knows() };
        let asked = Question {
            number,
            asked_ms: now_ms,
            follow,
            copied: node.disk.copied,
            term: node.disk.term(),
            last: node.disk.rows.last().copied(),
        };
        self.send(1 - who, 0, Mail::Question(asked));
        Ok(())
    }
}
