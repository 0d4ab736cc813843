//! What is wrong with a command line: clap's words, a tip where they leave the way out unsaid, and the
//! same as a failure of ours for `--json`.

use clap::Command;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind as Usage};
use xtb_client::{Error, ErrorKind};

/// How clap calls an argument that `--all` can stand for, behind the name of the other one.
const OR_ALL: &str = "|--all>";
const ALL: &str = "fleet-cli --help lists commands and options";

/// What is said to who gives no verb: the verbs by subject.
pub(super) const SHORT: &str = "\
{about}

{usage-heading} fleet-cli VERB …

  see        list  status  why  doctor  alerts  top  watch
  drive      goto  wander  home  teleop  set-pose  param
  stop       stop  estop  reset
  tasks      dispatch  tasks  task  cancel  pause  resume  retry  extend
  floor      map  place
  record     record  play  export  audit  events  report  fetch-log
  serve      router  traffic  dashboard  vda5050
  identify   pki  enrol
  try        sim  demo  plan
  and        schema  man  completions  help

`fleet-cli --help` says what each of them does, `fleet-cli VERB --help` how. Begin with `fleet-cli demo`.
";

/// In plainer words than clap's.
pub(super) fn clarified(error: clap::Error, command: &mut Command) -> clap::Error {
    with_tip(with_usage_of_its_verb(error, command))
}

/// clap's usage line shows what was typed, or set in the environment, as if it were asked for: the verb's own shows
/// what there is.
fn with_usage_of_its_verb(mut error: clap::Error, command: &mut Command) -> clap::Error {
    let Some(ContextValue::StyledStr(usage)) = error.get(ContextKind::Usage) else { return error };
    let usage = usage.to_string();
    // Behind "Usage:" and the program.
    let words: Vec<&str> = usage.split_whitespace().skip(2).collect();
    error.insert(ContextKind::Usage, ContextValue::StyledStr(usage_of(command, &words)));
    error
}

fn usage_of(verb: &mut Command, words: &[&str]) -> StyledStr {
    if let [word, words @ ..] = words
        && let Some(inner) = verb.find_subcommand_mut(word)
    {
        return usage_of(inner, words);
    }
    verb.render_usage()
}

/// With a tip, if `--all` would have been an answer.
fn with_tip(mut error: clap::Error) -> clap::Error {
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
    if matches!(error.kind(), Usage::DisplayHelpOnMissingArgumentOrSubcommand | Usage::MissingSubcommand) {
        return Error::new(ErrorKind::Invalid, "a verb is missing").hint(ALL);
    }
    let text = error.to_string();
    let in_one_line = |lines: &str| lines.split_whitespace().collect::<Vec<_>>().join(" ");
    let message = in_one_line(text.split("\n\n").next().unwrap_or_default());
    let message = message.strip_prefix("error: ").unwrap_or(&message);
    let tip = text.lines().find_map(|line| line.trim_start().strip_prefix("tip: "));
    Error::new(ErrorKind::Invalid, message).hint(tip.unwrap_or(ALL))
}
