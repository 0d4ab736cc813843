//! `stop`: robots drop their goals and stand; each is asked at once and must say so itself.

use super::muster::{Gaps, Muster, Outcome, Report};
use super::unknown_robots;
use crate::cli::{StopArgs, WhoArgs};
use crate::client::Client;
use crate::context::Context;
use crate::error::{Exit, Failure, Kind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::Body;

/// Stops the robots named, or all of the roster and whoever else is there.
///
/// # Errors
/// No router, or nobody to stop.
pub async fn run(ctx: &Context, args: &StopArgs) -> Result<Exit> {
    let client = Client::open(ctx).await?;
    let calling = call(&client, &args.who);
    let robots = &args.who.robots;
    let beside = unknown_robots::reported_beside(calling, ctx, &client, robots, "told to stop");
    let ((mut report, gaps), unknown_robots) = beside.await;
    report.unknown_robots = unknown_robots;
    if report.robots.is_empty() {
        return Err(gaps.alive.unwrap_or_else(|| client.nobody()));
    }
    ctx.out.result(&report, |report| report.table("stopped", &ctx.out))?;
    gaps.warn(ctx);
    client.close().await;
    Ok(report.exit())
}

/// Asks them, and says what came of it.
pub(super) async fn call(client: &Client, who: &WhoArgs) -> (Report, Gaps) {
    let mut stops = Muster::new(client, stop);
    let gaps = if who.all {
        stops.call(who.known.iter().cloned());
        stops.call_all(&who.expect).await
    } else {
        stops.call(who.robots.iter().cloned());
        Gaps::default()
    };
    (Report::new(stops.outcomes().await, &gaps), gaps)
}

async fn stop(client: Client, robot: Name) -> Outcome {
    match client.request(&robot, Body::Stop {}).await {
        Ok(_) => Outcome::Stopped,
        Err(Failure { kind: Kind::Refused(_), .. }) => Outcome::Refused,
        Err(failure) => {
            tracing::debug!("stopping {robot}: {failure}");
            Outcome::Unknown
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use std::time::Duration;
    use tokio::sync::mpsc;
    use xtb_bus::{Question, Service};
    use xtb_protocol::codec::Format;
    use xtb_protocol::messages::{Done, Reply, Request, Roster};

    /// Passes the questions on `key_expr` on.
    async fn questions(client: &Client, key_expr: &str) -> (Service, mpsc::UnboundedReceiver<Question>) {
        let (sender, receiver) = mpsc::unbounded_channel();
        let each = move |question| sender.send(question).unwrap_or_default();
        (client.bus().serve(key_expr, each).await.unwrap(), receiver)
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_robot_that_is_there_is_stopped_before_the_roster_is_known() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = Name::new("xtb-1").unwrap();
        let keys = client.keys().robot(&robot);
        let (_commands, mut commands) = questions(&client, &keys.cmd(None)).await;
        let roster_key = client.keys().sim_roster();
        let (_rosters, mut rosters) = questions(&client, &roster_key).await;
        let _token = client.bus().declare_alive(&keys.alive()).await.unwrap();
        let own_key = keys.cmd(Some(client.name()));
        let world = tokio::spawn(async move {
            let stop = commands.recv().await.unwrap();
            let (request, format) = stop.decode::<Request>().unwrap();
            stop.reply(&own_key, &Reply::done(request.id, Done::default()), format).await.unwrap();
            drop(stop);
            // The roster comes only now.
            let question = rosters.recv().await.unwrap();
            question.reply(&roster_key, &Roster { robots: Vec::new() }, Format::Json).await.unwrap();
        });
        let mut stops = Muster::new(&client, stop);
        let gaps = stops.call_all(&[]).await;
        assert!(gaps.none(), "{gaps:?}");
        assert_eq!(stops.outcomes().await, BTreeMap::from([(robot, Outcome::Stopped)]));
        world.await.unwrap();
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_roster_that_does_not_answer_leaves_a_gap_and_stops_nobody_less() {
        let client = Client::alone(Duration::from_millis(300)).await;
        let robot = Name::new("xtb-1").unwrap();
        let keys = client.keys().robot(&robot);
        let (_rosters, _unanswered) = questions(&client, &client.keys().sim_roster()).await;
        let _token = client.bus().declare_alive(&keys.alive()).await.unwrap();
        let mut stops = Muster::new(&client, stop);
        let gaps = stops.call_all(&[]).await;
        assert!(gaps.no_roster && gaps.alive.is_none(), "{gaps:?}");
        assert!(stops.outcomes().await.contains_key(&robot));
    }
}
