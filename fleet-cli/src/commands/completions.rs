//! `completions`: scripts for shells.

use crate::exit::Exit;
use crate::output::Output;
use clap::Args;
use clap_complete::Shell;
use xtb_client::Result;

/// Arguments of `completions`.
#[derive(Debug, Clone, Args)]
pub struct CompletionsArgs {
    /// Shell.
    #[arg(value_name = "SHELL")]
    pub shell: clap_complete::Shell,
}

/// Robots, tasks, places, tags and fleets that there are now, beside what clap knows.
const LIVE_BASH: &str = r#"
_fleet-cli_live() {
    local cur="${COMP_WORDS[COMP_CWORD]}" word kind= i last=$COMP_CWORD
    if [[ $2 == @* ]]; then # where bash begins a new word
        cur="$2"
        [[ $2 == @ ]] || ((last--))
        [[ ${COMP_WORDS[last-1]} != *, ]] || ((last--))
    fi
    _fleet__cli "$@"
    case "${COMP_WORDS[COMP_CWORD-1]}" in
        --robot | --expect) kind=robots ;;
        --tag) kind=tags ;;
        --fleet) kind=fleets ;;
    esac
    if [[ -z $kind && $cur != -* ]]; then
        for ((i = 1; i < last; i++)); do
            word="${COMP_WORDS[i]}"
            case "$word" in
                goto | set-pose)
                    kind=whom
                    ((i < last - 1)) || [[ ${COMP_WORDS[i-1]} == dispatch ]] && kind=places
                    break ;;
                route | patrol | remove) kind=places && break ;;
                here) ((i == last - 2)) && kind=robots; break ;;
                task | cancel | pause | resume | retry | extend) kind=tasks && break ;;
                wander | home | stop | estop | reset) kind=whom && break ;;
                status | why | teleop | top | fetch-log | param) kind=robots && break ;;
                dispatch) ;;
            esac
        done
    fi
    [[ -z $kind ]] || COMPREPLY+=($(compgen -W "$(fleet-cli names "$kind" 2>/dev/null)" -- "$cur"))
}
complete -F _fleet-cli_live -o bashdefault -o default fleet-cli
"#;

const LIVE_FISH: &str = r#"
complete -c fleet-cli -f -n "__fish_seen_subcommand_from task cancel pause resume retry extend" -a "(fleet-cli names tasks 2>/dev/null)"
complete -c fleet-cli -f -n "__fish_seen_subcommand_from goto wander home stop estop reset set-pose; and not __fish_seen_subcommand_from dispatch" -a "(fleet-cli names whom 2>/dev/null)"
complete -c fleet-cli -f -n "__fish_seen_subcommand_from status why teleop top fetch-log param" -a "(fleet-cli names robots 2>/dev/null)"
complete -c fleet-cli -f -n "__fish_seen_subcommand_from goto set-pose route patrol" -a "(fleet-cli names places 2>/dev/null)"
complete -c fleet-cli -f -n "__fish_seen_subcommand_from remove" -a "(fleet-cli names places 2>/dev/null)"
complete -c fleet-cli -f -n "__fish_seen_subcommand_from here" -a "(fleet-cli names robots 2>/dev/null)"
complete -c fleet-cli -n "__fish_seen_subcommand_from dispatch tasks" -l robot -x -a "(fleet-cli names robots 2>/dev/null)"
complete -c fleet-cli -n "__fish_seen_subcommand_from dispatch place" -l tag -x -a "(fleet-cli names tags 2>/dev/null)"
complete -c fleet-cli -l fleet -x -a "(fleet-cli names fleets 2>/dev/null)"
"#;

/// For zsh these stand in the place of clap's `_default`.
const LIVE_ZSH: &str = r#"
(( $+functions[_fleet-cli_robots] )) ||
_fleet-cli_robots() {
    local names; names=(${(f)"$(fleet-cli names robots 2>/dev/null)"})
    _describe -t robots 'robot' names
}
(( $+functions[_fleet-cli_whom] )) ||
_fleet-cli_whom() {
    local names; names=(${(f)"$(fleet-cli names whom 2>/dev/null)"})
    _describe -t robots 'robot or tag' names
}
(( $+functions[_fleet-cli_places] )) ||
_fleet-cli_places() {
    local names; names=(${(f)"$(fleet-cli names places 2>/dev/null)"})
    _describe -t places 'place' names
}
(( $+functions[_fleet-cli_tags] )) ||
_fleet-cli_tags() {
    local names; names=(${(f)"$(fleet-cli names tags 2>/dev/null)"})
    _describe -t tags 'tag' names
}
(( $+functions[_fleet-cli_fleets] )) ||
_fleet-cli_fleets() {
    local names; names=(${(f)"$(fleet-cli names fleets 2>/dev/null)"})
    _describe -t fleets 'fleet' names
}
(( $+functions[_fleet-cli_tasks] )) ||
_fleet-cli_tasks() {
    local names; names=(${(f)"$(fleet-cli names tasks 2>/dev/null)"})
    _describe -V -t tasks 'task' names
}
"#;

/// clap's script for zsh, which asks for what there is where it has arguments that are such.
fn zsh(script: &str) -> String {
    let live = |line: &str| {
        let whose = line.trim_start_matches('\'').trim_start_matches('*').trim_start_matches(':');
        let of = match whose.split([' ', '=']).next() {
            _ if line.contains("--tag=[") => "tags",
            _ if line.contains("--fleet=[") => "fleets",
            Some("robot" | "robots") if line.contains("@TAG") => "whom",
            Some("robot" | "robots" | "--robot") if line.contains(" -- ") || line.contains(":ROBOT:") => {
                "robots"
            }
            Some("point" | "points") if line.contains(" -- ") => "places",
            Some("task" | "tasks") if line.contains(" -- ") => "tasks",
            _ => return line.to_owned(),
        };
        line.replace(":_default'", &format!(":_fleet-cli_{of}'"))
    };
    let mut lines: Vec<String> = script.lines().map(live).collect();
    // The end of the script runs it, so that these have to stand before.
    let at = lines.iter().rposition(|line| line.starts_with("if [ \"$funcstack")).unwrap_or(lines.len());
    lines.insert(at, LIVE_ZSH.to_owned());
    lines.join("\n") + "\n"
}

/// clap's script for bash names its subcommands in two ways because of the hyphen in ours: they never meet.
fn bash(script: &str) -> String {
    script.replace("fleet__subcmd__cli", "fleet__cli")
}

/// Prints the script; needs neither config nor router.
///
/// # Errors
/// Nobody reads it.
pub fn run(out: Output, args: &CompletionsArgs, mut grammar: clap::Command) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut grammar, "fleet-cli", &mut script);
    let script = String::from_utf8_lossy(&script);
    out.text(&match args.shell {
        Shell::Bash => format!("{}{LIVE_BASH}", bash(&script)),
        Shell::Fish => format!("{script}{LIVE_FISH}"),
        Shell::Zsh => zsh(&script),
        _ => script.into_owned(),
    })?;
    Ok(Exit::Done)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cli;
    use clap::CommandFactory;
    use std::collections::BTreeSet;

    #[test]
    fn what_bash_calls_a_subcommand_is_what_it_looks_it_up_by() {
        let mut script = Vec::new();
        clap_complete::generate(Shell::Bash, &mut Cli::command(), "fleet-cli", &mut script);
        let script = bash(std::str::from_utf8(&script).unwrap());
        let lines = || script.lines().map(str::trim);
        let looked_up: BTreeSet<&str> = lines().filter_map(|line| line.strip_suffix(')')).collect();
        let called = lines().filter_map(|line| line.strip_prefix("cmd=\"")?.strip_suffix('"'));
        let missing: Vec<&str> =
            called.filter(|name| !name.is_empty() && !looked_up.contains(name)).collect();
        assert_eq!(missing, Vec::<&str>::new());
    }
}
