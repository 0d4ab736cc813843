//! `names`: robots, tasks or places that there are, one a line, for completion scripts.

use crate::context::Context;
use crate::exit::Exit;
use clap::{Args, ValueEnum};
use std::time::Duration;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::DispatcherClient;
use xtb_client::{Result, map_source};

/// Arguments of `names`.
#[derive(Debug, Clone, Args)]
pub struct NamesArgs {
    /// ErrorKind of names.
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
    /// Places of the fleet's map.
    Places,
}

/// Nobody waits longer for a suggestion.
const WITHIN: Duration = Duration::from_millis(700);

/// Prints what is found in time; nothing and no error if there is nothing.
///
/// # Errors
/// Nobody reads it.
pub async fn run(ctx: &Context, args: &NamesArgs) -> Result<Exit> {
    let ctx = ctx.with(|settings| settings.timeout = WITHIN);
    let found = tokio::time::timeout(WITHIN, names(&ctx, args.of)).await;
    if let Ok(Ok(names)) = found
        && !names.is_empty()
    {
        ctx.out.text(&names.join("\n"))?;
    }
    Ok(Exit::Done)
}

async fn names(ctx: &Context, of: NamesOf) -> Result<Vec<String>> {
    let client = Client::open(&ctx.settings).await?;
    match of {
        NamesOf::Robots => Ok(client.alive().await?.iter().map(ToString::to_string).collect()),
        NamesOf::Places => {
            let places = map_source::places(client.bus(), client.keys(), WITHIN).await?;
            Ok(places.iter().map(|place| place.name.to_string()).collect())
        }
        NamesOf::Tasks => {
            let list = DispatcherClient::of(&client).list().await?;
            // The newest are meant more often.
            Ok(list.tasks.iter().rev().map(|task| task.id.to_string()).collect())
        }
    }
}
