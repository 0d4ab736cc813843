//! Speeds as ratios within one run, and which of them fell since the last accepted run: `docs/performance.md`.
//!
//! A ratio is the time of a fixed reference work divided by the time of a figure's own fixed work, both measured
//! in turn: what slows the machine slows both, so runs of noisy machines compare. Higher is faster. Pure: times
//! come in, rows and text go out; `tests/benches/ratios` measures.

mod figures;
mod page;
#[cfg(test)]
mod tests;

pub use figures::{Figure, Reference};
pub use page::{shown, with_table};

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use thiserror::Error;

/// A ratio that has lost more than this part has fallen.
pub const FALL: f64 = 0.25;
/// What is nearer to the limit than this part of the accepted ratio is at the limit.
const ROUNDING: f64 = 1e-9;

/// Times of the two works, measured one after the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Of the reference work, in s.
    pub reference_s: f64,
    /// Of the figure's work, in s.
    pub figure_s: f64,
}

/// A figure of one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// [`Figure::name`].
    pub name: String,
    /// What the work is counted in.
    pub unit: String,
    /// Units of one measurement; ratios of different works do not compare.
    pub work: f64,
    /// Time of one unit on the machine of the run, in µs: median.
    pub unit_us: f64,
    /// Time of the reference work divided by that of the figure's work: median of the pairs.
    pub ratio: f64,
    /// A tenth of the pairs have a smaller ratio.
    pub p10: f64,
    /// A tenth of the pairs have a greater ratio.
    pub p90: f64,
}

impl Row {
    /// Of a figure whose work is so many units; `None` without pairs.
    #[must_use]
    pub fn of(figure: Figure, work: f64, pairs: &[Pair]) -> Option<Self> {
        let sorted = |of: fn(&Pair) -> f64| {
            let mut values: Vec<f64> = pairs.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let ratios = sorted(|pair| pair.reference_s / pair.figure_s);
        let at = |part: f64| quantile(&ratios, part).map(digits);
        Some(Self {
            name: figure.name().to_owned(),
            unit: figure.unit().to_owned(),
            work: digits(work),
            unit_us: digits(quantile(&sorted(|pair| pair.figure_s), 0.5)? * 1e6 / work),
            ratio: at(0.5)?,
            p10: at(0.1)?,
            p90: at(0.9)?,
        })
    }

    /// Whether the ratios of both compare.
    fn is_like(&self, other: &Self) -> bool {
        self.name == other.name && self.unit == other.unit && self.work == other.work
    }
}

/// The value below which this part of the sorted values lies, between two of them if need be.
fn quantile(sorted: &[f64], part: f64) -> Option<f64> {
    let place = part * sorted.len().checked_sub(1)? as f64;
    let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    Some(low + (high - low) * place.fract())
}

/// Four digits: more is noise.
fn digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// All figures of one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// ISO 8601, as 2026-11-24.
    pub date: String,
    /// Short hash.
    pub commit: String,
    /// Of Cargo: `bench` or `test`. Only runs of one profile compare.
    pub profile: String,
    /// Processor, cores, load.
    pub machine: String,
    /// In the order of [`Figure::ALL`].
    pub rows: Vec<Row>,
}

/// Why a history cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum HistoryError {
    /// Not an array of runs.
    #[error("{file}: not a history of ratios: {reason}")]
    Damaged {
        /// Its name.
        file: String,
        /// The parser's reason.
        reason: String,
    },
    /// A number that no measurement gives.
    #[error("{file}: row {row:?} of the run of {date} ({commit}) has a number that is not above 0")]
    Number {
        /// Its name.
        file: String,
        /// The run's day.
        date: String,
        /// The run's commit.
        commit: String,
        /// The row's name.
        row: String,
    },
}

/// The accepted runs in the text of a file, oldest first; the file's name is for the error.
///
/// # Errors
/// See [`HistoryError`].
pub fn read_history(file: &str, text: &str) -> Result<Vec<Run>, HistoryError> {
    let damaged =
        |error: serde_json::Error| HistoryError::Damaged { file: file.to_owned(), reason: error.to_string() };
    let history: Vec<Run> = serde_json::from_str(text).map_err(damaged)?;
    for run in &history {
        let is_wrong = |row: &&Row| {
            let numbers = [row.work, row.unit_us, row.ratio, row.p10, row.p90];
            !numbers.iter().all(|number| number.is_finite() && *number > 0.0)
        };
        if let Some(row) = run.rows.iter().find(is_wrong) {
            let (file, row) = (file.to_owned(), row.name.clone());
            return Err(HistoryError::Number {
                file,
                date: run.date.clone(),
                commit: run.commit.clone(),
                row,
            });
        }
    }
    Ok(history)
}

/// A ratio that has fallen.
#[derive(Debug, Clone, PartialEq)]
pub struct Fall {
    /// The row's name.
    pub name: String,
    /// Now.
    pub ratio: f64,
    /// In the accepted run.
    pub accepted: f64,
    /// The accepted run's commit.
    pub commit: String,
}

impl fmt::Display for Fall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, ratio, accepted, commit } = self;
        let lost = 100.0 * (1.0 - ratio / accepted);
        let (ratio, accepted) = (shown(*ratio), shown(*accepted));
        write!(
            f,
            "ratio {name:?} fell by {lost:.0} %: {ratio} of the reference, accepted {accepted} ({commit})"
        )
    }
}

/// A run beside the last accepted one of its profile.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Day and commit of the accepted run.
    pub accepted: String,
    /// Ratios that have lost more than [`FALL`].
    pub fell: Vec<Fall>,
    /// Median of all ratios, each divided by the accepted one; 1 without any.
    pub median: f64,
    /// Accepted rows that this run does not have.
    pub missing: Vec<String>,
    /// Rows of this run that were not accepted yet, or with another work.
    pub new: Vec<String>,
}

impl Comparison {
    /// Those that have fallen and have lost more than [`FALL`] of the median, too. On a computer of another kind all
    /// ratios may be lower.
    pub fn fell_beside_the_others(&self) -> impl Iterator<Item = &Fall> {
        let least = self.median * (1.0 - FALL - ROUNDING);
        self.fell.iter().filter(move |fall| fall.ratio < fall.accepted * least)
    }

    /// Whether the ratios are lower as a whole.
    #[must_use]
    pub fn all_fell(&self) -> bool {
        self.median < 1.0 - FALL - ROUNDING
    }
}

/// Compares a run with the last accepted one of its profile; `None` = there is none.
#[must_use]
pub fn compare(run: &Run, history: &[Run]) -> Option<Comparison> {
    let accepted = history.iter().rev().find(|accepted| accepted.profile == run.profile)?;
    let (mut fell, mut new, mut kept) = (Vec::new(), Vec::new(), Vec::new());
    for row in &run.rows {
        let Some(before) = accepted.rows.iter().find(|before| before.is_like(row)) else {
            new.push(row.name.clone());
            continue;
        };
        kept.push(row.ratio / before.ratio);
        if row.ratio < before.ratio * (1.0 - FALL - ROUNDING) {
            fell.push(Fall {
                name: row.name.clone(),
                ratio: row.ratio,
                accepted: before.ratio,
                commit: accepted.commit.clone(),
            });
        }
    }
    let is_measured = |row: &&Row| run.rows.iter().any(|now| now.name == row.name);
    let missing = accepted.rows.iter().filter(|row| !is_measured(row)).map(|row| row.name.clone()).collect();
    kept.sort_by(f64::total_cmp);
    let median = quantile(&kept, 0.5).unwrap_or(1.0);
    Some(Comparison {
        accepted: format!("{}, {}", accepted.date, accepted.commit),
        fell,
        median,
        missing,
        new,
    })
}

/// By a row's name its accepted ratios of a profile, each with the number of its run, divided by the first one.
/// A row begins anew where its work has changed.
#[must_use]
pub fn courses(history: &[Run], profile: &str) -> BTreeMap<String, Vec<(usize, f64)>> {
    let mut rows: BTreeMap<String, Vec<(usize, &Row)>> = BTreeMap::new();
    for (number, run) in history.iter().filter(|run| run.profile == profile).enumerate() {
        for row in &run.rows {
            let course = rows.entry(row.name.clone()).or_default();
            if course.last().is_some_and(|(_, before)| !before.is_like(row)) {
                course.clear();
            }
            course.push((number, row));
        }
    }
    let relative = |course: Vec<(usize, &Row)>| {
        let first = course.first().map_or(1.0, |(_, row)| row.ratio);
        course.into_iter().map(|(number, row)| (number, row.ratio / first)).collect()
    };
    rows.into_iter().map(|(name, course)| (name, relative(course))).collect()
}
