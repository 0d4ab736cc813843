//! Whether a page shows what is seen: numbers may be others, `…` stands for anything.
//!
//! A line with `…` alone stands for any lines. Blanks count as one, however many: columns are as wide
//! as their widest value. Digits that belong to a name (`xtb-1`, `t3`) must be the same.

/// Whether `shown` describes `seen`.
pub(super) fn fits(shown: &str, seen: &str) -> bool {
    let tidy =
        |text: &str| -> Vec<String> { text.lines().map(plain).filter(|line| !line.is_empty()).collect() };
    lines_fit(&tidy(shown), &tidy(seen))
}

fn lines_fit(shown: &[String], seen: &[String]) -> bool {
    match shown {
        [] => seen.is_empty(),
        [gap, rest @ ..] if gap == "…" => (0..=seen.len()).any(|skipped| lines_fit(rest, &seen[skipped..])),
        [line, rest @ ..] => {
            seen.first().is_some_and(|first| line_fits(line, first) && lines_fit(rest, &seen[1..]))
        }
    }
}

fn line_fits(shown: &str, seen: &str) -> bool {
    let Some((start, rest)) = shown.split_once('…') else { return shown == seen };
    let Some(mut left) = seen.strip_prefix(start) else { return false };
    let (middle, end) = rest.rsplit_once('…').map_or(("", rest), |(middle, end)| (middle, end));
    for part in middle.split('…').filter(|part| !part.is_empty()) {
        let Some((_, after)) = left.split_once(part) else { return false };
        left = after;
    }
    left.ends_with(end)
}

/// One blank for many, 0 for any free number.
fn plain(line: &str) -> String {
    let mut out = String::new();
    let line = line.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut rest = line.as_str();
    while let Some(next) = rest.chars().next() {
        let number = number(rest);
        let part_of_a_name = {
            let before = out.trim_end_matches('-');
            out.ends_with(char::is_alphanumeric)
                || before.len() < out.len() && before.ends_with(char::is_alphanumeric)
        };
        if number > 0 && !part_of_a_name {
            out.push('0');
            rest = &rest[number..];
        } else {
            let taken = if number > 0 { number } else { next.len_utf8() };
            out.push_str(&rest[..taken]);
            rest = &rest[taken..];
        }
    }
    out
}

/// How many bytes of `text` are a number with which it begins.
fn number(text: &str) -> usize {
    let unsigned = text.strip_prefix(['-', '−']).unwrap_or(text);
    let digits = |text: &str| text.len() - text.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let whole = digits(unsigned);
    if whole == 0 {
        return 0;
    }
    let fraction = unsigned[whole..].strip_prefix('.').map_or(0, digits);
    text.len() - unsigned.len() + whole + if fraction > 0 { fraction + 1 } else { 0 }
}

#[test]
fn numbers_may_vary_and_names_may_not() {
    assert!(fits("xtb-1  idle  (0.00, 0.01) 90°", "xtb-1 idle   (-0.31, 12) 87.5°\n"));
    assert!(
        !fits("xtb-1 idle", "xtb-2 idle") && !fits("xtb-1 idle", "xtb-1 goto") && !fits("t1 done", "t2 done")
    );
    assert!(fits("recordings/xtb-1-….mcap is whole", "recordings/xtb-1-20041201T120000Z.mcap is whole"));
    assert!(fits("a … b … c", "a 1 b 2 c") && !fits("a … b … c", "a 1 c 2 c"));
    assert!(fits("slope −0.0205", "slope 0.03"));
}

#[test]
fn a_gap_stands_for_any_lines() {
    assert!(fits("one\n…\nthree", "one\ntwo\ntwo\nthree") && fits("one\n…\nthree", "one\nthree"));
    assert!(!fits("one\n…\nthree", "one\ntwo") && !fits("one", "one\ntwo") && !fits("one\ntwo", "one"));
}
