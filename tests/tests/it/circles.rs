//! No file imports back up: within a crate, what a file uses never uses that file, by whatever way round. What a
//! module and those inside it take from each other is one module's inside.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

type Module = Vec<String>;

const CRATES: [&str; 23] = [
    "core/control",
    "core/protocol",
    "core/nav",
    "core/traffic",
    "core/robot",
    "core/dispatch",
    "core/ros2",
    "core/ros2-node",
    "core/board-codec",
    "core/identity",
    "core/vda5050",
    "core/sim",
    "core/chaos",
    "core/bus",
    "core/client",
    "core/recording",
    "robot-agent",
    "fleet-cli/services",
    "robot-agent/board-emulator",
    "fleet-cli/simulator",
    "fleet-cli/dashboard",
    "fleet-cli",
    "tests",
];

/// Every file below `folder`, but unit tests, by the path of its module.
fn files(folder: &Path, at: &Module, found: &mut BTreeMap<Module, PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
        let inner = at.iter().cloned().chain([stem.clone()]).collect();
        if path.is_dir() {
            files(&path, &inner, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") && stem != "tests" {
            let root = matches!(stem.as_str(), "lib" | "main" | "mod");
            found.insert(if root { at.clone() } else { inner }, path);
        }
    }
}

/// The paths that a use tree such as `a::{b, c::{d, e}}` names.
fn expand(tree: &str) -> Vec<String> {
    let tree = tree.trim();
    let Some((head, rest)) = tree.split_once('{') else {
        return vec![tree.split_whitespace().next().unwrap_or_default().to_owned()];
    };
    let (mut depth, mut from, mut paths) = (0, 0, Vec::new());
    for (at, byte) in rest.bytes().enumerate() {
        let ends = depth == 0 && (byte == b',' || byte == b'}');
        match byte {
            b'{' => depth += 1,
            b'}' => depth -= 1,
            _ => {}
        }
        if ends {
            paths.extend(expand(&rest[from..at]).into_iter().map(|path| format!("{head}{path}")));
            from = at + 1;
        }
        if depth < 0 {
            break;
        }
    }
    paths
}

/// What a file names of its crate.
fn named(file: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(file).unwrap();
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let code: String =
        code.lines().map(|line| line.split("//").next().unwrap_or_default().to_owned() + "\n").collect();
    let uses = code.split("\nuse ").chain(code.split("pub use ").skip(1)).chain(code.split(") use ").skip(1));
    let mut paths: Vec<String> =
        uses.skip(1).flat_map(|rest| expand(rest.split(';').next().unwrap_or_default())).collect();
    for start in ["crate::", "super::"] {
        for (at, _) in code.match_indices(start) {
            let end = code[at..].find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')).unwrap_or(0);
            paths.push(code[at..at + end].to_owned());
        }
    }
    paths
}

/// The file that holds what `path` names, as seen from `from`.
fn resolve(files: &BTreeMap<Module, PathBuf>, from: &Module, path: &str) -> Option<Module> {
    let mut parts = path.split("::").map(str::trim).filter(|part| !part.is_empty()).peekable();
    let mut at = match *parts.peek()? {
        "crate" => Module::new(),
        "super" | "self" => from.clone(),
        child => {
            let inner: Module = from.iter().cloned().chain([child.to_owned()]).collect();
            files.get(&inner)?;
            from.clone()
        }
    };
    while let Some(part) = parts.next_if(|part| matches!(*part, "crate" | "super" | "self")) {
        if part == "super" {
            at.pop();
        }
    }
    for part in parts {
        let inner: Module = at.iter().cloned().chain([part.to_owned()]).collect();
        if !files.contains_key(&inner) {
            break;
        }
        at = inner;
    }
    files.contains_key(&at).then_some(at)
}

/// Whom `from` reaches by what it uses.
fn reached<'a>(uses: &'a BTreeMap<Module, BTreeSet<Module>>, from: &'a Module) -> BTreeSet<&'a Module> {
    let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(next) = open.pop() {
        for used in uses.get(next).into_iter().flatten() {
            if reached.insert(used) {
                open.push(used);
            }
        }
    }
    reached
}

#[test]
fn no_file_imports_back_up() {
    let mut circles = Vec::new();
    for name in CRATES {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name).join("src");
        let mut found = BTreeMap::new();
        files(&folder, &Module::new(), &mut found);
        let mut uses: BTreeMap<Module, BTreeSet<Module>> = BTreeMap::new();
        for (module, file) in &found {
            let used = named(file).into_iter().filter_map(|path| resolve(&found, module, &path));
            let beside = |used: &Module| !used.starts_with(module) && !module.starts_with(used);
            uses.insert(module.clone(), used.filter(beside).collect());
        }
        let circle = uses.keys().filter(|module| reached(&uses, module).contains(module));
        circles.extend(circle.map(|module| format!("{name}: {}", module.join("::"))));
    }
    assert!(circles.is_empty(), "\n{}", circles.join("\n"));
}
