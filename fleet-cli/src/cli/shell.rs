//! The grammar of what shells ask for.

use clap::{Args, ValueEnum};

/// Arguments of `completions`.
#[derive(Debug, Clone, Args)]
pub struct CompletionsArgs {
    /// For which shell.
    #[arg(value_name = "SHELL")]
    pub shell: clap_complete::Shell,
}

/// Arguments of `names`.
#[derive(Debug, Clone, Args)]
pub struct NamesArgs {
    /// Of what.
    #[arg(value_enum)]
    pub of: NamesOf,
}

/// What has names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum NamesOf {
    /// Robots that are there.
    Robots,
    /// Tasks of the dispatcher, newest first.
    Tasks,
}
