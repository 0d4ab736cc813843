//! The part of `docs/performance.md` that is made from the accepted runs.

use super::Run;
use std::fmt::Write as _;

const BEGIN: &str = "<!-- written by the bench: begin -->\n";
const END: &str = "<!-- written by the bench: end -->";

/// The page with the last accepted run of each profile between its two marks; `None` if it has no marks.
#[must_use]
pub fn with_table(page: &str, history: &[Run]) -> Option<String> {
    let (before, rest) = page.split_once(BEGIN)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{BEGIN}{}{END}{after}", tables(history)))
}

fn tables(history: &[Run]) -> String {
    if history.is_empty() {
        return "No run has been accepted yet; the first one fills in its table and its plot here.\n"
            .to_owned();
    }
    let last = |profile: &str| history.iter().rev().find(|run| run.profile == profile);
    let mut text: Vec<String> = ["bench", "test"].into_iter().filter_map(last).map(table).collect();
    text.push("![The accepted ratios of profile bench, run by run](ratios/history.svg)\n".to_owned());
    text.join("\n")
}

fn table(run: &Run) -> String {
    let Run { date, commit, profile, machine, rows } = run;
    let mut text = format!(
        "Profile `{profile}`, {date}, commit {commit}; {machine}:\n\n\
         | figure | on this machine | ratio | p10 to p90 |\n| --- | ---: | ---: | ---: |\n"
    );
    for row in rows {
        let [unit_us, ratio, p10, p90] = [row.unit_us, row.ratio, row.p10, row.p90].map(shown);
        // Writing into a string cannot fail.
        let _ = writeln!(text, "| {} | {unit_us} µs a {} | {ratio} | {p10} to {p90} |", row.name, row.unit);
    }
    text
}

/// A positive number in few digits.
#[must_use]
pub fn shown(number: f64) -> String {
    match number {
        100.0.. => format!("{number:.0}"),
        0.1.. => format!("{number:.2}"),
        _ => format!("{number:.4}"),
    }
}
