//! Findings that are the same trouble of several robots: one line of them all.
//!
//! The same are those that differ in nothing but the robot's own name and measured values, such as an age.

use super::finding::Finding;
use xtb_protocol::Name;

/// Names that a line shows at most.
const NAMES_SHOWN: usize = 8;
/// What stands for the name of each robot where there are several.
const ANY: &str = "ROBOT";
/// A number before one of these is a measured value.
const UNITS: [&str; 7] = ["ms", "s", "min", "h", "d", "V", "%"];

/// A finding, with the robots of which it is.
#[derive(Debug)]
pub(super) struct Group<'a> {
    /// The first of them.
    pub(super) first: &'a Finding,
    of: Vec<&'a Finding>,
}

/// Each trouble once, in the order of the first finding of each.
pub(super) fn grouped(findings: &[Finding]) -> Vec<Group<'_>> {
    let mut groups: Vec<(Option<Trouble>, Group<'_>)> = Vec::new();
    for finding in findings {
        // What is of the fleet stands alone.
        let trouble = Trouble::of(finding);
        match groups.iter_mut().find(|(other, _)| trouble.is_some() && *other == trouble) {
            Some((_, group)) => group.of.push(finding),
            None => groups.push((trouble, Group { first: finding, of: vec![finding] })),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

impl Group<'_> {
    /// `xtb-1, xtb-2: ` before what is wrong with them, and of the values that differ the least and the most.
    pub(super) fn text(&self) -> String {
        let robots: Vec<&Name> = self.of.iter().filter_map(|finding| finding.robot.as_ref()).collect();
        match self.of.as_slice() {
            [] | [_] => format!("{}{}", listed(&robots), self.first.text),
            several => format!("{}{}", listed(&robots), merged(several)),
        }
    }

    /// What to do about it.
    pub(super) fn hint(&self) -> Option<String> {
        let (hint, robot) = (self.first.hint.as_ref()?, self.first.robot.as_ref());
        Some(match robot.filter(|_| self.of.len() > 1) {
            Some(robot) => anonymous(hint, robot),
            None => hint.clone(),
        })
    }
}

/// What is the same of several robots.
#[derive(Debug, PartialEq)]
struct Trouble {
    of: (super::finding::Level, &'static str),
    text: Vec<String>,
    hint: Option<String>,
}

impl Trouble {
    fn of(finding: &Finding) -> Option<Self> {
        let robot = finding.robot.as_ref()?;
        let text = anonymous(&finding.text, robot);
        let words: Vec<&str> = text.split(' ').collect();
        let shape = words.iter().enumerate().map(|(i, word)| match value(&words, i) {
            Some(_) => String::new(),
            None => (*word).to_owned(),
        });
        let hint = finding.hint.as_ref().map(|hint| anonymous(hint, robot));
        Some(Self { of: (finding.level, finding.topic), text: shape.collect(), hint })
    }
}

/// The measured value that a word is, if it is one.
fn value(words: &[&str], i: usize) -> Option<f64> {
    let unit = words.get(i + 1)?.trim_end_matches([',', ';', ':', '.', ')']);
    UNITS.contains(&unit).then(|| words[i].trim_start_matches('(').parse().ok()).flatten()
}

/// The same without this robot's name.
fn anonymous(text: &str, robot: &Name) -> String {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '-';
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(robot.as_str()) {
        let (before, found) = rest.split_at(at);
        let after = &found[robot.as_str().len()..];
        out.push_str(before);
        let whole = !out.ends_with(is_part) && !after.starts_with(is_part);
        out.push_str(if whole { ANY } else { robot.as_str() });
        rest = after;
    }
    out + rest
}

/// One text of several that differ in measured values only.
fn merged(findings: &[&Finding]) -> String {
    let texts: Vec<String> = findings
        .iter()
        .map(|finding| match &finding.robot {
            Some(robot) => anonymous(&finding.text, robot),
            None => finding.text.clone(),
        })
        .collect();
    let split: Vec<Vec<&str>> = texts.iter().map(|text| text.split(' ').collect()).collect();
    let word = |i: usize| {
        let values = split.iter().filter_map(|words| Some((value(words, i)?, words[i])));
        let least = values.clone().min_by(|a, b| a.0.total_cmp(&b.0));
        let most = values.max_by(|a, b| a.0.total_cmp(&b.0));
        match least.zip(most) {
            Some(((_, least), (_, most))) if least != most => {
                format!("{least} to {}", most.trim_start_matches('('))
            }
            _ => split[0][i].to_owned(),
        }
    };
    (0..split[0].len()).map(word).collect::<Vec<_>>().join(" ")
}

/// Names, of very many only the first, and a colon.
fn listed(robots: &[&Name]) -> String {
    if robots.is_empty() {
        return String::new();
    }
    let shown = robots.iter().take(NAMES_SHOWN).map(|name| name.as_str()).collect::<Vec<_>>().join(", ");
    match robots.len().saturating_sub(NAMES_SHOWN) {
        0 => format!("{shown}: "),
        more => format!("{shown} and {more} more: "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;

    fn lines(findings: &[Finding]) -> Vec<(String, Option<String>)> {
        grouped(findings).iter().map(|group| (group.text(), group.hint())).collect()
    }

    fn latched(robot: &str, age: &str) -> Finding {
        let text = format!("estop by cli-1, {age} ago; cause gone");
        Finding::problem("latches", text, format!("`fleet-cli why {robot}`, then `fleet-cli reset {robot}`"))
            .of(&name(robot))
    }

    #[test]
    fn many_robots_with_the_same_trouble_are_one_line() {
        let ages = ["12.0 s", "12.4 s", "11.9 s"];
        let findings: Vec<Finding> =
            (1..=24).map(|n| latched(&format!("xtb-{n}"), ages[n % ages.len()])).collect();
        let names = (1..=8).map(|n| format!("xtb-{n}")).collect::<Vec<_>>().join(", ");
        let text = format!("{names} and 16 more: estop by cli-1, 11.9 to 12.4 s ago; cause gone");
        let hint = "`fleet-cli why ROBOT`, then `fleet-cli reset ROBOT`".to_owned();
        assert_eq!(lines(&findings), [(text, Some(hint))]);
    }

    #[test]
    fn one_robot_keeps_its_name_and_other_troubles_their_lines() {
        let other = Finding::problem("latches", "estop by cli-2, 3.0 s ago", "x").of(&name("xtb-9"));
        let fleets = Finding::problem("latches", "estop by cli-2, 3.0 s ago", "x");
        let found = lines(&[latched("xtb-1", "12.0 s"), other, fleets]);
        assert_eq!(found.len(), 3, "{found:?}");
        assert_eq!(found[0].0, "xtb-1: estop by cli-1, 12.0 s ago; cause gone");
        assert!(found[0].1.as_ref().unwrap().contains("`fleet-cli reset xtb-1`"), "{found:?}");
        assert_eq!(found[2].0, "estop by cli-2, 3.0 s ago");
    }

    #[test]
    fn versions_and_names_that_only_begin_alike_are_not_the_same() {
        let of = |robot: &str, text: &str| Finding::warning("versions", text, "update").of(&name(robot));
        assert_eq!(lines(&[of("xtb-1", "version 0.1"), of("xtb-2", "version 0.2")]).len(), 2);
        assert_eq!(anonymous("xtb-1, xtb-10 and xtb-1's", &name("xtb-1")), "ROBOT, xtb-10 and ROBOT's");
    }
}
