//! What to ask a robot next to get one recording whole, whatever is there already. Pure: answers in,
//! questions and bytes out.

use thiserror::Error;
use xtb_protocol::messages::{LogRequest, MAX_PIECE};

/// The recording here is not the beginning of the robot's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the partial download does not match the robot's recording")]
pub(super) struct Differs;

/// What to do next.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// Ask the robot.
    Ask(LogRequest),
    /// The recording is here, whole.
    Done,
}

/// One recording on its way.
#[derive(Debug)]
pub(super) struct Fetch {
    file: String,
    /// Bytes that are here and known to be the robot's.
    have: u64,
    /// Where the recording ended when it was first asked for; it may grow meanwhile.
    end: Option<u64>,
    /// The last bytes of what was fetched before: the robot's must be the same.
    check: Vec<u8>,
}

impl Fetch {
    /// Goes on after `have` bytes, of which `tail` are the last (at most [`MAX_PIECE`]).
    pub(super) fn new(file: String, have: u64, tail: Vec<u8>) -> Self {
        Self { file, have, end: None, check: tail }
    }

    pub(super) fn next(&self) -> Next {
        let read = |offset, length| Next::Ask(LogRequest::Read { file: self.file.clone(), offset, length });
        if !self.check.is_empty() {
            let length = u32::try_from(self.check.len()).unwrap_or(MAX_PIECE);
            return read(self.have - u64::from(length), length);
        }
        match self.end {
            Some(end) if self.have >= end => Next::Done,
            Some(end) => read(self.have, u32::try_from(end - self.have).unwrap_or(MAX_PIECE).min(MAX_PIECE)),
            None => read(self.have, MAX_PIECE),
        }
    }

    /// The robot's answer to the question before; gives back what is to be written.
    ///
    /// # Errors
    /// [`Differs`].
    pub(super) fn take(&mut self, bytes: u64, data: Vec<u8>) -> Result<Vec<u8>, Differs> {
        if !self.check.is_empty() {
            return match std::mem::take(&mut self.check) == data {
                true => Ok(Vec::new()),
                false => Err(Differs),
            };
        }
        let end = *self.end.get_or_insert(bytes.max(self.have));
        // A recording that has become shorter has been replaced.
        if bytes < self.have || (data.is_empty() && self.have < end) {
            return Err(Differs);
        }
        self.have += data.len() as u64;
        Ok(data)
    }

    /// Bytes that are here, and of how many.
    pub(super) fn progress(&self) -> (u64, Option<u64>) {
        (self.have, self.end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fetches from a recording that grows by `grows` bytes with each piece.
    fn fetch(mut theirs: Vec<u8>, ours: Vec<u8>, grows: usize) -> Result<(Vec<u8>, usize), Differs> {
        let tail = ours[ours.len().saturating_sub(MAX_PIECE as usize)..].to_vec();
        let (mut fetch, mut got) = (Fetch::new("a.mcap".into(), ours.len() as u64, tail), ours);
        let mut asked = 0;
        while let Next::Ask(LogRequest::Read { offset, length, .. }) = fetch.next() {
            asked += 1;
            let from = (offset as usize).min(theirs.len());
            let to = (from + length as usize).min(theirs.len());
            let piece = theirs[from..to].to_vec();
            got.extend(fetch.take(theirs.len() as u64, piece)?);
            theirs.extend(vec![7; grows]);
        }
        Ok((got, asked))
    }

    fn recording(bytes: usize) -> Vec<u8> {
        (0..bytes).map(|n| (n * 31 % 251) as u8).collect()
    }

    #[test]
    fn a_recording_comes_whole_and_in_as_few_pieces_as_it_takes() {
        let piece = MAX_PIECE as usize;
        for (bytes, pieces) in [(0, 1), (1, 1), (piece, 1), (piece + 1, 2), (10 * piece - 5, 10)] {
            assert_eq!(fetch(recording(bytes), Vec::new(), 0), Ok((recording(bytes), pieces)), "{bytes}");
        }
    }

    #[test]
    fn what_is_here_is_not_asked_for_again_but_for_its_end() {
        let all = recording(200_000);
        let (got, asked) = fetch(all.clone(), all[..150_000].to_vec(), 0).unwrap();
        assert_eq!((got == all, asked), (true, 1 + 2));
        assert_eq!(fetch(all.clone(), all.clone(), 0).unwrap(), (all, 2));
    }

    #[test]
    fn a_recording_that_grows_comes_as_long_as_it_was() {
        assert_eq!(fetch(recording(100_000), Vec::new(), 1000).unwrap().0, recording(100_000));
    }

    #[test]
    fn another_recording_of_the_same_name_is_noticed() {
        let mut other = recording(200_000);
        other[149_000] ^= 1;
        assert_eq!(fetch(other, recording(150_000), 0), Err(Differs));
        assert_eq!(fetch(recording(100), recording(150_000), 0), Err(Differs), "shorter");
    }
}
