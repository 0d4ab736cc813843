//! `names`: robots, tasks, places, tags or fleets that there are, one a line, for completion scripts.

use crate::context::Context;
use crate::exit::Exit;
use clap::{Args, ValueEnum};
use std::collections::BTreeSet;
use std::time::Duration;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::DispatcherClient;
use xtb_client::fleet_view::by_number;
use xtb_client::{Result, map_source};
use xtb_protocol::Name;
use xtb_protocol::keys::{self, Key};

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
    /// The same, and tags of the roster as they stand for robots: @red.
    Whom,
    /// Tasks of the dispatcher, newest first.
    Tasks,
    /// Places of the fleet's map.
    Places,
    /// Tags of robots and of places.
    Tags,
    /// Fleets with robots that are present.
    Fleets,
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

async fn robots(client: &Client) -> Result<Vec<String>> {
    let mut robots: Vec<Name> = client.alive().await?.into_iter().collect();
    robots.sort_by_cached_key(by_number);
    Ok(robots.iter().map(ToString::to_string).collect())
}

async fn names(ctx: &Context, of: NamesOf) -> Result<Vec<String>> {
    let client = Client::open(&ctx.settings).await?;
    match of {
        NamesOf::Robots => robots(&client).await,
        NamesOf::Whom => {
            let (robots, roster) = tokio::join!(robots(&client), client.roster_entries(&[]));
            let tags = roster?.into_iter().flatten().flat_map(|entry| entry.tags);
            let tags: BTreeSet<String> =
                tags.map(|tag| format!("@{}", tag.trim_start_matches('@'))).collect();
            Ok(robots?.into_iter().chain(tags).collect())
        }
        NamesOf::Places => {
            let places = map_source::places(client.bus(), client.keys(), WITHIN).await?;
            Ok(places.iter().flatten().map(|place| place.name.to_string()).collect())
        }
        NamesOf::Tags => {
            let (roster, places) = tokio::join!(
                client.roster_entries(&[]),
                map_source::places(client.bus(), client.keys(), WITHIN)
            );
            let of_robots = roster?.into_iter().flatten().flat_map(|entry| entry.tags);
            let of_places = places.into_iter().flatten().flatten().flat_map(|place| place.tags);
            let tags: BTreeSet<String> = of_robots.chain(of_places.map(|tag| tag.to_string())).collect();
            Ok(tags.into_iter().collect())
        }
        NamesOf::Fleets => {
            let keys = client.bus().alive(keys::any::ALIVE, WITHIN).await?;
            let fleets: BTreeSet<String> =
                keys.iter().filter_map(|key| Some(Key::parse(key)?.fleet.to_string())).collect();
            Ok(fleets.into_iter().collect())
        }
        NamesOf::Tasks => {
            let list = DispatcherClient::of(&client).list().await?;
            // The newest are meant more often.
            Ok(list.tasks.iter().rev().map(|task| task.id.to_string()).collect())
        }
    }
}
