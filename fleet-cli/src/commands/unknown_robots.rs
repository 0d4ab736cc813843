//! Robots that were named and that neither roster nor fleet knows: says at once which were probably
//! meant. What was asked for them is done all the same: the roster may be wrong, and a stop waits for
//! nothing.

use crate::context::Context;
use crate::nearest::nearest;
use std::collections::{BTreeMap, BTreeSet};
use std::pin::pin;
use xtb_client::client::Client;
use xtb_client::fleet_view::by_number;
use xtb_protocol::Name;

/// Names that are listed where none is like the one that was given.
const SHOWN: usize = 5;

/// Carries `call` out, and says meanwhile which of `robots` are unknown, each with the name that was
/// probably meant; `anyway` is what happens to them all the same. Who is not found out before `call` has
/// ended is not waited for.
pub(super) async fn reported_beside<T>(
    call: impl Future<Output = T>,
    ctx: &Context,
    client: &Client,
    robots: &[Name],
    anyway: &str,
) -> (T, BTreeMap<Name, Option<Name>>) {
    let (mut call, mut finding) = (pin!(call), pin!(find(client, robots)));
    let unknown = tokio::select! {
        biased;
        called = &mut call => return (called, BTreeMap::new()),
        unknown = &mut finding => unknown,
    };
    if !ctx.out.json {
        unknown.said.iter().for_each(|said| {
            ctx.out.note(&format!(
                "{said} The robot is {anyway} anyway, by the name \
                given."
            ))
        });
    }
    (call.await, unknown.meant)
}

#[derive(Debug, Default, PartialEq)]
struct Unknown {
    meant: BTreeMap<Name, Option<Name>>,
    said: Vec<String>,
}

/// Nobody is unknown as long as that cannot be told.
async fn find(client: &Client, robots: &[Name]) -> Unknown {
    if robots.is_empty() {
        return Unknown::default();
    }
    let roster = client.roster(&[]).await.ok().flatten();
    let known = |name: &Name| roster.as_ref().is_some_and(|roster| roster.contains(name));
    if robots.iter().all(known) {
        return Unknown::default();
    }
    let Ok(alive) = client.alive().await else { return Unknown::default() };
    of(robots, roster.as_ref(), &alive)
}

fn of(robots: &[Name], roster: Option<&BTreeSet<Name>>, alive: &BTreeSet<Name>) -> Unknown {
    let mut known: Vec<&Name> = roster.into_iter().flatten().chain(alive).collect();
    known.sort_by_key(|name| by_number(name));
    known.dedup();
    let mut unknown = Unknown::default();
    if known.is_empty() {
        // Nothing to compare with: that nobody is there is said elsewhere.
        return unknown;
    }
    for robot in robots.iter().filter(|robot| !known.contains(robot)) {
        let meant = nearest(robot.as_str(), known.iter().map(|name| name.as_str()));
        let lacks = match roster {
            Some(_) => "is not in the roster",
            None => "does not answer",
        };
        unknown.said.push(match meant {
            Some(meant) => format!("{robot} {lacks}: did you mean {meant}?"),
            None => format!("{robot} {lacks}. Known: {}.", listed(&known)),
        });
        unknown.meant.insert(robot.clone(), meant.and_then(|meant| Name::new(meant).ok()));
    }
    unknown
}

fn listed(known: &[&Name]) -> String {
    let shown = known.iter().take(SHOWN).map(|name| name.as_str()).collect::<Vec<_>>().join(", ");
    match known.len().saturating_sub(SHOWN) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;

    fn names(all: &[&str]) -> BTreeSet<Name> {
        all.iter().map(|text| name(text)).collect()
    }

    #[test]
    fn a_name_that_roster_and_fleet_lack_is_pointed_out_with_the_one_meant() {
        let roster = names(&["xtb-1", "xtb-2"]);
        let guest = names(&["guest"]);
        let found = of(&["xtb-1", "guest", "xtb-11"].map(name), Some(&roster), &guest);
        assert_eq!(found.meant, BTreeMap::from([(name("xtb-11"), Some(name("xtb-1")))]));
        assert_eq!(found.said, ["xtb-11 is not in the roster: did you mean xtb-1?"]);
        let found = of(&[name("carla")], Some(&roster), &names(&["a", "b", "c", "d"]));
        assert_eq!(found.said, ["carla is not in the roster. Known: a, b, c, d, xtb-1 and 1 more."]);
        let found = of(&[name("xbt-2")], None, &roster);
        assert_eq!(found.said, ["xbt-2 does not answer: did you mean xtb-2?"]);
        assert_eq!(of(&[name("xtb-11")], None, &BTreeSet::new()), Unknown::default());
    }
}
