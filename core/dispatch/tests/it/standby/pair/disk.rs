//! What is on a computer's disk, and what has happened to two of them.

/// What has happened.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Counts {
    pub(crate) acknowledged: usize,
    pub(crate) taken_over: usize,
    pub(crate) alone: usize,
    pub(crate) held: usize,
    pub(crate) begun_anew: usize,
    /// Storms after which no dispatcher was active.
    pub(crate) left_alone: usize,
}

impl Counts {
    pub(crate) fn add(&mut self, other: &Self) {
        self.acknowledged += other.acknowledged;
        self.taken_over += other.taken_over;
        self.alone += other.alone;
        self.held += other.held;
        self.begun_anew += other.begun_anew;
        self.left_alone += other.left_alone;
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Row {
    Task(u64),
    Term(u32, u64),
    Pair(Option<u64>, u64),
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Disk {
    pub(crate) rows: Vec<Row>,
    pub(crate) copied: bool,
    pub(crate) copy: u64,
}

impl Disk {
    pub(crate) fn term(&self) -> u32 {
        let term = |row: &Row| if let Row::Term(term, _) = row { Some(*term) } else { None };
        self.rows.iter().rev().find_map(term).unwrap_or(0)
    }

    /// The pair that the first `count` rows end with.
    pub(crate) fn pair(&self, count: u64) -> Option<u64> {
        let last = self.rows[..count as usize].iter().rev().find(|row| !matches!(row, Row::Task(_)));
        if let Some(Row::Pair(copy, _)) = last { *copy } else { None }
    }

    pub(crate) fn last(&self) -> u64 {
        self.rows.len() as u64
    }

    /// The rows that follow, as many as an answer has.
    pub(crate) fn next(&self, after: u64) -> Vec<Row> {
        self.rows[after as usize..].iter().take(20).copied().collect()
    }
}
