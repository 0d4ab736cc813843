//! docs/guide: each command of each page is run as it stands there, what the pages show is compared
//! with what is seen, and what they write is read.

mod page;
mod shown;
mod terminal;
mod walk;

use page::{What, folder, names, steps, text};
use walk::walk;

/// The pages, and the tests below: one each, so that they run side by side.
const PAGES: [&str; 10] = [
    "README.md",
    "first-drive.md",
    "fleet.md",
    "install.md",
    "recordings.md",
    "rooms.md",
    "screens.md",
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
fn every_link_leads_somewhere() {
    for page in names() {
        for part in text(&page).split("](").skip(1) {
            let target = part.split(')').next().unwrap_or_default();
            let file = target.split('#').next().unwrap_or_default();
            let leads = target.starts_with("https://") || folder().join(file).exists();
            assert!(leads, "{page}: {target}");
        }
    }
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
