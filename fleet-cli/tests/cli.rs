//! The binary as a shell sees it, in an empty home, without any router.

#![allow(clippy::unwrap_used)]

mod home;

use home::*;

#[test]
fn help_lists_verbs_and_exit_codes() {
    let help = stdout(&Home::empty().run("--help").code(0));
    for part in [
        "list",
        "why",
        "doctor",
        "estop",
        "reset",
        "set-pose",
        "teleop",
        "completions",
        "Exit codes:",
        "3    no router",
        "130",
        "XTB_CONNECT",
    ] {
        assert!(help.contains(part), "{part} is missing in\n{help}");
    }
}

#[test]
fn wrong_usage_exits_with_2() {
    let home = Home::empty();
    for line in [
        "",
        "fly",
        "goto xtb-1",
        "goto xtb-1 1 nan",
        "goto Xtb-1 1 2",
        "stop",
        "stop --all xtb-1",
        "stop --expect xtb-1",
        "estop",
        "estop --all xtb-1",
        "reset",
        "reset xtb-1 --latch nonsense",
        "set-pose",
        "set-pose xtb-1 1",
        "set-pose xtb-1 1 nan",
        "set-pose xtb-1 1 2 --yaw 400",
        "stop xtb-1 --take",
        "alerts ack",
        "alerts ack 3 --all",
        "alerts ack three",
        "events --kind nonsense",
        "events --limit 0",
        "report --day 2026-02-30",
        "report --csv --json",
        "why",
        "wander xtb-1 --for -3",
        "home",
        "home --all xtb-1",
        "home xtb-1 --cancel-on-interrupt",
        "--fleet LAB list",
    ] {
        home.run(line).code(2);
    }
    let error = &json(&home.run("--json goto xtb-1 X 2").code(2))["error"];
    assert_eq!(error["code"], "usage");
    assert!(error["message"].as_str().unwrap().contains("invalid value"), "{error}");
}

#[test]
fn who_names_nobody_is_told_of_all() {
    let home = Home::empty();
    for (verb, what) in [("stop", "robot"), ("home", "robot"), ("estop", "robot"), ("cancel", "task")] {
        let tip = format!("name at least one {what}, or use --all for every {what}");
        let said = stderr(&home.run(verb).code(2));
        assert!(said.contains(&format!("tip: {tip}")), "{said}");
        let error = &json(&home.run(&format!("{verb} --json")).code(2))["error"];
        assert_eq!((&error["code"], &error["hint"]), (&"usage".into(), &tip.into()));
        assert!(error["message"].as_str().unwrap().contains("--all"), "{error}");
    }
    // What only a terminal needs is not part of the message, and what was missing is.
    let error = &json(&home.run("goto xtb-1 --json").code(2))["error"];
    assert_eq!(error["message"], "the following required arguments were not provided: <X|PLACE>");
}

#[test]
fn without_a_router_every_verb_says_what_it_tried_and_what_to_do() {
    let home = Home::empty();
    for line in [
        "list",
        "status",
        "why xtb-1",
        "goto xtb-1 1 2 --take",
        "wander xtb-1",
        "home @red",
        "stop --all",
        "stop xtb-1",
        "reset xtb-1 --latch gyro_lost --take",
        "set-pose xtb-1 -1 2.5 --yaw -90 --take",
        "watch xtb/**",
        "map show --live",
    ] {
        let said = stderr(&home.alone(line).code(3));
        assert!(said.contains(&format!("error: No router answers at {NOWHERE}")), "{line}: {said}");
        assert!(
            said.contains("hint: start `fleet-cli sim`") && said.contains("XTB_CONNECT"),
            "{line}: {said}"
        );
    }
}

#[test]
fn a_router_that_does_not_answer_is_the_doctors_finding() {
    let home = Home::empty();
    let said = stdout(&home.alone("doctor").code(1));
    assert!(said.contains(&format!("problem  router    No router answers at {NOWHERE}")), "{said}");
    assert!(said.contains("→ start `fleet-cli sim`") && said.ends_with("1 problem, 0 warnings\n"), "{said}");
    let report = json(&home.alone("doctor --json").code(1));
    assert_eq!((&report["problems"], &report["findings"][0]["level"]), (&1.into(), &"problem".into()));
}

#[test]
fn an_emergency_stop_is_not_sold_as_a_safety_rated_one() {
    let help = stdout(&Home::empty().run("estop --help").code(0));
    assert!(help.contains("not a safety-rated stop") && help.contains("--expect"), "{help}");
}

#[test]
fn latches_can_be_completed() {
    for shell in ["bash", "zsh", "fish"] {
        let script = stdout(&Home::empty().run(&format!("completions {shell}")).code(0));
        assert!(script.contains("remote_takeover") && script.contains("doctor"), "{shell}");
    }
}

#[test]
fn an_error_as_json_is_one_line_on_standard_output() {
    let home = Home::empty();
    for line in ["--json list", "list --json"] {
        let error = &json(&home.alone(line).code(3))["error"];
        assert_eq!(error["code"], "no_router");
        assert!(error["message"].as_str().unwrap().contains(NOWHERE));
        assert!(!error["hint"].as_str().unwrap().is_empty());
    }
}

#[test]
fn negative_coordinates_need_no_dashes() {
    // It gets as far as looking for a router.
    Home::empty().alone("goto xtb-1 -1.5 -2").code(3);
}

#[test]
fn the_environment_and_the_config_name_the_router() {
    let home = Home::empty();
    let by_environment = home
        .command()
        .env("XTB_CONNECT", "tcp/127.0.0.1:2,tcp/127.0.0.1:3")
        .args(["--timeout", "0.3", "list"])
        .assert()
        .code(3);
    assert!(stderr(&by_environment).contains("tcp/127.0.0.1:2, tcp/127.0.0.1:3"));
    home.config("connect = ['tcp/127.0.0.1:4']");
    assert!(stderr(&home.run("list --timeout 0.3").code(3)).contains("at tcp/127.0.0.1:4 "));
    assert!(stderr(&home.alone("list").code(3)).contains(NOWHERE));
}

#[test]
fn a_router_whose_name_cannot_be_resolved_is_named() {
    let said = stderr(&Home::empty().run("list --connect nonsense.invalid --timeout 0.3").code(3));
    assert!(said.contains("nonsense.invalid cannot be resolved") && said.contains("hint: "), "{said}");
}

#[test]
fn an_unknown_config_key_names_the_one_meant() {
    let home = Home::empty();
    home.config("[[robots]]\nnme = 'xtb-1'");
    let said = stderr(&home.alone("list").code(2));
    assert!(said.contains("fleet.toml") && said.contains("unknown key robots[0].nme"), "{said}");
    assert!(said.contains("did you mean robots[0].name?"), "{said}");
    let missing = stderr(&home.alone("list --config nowhere.toml").code(2));
    assert!(missing.contains("cannot read the config nowhere.toml"), "{missing}");
}

#[test]
fn a_world_is_imported_and_the_files_are_the_same_map() {
    let home = Home::empty();
    std::fs::write(home.path().join("hall.toml"), HALL).unwrap();
    let world = json(&home.run("map show hall.toml --json").code(0));
    assert_eq!(
        (&world["name"], &world["width"], &world["height"]),
        (&"hall".into(), &124.into(), &84.into())
    );
    let written = json(&home.run("--json map import hall.toml --out new.yaml").code(0));
    assert_eq!((&written["hash"], &written["image"]), (&world["hash"], &"new.pgm".into()));
    let file = json(&home.run("map show new.yaml --json").code(0));
    assert_eq!(file, world);
    let again = stderr(&home.run("map import new.yaml --out new.yaml").code(1));
    assert!(again.contains("new.yaml already exists") && again.contains("hint: --force"), "{again}");
    home.run("map import new.yaml --out new.yaml --force").code(0);
    let coarse = json(&home.run("map show hall.toml --resolution 0.1 --json").code(0));
    assert_eq!(coarse["width"], 62);
}

#[test]
fn places_are_named_moved_and_removed_in_a_worlds_and_in_a_maps_file() {
    let home = Home::empty();
    std::fs::write(home.path().join("hall.toml"), HALL).unwrap();
    home.run("map import hall.toml --out hall.yaml").code(0);
    for file in ["hall.toml", "hall.yaml"] {
        let run = |line: &str| home.run(&format!("{line} --file {file}"));
        let hash = |file: &str| json(&home.run(&format!("--json map show {file}")).code(0))["hash"].clone();
        let before = std::fs::read_to_string(home.path().join(file)).unwrap();
        let floor = hash(file);
        let said = stdout(&run("place add dock-2 -1.5 1 --yaw 90 --kind dock --tag north").code(0));
        assert_eq!(said, format!("dock-2 is (-1.50, 1.00) 90° in {file}\n"));
        run("place add gate 2 -1").code(0);
        let listed = stdout(&run("place list").code(0));
        let expected = "dock-2  dock     (-1.50, 1.00) 90° @north\ngate    place    (2.00, -1.00) any yaw\n";
        assert_eq!(listed, expected);
        let docks = json(&run("--json place list --kind dock").code(0));
        let yaw_rad = docks["places"][0]["yaw_rad"].as_f64().unwrap();
        assert!((yaw_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-4, "{docks}");
        let taken = stderr(&run("place add gate 0 0").code(1));
        assert!(
            taken.contains("has a place gate at (2.00, -1.00)") && taken.contains("--replace"),
            "{taken}"
        );
        run("place add gate 0 1 --replace").code(0);
        assert!(stdout(&run("place list").code(0)).contains("gate    place    (0.00, 1.00)"));
        assert_eq!(hash(file), floor, "no robot has to take another map");
        let missing = stderr(&run("place remove gate dock-9").code(1));
        assert!(
            missing.contains("has no place dock-9") && missing.contains("nothing was removed"),
            "{missing}"
        );
        run("place remove gate dock-2").code(0);
        assert_eq!(std::fs::read_to_string(home.path().join(file)).unwrap(), before);
    }
    for (line, reason) in [
        ("place add 7 1 2 --file hall.toml", "must begin with a letter"),
        ("place add inf 1 2 --file hall.toml", "not be a number"),
        ("place add a 1 --file hall.toml", "needs two numbers"),
        ("place add a 1 2 --file nothing.toml", "cannot read nothing.toml"),
        ("goto xtb-1 dock-1 2", "needs no Y"),
    ] {
        let said = stderr(&home.alone(line).code(2));
        assert!(said.contains(reason), "{line}: {said}");
    }
}

#[test]
fn a_map_is_drawn_and_checked() {
    let home = Home::empty();
    std::fs::write(home.path().join("hall.toml"), HALL).unwrap();
    let drawn = stdout(&home.run("map show hall.toml").code(0));
    assert!(
        drawn.contains("▒ keep-out charger") && drawn.contains("6.20 × 4.20 m, cells of 5 cm"),
        "{drawn}"
    );
    assert!(drawn.lines().all(|line| line.chars().count() <= 80), "{drawn}");
    let good = stdout(&home.run("map check hall.toml").code(0));
    assert!(good.contains("ok       one island") && good.ends_with("0 problems, 0 warnings\n"), "{good}");
    std::fs::write(home.path().join("wide.toml"), "[vehicle.geometry]\nbody_width_m = 3.0\n").unwrap();
    let wide = json(&home.run("--json map check hall.toml --car-from wide.toml").code(1));
    assert_eq!((&wide["problems"], wide["islands"].as_array().unwrap().len()), (&1.into(), 0));
    let off =
        HALL.replace("[-3.0, -2.0], [-2.0, -2.0], [-2.0, -1.0], [-3.0, -1.0]", "[9, 9], [8, 9], [8, 8]");
    std::fs::write(home.path().join("off.toml"), off).unwrap();
    let said = stdout(&home.run("map check off.toml").code(1));
    assert!(said.contains("problem  zone charger is outside the map"), "{said}");
}

#[test]
fn what_is_no_map_is_refused_with_file_and_reason() {
    let home = Home::empty();
    let file = |name: &str, text: &str| std::fs::write(home.path().join(name), text).unwrap();
    let yaml = "image: gone.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n\
                free_thresh: 0.196\n";
    file("gone.yaml", yaml);
    file("turned.yaml", &yaml.replace("0, 0, 0", "0, 0, 1.5"));
    file("bow.toml", &HALL.replace("[-2.0, -2.0], [-2.0, -1.0]", "[-2.0, -1.0], [-2.0, -2.0]"));
    file("map.txt", "");
    for (line, reason) in [
        ("map show nothing.yaml", "cannot read nothing.yaml"),
        ("map check gone.yaml", "cannot read gone.pgm"),
        ("map serve turned.yaml", "turned.yaml: the YAML's origin: a yaw of 1.5 rad"),
        ("map import bow.toml --out x.yaml", "zone \"charger\": the side from point"),
        ("map show map.txt", "neither a map nor a world"),
        ("map import bow.toml --out x.pgm", "zone"),
        ("map show", "required arguments"),
        ("map show map.txt --live", "cannot be used with"),
        ("map show map.txt --resolution 2", "0.005..=1"),
    ] {
        let said = stderr(&home.alone(line).code(2));
        assert!(said.contains(reason), "{line}: {said}");
    }
}

#[test]
fn a_board_without_firmware_emulator_or_node_is_refused_with_what_to_do() {
    let home = Home::empty();
    std::fs::write(home.path().join("board.elf"), "no firmware").unwrap();
    for (line, reason) in [
        ("sim --board-firmware none.elf", "none.elf is no file\nhint: build it: cargo xtask uf2"),
        ("sim --board-firmware board.elf", "robot-agent/firmware/emulator has no bridge.mjs\nhint: name"),
        ("sim --emulator .", "--board-firmware"),
        ("sim --virtual --board-firmware board.elf", "cannot be used with"),
    ] {
        let said = stderr(&home.run(line).code(2));
        assert!(said.contains(reason), "{line}: {said}");
    }
    std::fs::write(home.path().join("bridge.mjs"), "").unwrap();
    let line = ["sim", "--board-firmware", "board.elf", "--emulator", "."];
    let said = stderr(&home.command().args(line).assert().code(2));
    assert!(said.contains("hint: npm ci --ignore-scripts"), "{said}");
    std::fs::create_dir_all(home.path().join("node_modules/rp2040js")).unwrap();
    let said = stderr(&home.command().env("PATH", "").args(line).assert().code(1));
    assert!(said.contains("node does not start") && said.contains("hint: install Node 18"), "{said}");
}

#[test]
fn teleop_needs_a_terminal() {
    let said = stderr(&Home::empty().alone("teleop xtb-1").code(2));
    assert!(said.contains("terminal"), "{said}");
}

#[test]
fn commands_cannot_be_watched() {
    let error = &json(&Home::empty().alone("--json watch xtb/lab/*/cmd/*").code(2))["error"];
    assert_eq!(error["code"], "usage");
    assert!(error["message"].as_str().unwrap().contains("commands"), "{error}");
}

#[test]
fn a_taken_port_is_said_to_be_taken() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", taken.local_addr().unwrap());
    let said = stderr(&Home::empty().run(&format!("router --listen {endpoint}")).code(1));
    assert!(said.contains(&endpoint) && said.contains("--listen"), "{said}");
}

#[test]
fn completions_exist_for_every_shell_and_need_no_config() {
    let home = Home::empty();
    home.config("broken");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = stdout(&home.run(&format!("completions {shell}")).code(0));
        assert!(script.contains("teleop"), "{shell}");
    }
}

#[test]
fn there_is_a_manual_page_for_each_command_that_people_use() {
    let home = Home::empty();
    home.config("broken");
    let folder = home.path().join("share/man1");
    let line = format!("man {}", folder.display());
    assert_eq!(json(&home.run(&format!("--json {line}")).code(0))["folder"], folder.display().to_string());
    let page = |name: &str| std::fs::read_to_string(folder.join(name));
    assert!(page("fleet-cli.1").unwrap().contains("Exit codes:"));
    assert!(page("fleet-cli-dispatch-submit.1").is_ok() && page("fleet-cli-names.1").is_err());
    let said = stderr(&home.run("man /dev/null/pages").code(1));
    assert!(
        said.contains("cannot write manual pages to /dev/null/pages: ") && said.contains("hint: "),
        "{said}"
    );
}

#[test]
fn bash_completes_robots_and_tasks_that_there_are() {
    let home = Home::empty();
    let script = stdout(&home.run("completions bash").code(0));
    for (words, expected) in [
        ("cancel ''", "tasks-now"),
        ("goto ''", "whom-now"),
        ("goto @ r", "@red"),
        ("goto @", "@red"),
        ("goto xtb-1, @ r", "@red"),
        ("goto xtb-1 @ r", ""),
        ("home --parking @ r", "@red"),
        ("status ''", "robots-now"),
        ("dispatch goto 1 2 --robot ''", "robots-now"),
        ("goto xtb-1 ''", "places-now"),
        ("dispatch goto ''", "places-now"),
        ("dispatch route dock-1 ''", "places-now"),
        ("place remove ''", "places-now"),
        ("place here dock-1 ''", "robots-now"),
        ("dispatch goto 1 2 --tag ''", "tags-now"),
        ("list --fleet ''", "fleets-now"),
    ] {
        let last = words.split(' ').count();
        // As bash parts words, and what readline takes for the word at the cursor.
        let (before, at) = words.rsplit_once(' ').unwrap_or(("", words));
        let word = if before.ends_with('@') { format!("@{at}") } else { at.replace("''", "") };
        let ask = format!(
            "fleet-cli() {{ [ \"$1\" = names ] && echo \"$2-now\"; [ \"$2\" != whom ] || echo @red; }}\n{script}\n\
             COMP_WORDS=(fleet-cli {words}); COMP_CWORD={last}\n\
             _fleet-cli_live fleet-cli '{word}' \"${{COMP_WORDS[COMP_CWORD-1]}}\"; echo \"${{COMPREPLY[*]}}\""
        );
        let file = home.path().join("ask.bash"); // too long for an argument
        std::fs::write(&file, ask).unwrap();
        let output = std::process::Command::new("bash").arg("--norc").arg(file).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let found = said.split_whitespace().any(|word| word == expected);
        assert!(found || expected.is_empty() && said.trim().is_empty(), "{words}: {output:?}");
    }
}

#[test]
fn zsh_and_fish_complete_robots_and_tasks_that_there_are() {
    let zsh = stdout(&Home::empty().run("completions zsh").code(0));
    let asks = |end: &str| zsh.lines().filter(|line| line.ends_with(end)).count();
    let of = |what: &str| asks(&format!(":_fleet-cli_{what}' \\"));
    // task, cancel, extend, pause, resume, retry; as many robots as there are places for them.
    assert_eq!(of("tasks"), 6, "{zsh}");
    let has = |option: &str| zsh.lines().filter(|line| line.contains(option)).count();
    assert_eq!((of("tags"), of("fleets")), (has("--tag=["), has("--fleet=[")), "{zsh}");
    let left = zsh.lines().filter(|line| line.contains(":ROBOT:_default") || line.contains("obot:_default"));
    assert_eq!((of("robots") > 10, left.count()), (true, 0), "{zsh}");
    let defined = zsh.find("_fleet-cli_tasks() {").unwrap();
    assert!(defined < zsh.find("if [ \"$funcstack").unwrap(), "the script runs before they are there");
    let fish = stdout(&Home::empty().run("completions fish").code(0));
    assert!(fish.contains("(fleet-cli names tasks") && fish.contains("(fleet-cli names robots"), "{fish}");
}

#[test]
fn nothing_is_coloured_outside_a_terminal() {
    let home = Home::empty();
    home.config("[[robots]]\nname = 'xtb-1'");
    let assert = home.alone("list").code(3);
    assert!(!stdout(&assert).contains('\x1b') && !stderr(&assert).contains('\x1b'));
}
