//! The binary as a shell sees it, in an empty home.

#![allow(dead_code)] // each test binary uses its own part

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use std::path::Path;
use tempfile::TempDir;

/// Nothing listens there.
pub(crate) const NOWHERE: &str = "tcp/127.0.0.1:1";

pub(crate) struct Home(TempDir);

impl Home {
    pub(crate) fn empty() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fleet-cli"));
        command.env_clear().env("HOME", self.path()).current_dir(self.path());
        command
    }

    pub(crate) fn run(&self, line: &str) -> Assert {
        self.command().args(line.split_whitespace()).assert()
    }

    /// The same, where no router answers.
    pub(crate) fn alone(&self, line: &str) -> Assert {
        self.command().args(["--connect", NOWHERE, "--timeout", "0.3"]).args(line.split_whitespace()).assert()
    }

    pub(crate) fn config(&self, text: &str) {
        let folder = self.path().join(".config/xtb");
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("fleet.toml"), text).unwrap();
    }
}

pub(crate) fn stdout(assert: &Assert) -> String {
    String::from_utf8(assert.get_output().stdout.clone()).unwrap()
}

pub(crate) fn stderr(assert: &Assert) -> String {
    String::from_utf8(assert.get_output().stderr.clone()).unwrap()
}

/// One line of JSON on standard output, and nothing else there.
pub(crate) fn json(assert: &Assert) -> serde_json::Value {
    let text = stdout(assert);
    assert_eq!(text.lines().count(), 1, "{text}");
    serde_json::from_str(&text).unwrap()
}

/// A room of 6 × 4 m with a wall and a zone.
pub(crate) const HALL: &str = "name = 'hall'\n[room]\nwidth_m = 6.0\ndepth_m = 4.0\n[[walls]]\n\
                    points = [[0.0, -2.0], [0.0, 0.5]]\n[[zones]]\nname = 'charger'\nkind = 'keep_out'\n\
                    points = [[-3.0, -2.0], [-2.0, -2.0], [-2.0, -1.0], [-3.0, -1.0]]\n";
