//! Which of the known words was probably meant.

/// Words less alike than this are not taken for each other (Jaro-Winkler, 0 to 1).
const ALIKE: f64 = 0.7;

/// The known word that is most like `word`, if one is; of several the first.
pub(crate) fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let alike = known.into_iter().map(|other| (strsim::jaro_winkler(word, other), other));
    let nearest = alike.reduce(|best, other| if other.0 > best.0 { other } else { best });
    let (_, other) = nearest.filter(|(likeness, _)| *likeness > ALIKE)?;
    // One that only begins like it is another word.
    let changes = strsim::osa_distance(word, other);
    (2 * changes <= word.chars().count().max(other.chars().count())).then_some(other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_finger_is_found_and_another_word_is_not() {
        let robots = ["xtb-1", "xtb-2", "xtb-12"];
        for (typed, meant) in
            [("xtb-11", "xtb-1"), ("xtb1", "xtb-1"), ("xbt-2", "xtb-2"), ("xtb-122", "xtb-12")]
        {
            assert_eq!(nearest(typed, robots), Some(meant), "{typed}");
        }
        assert_eq!(nearest("carla", robots), None);
        assert_eq!(nearest("carla", ["c", "carl-is-another"]), None);
        assert_eq!(nearest("xtb-1", []), None);
    }
}
