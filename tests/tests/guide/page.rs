//! A page of the guide as a walk: what is typed, shown, written into a file, and ended by Ctrl-C.
//!
//! A fence's info string says how its block is meant: the language first, then notes such as
//! `background`, `expect=1` or `file=fleet.toml`. A comment `<!-- ctrl-c WORD -->` on a line of its
//! own ends the programs in the background whose command lines contain that word.

use std::path::{Path, PathBuf};

/// One step of the walk, with the page's line on which it begins.
#[derive(Debug, PartialEq)]
pub(super) struct Step {
    pub(super) line: usize,
    pub(super) what: What,
}

/// What is done in a step.
#[derive(Debug, PartialEq)]
pub(super) enum What {
    /// Lines for the shell.
    Commands(Notes, Vec<String>),
    /// What the commands before have shown.
    Shown(String),
    /// A file that the reader writes.
    File(Notes, String),
    /// Ctrl-C, in the terminals with this word in their command line.
    CtrlC(String),
}

/// The words after a fence's language.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Notes {
    pub(super) language: String,
    words: Vec<String>,
}

impl Notes {
    /// Whether a word stands there.
    pub(super) fn has(&self, word: &str) -> bool {
        self.words.iter().any(|one| one == word)
    }

    /// The value of `key=value`.
    pub(super) fn value(&self, key: &str) -> Option<&str> {
        self.words.iter().find_map(|one| one.strip_prefix(key)?.strip_prefix('='))
    }

    /// The exit code that is told.
    pub(super) fn exit_code(&self) -> i32 {
        self.value("expect").map_or(0, |code| code.parse().unwrap())
    }
}

/// Notes of the languages; anything else is a slip of the pen.
const KNOWN: [(&str, &[&str]); 3] = [
    ("sh", &["background", "screen", "not-run", "until", "expect=", "ready=", "keys=", "shows="]),
    ("text", &["file="]),
    ("toml", &["file=", "fleet", "agent", "tasks"]),
];

/// The folder of the guide.
pub(super) fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guide")
}

/// The pages' names, in order of the alphabet.
pub(super) fn names() -> Vec<String> {
    let entries = std::fs::read_dir(folder()).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut pages: Vec<_> = names.filter(|name| name.ends_with(".md")).collect();
    pages.sort();
    pages
}

/// The text of a page.
pub(super) fn text(page: &str) -> String {
    std::fs::read_to_string(folder().join(page)).unwrap_or_else(|error| panic!("{page}: {error}"))
}

/// The steps of a page.
pub(super) fn steps(page: &str, text: &str) -> Vec<Step> {
    let mut steps = Vec::new();
    let mut lines = text.lines().enumerate();
    while let Some((i, line)) = lines.next() {
        let at = i + 1;
        if let Some(word) = line.strip_prefix("<!-- ctrl-c ").and_then(|rest| rest.strip_suffix(" -->")) {
            steps.push(Step { line: at, what: What::CtrlC(word.to_owned()) });
        } else if let Some(info) = line.strip_prefix("```") {
            let notes = notes(info).unwrap_or_else(|wrong| panic!("{page}:{at}: {wrong}"));
            let body: Vec<&str> =
                lines.by_ref().map(|(_, line)| line).take_while(|line| *line != "```").collect();
            steps.push(Step { line: at, what: step(notes, &body) });
        }
    }
    steps
}

fn step(notes: Notes, body: &[&str]) -> What {
    match notes.language.as_str() {
        "sh" => {
            let typed = body.iter().filter(|line| !line.trim().is_empty() && !line.trim().starts_with('#'));
            What::Commands(notes, typed.map(|line| (*line).to_owned()).collect())
        }
        "text" if notes.value("file").is_none() => What::Shown(body.join("\n")),
        _ => What::File(notes, body.join("\n") + "\n"),
    }
}

fn notes(info: &str) -> Result<Notes, String> {
    let mut words = info.split_whitespace().map(str::to_owned);
    let language = words.next().ok_or("a fence without a language")?;
    let known = KNOWN.iter().find(|(name, _)| *name == language);
    let (_, known) = known.ok_or_else(|| format!("nothing is done with {language:?}"))?;
    let words: Vec<String> = words.collect();
    let is_known =
        |word: &String| known.iter().any(|one| word == one || one.ends_with('=') && word.starts_with(one));
    match words.iter().find(|word| !is_known(word)) {
        Some(word) => Err(format!("{word:?} says nothing about {language}")),
        None => Ok(Notes { language, words }),
    }
}

#[test]
fn a_page_becomes_steps() {
    let text = "# A\n\n```sh expect=1\nfleet-cli list   # who\n\n# nobody\n```\n\n```text\nname\n```\n\
        <!-- ctrl-c sim -->\n```toml fleet file=a.toml\nfleet = \"lab\"\n```\n";
    let steps = steps("a.md", text);
    let lines: Vec<usize> = steps.iter().map(|step| step.line).collect();
    assert_eq!(lines, [3, 9, 12, 13]);
    let What::Commands(notes, typed) = &steps[0].what else { panic!("{steps:?}") };
    assert_eq!((notes.exit_code(), typed.as_slice()), (1, &["fleet-cli list   # who".to_owned()][..]));
    assert_eq!(steps[1].what, What::Shown("name".to_owned()));
    assert_eq!(steps[2].what, What::CtrlC("sim".to_owned()));
    let What::File(notes, text) = &steps[3].what else { panic!("{steps:?}") };
    assert_eq!(
        (notes.value("file"), notes.has("fleet"), text.as_str()),
        (Some("a.toml"), true, "fleet = \"lab\"\n")
    );
    assert!(notes_of_slips().iter().all(Result::is_err));
}

#[cfg(test)]
fn notes_of_slips() -> [Result<Notes, String>; 3] {
    [notes(""), notes("bash"), notes("sh backgruond")]
}
