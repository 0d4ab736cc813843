//! Measures the verbs over slow links: `cargo run --release -p fleet-tests --example slow_links`. Prints the table
//! of docs/network.md; needs `cargo build --release` first.

#![allow(clippy::print_stdout)] // a measurement's table

use fleet_tests::slow_link::LinkQuality;
use fleet_tests::slow_verbs::SlowFleet;
use std::collections::BTreeMap;
use std::time::Duration;

const ROBOTS: usize = 3;

#[tokio::main]
async fn main() {
    let delayed = |ms| LinkQuality::delayed(Duration::from_millis(ms));
    let links = [
        ("0 ms", delayed(0)),
        ("100 ms", delayed(100)),
        ("250 ms", delayed(250)),
        ("500 ms", delayed(500)),
        ("50 kbit/s", LinkQuality::throttled(50_000)),
    ];
    let mut order = Vec::new();
    let mut rows = BTreeMap::<&str, Vec<String>>::new();
    for (seed, (_, quality)) in links.iter().enumerate() {
        let fleet = SlowFleet::start(ROBOTS, *quality, 1000 + seed as u64).await;
        for ended in fleet.all().await {
            if seed == 0 {
                order.push(ended.verb);
            }
            let seconds = format!("{:.1} s", ended.took.as_secs_f64());
            let cell = match ended.code {
                Some(0) => seconds,
                code => {
                    println!("{} over {}: {:?} {}", ended.verb, links[seed].0, code, ended.said.trim());
                    format!("**{}** after {seconds}", code.map_or("none".into(), |code| code.to_string()))
                }
            };
            rows.entry(ended.verb).or_default().push(cell);
        }
    }
    println!("| verb | {} |", links.map(|(name, _)| name).join(" | "));
    println!("| --- |{}", " ---: |".repeat(links.len()));
    for verb in order {
        println!("| `{verb}` | {} |", rows[verb].join(" | "));
    }
}
