//! The grammar of what shells ask for.

use clap::{Args, ValueEnum};

/// Arguments of `completions`.
#[derive(Debug, Clone, Args)]
pub struct CompletionsArgs {
    /// Shell.
    #[arg(value_name = "SHELL")]
    pub shell: clap_complete::Shell,
}

/// Arguments of `names`.
#[derive(Debug, Clone, Args)]
pub struct NamesArgs {
    /// Kind of names.
    #[arg(value_enum)]
    pub of: NamesOf,
}

/// What has names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum NamesOf {
    /// Robots present.
    Robots,
    /// Tasks of the dispatcher, newest first.
    Tasks,
}
