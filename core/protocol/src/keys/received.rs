//! What the key of something received has to be. Zenoh delivers what *intersects* with a declaration, so a
//! stranger's key expression can hold wildcards anywhere; here it becomes one concrete key, or nothing.
//!
//! The key must be exactly one of ours: concrete fleet, channel and client. The robot alone may be `*`
//! where that means "each of you": in questions, and in an emergency stop, which is never dropped because
//! it is meant for more than one robot.

use super::{ANY, Channel, Key};

/// Where the robot's name stands in a key.
const ROBOT: usize = 2;

/// The key of a message that was put on `received`, as the subscriber to `declared` has to take it; `None`:
/// it is to be dropped.
#[must_use]
pub fn put(declared: &str, received: &str) -> Option<String> {
    if Key::parse(received).is_some() {
        return covers(declared, received).then(|| received.to_owned());
    }
    let (key, text) = addressed(declared, received)?;
    matches!(key.channel, Channel::Estop(_) | Channel::EstopAll(_)).then_some(text)
}

/// The key of a question on `received`, as whoever answers on `declared` has to take it; `None`: it is not
/// to be answered.
#[must_use]
pub fn question(declared: &str, received: &str) -> Option<Key> {
    match Key::parse(received) {
        Some(key) => covers(declared, received).then_some(key),
        None => addressed(declared, received).map(|(key, _)| key).filter(|key| key.robot.is_some()),
    }
}

/// Whether a question is to each robot, and so, on the keys of somebody who is none, no concern of theirs: those of the
/// dispatcher and of identities have the form of a robot's.
#[must_use]
pub fn is_to_each_robot(received: &str) -> bool {
    let mut chunks: Vec<&str> = received.split('/').collect();
    let Some(robot) = chunks.get_mut(ROBOT).filter(|robot| **robot == ANY) else { return false };
    *robot = "any";
    Key::parse(&chunks.join("/")).is_some_and(|key| key.robot.is_some())
}

/// The key of an answer to a question on `asked`; `None`: it is nobody's.
#[must_use]
pub fn answer(asked: &str, received: &str) -> Option<Key> {
    let asked = asked.split('?').next().unwrap_or(asked);
    Key::parse(received).filter(|_| covers(asked, received))
}

/// What `received`, which names every robot, means to the robot of `declared`.
fn addressed(declared: &str, received: &str) -> Option<(Key, String)> {
    let mut chunks: Vec<&str> = received.split('/').collect();
    let robot = chunks.get_mut(ROBOT).filter(|robot| **robot == ANY)?;
    *robot = declared.split('/').nth(ROBOT)?;
    let text = chunks.join("/");
    let key = Key::parse(&text)?;
    covers(declared, &text).then_some((key, text))
}

/// Whether a concrete key belongs to what was declared or asked: the same chunks, or any where that has `*`.
/// An expression with other wildcards is a person's (`watch`); Zenoh has compared it.
fn covers(declared: &str, key: &str) -> bool {
    let others = |chunk: &str| chunk != ANY && chunk.contains('*');
    if declared.split('/').any(others) {
        return true;
    }
    let mut key = key.split('/');
    declared.split('/').all(|chunk| key.next().is_some_and(|it| chunk == ANY || chunk == it))
        && key.next().is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keys::Name;

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    const CMD: &str = "xtb/lab/xtb-1/cmd/*";
    const ESTOP: &str = "xtb/lab/xtb-1/estop/*";
    const ESTOP_ALL: &str = "xtb/lab/all/estop/*";
    const STATES: &str = "xtb/lab/*/state";

    #[test]
    fn a_question_is_to_this_robot_or_to_each_by_a_concrete_client() {
        for asked in ["xtb/lab/xtb-1/cmd/me", "xtb/lab/*/cmd/me"] {
            let key = question(CMD, asked).unwrap();
            assert_eq!((key.robot, key.channel), (Some(name("xtb-1")), Channel::Cmd(name("me"))), "{asked}");
        }
        assert_eq!(question("xtb/lab/xtb-1/state", "xtb/lab/*/state").unwrap().channel, Channel::State);
        assert_eq!(question("xtb/lab/map", "xtb/lab/map").unwrap().channel, Channel::Map);
    }

    #[test]
    fn a_wildcard_anywhere_else_is_no_question_of_ours() {
        for asked in [
            "xtb/lab/xtb-1/*/guest",
            "xtb/lab/xtb-1/c$*/guest",
            "xtb/lab/xtb-1/**/guest",
            "xtb/lab/xtb-1/cmd/*",
            "xtb/lab/xtb-1/cmd/**",
            "xtb/lab/xtb-1/cmd/g$*",
            "xtb/lab/xtb-1/cmd/guest/**",
            "xtb/lab/xtb-$*/cmd/guest",
            "xtb/lab/**/cmd/guest",
            "xtb/*/xtb-1/cmd/guest",
            "xtb/*/*/cmd/guest",
            "*/lab/xtb-1/cmd/guest",
            "xtb/lab/*/*/guest",
            "xtb/lab/*/cmd/*",
            "xtb/**",
            "**",
        ] {
            assert_eq!(question(CMD, asked), None, "{asked}");
        }
        // The dispatcher and the map are no robots.
        assert_eq!(question("xtb/lab/dispatch/cmd/*", "xtb/lab/*/cmd/me"), None);
        assert_eq!(question("xtb/lab/map", "xtb/lab/*"), None);
        assert_eq!(question("xtb/lab/identity/*", "xtb/lab/*/state"), None);
    }

    #[test]
    fn a_question_to_each_robot_is_no_mistake_where_a_service_hears_it_too() {
        for asked in ["xtb/lab/*/cmd/me", "xtb/lab/*/state", "xtb/lab/*/about"] {
            assert!(is_to_each_robot(asked), "{asked}");
        }
        for asked in [
            "xtb/lab/*/*/me",
            "xtb/lab/*/unheard-of",
            "xtb/**",
            "xtb/*/*/state",
            "xtb/lab/*",
            "xtb/lab/xtb-1/state",
        ] {
            assert!(!is_to_each_robot(asked), "{asked}");
        }
    }

    #[test]
    fn another_robots_or_channels_key_is_not_this_one() {
        for asked in
            ["xtb/lab/xtb-2/cmd/me", "xtb/barn/xtb-1/cmd/me", "xtb/lab/xtb-1/log/me", "xtb/lab/xtb-1/state"]
        {
            assert_eq!((question(CMD, asked), put(CMD, asked)), (None, None), "{asked}");
        }
    }

    #[test]
    fn a_message_is_put_on_a_concrete_key() {
        assert_eq!(put(STATES, "xtb/lab/xtb-1/state").unwrap(), "xtb/lab/xtb-1/state");
        for key in ["xtb/lab/*/state", "xtb/**", "xtb/lab/xtb-1/st$*", "xtb/*/xtb-1/state", "xtb/lab/xtb-1/*"]
        {
            assert_eq!((put(STATES, key), put("xtb/lab/xtb-1/state", key)), (None, None), "{key}");
        }
        assert_eq!(put("xtb/lab/xtb-1/teleop/*", "xtb/lab/*/teleop/me"), None);
        assert_eq!(put("xtb/lab/xtb-1/fix", "xtb/lab/*/fix"), None);
    }

    #[test]
    fn an_emergency_stop_may_name_every_robot_but_names_its_client() {
        assert_eq!(put(ESTOP, "xtb/lab/xtb-1/estop/me").unwrap(), "xtb/lab/xtb-1/estop/me");
        assert_eq!(put(ESTOP, "xtb/lab/*/estop/me").unwrap(), "xtb/lab/xtb-1/estop/me");
        assert_eq!(put(ESTOP_ALL, "xtb/lab/*/estop/me").unwrap(), "xtb/lab/all/estop/me");
        for key in [
            "xtb/**",
            "xtb/lab/**",
            "xtb/lab/xtb-1/estop/*",
            "xtb/lab/*/*/me",
            "xtb/*/*/estop/me",
            "xtb/lab/*/estop/m$*",
        ] {
            assert_eq!((put(ESTOP, key), put(ESTOP_ALL, key)), (None, None), "{key}");
        }
    }

    #[test]
    fn an_answer_comes_on_the_own_key_of_one_who_was_asked() {
        assert_eq!(answer(STATES, "xtb/lab/xtb-1/state").unwrap().robot, Some(name("xtb-1")));
        assert!(answer("xtb/lab/dispatch/tasks?format=json", "xtb/lab/dispatch/tasks").is_some());
        for key in [STATES, "xtb/lab/**", "xtb/lab/xtb-1/about", "ros/lab"] {
            assert_eq!(answer(STATES, key), None, "{key}");
        }
        // What a person asks with other wildcards is compared by Zenoh.
        assert!(answer("xtb/lab/xtb-$*/state", "xtb/lab/xtb-1/state").is_some());
    }
}
