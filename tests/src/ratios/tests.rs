//! Made-up numbers, and the committed history.

use super::*;
use std::collections::BTreeSet;

const HISTORY: &str = include_str!("../../../docs/ratios/history.json");
const PAGE: &str = include_str!("../../../docs/performance.md");

fn pairs(times_s: &[(f64, f64)]) -> Vec<Pair> {
    times_s.iter().map(|&(reference_s, figure_s)| Pair { reference_s, figure_s }).collect()
}

fn row(name: &str, ratio: f64) -> Row {
    let (name, unit) = (name.to_owned(), "turn".to_owned());
    Row { name, unit, work: 1000.0, unit_us: 4.3, ratio, p10: ratio * 0.9, p90: ratio * 1.1 }
}

fn run(profile: &str, commit: &str, rows: Vec<Row>) -> Run {
    let [date, commit, profile, machine] =
        ["2026-11-24", commit, profile, "some processor, 2 cores, load 0.10"].map(str::to_owned);
    Run { date, commit, profile, machine, rows }
}

#[test]
fn a_ratio_is_the_median_of_the_pairs_and_not_of_the_times() {
    // One pair was measured while the machine was ten times slower: both works were.
    let measured = pairs(&[(0.010, 0.020), (0.100, 0.190), (0.010, 0.021)]);
    let row = Row::of(Figure::RobotTurn, 1000.0, &measured).unwrap();
    assert_eq!((row.name.as_str(), row.unit.as_str(), row.work), ("robot turn", "turn", 1000.0));
    assert_eq!((row.ratio, row.unit_us), (0.5, 21.0));
    // Of two pairs their mean; a tenth of the way from the least to the greatest.
    let row = Row::of(Figure::RobotTurn, 1000.0, &pairs(&[(2.0, 1.0), (1.0, 1.0)])).unwrap();
    assert_eq!((row.p10, row.ratio, row.p90), (1.1, 1.5, 1.9));
    assert_eq!(Row::of(Figure::RobotTurn, 1000.0, &[]), None);
}

#[test]
fn what_has_lost_a_quarter_exactly_has_not_fallen_and_what_has_lost_more_has() {
    for accepted in [0.8, 1.0, 0.0123, 7.3] {
        let history = [run("bench", "a1b2c3d", vec![row("robot turn", accepted)])];
        let fell = |ratio: f64| {
            compare(&run("bench", "now", vec![row("robot turn", ratio)]), &history).unwrap().fell.len()
        };
        assert_eq!((fell(accepted * 0.75), fell(accepted * 0.7499), fell(accepted * 2.0)), (0, 1, 0));
    }
    let at_limit = run("bench", "now", vec![row("robot turn", 0.6)]);
    let history = [run("bench", "a1b2c3d", vec![row("robot turn", 0.8)])];
    assert!(compare(&at_limit, &history).unwrap().fell.is_empty());
}

#[test]
fn a_fall_names_its_row_both_ratios_and_the_accepted_commit() {
    let history = [run("test", "a1b2c3d", vec![row("robot turn", 0.75)])];
    let compared = compare(&run("test", "now", vec![row("robot turn", 0.52)]), &history).unwrap();
    assert_eq!(
        compared.fell[0].to_string(),
        r#"ratio "robot turn" fell by 31 %: 0.52 of the reference, accepted 0.75 (a1b2c3d)"#
    );
    assert_eq!(compared.accepted, "2026-11-24, a1b2c3d");
}

#[test]
fn where_all_ratios_are_lower_those_that_fell_beside_the_others_are_known() {
    let of = |ratios: [f64; 4]| {
        ["a", "b", "c", "d"].into_iter().zip(ratios).map(|(name, ratio)| row(name, ratio)).collect()
    };
    let history = [run("bench", "a1b2c3d", of([0.5, 1.0, 2.0, 4.0]))];
    let beside = |ratios: [f64; 4]| {
        let compared = compare(&run("bench", "now", of(ratios)), &history).unwrap();
        let names: Vec<String> = compared.fell_beside_the_others().map(|fall| fall.name.clone()).collect();
        (compared.all_fell(), compared.fell.len(), names)
    };
    assert_eq!(beside([0.3, 0.6, 1.2, 1.6]), (true, 4, vec!["d".to_owned()]));
    assert_eq!(beside([0.3, 0.6, 1.2, 2.4]), (true, 4, vec![]));
    assert_eq!(beside([0.5, 1.0, 2.0, 1.6]), (false, 1, vec!["d".to_owned()]));
}

#[test]
fn a_missing_row_a_new_row_and_one_of_another_work_are_told_and_are_no_falls() {
    let history = [run("bench", "a1b2c3d", vec![row("gone", 1.0), row("stays", 1.0), row("changed", 1.0)])];
    let changed = Row { work: 2000.0, ..row("changed", 0.1) };
    let now = run("bench", "now", vec![row("stays", 0.9), changed, row("added", 0.1)]);
    let compared = compare(&now, &history).unwrap();
    assert!(compared.fell.is_empty(), "{compared:?}");
    assert_eq!(compared.missing, ["gone"]);
    assert_eq!(compared.new, ["changed", "added"]);
}

#[test]
fn a_run_is_compared_with_the_last_accepted_one_of_its_own_profile() {
    let turn = |ratio: f64| vec![row("robot turn", ratio)];
    let history = [
        run("bench", "first", turn(4.0)),
        run("bench", "second", turn(1.0)),
        run("test", "third", turn(9.0)),
    ];
    let compared = compare(&run("bench", "now", turn(0.7)), &history).unwrap();
    assert_eq!((compared.fell[0].accepted, compared.fell[0].commit.as_str()), (1.0, "second"));
    assert_eq!(compare(&run("profiling", "now", turn(0.1)), &history), None);
    assert_eq!(compare(&run("bench", "now", turn(0.1)), &[]), None);
}

#[test]
fn a_history_comes_back_from_its_json_as_it_was() {
    let measured = Row::of(Figure::BadDays, 123.456, &pairs(&[(0.0051, 0.0377), (0.0053, 0.0381)])).unwrap();
    let history =
        vec![run("bench", "a1b2c3d", vec![measured, row("robot turn", 0.75)]), run("test", "b", vec![])];
    let text = serde_json::to_string_pretty(&history).unwrap();
    assert_eq!(read_history("history.json", &text).unwrap(), history);
}

#[test]
fn a_damaged_history_is_refused_with_the_name_of_its_file() {
    for text in ["", "[", "{}", r#"[{"date": "2026-11-24"}]"#, r#"[{"ratios": 1}]"#] {
        let error = read_history("docs/x.json", text).unwrap_err();
        assert!(matches!(error, HistoryError::Damaged { .. }), "{text}: {error:?}");
        assert!(error.to_string().starts_with("docs/x.json: not a history of ratios: "), "{error}");
    }
    let text = serde_json::to_string(&[run("bench", "a1b2c3d", vec![row("robot turn", 0.0)])]).unwrap();
    assert_eq!(
        read_history("docs/x.json", &text).unwrap_err().to_string(),
        r#"docs/x.json: row "robot turn" of the run of 2026-11-24 (a1b2c3d) has a number that is not above 0"#
    );
}

#[test]
fn a_course_is_relative_to_its_first_run_and_begins_anew_with_another_work() {
    let changed = |ratio: f64| Row { work: 2.0, ..row("changed", ratio) };
    let history = [
        run("bench", "first", vec![row("stays", 2.0), row("changed", 1.0)]),
        run("test", "other", vec![row("stays", 50.0)]),
        run("bench", "second", vec![row("stays", 3.0), changed(8.0)]),
        run("bench", "third", vec![changed(4.0)]),
    ];
    let courses = courses(&history, "bench");
    assert_eq!(courses["stays"], [(0, 1.0), (1, 1.5)]);
    assert_eq!(courses["changed"], [(1, 1.0), (2, 0.5)]);
    assert_eq!(courses.len(), 2);
}

#[test]
fn the_page_gets_the_last_run_of_each_profile_and_keeps_what_stands_around() {
    let history = [
        run("bench", "old", vec![row("robot turn", 0.5)]),
        run("test", "debug", vec![row("robot turn", 8.0)]),
        run("bench", "a1b2c3d", vec![row("robot turn", 0.8)]),
    ];
    let empty = with_table(PAGE, &[]).unwrap();
    let filled = with_table(PAGE, &history).unwrap();
    assert!(filled.contains("| robot turn | 4.30 µs a turn | 0.80 | 0.72 to 0.88 |\n"), "{filled}");
    assert!(filled.contains("Profile `test`") && !filled.contains("commit old"), "{filled}");
    assert_eq!(with_table(&filled, &[]).unwrap(), empty);
    assert_eq!(with_table("no marks", &history), None);
}

#[test]
fn figures_differ_in_their_names() {
    let names: BTreeSet<&str> = Figure::ALL.into_iter().map(Figure::name).collect();
    assert_eq!(names.len(), Figure::ALL.len());
}

#[test]
fn the_committed_history_has_rows_of_this_bench_only_and_the_page_shows_it() {
    let history = read_history("docs/ratios/history.json", HISTORY).unwrap();
    for row in history.iter().flat_map(|run| &run.rows) {
        let known = Figure::ALL.into_iter().any(|figure| figure.name() == row.name);
        assert!(known, "{:?} is no figure of tests/benches/ratios", row.name);
    }
    assert_eq!(with_table(PAGE, &history).unwrap(), PAGE, "--accept writes the page");
}
