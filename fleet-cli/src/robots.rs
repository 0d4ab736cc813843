//! Robots on the command line: names, and `@TAG` for all robots of the roster that have the tag.

use std::collections::BTreeMap;
use xtb_client::fleet_view::by_number;
use xtb_client::{Client, Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::RosterEntry;

/// Tags that are listed where the one that was given is unknown.
const SHOWN: usize = 8;

/// One word: names and tags, separated by commas.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RobotsWord(Vec<Meant>);

#[derive(Debug, Clone, PartialEq, Eq)]
enum Meant {
    Robot(Name),
    /// Without the `@`.
    Tag(String),
}

impl RobotsWord {
    /// Reads it.
    ///
    /// # Errors
    /// The part that is neither a robot's name nor a tag.
    pub fn parse(text: &str) -> std::result::Result<Self, String> {
        let part = |part: &str| match part.strip_prefix('@') {
            Some("") => Err("a tag is missing after the @".to_owned()),
            Some(tag) => Ok(Meant::Tag(tag.to_owned())),
            None => Name::robot(part).map(Meant::Robot).map_err(|error| error.to_string()),
        };
        text.split(',').map(part).collect::<std::result::Result<_, _>>().map(Self)
    }
}

/// Whom words mean.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Robots {
    /// Each once, in the order in which they were written; those of a tag by their numbers.
    pub(crate) names: Vec<Name>,
    /// The first tag that nobody has, or why the roster could not be asked for.
    pub(crate) unknown: Option<Error>,
}

impl Robots {
    /// All of them.
    ///
    /// # Errors
    /// [`ErrorKind::Invalid`]: a tag that nobody has; [`ErrorKind::Failed`]: the roster could not be asked for.
    pub(crate) fn all(self) -> Result<Vec<Name>> {
        self.unknown.map_or(Ok(self.names), Err)
    }
}

/// Whom `words` mean; the roster is asked for only if there is a tag among them.
pub(crate) async fn meant(client: &Client, words: &[RobotsWord]) -> Robots {
    let named = named(words);
    if !named.tags {
        return of(words, &[]);
    }
    match client.roster_entries(&[]).await {
        Ok(roster) => of(words, &roster.unwrap_or_default()),
        Err(error) => Robots { names: named.names, unknown: Some(error) },
    }
}

/// The robots that are named as such.
pub(crate) struct Named {
    pub(crate) names: Vec<Name>,
    /// Whether there are tags besides.
    pub(crate) tags: bool,
}

pub(crate) fn named(words: &[RobotsWord]) -> Named {
    let mut named = Named { names: Vec::new(), tags: false };
    for meant in words.iter().flat_map(|word| &word.0) {
        match meant {
            Meant::Robot(name) => named.names.push(name.clone()),
            Meant::Tag(_) => named.tags = true,
        }
    }
    Named { names: once_each(&named.names), ..named }
}

fn of(words: &[RobotsWord], roster: &[RosterEntry]) -> Robots {
    let mut robots = Robots { names: Vec::new(), unknown: None };
    for meant in words.iter().flat_map(|word| &word.0) {
        let found = match meant {
            Meant::Robot(name) => vec![name.clone()],
            Meant::Tag(tag) => tagged(tag, roster),
        };
        if let (Meant::Tag(tag), true) = (meant, found.is_empty()) {
            robots.unknown.get_or_insert_with(|| unknown(tag, roster));
        }
        robots.names.extend(found);
    }
    robots.names = once_each(&robots.names);
    robots
}

/// The robots in the order in which they were named, each once.
pub(crate) fn once_each(named: &[Name]) -> Vec<Name> {
    let mut robots: Vec<Name> = Vec::new();
    for robot in named {
        if !robots.contains(robot) {
            robots.push(robot.clone());
        }
    }
    robots
}

fn tagged(tag: &str, roster: &[RosterEntry]) -> Vec<Name> {
    let has = |entry: &&RosterEntry| entry.tags.iter().any(|own| bare(own) == tag);
    let mut names: Vec<Name> = roster.iter().filter(has).map(|entry| entry.name.clone()).collect();
    names.sort_by_key(by_number);
    names
}

/// Some rosters write the `@` too.
fn bare(tag: &str) -> &str {
    tag.trim_start_matches('@')
}

fn unknown(tag: &str, roster: &[RosterEntry]) -> Error {
    let mut known: BTreeMap<&str, usize> = BTreeMap::new();
    for tag in roster.iter().flat_map(|entry| &entry.tags) {
        *known.entry(bare(tag)).or_default() += 1;
    }
    let listed = known.iter().take(SHOWN).map(|(tag, robots)| format!("@{tag} ({robots})"));
    let listed = listed.collect::<Vec<_>>().join(", ");
    let message = format!("no robot of the roster has the tag @{tag}");
    Error::new(ErrorKind::Invalid, message).hint(match known.len() {
        0 => "the roster has no tags: write `tags = [\"…\"]` below [[robots]] in the fleet config".to_owned(),
        count if count > SHOWN => format!("tags of the roster: {listed} and {} more", count - SHOWN),
        _ => format!("tags of the roster: {listed}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;

    fn roster() -> Vec<RosterEntry> {
        [("xtb-10", "red"), ("xtb-2", "@red"), ("xtb-3", "blue")]
            .map(|(robot, tag)| RosterEntry { name: name(robot), tags: vec![tag.into()], start_pose: None })
            .into()
    }

    fn means(words: &[&str]) -> Robots {
        let words: Vec<_> = words.iter().map(|word| RobotsWord::parse(word).unwrap()).collect();
        of(&words, &roster())
    }

    #[test]
    fn names_and_tags_are_each_robot_once_and_those_of_a_tag_by_number() {
        assert_eq!(means(&["@red"]).all(), Ok(["xtb-2", "xtb-10"].map(name).into()));
        assert_eq!(
            means(&["xtb-10,@red", "@blue", "guest"]).all(),
            Ok(["xtb-10", "xtb-2", "xtb-3", "guest"].map(name).into())
        );
        assert_eq!(means(&["xtb-9", "xtb-9"]).all(), Ok(vec![name("xtb-9")]));
    }

    #[test]
    fn a_tag_that_nobody_has_is_named_with_those_that_there_are_and_the_others_are_known() {
        let found = means(&["xtb-7,@rde"]);
        assert_eq!(found.names, [name("xtb-7")]);
        let error = found.all().unwrap_err();
        assert_eq!(
            (error.kind, error.message.as_str()),
            (ErrorKind::Invalid, "no robot of the roster has the tag @rde")
        );
        assert_eq!(error.hint, "tags of the roster: @blue (1), @red (2)");
        assert!(of(&[RobotsWord::parse("@red").unwrap()], &[]).unknown.unwrap().hint.contains("no tags"));
    }

    #[test]
    fn what_is_no_name_and_no_tag_is_refused() {
        for text in ["", "xtb-1,", ",", "@", "xtb-1,@", "Xtb", "all", "a b"] {
            assert!(RobotsWord::parse(text).is_err(), "{text:?}");
        }
    }
}
