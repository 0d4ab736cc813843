//! What the binary says to whoever asks for something that cannot be: what is wrong, and what to do.

#![allow(clippy::unwrap_used)]

mod home;

use home::*;
use std::io::{BufRead, BufReader};
use std::process::Stdio;

#[test]
fn an_emergency_stop_without_a_router_says_what_to_do_and_goes_on_trying() {
    let home = Home::empty();
    for line in ["estop --all --expect xtb-1", "estop xtb-1", "estop --all --json"] {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_fleet-cli"));
        command.env_clear().env("HOME", home.path()).args(["--connect", NOWHERE, "--timeout", "0.3"]);
        let mut child =
            command.args(line.split(' ')).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
        let first: Vec<String> = said.by_ref().take(2).collect();
        assert!(first[0].starts_with(&format!("No router answers at {NOWHERE}")), "{line}: {first:?}");
        assert!(first[1].starts_with("robots may still drive: use the switch"), "{line}: {first:?}");
        assert_eq!(child.try_wait().unwrap(), None, "{line}: it does not try again");
        let pid = child.id().to_string();
        assert!(std::process::Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
        assert_eq!(child.wait().unwrap().code(), Some(130), "{line}");
    }
}

#[test]
fn every_error_has_a_hint() {
    let home = Home::empty();
    let file = |name: &str, text: &str| std::fs::write(home.path().join(name), text).unwrap();
    file("hall.toml", HALL);
    file("broken", "\u{7f} [= no file of ours");
    for ending in ["toml", "yaml", "mcap", "xtbid", "ledger", "txt"] {
        file(&format!("broken.{ending}"), "\u{7f} [= no file of ours");
    }
    for line in [
        "fly",
        "goto xtb-1",
        "list --frob",
        "list",
        "goto xtb-1 dock-1",
        "goto xtb-1 1",
        "teleop xtb-1",
        "home --all",
        "top",
        "reset --all",
        "watch xtb/lab/*/cmd/*",
        "watch a//b",
        "fetch-log xtb-1",
        "record",
        "play nothing.mcap",
        "play broken.mcap",
        "export broken.mcap --csv",
        "audit nothing.mcap",
        "audit broken.mcap",
        "audit --ledger nothing.ledger",
        "audit --ledger broken.ledger",
        "tasks",
        "task t1",
        "cancel t1",
        "extend t1 broken.txt",
        "extend t1 nothing.txt",
        "dispatch submit nothing.toml",
        "dispatch submit broken.toml",
        "dispatch route 1,x",
        "dispatch status",
        "dispatch compact --ledger nothing.ledger",
        "dispatch export --ledger nothing.ledger",
        "dispatch serve --ledger broken.ledger",
        "traffic serve --map broken.yaml",
        "map show nothing.yaml",
        "map show broken.toml",
        "map check broken.txt",
        "map import hall.toml --out x.pgm",
        "map import hall.toml --out no/folder.yaml",
        "place add a 1 2 --file broken.toml",
        "place remove a --file hall.toml",
        "place list --file broken.yaml",
        "sim --world nothing.toml",
        "sim --world broken.toml",
        "sim --world broken.yaml",
        "sim --vehicle broken.toml",
        "sim --robots 0",
        "demo --goals 0",
        "plan nothing.yaml --out x",
        "plan broken.yaml --out x",
        "pki list",
        "pki add-robot xtb-1",
        "enrol nothing.xtbid",
        "enrol broken.xtbid",
        "router --listen nonsense",
        "router --listen tls/127.0.0.1:0 --pki nowhere",
        "dashboard --listen 0.0.0.0:0",
        "vda5050 serve --mqtt nonsense://x",
        "man /dev/null/pages",
        "schema lst",
        "list --config nothing.toml",
        "list --config broken.toml",
        "list --identity nowhere",
    ] {
        let ended = home.alone(&format!("--json {line}"));
        assert_ne!(ended.get_output().status.code(), Some(0), "{line}");
        let text = stdout(&ended);
        let last = text.lines().last().unwrap_or_else(|| panic!("{line} says nothing: {}", stderr(&ended)));
        let error = &serde_json::from_str::<serde_json::Value>(last).unwrap()["error"];
        for field in ["code", "message", "hint"] {
            assert!(error[field].as_str().is_some_and(|text| !text.is_empty()), "{line}: {field}: {text}");
        }
    }
}

#[test]
fn who_gives_no_verb_gets_a_short_list_and_a_verb_its_schema() {
    let home = Home::empty();
    home.config("broken");
    let short = stderr(&home.run("").code(2));
    assert!(short.lines().count() < 20 && short.contains("fleet-cli demo"), "{short}");
    let schema: serde_json::Value = serde_json::from_str(&stdout(&home.run("schema list").code(0))).unwrap();
    assert_eq!(schema["title"], "fleet-cli --json list");
    assert_eq!(json(&home.run("schema list --json").code(0)), schema);
    let verbs = stdout(&home.run("schema").code(0));
    assert!(verbs.lines().any(|verb| verb == "dispatch status"), "{verbs}");
}

#[test]
fn an_instance_of_plan_and_a_careless_map_are_told_apart_from_a_good_one() {
    let home = Home::empty();
    let write = |name: &str, bytes: &[u8]| std::fs::write(home.path().join(name), bytes).unwrap();
    write("instance.yaml", b"world: hall.toml\nagents:\n  - {name: a, start: [0, 0, 0], goal: [1, 0, 0]}\n");
    for line in ["sim --world instance.yaml", "map check instance.yaml"] {
        let said = stderr(&home.run(line).code(2));
        assert!(said.contains("an instance of `fleet-cli plan`, neither a map nor a world"), "{said}");
        assert!(said.contains("hint: `fleet-cli plan instance.yaml --out FILE`"), "{said}");
    }
    // 205 is what map_saver writes for unknown; nav2's own free_thresh makes it free.
    let mut image = b"P5\n40 40 255\n".to_vec();
    image.extend((0..1600).map(|i| if i / 40 < 10 { 205 } else { 254 }));
    write("lab.pgm", &image);
    let yaml = |free_thresh: &str| {
        format!(
            "image: lab.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n\
             free_thresh: {free_thresh}\n"
        )
    };
    write("careless.yaml", yaml("0.25").as_bytes());
    write("good.yaml", yaml("0.196").as_bytes());
    let careless = json(&home.run("--json map check careless.yaml").code(0));
    let finding = &careless["findings"][0];
    assert_eq!((&finding["level"], &careless["warnings"]), (&"warning".into(), &1.into()), "{careless}");
    assert!(finding["text"].as_str().unwrap().starts_with("400 cells that map_saver has written as unknown"));
    assert!(finding["hint"].as_str().unwrap().contains("0.196"), "{careless}");
    assert_eq!(json(&home.run("--json map check good.yaml").code(0))["warnings"], 0);
    let said = stderr(&home.alone("map serve careless.yaml").code(3));
    assert!(said.contains("warning: careless.yaml: 400 cells"), "{said}");
    assert!(!stderr(&home.alone("map serve good.yaml").code(3)).contains("warning"));
}
