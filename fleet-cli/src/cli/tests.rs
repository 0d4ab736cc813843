//! Command lines and what they mean.

use super::*;

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
    assert_eq!((goto.x_m, goto.y_m, goto.wait), (-1.5, -2.0, true));
    for bad in ["nan", "inf", "1001", "x"] {
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
fn latches_are_named_as_robots_name_them() {
    let Verb::Reset(reset) = read("fleet-cli reset xtb-1 --latch gyro_lost --take").unwrap().verb else {
        panic!()
    };
    assert_eq!((reset.latch, reset.lease.take), (Some(Latch::GyroLost), true));
    assert!(read("fleet-cli reset xtb-1 --latch gyro").is_err());
    assert_eq!(LATCHES.map(str::to_owned), Latch::ALL.map(|latch| latch.to_string()));
}

#[test]
fn a_reserved_name_is_no_robot() {
    assert!(read("fleet-cli stop all").unwrap_err().to_string().contains("reserved"));
    assert!(read("fleet-cli stop").is_err());
    assert!(read("fleet-cli stop --all --expect xtb-1,xtb-2").is_ok());
}
