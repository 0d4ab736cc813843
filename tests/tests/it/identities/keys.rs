//! The keys that are tried: each channel, of the robot, of another and of all, under names of each client; wildcards;
//! and what is none of the fleet's.

use std::collections::BTreeSet;

/// Channels of a robot.
const ROBOT: [&str; 22] = [
    "alive",
    "state",
    "sensors",
    "event",
    "event/@adv/pub/z/1/_",
    "event/@adv/**",
    "event/json",
    "event/json/@adv/pub/z/1/_",
    "event/json/@adv/**",
    "state/@adv/**",
    "state/json",
    "about",
    "fix",
    "route",
    "near/x0y0",
    "near/*",
    "cmd/alice",
    "cmd/*",
    "log/alice",
    "teleop/alice",
    "estop/alice",
    "estop/*",
];
/// Clients' keys of one robot, and the others.
const OTHERS: [&str; 60] = [
    "xtb-1/cmd/alice-3f9a1c",
    "xtb-1/cmd/alicex",
    "xtb-1/cmd/vera",
    "xtb-1/cmd/eve",
    "xtb-1/cmd/web-3f9a1c",
    "xtb-1/cmd/dispatch",
    "xtb-1/cmd/page",
    "xtb-1/log/*",
    "xtb-1/log/vera",
    "xtb-1/teleop/*",
    "xtb-1/teleop/alice-3f9a1c",
    "xtb-1/teleop/vera",
    "xtb-1/teleop/web-3f9a1c",
    "xtb-1/teleop/dispatch",
    "xtb-1/estop/vera",
    "xtb-1/estop/vera-3f9a1c",
    "xtb-1/estop/eve",
    "xtb-1/estop/web-3f9a1c",
    "*/estop/vera",
    "*/cmd/dispatch",
    "*/cmd/web-3f9a1c",
    "all/estop/alice",
    "all/estop/vera",
    "all/estop/web-3f9a1c",
    "all/estop/eve",
    "all/estop/*",
    "traffic/alive",
    "traffic/state",
    "map",
    "dispatch/alive",
    "dispatch/tasks",
    "dispatch/event",
    "dispatch/event/@adv/pub/z/1/_",
    "dispatch/event/@adv/**",
    "dispatch/cmd/alice",
    "dispatch/cmd/vera",
    "dispatch/cmd/web-3f9a1c",
    "dispatch/cmd/dispatch",
    "dispatch/cmd/*",
    "dispatch/standby/alice",
    "dispatch/standby/vera",
    "dispatch/standby/dispatch",
    "dispatch/standby/*",
    "sim/truth",
    "sim/roster",
    "sim/stats",
    "sim/*",
    "identity/alice",
    "identity/eve",
    "identity/*",
    "unheard-of",
    "xtb-1/unheard-of",
    "**",
    "*/*",
    "xtb-1/**",
    "xtb-1/*/alice",
    "*/*/alice",
    "**/cmd/alice",
    "xtb-$*/state",
    "xtb-1/cmd/al$*",
];
/// Not of this fleet.
const FOREIGN: [&str; 6] =
    ["xtb/other/xtb-1/state", "xtb/other/xtb-1/cmd/alice", "xtb/*/xtb-1/cmd/alice", "xtb/**", "**", "ros/a"];

pub(super) fn keys() -> Vec<String> {
    let robots =
        ["xtb-1", "xtb-2", "*"].into_iter().flat_map(|robot| ROBOT.map(|key| format!("{robot}/{key}")));
    let own = robots.chain(OTHERS.map(str::to_owned)).map(|key| format!("xtb/lab/{key}"));
    let keys: BTreeSet<String> = own.chain(FOREIGN.map(str::to_owned)).collect();
    keys.into_iter().collect()
}
