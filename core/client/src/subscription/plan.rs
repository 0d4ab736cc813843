//! What has to be done to see the keys that an expression names. Pure: an expression in, a plan out.
//!
//! Not everything on our keys is published: presence is a liveliness token, some keys only answer
//! questions, and commands are questions between others. So an expression is compared with each kind
//! of key; Zenoh says whether they have keys in common, [`WatchPlan::of`] which.

use crate::error::{Error, ErrorKind, Result};
use xtb_bus::intersect;
use xtb_protocol::Name;
use xtb_protocol::keys::any;

/// Any chunk.
const ANY: &str = "*";
/// Any number of chunks, none too.
const ANY_MANY: &str = "**";

/// Keys that carry published messages only.
const PUBLISHED: [&str; 9] = [
    any::STATE_JSON,
    any::EVENT_JSON,
    any::SENSORS,
    any::NEAR,
    any::TELEOP,
    any::ESTOP,
    any::MAP,
    any::SIM_TRUTH,
    any::SIM_STATS,
];

/// How to watch an expression.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum WatchPlan {
    /// Presence comes and goes.
    Presence,
    /// The last events, then each new one.
    Events,
    /// Nothing is published there: the answers to these questions are all there is.
    Answers(Vec<String>),
    /// Messages as they are published, the answers to these questions, and presence on these.
    Messages {
        /// Expressions to ask once.
        ask: Vec<String>,
        /// Expressions whose presence is watched.
        presence: Vec<String>,
    },
}

impl WatchPlan {
    /// The plan for an expression. One that is not valid, or that names none of our keys, is
    /// subscribed to as it is: Zenoh then says what is wrong with it.
    ///
    /// # Errors
    /// [`ErrorKind::Invalid`]: it names commands and nothing else.
    pub fn of(expression: &str) -> Result<Self> {
        let asks = [any::STATE, any::ABOUT, any::SIM_ROSTER].map(|pattern| overlap(expression, pattern));
        let [states, abouts, rosters] = asks;
        let presence = overlap(expression, any::ALIVE);
        let events = intersect(expression, any::EVENT);
        let long = [any::MAP, any::PLACES, any::DISPATCH_ALERTS];
        let long = long.map(|pattern| overlap(expression, pattern)).concat();
        let answers: Vec<String> = abouts.into_iter().chain(rosters).collect();
        match last_chunk(expression) {
            "alive" if !presence.is_empty() => return Ok(Self::Presence),
            "event" if events => return Ok(Self::Events),
            "json" if intersect(expression, any::EVENT_JSON) && !intersect(expression, any::STATE_JSON) => {
                return Ok(Self::Events);
            }
            // Long, so not within wider expressions.
            "map" | "places" | "alerts" if !long.is_empty() => {
                return Ok(Self::Messages { ask: long, presence: Vec::new() });
            }
            "about" | "roster" if !answers.is_empty() => return Ok(Self::Answers(answers)),
            _ => {}
        }
        let ask: Vec<String> = states.into_iter().chain(answers).collect();
        let published = events || PUBLISHED.iter().any(|pattern| intersect(expression, pattern));
        let shows_something = published || !(ask.is_empty() && presence.is_empty());
        if !shows_something && intersect(expression, any::CMD) {
            return Err(only_commands(expression));
        }
        Ok(Self::Messages { ask, presence })
    }
}

/// Keys on which messages are published that whoever looks may hear, each message on one of them: without the same
/// once more in JSON.
const HEARD: [&str; 12] = [
    any::STATE,
    any::SENSORS,
    any::EVENT,
    any::FIX,
    any::ROUTE,
    any::NEAR,
    any::MAP,
    any::PLACES,
    any::DISPATCH_TASKS,
    any::DISPATCH_ALERTS,
    any::SIM_TRUTH,
    any::SIM_STATS,
];
/// And those that only a router without identities passes on: what people publish, and whatever else somebody should
/// publish on keys that are for questions.
const UNGUARDED: [&str; 9] = [
    any::TELEOP,
    any::ESTOP,
    any::CMD,
    any::PARAM,
    any::LOG,
    any::ABOUT,
    any::SIM_ROSTER,
    any::DISPATCH_STANDBY,
    any::DISPATCH_HOMES,
];

impl WatchPlan {
    /// The same channel by channel, and without what is published in JSON too. Of this fleet: what a router with
    /// identities passes on; it drops a subscription to more than its rules allow, and does not narrow it. `None`: of
    /// any, without identities. Empty: nothing can be seen there.
    #[must_use]
    pub fn by_channel(self, expression: &str, fleet: Option<&Name>) -> Vec<(String, Self)> {
        let overlaps = |pattern: &str| overlap(expression, &within(pattern, fleet));
        let each = |pattern: &str, plan: &Self| {
            overlaps(pattern).into_iter().map(|part| (part, plan.clone())).collect::<Vec<_>>()
        };
        let asks = |ask: Vec<String>| {
            let ask: Vec<String> = ask.iter().filter_map(|ask| ask_within(ask, fleet)).collect();
            (!ask.is_empty()).then(|| (expression.to_owned(), Self::Answers(ask)))
        };
        match self {
            Self::Presence => each(any::ALIVE, &Self::Presence),
            Self::Events => each(any::EVENT, &Self::Events),
            Self::Answers(ask) => asks(ask).into_iter().collect(),
            Self::Messages { ask, presence } => {
                let published = Self::Messages { ask: Vec::new(), presence: Vec::new() };
                let unguarded: &[&str] = if fleet.is_none() { &UNGUARDED } else { &[] };
                let mut parts: Vec<_> =
                    HEARD.iter().chain(unguarded).flat_map(|pattern| each(pattern, &published)).collect();
                if !presence.is_empty() {
                    parts.extend(each(any::ALIVE, &Self::Presence));
                }
                parts.extend(asks(ask));
                parts
            }
        }
    }
}

/// Of this fleet, if of one.
fn within(pattern: &str, fleet: Option<&Name>) -> String {
    fleet.map_or_else(|| pattern.to_owned(), |fleet| pattern.replacen(ANY, fleet.as_str(), 1))
}

/// A question to whatever fleets, to this one alone; `None` = it is to another.
fn ask_within(ask: &str, fleet: Option<&Name>) -> Option<String> {
    let Some(fleet) = fleet else { return Some(ask.to_owned()) };
    let mut chunks: Vec<&str> = ask.split('/').collect();
    let of = chunks.get_mut(1).filter(|of| intersect(of, fleet.as_str()))?;
    *of = fleet.as_str();
    Some(chunks.join("/"))
}

fn only_commands(expression: &str) -> Error {
    let message = format!(
        "cannot watch {expression:?}: commands are requests from one client to one robot, not visible to \
         others"
    );
    Error::new(ErrorKind::Invalid, message).hint(
        "the effect of commands is visible in xtb/<fleet>/<robot>/state and …/event, setpoints in \
               …/teleop/*",
    )
}

fn last_chunk(expression: &str) -> &str {
    expression.rsplit('/').next().unwrap_or_default()
}

/// Expressions that together match what both `expression` and `pattern` (without `**`) match. Zenoh knows
/// whether there are such keys, but has no expression for them.
fn overlap(expression: &str, pattern: &str) -> Vec<String> {
    let expression: Vec<&str> = expression.split('/').collect();
    let pattern: Vec<&str> = pattern.split('/').collect();
    let mut found: Vec<String> = both(&expression, &pattern).iter().map(|chunks| chunks.join("/")).collect();
    found.sort();
    found.dedup();
    found
}

fn both<'a>(expression: &[&'a str], pattern: &[&'a str]) -> Vec<Vec<&'a str>> {
    match (expression, pattern) {
        ([], []) => vec![Vec::new()],
        ([ANY_MANY, rest @ ..], _) => {
            let mut found = both(rest, pattern);
            if let [first, left @ ..] = pattern {
                found.extend(both(expression, left).into_iter().map(|chunks| before(first, chunks)));
            }
            found
        }
        ([ours, rest @ ..], [theirs, left @ ..]) if intersect(ours, theirs) => {
            // Theirs is a word or any chunk.
            let narrower = if *theirs == ANY { *ours } else { *theirs };
            both(rest, left).into_iter().map(|chunks| before(narrower, chunks)).collect()
        }
        _ => Vec::new(),
    }
}

fn before<'a>(first: &'a str, mut chunks: Vec<&'a str>) -> Vec<&'a str> {
    chunks.insert(0, first);
    chunks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answers(ask: &[&str]) -> WatchPlan {
        WatchPlan::Answers(ask.iter().map(ToString::to_string).collect())
    }

    fn messages(ask: &[&str], presence: &[&str]) -> WatchPlan {
        let own = |texts: &[&str]| texts.iter().map(ToString::to_string).collect();
        WatchPlan::Messages { ask: own(ask), presence: own(presence) }
    }

    #[test]
    fn each_kind_of_key_is_watched_in_its_own_way() {
        for (expression, plan) in [
            ("xtb/lab/*/alive", WatchPlan::Presence),
            ("xtb/**/alive", WatchPlan::Presence),
            ("xtb/lab/xtb-1/event", WatchPlan::Events),
            ("**/event", WatchPlan::Events),
            ("xtb/lab/*/about", answers(&["xtb/lab/*/about"])),
            ("xtb/**/about", answers(&["xtb/*/*/about"])),
            ("xtb/lab/sim/roster", answers(&["xtb/lab/sim/roster"])),
            ("xtb/lab/*/state", messages(&["xtb/lab/*/state"], &[])),
            ("xtb/lab/*/sensors", messages(&[], &[])),
            ("xtb/lab/*/state/json", messages(&[], &[])),
            ("xtb/lab/xtb-1/event/json", WatchPlan::Events),
            ("xtb/lab/sim/truth", messages(&[], &[])),
            ("xtb/lab/*/teleop/*", messages(&[], &[])),
            ("xtb/lab/map", messages(&["xtb/lab/map"], &[])),
            ("xtb/**/map", messages(&["xtb/*/map"], &[])),
            ("xtb/lab/dispatch/alerts", messages(&["xtb/lab/dispatch/alerts"], &[])),
            ("ros/**", messages(&[], &[])),
        ] {
            assert_eq!(WatchPlan::of(expression), Ok(plan), "{expression}");
        }
    }

    #[test]
    fn a_wide_expression_never_asks_commands() {
        let all = ["xtb/*/*/state", "xtb/*/*/about", "xtb/*/sim/roster"];
        assert_eq!(WatchPlan::of("xtb/**"), Ok(messages(&all, &["xtb/*/*/alive"])));
        let one = ["xtb/lab/xtb-1/state", "xtb/lab/xtb-1/about"];
        assert_eq!(WatchPlan::of("xtb/lab/xtb-1/**"), Ok(messages(&one, &["xtb/lab/xtb-1/alive"])));
        assert_eq!(WatchPlan::of("xtb/lab/*/s$*"), Ok(messages(&["xtb/lab/*/state"], &[])));
    }

    #[test]
    fn with_an_identity_each_channel_is_subscribed_by_itself() {
        let fleet = crate::fake::name("lab");
        let fleet = Some(&fleet);
        let parts = |expression: &str| WatchPlan::of(expression).unwrap().by_channel(expression, fleet);
        let heard: Vec<String> = HEARD.iter().map(|pattern| within(pattern, fleet)).collect();
        for wide in ["xtb/**", "**", "xtb/lab/**"] {
            let found = parts(wide);
            let messages: Vec<_> = found
                .iter()
                .filter(|(_, plan)| matches!(plan, WatchPlan::Messages { .. }))
                .map(|(key, _)| key.clone())
                .collect();
            assert_eq!(messages, heard, "{wide}");
            assert!(found.contains(&("xtb/lab/*/alive".into(), WatchPlan::Presence)), "{wide}");
            let ask = answers(&["xtb/lab/*/state", "xtb/lab/*/about", "xtb/lab/sim/roster"]);
            assert!(found.contains(&(wide.to_owned(), ask)), "{found:?}");
        }
        let one = |key: &str, plan: WatchPlan| vec![(key.to_owned(), plan)];
        assert_eq!(parts("xtb/**/event"), one("xtb/lab/*/event", WatchPlan::Events));
        assert_eq!(parts("xtb/*/*/about"), one("xtb/*/*/about", answers(&["xtb/lab/*/about"])));
        assert_eq!(parts("xtb/lab/dispatch/event"), one("xtb/lab/dispatch/event", WatchPlan::Events));
        assert_eq!(parts("xtb/lab/traffic/state")[0].0, "xtb/lab/traffic/state");
        for hidden in ["ros/**", "xtb/home/*/state", "xtb/lab/*/teleop/*", "xtb/home/*/about"] {
            assert_eq!(parts(hidden), [], "{hidden}");
        }
    }

    #[test]
    fn a_recorder_hears_each_channel_of_any_fleet_and_nothing_twice() {
        let parts = |expression: &str| WatchPlan::of(expression).unwrap().by_channel(expression, None);
        let subscribed =
            parts("xtb/**").into_iter().filter(|(_, plan)| !matches!(plan, WatchPlan::Answers(_)));
        let keys: Vec<String> = subscribed.map(|(key, _)| key).collect();
        for key in HEARD.iter().chain(&UNGUARDED).chain(&[any::ALIVE]) {
            assert!(keys.contains(&(*key).to_owned()), "{key} is missing in {keys:?}");
        }
        assert!(!keys.iter().any(|key| intersect(key, any::STATE_JSON)), "{keys:?}");
        assert_eq!(parts("xtb/lab/xtb-1/state/json"), []);
        assert_eq!(parts("ros/**"), []);
    }

    #[test]
    fn commands_cannot_be_watched() {
        for expression in
            ["xtb/lab/xtb-1/cmd/*", "xtb/lab/*/cmd/me", "xtb/*/*/cmd/**", "xtb/lab/xtb-1/cmd/about"]
        {
            let failure = WatchPlan::of(expression).unwrap_err();
            assert_eq!(failure.kind, ErrorKind::Invalid, "{expression}");
            assert!(failure.hint.contains("event"), "{failure}");
        }
        // A robot may be called so.
        assert_eq!(WatchPlan::of("xtb/lab/cmd/event"), Ok(WatchPlan::Events));
    }

    #[test]
    fn parts_of_words_match_as_zenoh_has_it() {
        for (chunk, matches) in [
            ("state", true),
            ("st$*", true),
            ("$*te", true),
            ("s$*a$*e", true),
            ("state$*", true),
            ("x$*", false),
            ("s$*b", false),
        ] {
            let found = overlap(&format!("**/{chunk}"), any::STATE);
            let wanted: &[&str] = if matches { &["xtb/*/*/state"] } else { &[] };
            assert_eq!(found, wanted, "{chunk}");
        }
    }
}
