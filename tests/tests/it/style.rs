//! The rules that no compiler checks.

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Places where one of `words` stands in code below `folders`, outside unit tests and in files named in `except`.
fn places(folders: &[&str], words: &[&str], except: &[&str]) -> Vec<String> {
    let mut files = Vec::new();
    for folder in folders {
        sources(&root().join(folder), &mut files);
    }
    assert!(!files.is_empty());
    let mut places = Vec::new();
    for file in files.iter().filter(|file| !except.iter().any(|name| file.ends_with(name))) {
        let text = std::fs::read_to_string(file).unwrap();
        let text = text.split("#[cfg(test)]").next().unwrap_or_default();
        for (number, line) in text.lines().enumerate() {
            let code = line.split("//").next().unwrap_or_default();
            if words.iter().any(|word| code.contains(word)) {
                places.push(format!("{}:{}: {}", file.display(), number + 1, line.trim()));
            }
        }
    }
    places
}

/// What the two programs are made of.
const PROGRAMS: [&str; 6] = [
    "robot-agent/src",
    "robot-agent/board-emulator/src",
    "fleet-cli/src",
    "fleet-cli/services/src",
    "fleet-cli/simulator/src",
    "fleet-cli/dashboard/src",
];

fn none(places: &[String]) {
    assert!(places.is_empty(), "\n{}", places.join("\n"));
}

#[test]
fn keys_stand_in_the_key_table_only() {
    let folders = [&["core", "tests/src"], &PROGRAMS[..]].concat();
    none(&places(&folders, &["\"xtb/"], &["keys.rs", "tests.rs"]));
}

#[test]
fn the_core_knows_no_clock_file_socket_or_thread() {
    let folders = [
        "board-codec",
        "control",
        "protocol",
        "nav",
        "traffic",
        "robot",
        "dispatch",
        "ros2",
        "vda5050",
        "sim",
        "chaos",
    ]
    .map(|name| format!("core/{name}/src"));
    let folders = folders.each_ref().map(String::as_str);
    let words =
        ["Instant::now", "SystemTime", "tokio", "zenoh::", "std::fs", "std::net", "std::thread", "std::io"];
    // One reads a PNG from bytes that it is given, the other writes a time that it is given as a date.
    none(&places(&folders, &words, &["map/ros/image.rs", "vda5050/src/header.rs"]));
}

/// What packages are built from, one package or feature a line.
fn built_from(arguments: &[&str]) -> String {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let mut tree = std::process::Command::new(cargo);
    tree.args(["tree", "--offline", "--locked", "--prefix", "none"]).args(arguments);
    let output = tree.current_dir(root()).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_client_of_ones_own_needs_no_terminal_web_server_or_database() {
    let text = built_from(&["-p", "xtb-client", "-e", "normal"]);
    assert!(text.starts_with("xtb-client "), "{text}");
    for crate_ in ["axum", "clap", "crossterm", "ratatui", "rusqlite", "mcap", "fleet-cli", "robot-agent"] {
        assert!(!text.lines().any(|line| line.split(' ').next() == Some(crate_)), "{crate_}\n{text}");
    }
}

#[test]
fn the_package_of_a_robot_contains_no_simulator() {
    let build = std::fs::read_to_string(root().join("packaging/build")).unwrap();
    let options = build.lines().find_map(|line| line.split_once(" -p robot-agent ")).expect("its build").1;
    let arguments: Vec<&str> =
        ["-p", "robot-agent", "-e", "normal"].into_iter().chain(options.split(' ')).collect();
    let text = built_from(&arguments);
    assert!(text.starts_with("robot-agent "), "{text}");
    assert!(!text.lines().any(|line| line.starts_with("xtb-sim ")), "{text}");
}

#[test]
fn zenoh_is_opened_in_the_bus_only() {
    let folders = [
        "core/control/src",
        "core/protocol/src",
        "core/nav/src",
        "core/traffic/src",
        "core/sim/src",
        "core/chaos/src",
        "core/client/src",
        "core/recording/src",
    ];
    none(&places(&[&folders, &PROGRAMS[..]].concat(), &["zenoh::", "zenoh_ext"], &[]));
}

#[test]
fn recordings_are_files_and_know_no_clock_socket_or_thread() {
    let words = ["Instant::now", "SystemTime", "tokio", "std::net", "std::thread"];
    none(&places(&["core/recording/src"], &words, &[]));
}

#[test]
fn recordings_are_written_and_read_in_one_crate_only() {
    let folders = ["core/bus/src", "core/client/src", "core/robot/src", "tests/src"];
    none(&places(&[&folders, &PROGRAMS[..]].concat(), &["mcap::"], &[]));
}

/// A ledger's own files are not somebody else's.
#[test]
fn files_are_read_with_their_bounds_only() {
    let words = ["fs::read_to_string(", "fs::read(", "File::open("];
    let except = [
        "files.rs",
        "ledger.rs",
        "ledger/wal.rs",
        "ledger/export.rs",
        "anew.rs",
        "tests.rs",
        "tests/damage.rs",
    ];
    none(&places(&[&["core/recording/src"], &PROGRAMS[..]].concat(), &words, &except));
}

#[test]
fn every_module_says_what_it_is_for() {
    let mut files = Vec::new();
    for folder in ["core", "robot-agent", "fleet-cli", "tests"] {
        sources(&root().join(folder), &mut files);
    }
    let silent = files.iter().filter(|file| !std::fs::read_to_string(file).unwrap().starts_with("//! "));
    let silent: Vec<String> = silent.map(|file| file.display().to_string()).collect();
    none(&silent);
}

#[test]
fn nothing_that_drives_a_robot_switches_a_guard_off() {
    let words = ["with_guards", "set_guards", "Guards::"];
    none(&places(&PROGRAMS, &words, &[]));
    let text = built_from(&["-p", "robot-agent", "-p", "fleet-cli", "-e", "normal,features"]);
    assert!(text.contains("xtb-robot ") && !text.contains("switchable-guards"), "{text}");
}

/// Texts that are not escaped where they are read: their form is checked.
const CHECKED: [(&str, &str); 4] = [
    ("log.rs", "pub file: String,"),
    ("log.rs", "text: String,"),
    ("map.rs", "pub name: String,"),
    ("standby.rs", "pub body: String,"),
];

#[test]
fn every_text_of_a_message_is_escaped_where_it_is_read() {
    let mut files = Vec::new();
    sources(&root().join("core/protocol/src/messages"), &mut files);
    let mut raw = Vec::new();
    for file in &files {
        let text = std::fs::read_to_string(file).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        let mut before = "";
        for line in code.lines().map(str::trim) {
            let field = line.ends_with("String,") || line.ends_with("String>,") || line.ends_with("String),");
            let escaped = [before, line].iter().any(|it| it.contains("deserialize_with = \"text::read"));
            let checked = CHECKED.iter().any(|(name, field)| file.ends_with(name) && line == *field);
            if field && !escaped && !checked {
                raw.push(format!("{}: {line}", file.display()));
            }
            before = line;
        }
    }
    none(&raw);
}

#[test]
fn only_places_that_escape_write_to_the_terminal() {
    let words = ["stdout()", "stderr()", "style::Print("];
    // Whether it is a terminal says nothing to it; ratatui drops control characters itself.
    let harmless = [".is_terminal()", "CrosstermBackend::new(", "with_writer(", "use_stderr()"];
    let found = places(&PROGRAMS, &words, &[]);
    let writes = found.iter().filter(|place| !harmless.iter().any(|word| place.contains(word)));
    let safe = [
        "fleet-cli/src/output.rs",
        // Control sequences of its own, and lines that output.rs has looked at.
        "fleet-cli/src/terminal.rs",
        "robot-agent/src/logging.rs",
        "robot-agent/src/commands.rs",
        // Samples as numbers.
        "robot-agent/src/commands/replay.rs",
    ];
    none(&writes.filter(|place| !safe.iter().any(|file| place.contains(file))).cloned().collect::<Vec<_>>());
}

#[test]
fn every_file_that_readme_and_paths_name_by_its_whole_path_is_there() {
    let text = |file| std::fs::read_to_string(root().join(file)).unwrap();
    let readme = text("README.md") + &text("docs/paths.md");
    let folders = ["core/", "robot-agent/", "fleet-cli/", "tests/"];
    let named = readme.split('`').skip(1).step_by(2);
    let named = named.filter(|text| text.ends_with(".rs") && folders.iter().any(|it| text.starts_with(it)));
    let (there, missing): (Vec<&str>, Vec<&str>) = named.partition(|path| root().join(path).is_file());
    assert!(there.len() > 20 && missing.is_empty(), "they name {missing:?}");
}
