//! docs/guide: each command of each page is run as it stands there, what the pages show is compared
//! with what is seen, and what they write is read. A binary of its own: ten fleets at once would keep
//! the real-time ones of the other tests waiting.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod page;
mod shown;
mod terminal;
mod walk;

use fleet_tests::processes::program;
use page::{What, folder, names, steps, text};
use std::collections::BTreeSet;
use std::process::Command;
use walk::walk;

/// The pages, and the tests below: one each, so that they run side by side.
const PAGES: [&str; 11] = [
    "README.md",
    "first-drive.md",
    "fleet.md",
    "install.md",
    "recordings.md",
    "rooms.md",
    "screens.md",
    "security.md",
    "tasks.md",
    "troubleshooting.md",
    "your-robot.md",
];
/// Commands that no test can run: they install, ask for a password, or need a service manager.
const NOT_RUN: usize = 12;

#[test]
fn every_page_is_walked() {
    assert_eq!(names(), PAGES);
}

#[test]
fn few_commands_are_not_run() {
    let (mut run, mut not_run) = (0, 0);
    for page in names() {
        for step in steps(&page, &text(&page)) {
            if let What::Commands(notes, typed) = step.what {
                *if notes.has("not-run") { &mut not_run } else { &mut run } += typed.len();
            }
        }
    }
    assert!(not_run <= NOT_RUN && run >= 5 * NOT_RUN, "{run} are run and {not_run} are not");
}

#[test]
fn every_verb_is_met() {
    let guide: String = names().iter().map(|page| text(page)).collect();
    for name in ["fleet-cli", "robot-agent"] {
        let output = Command::new(program(name)).arg("--help").output().unwrap();
        let help = String::from_utf8(output.stdout).unwrap();
        let verbs =
            help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
        let verbs: Vec<&str> = verbs.filter(|line| !line.starts_with("   ")).filter_map(first_word).collect();
        assert!(verbs.len() > 5, "{help}");
        let missing =
            verbs.iter().filter(|verb| **verb != "help" && !guide.contains(&format!("{name} {verb}")));
        assert_eq!(missing.collect::<Vec<_>>(), Vec::<&&str>::new(), "the guide does not know them");
    }
}

fn first_word(line: &str) -> Option<&str> {
    line.split_whitespace().next()
}

#[test]
fn every_link_leads_somewhere() {
    for page in names() {
        for part in text(&page).split("](").skip(1) {
            let target = part.split(')').next().unwrap_or_default();
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let file = folder().join(file);
            let leads = || {
                let there = heading.is_empty()
                    || headings(&std::fs::read_to_string(&file).unwrap()).contains(heading);
                file.exists() && there
            };
            assert!(target.starts_with("https://") || leads(), "{page}: {target}");
        }
    }
}

/// The headings of a page, as links name them.
fn headings(text: &str) -> BTreeSet<String> {
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let named = headings.map(|line| line.trim_start_matches('#').trim().to_lowercase());
    let letter = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
    named.map(|line| line.chars().filter(letter).collect::<String>().replace(' ', "-")).collect()
}

#[test]
fn first_drive_runs_as_written() {
    walk("first-drive.md");
}

#[test]
fn fleet_runs_as_written() {
    walk("fleet.md");
}

#[test]
fn install_runs_as_written() {
    walk("install.md");
}

#[test]
fn recordings_runs_as_written() {
    walk("recordings.md");
}

#[test]
fn rooms_runs_as_written() {
    walk("rooms.md");
}

#[test]
fn screens_runs_as_written() {
    walk("screens.md");
}

#[test]
fn security_runs_as_written() {
    walk("security.md");
}

#[test]
fn tasks_runs_as_written() {
    walk("tasks.md");
}

#[test]
fn troubleshooting_runs_as_written() {
    walk("troubleshooting.md");
}

#[test]
fn your_robot_runs_as_written() {
    walk("your-robot.md");
}
