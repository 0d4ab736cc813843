//! What is wrong with a command line: clap's words, a tip where they leave the way out unsaid, and the
//! same as a failure of ours for `--json`.

use clap::error::{ContextKind, ContextValue, ErrorKind as Usage};
use xtb_client::{Error, ErrorKind};

/// How clap calls an argument that `--all` can stand for, behind the name of the other one.
const OR_ALL: &str = "|--all>";

/// With a tip, if `--all` would have been an answer.
pub(super) fn with_tip(mut error: clap::Error) -> clap::Error {
    let missing = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::Strings(missing)) if error.kind() == Usage::MissingRequiredArgument => missing,
        _ => return error,
    };
    let one_or_all = missing.iter().find_map(|argument| argument.strip_suffix(OR_ALL)?.strip_prefix('<'));
    if let Some(one) = one_or_all.map(str::to_lowercase) {
        let tip = format!("name at least one {one}, or use --all for every {one}");
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
}

/// The same without the lines that only help in a terminal: what is wrong, and clap's tip as the hint.
#[must_use]
pub fn failure(error: &clap::Error) -> Error {
    let text = error.to_string();
    let in_one_line = |lines: &str| lines.split_whitespace().collect::<Vec<_>>().join(" ");
    let message = in_one_line(text.split("\n\n").next().unwrap_or_default());
    let message = message.strip_prefix("error: ").unwrap_or(&message);
    let tip = text.lines().find_map(|line| line.trim_start().strip_prefix("tip: "));
    Error::new(ErrorKind::Invalid, message).hint(tip.unwrap_or("fleet-cli --help lists commands and options"))
}
