//! The questions of stand-bys: which records each has, what the ledger has more, and those that wait for news.

use super::super::CLIENT;
use super::{Holds, Input, Parked, ReadFor, StandbyLink};
use crate::ledger::CopyStanding;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use xtb_bus::Question;
use xtb_dispatch::Dispatcher;
use xtb_dispatch::replication::Follow;
use xtb_protocol::codec::Format;
use xtb_protocol::messages::{Copied, STANDBY_PAGE_BYTES, StandbyReply, StandbyRequest};

/// Questions of several stand-bys that wait for news at most; then the first one is answered.
const PARKED: usize = 8;

impl StandbyLink {
    pub(super) fn asked(&mut self, now_ms: u64, question: Question, dispatcher: &Dispatcher) {
        let (request, format) = match question.decode::<StandbyRequest>() {
            Ok(read) => read,
            Err(error) => return tracing::debug!("a stand-by's question: {error}"),
        };
        self.questions += 1;
        // Others may ask how it stands, but not be its stand-by: under identities that takes a dispatcher's.
        let status = matches!(request, StandbyRequest::Status {});
        if !status && question.client().is_none_or(|client| client.as_str() != CLIENT) {
            return tracing::warn!("{:?} asks like a stand-by and is not answered", question.client());
        }
        match request {
            StandbyRequest::Follow { copy, copied, ledger, term, last, sum, offset, witnesses } => {
                let follow = Follow { copy, last, witnesses };
                let holds = Holds { number: self.questions, copied, ledger, term, sum, offset, follow };
                self.look_up(question, format, holds, false);
            }
            StandbyRequest::Leave { copy } => {
                self.left = Some((copy, self.questions));
                self.pair.left(copy);
                self.answer(now_ms, (question, format), None, Copied::Records(Vec::new()), dispatcher);
            }
            StandbyRequest::Status {} => {
                self.answer(now_ms, (question, format), None, Copied::Records(Vec::new()), dispatcher);
            }
        }
    }

    /// Reads beside the writer, on a thread that may wait for the disk.
    pub(super) fn look_up(&self, question: Question, format: Format, holds: Holds, parked: bool) {
        let room = self.reads.clone().try_acquire_owned().ok();
        if room.is_none() && !parked {
            self.overloaded.fetch_add(1, Ordering::Relaxed);
            return;
        }
        let (reader, sender) = (self.reader.clone(), self.sender.clone());
        tokio::spawn(async move {
            let Holds { sum, offset, follow, .. } = holds;
            let reading = tokio::task::spawn_blocking(move || {
                let reader = reader.lock().unwrap_or_else(PoisonError::into_inner);
                reader.page(follow.last, sum, offset, STANDBY_PAGE_BYTES)
            });
            let found = match reading.await {
                Ok(found) => found.map_err(|error| error.to_string()),
                Err(error) => Err(error.to_string()),
            };
            let read = ReadFor { question, format, holds, parked, found };
            // Nobody takes it: the dispatcher has ended.
            let _ = sender.send(Input::Read(Box::new(read))).await;
            drop(room);
        });
    }

    pub(super) fn read(&mut self, now_ms: u64, read: ReadFor, dispatcher: &Dispatcher) {
        let ReadFor { question, format, holds, parked, found } = read;
        let (history, records) = match found {
            Ok(found) => found,
            Err(error) => return tracing::warn!("the stand-by gets no records: {error}"),
        };
        let is_ledger = holds.ledger == 0 || Some(holds.ledger) == dispatcher.store().ledger();
        // A term that only a copy has was never begun; an empty ledger has none.
        if is_ledger && !holds.copied && holds.ledger != 0 {
            self.pair.saw_term(holds.term);
        }
        let is_ours = is_ledger
            && match history {
                CopyStanding::Same => true,
                CopyStanding::Replaced => holds.copied,
                CopyStanding::Other => false,
            };
        let (copy, last, store) = (holds.follow.copy, holds.follow.last, dispatcher.store());
        let is_of_this_term = store.ledger() == Some(holds.ledger) && store.term() == holds.term;
        let is_pair = holds.copied && is_of_this_term && store.pair() == Some(copy);
        if !is_ours && is_pair && last > self.own {
            // It is not told to begin anew: what it has more may have been acknowledged.
            self.ahead = Some(last);
            return;
        }
        if !is_ours {
            return self.answer(now_ms, (question, format), Some(holds), Copied::Diverged {}, dispatcher);
        }
        let has_left = self.left.is_some_and(|(left, number)| left == copy && holds.number < number);
        if !parked && !has_left {
            self.pair.follows(now_ms, holds.follow);
        }
        if records.is_empty() && !parked {
            if self.own > holds.follow.last {
                // Written since.
                return self.look_up(question, format, holds, true);
            }
            let until_ms = now_ms + self.times.answer_ms;
            if self.parked.len() >= PARKED {
                let first = self.parked.remove(0);
                self.nothing_new(now_ms, first, dispatcher);
            }
            self.parked.push(Parked { question, format, holds, until_ms });
            return;
        }
        self.answer(now_ms, (question, format), Some(holds), Copied::Records(records), dispatcher);
    }

    /// Answers the questions that have waited long enough.
    pub(super) fn release(&mut self, now_ms: u64, dispatcher: &Dispatcher) {
        let all = std::mem::take(&mut self.parked).into_iter();
        let (due, waiting): (Vec<_>, Vec<_>) = all.partition(|parked| now_ms >= parked.until_ms);
        self.parked = waiting;
        due.into_iter().for_each(|parked| self.nothing_new(now_ms, parked, dispatcher));
    }

    fn nothing_new(&self, now_ms: u64, parked: Parked, dispatcher: &Dispatcher) {
        let Parked { question, format, holds, .. } = parked;
        self.answer(now_ms, (question, format), Some(holds), Copied::Records(Vec::new()), dispatcher);
    }

    fn answer(
        &self,
        now_ms: u64,
        (question, format): (Question, Format),
        holds: Option<Holds>,
        copied: Copied,
        dispatcher: &Dispatcher,
    ) {
        let Some(client) = question.client() else { return };
        let (store, key) = (dispatcher.store(), self.keys.dispatch_standby(Some(client)));
        let mut standby = self.pair.view(now_ms);
        if let Some(view) = &mut standby {
            // Not before the ledger says so: a restart has to know it.
            view.paired &= store.pair() == Some(view.copy);
        }
        // Where nobody is paired yet each of several may be the one.
        let is_it = |holds: &Holds| self.pair.paired().is_none_or(|copy| copy == holds.follow.copy);
        let holds = holds.filter(is_it);
        let reply = StandbyReply {
            run: self.run,
            ledger: store.ledger().unwrap_or_default(),
            term: store.term(),
            last: self.own,
            witnesses: holds.and_then(|holds| self.pair.witnesses_for(holds.follow.witnesses)),
            standby,
            held: self.pair.held().map(str::to_owned),
            copied,
        };
        tokio::spawn(async move {
            if let Err(error) = question.reply(&key, &reply, format).await {
                tracing::debug!("cannot answer a stand-by: {error}");
            }
        });
    }
}
