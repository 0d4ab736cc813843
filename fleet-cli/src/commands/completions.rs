//! `completions`: scripts for shells.

use crate::cli::{Cli, CompletionsArgs};
use crate::error::{Exit, Result};
use crate::output::Output;
use clap::CommandFactory;
use clap_complete::Shell;

/// Robots and tasks that there are now, beside what clap knows.
const LIVE_BASH: &str = r#"
_fleet-cli_live() {
    local cur="${COMP_WORDS[COMP_CWORD]}" word kind=
    _fleet__cli "$@"
    if [[ ${COMP_WORDS[COMP_CWORD-1]} == --robot ]]; then
        kind=robots
    elif [[ $cur != -* ]]; then
        for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
            case "$word" in
                task | cancel | pause | resume | retry) kind=tasks && break ;;
                status | why | goto | wander | stop | estop | reset | teleop) kind=robots && break ;;
                dispatch) break ;;
            esac
        done
    fi
    [[ -z $kind ]] || COMPREPLY+=($(compgen -W "$(fleet-cli names "$kind" 2>/dev/null)" -- "$cur"))
}
complete -F _fleet-cli_live -o bashdefault -o default fleet-cli
"#;

const LIVE_FISH: &str = r#"
complete -c fleet-cli -f -n "__fish_seen_subcommand_from task cancel pause resume retry" -a "(fleet-cli names tasks 2>/dev/null)"
complete -c fleet-cli -f -n "__fish_seen_subcommand_from status why goto wander stop estop reset teleop; and not __fish_seen_subcommand_from dispatch" -a "(fleet-cli names robots 2>/dev/null)"
complete -c fleet-cli -n "__fish_seen_subcommand_from dispatch tasks" -l robot -x -a "(fleet-cli names robots 2>/dev/null)"
"#;

/// Prints the script; needs neither config nor router.
///
/// # Errors
/// Nobody reads it.
pub fn run(out: Output, args: &CompletionsArgs) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "fleet-cli", &mut script);
    let live = match args.shell {
        Shell::Bash => LIVE_BASH,
        Shell::Fish => LIVE_FISH,
        _ => "",
    };
    out.text(&format!("{}{live}", String::from_utf8_lossy(&script)))?;
    Ok(Exit::Done)
}
