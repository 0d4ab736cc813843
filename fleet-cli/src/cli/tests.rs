//! Command lines and what they mean.

use super::*;
use crate::args::LinkLossArg;
use crate::commands::Verb;
use crate::commands::dispatch::{DispatchArgs, DispatchVerb};
use crate::point::PointWord;
use crate::values::LATCHES;
use xtb_protocol::messages::Latch;

fn read(line: &str) -> Result<Cli, clap::Error> {
    Cli::read(line.split(' ').map(OsString::from))
}

#[test]
fn the_grammar_is_consistent() {
    Cli::command().debug_assert();
}

#[test]
fn negative_coordinates_need_no_dashes() {
    let Verb::Goto(goto) = read("fleet-cli goto xtb-1 -1.5 -2e0 --wait").unwrap().verb else { panic!() };
    assert_eq!((goto.to.point, goto.to.y_m, goto.wait), (PointWord::X(-1.5), Some(-2.0), true));
    for bad in ["nan", "inf", "1001", "X"] {
        assert!(read(&format!("fleet-cli goto xtb-1 {bad} 0")).is_err(), "{bad}");
    }
}

#[test]
fn global_options_stand_before_or_after_the_verb() {
    for line in [
        "fleet-cli --json --connect tcp/a:1,tcp/b:2 list",
        "fleet-cli list --connect tcp/a:1 --connect tcp/b:2 --json",
    ] {
        let global = read(line).unwrap().global;
        assert!(global.json && global.connect_given, "{line}");
        assert_eq!(global.connect, ["tcp/a:1", "tcp/b:2"], "{line}");
    }
    assert!(!read("fleet-cli list").unwrap().global.connect_given);
}

#[test]
fn a_router_may_be_named_by_its_computer_alone() {
    let connect = |endpoint: &str| {
        read(&format!("fleet-cli list --identity none --connect {endpoint}")).unwrap().global.connect
    };
    for (given, meant) in [
        ("10.0.0.1", "tcp/10.0.0.1:7447"),
        ("lab-pc:7000", "tcp/lab-pc:7000"),
        ("[::1]", "tcp/[::1]:7447"),
        ("[::1]:7000", "tcp/[::1]:7000"),
        ("tls/a:1", "tls/a:1"),
    ] {
        assert_eq!(connect(given), [meant]);
    }
    let with = read("fleet-cli list --identity folder --connect 10.0.0.1").unwrap().global.connect;
    assert_eq!(with, ["tls/10.0.0.1:7447"]);
}

#[test]
fn a_negative_number_is_refused_by_its_own_option() {
    for line in ["wander xtb-1 --for -3", "list --timeout -1", "goto xtb-1 1 2 --within -3"] {
        let error = read(&format!("fleet-cli {line}")).unwrap_err();
        assert_ne!(error.kind(), clap::error::ErrorKind::UnknownArgument, "{line}: {error}");
    }
}

#[test]
fn latches_are_named_as_robots_name_them() {
    let Verb::Reset(reset) = read("fleet-cli reset xtb-1 --latch gyro_lost --take").unwrap().verb else {
        panic!()
    };
    assert_eq!((reset.latch, reset.lease.take), (Some(Latch::GyroLost), true));
    assert!(read("fleet-cli reset xtb-1 --latch gyro").is_err());
    assert_eq!(LATCHES.map(str::to_owned), Latch::ALL.map(|latch| latch.to_string()));
}

#[test]
fn a_reset_is_of_named_robots_or_of_all() {
    let reset = |line: &str| match read(line).map(|cli| cli.verb) {
        Ok(Verb::Reset(reset)) => Ok((reset.who.robots.len(), reset.who.all, reset.yes)),
        Ok(other) => panic!("{other:?}"),
        Err(error) => Err(error.kind()),
    };
    assert_eq!(reset("fleet-cli reset xtb-1 xtb-2"), Ok((2, false, false)));
    assert_eq!(reset("fleet-cli reset --all --yes"), Ok((0, true, true)));
    for bad in ["reset", "reset xtb-1 --all", "reset --yes"] {
        assert!(reset(&format!("fleet-cli {bad}")).is_err(), "{bad}");
    }
    let Verb::Why(why) = read("fleet-cli why xtb-1 xtb-2").unwrap().verb else { panic!() };
    assert_eq!(why.robots.len(), 2);
    assert!(read("fleet-cli why").is_err());
}

#[test]
fn a_reserved_name_is_no_robot() {
    assert!(read("fleet-cli stop all").unwrap_err().to_string().contains("reserved"));
    assert!(read("fleet-cli stop").is_err());
    assert!(read("fleet-cli stop --all --expect xtb-1,xtb-2").is_ok());
}

#[test]
fn points_may_be_negative_and_options_may_follow_them() {
    let line = "fleet-cli dispatch route -1,0 -.5,-2,90 1,1 --loops 2 --robot xtb-1 --wait";
    let Verb::Dispatch(DispatchArgs { verb: DispatchVerb::Route(route) }) = read(line).unwrap().verb else {
        panic!()
    };
    let points: Vec<&str> = route.points.iter().map(|point| point.trim()).collect();
    assert_eq!(points, ["-1,0", "-.5,-2,90", "1,1"]);
    assert_eq!((route.loops, route.stay.wait), (2, true));
    assert!(read("fleet-cli dispatch goto -1.5 -2 --yaw -90").is_ok());
}

#[test]
fn tasks_are_called_by_their_ids() {
    let Verb::Cancel(cancel) = read("fleet-cli cancel t17 t3").unwrap().verb else { panic!() };
    assert_eq!(cancel.tasks.iter().map(|task| task.number()).collect::<Vec<_>>(), [17, 3]);
    assert!(read("fleet-cli cancel 17").unwrap_err().to_string().contains("such as t17"));
    for bad in ["cancel", "cancel --all t1", "pause", "resume", "retry", "task", "extend", "extend t1"] {
        assert!(read(&format!("fleet-cli {bad}")).is_err(), "{bad}");
    }
    assert!(read("fleet-cli cancel --all").is_ok());
    let Verb::Extend(extend) = read("fleet-cli extend t17 -1,0 2,2,90 --after 3").unwrap().verb else {
        panic!()
    };
    assert_eq!((extend.task.number(), extend.points.len(), extend.after), (17, 2, Some(3)));
}

#[test]
fn a_task_is_for_one_robot_tag_or_capability_and_interrupting_needs_waiting() {
    for bad in [
        "goto 1 2 --robot xtb-1 --tag red",
        "goto 1 2 --cancel-on-interrupt",
        "goto 1 2 --priority 10",
        "wander",
        "route",
        "patrol 0,0 --dwell -1",
        "goto 1 2 --on-link-loss go",
        "goto 1 2 --finish 60",
    ] {
        assert!(read(&format!("fleet-cli dispatch {bad}")).is_err(), "{bad}");
    }
}

#[test]
fn a_task_says_what_its_robot_does_without_the_dispatcher() {
    let terms = |line: &str| match read(&format!("fleet-cli dispatch {line}")).unwrap().verb {
        Verb::Dispatch(DispatchArgs { verb: DispatchVerb::Wander(args) }) => args.terms,
        Verb::Dispatch(DispatchArgs { verb: DispatchVerb::Goto(args) }) => args.terms,
        other => panic!("{other:?}"),
    };
    let finish = terms("goto 1 2 --on-link-loss finish --finish 60");
    assert_eq!((finish.on_link_loss, finish.finish), (LinkLossArg::Finish, Some(60.0)));
    let halt = terms("wander --for 60");
    assert_eq!((halt.on_link_loss, halt.finish), (LinkLossArg::Halt, None));
}

#[test]
fn a_usage_line_is_that_of_the_verb_whatever_was_typed() {
    for (line, usage) in [
        ("--timeout 5 wander --wait", "Usage: fleet-cli wander [OPTIONS] <ROBOT>..."),
        ("--connect 10.0.0.1 goto xtb-1", "Usage: fleet-cli goto [OPTIONS] <ROBOT> <X|PLACE> [Y]"),
        ("dispatch activate --fly", "Usage: fleet-cli dispatch activate [OPTIONS]"),
        ("stop --json", "Usage: fleet-cli stop [OPTIONS] <ROBOT|--all>"),
    ] {
        let said = read(&format!("fleet-cli {line}")).unwrap_err().to_string();
        let found = said.lines().find(|line| line.starts_with("Usage: ")).unwrap();
        assert_eq!(found, usage, "{said}");
    }
}

#[test]
fn who_gives_no_verb_gets_a_short_list_of_all() {
    let short = read("fleet-cli").unwrap_err().to_string();
    assert!(short.lines().count() < 20, "{short}");
    let words: Vec<&str> = short.split_whitespace().collect();
    for verb in Cli::command().get_subcommands().filter(|verb| !verb.is_hide_set()) {
        assert!(words.contains(&verb.get_name()), "{} is missing in\n{short}", verb.get_name());
    }
    let long = read("fleet-cli --json").unwrap_err();
    assert_eq!(usage_failure(&long).message, "a verb is missing");
}
