//! Pages that stall hold up neither the server, nor other pages, nor robots.

use super::page::{Page, connect_on, metric};
use fleet_tests::processes::{Process, program};
use fleet_tests::{Fleet, Setup, eventually};
use futures_util::SinkExt;
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::process::Command;
use std::time::{Duration, Instant};
use tokio::net::TcpSocket;
use tokio_tungstenite::tungstenite::Message;

pub(super) fn dashboard(fleet: &Fleet) -> (Process, SocketAddr) {
    let mut command = Command::new(program("fleet-cli"));
    command.args(["--json", "--connect", fleet.simulator.endpoint(), "dashboard", "--listen", "127.0.0.1:0"]);
    let (process, line) = Process::start_ready(&mut command);
    let ready: Value = serde_json::from_str(&line).unwrap();
    (process, ready["address"].as_str().unwrap().parse().unwrap())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_that_answers_no_frame_gets_two_and_then_the_present() {
    let fleet = Fleet::start(Setup::default()).await;
    let (_process, address) = dashboard(&fleet);
    let mut healthy = Page::open(address).await;
    let own = format!("http://{address}");
    let mut stalled = Page::on(super::page::connect(address, &[("origin", &own)]).await.unwrap());
    // Messages in the order in which they came, unanswered.
    let mut frames = Vec::new();
    let mut read = async |until: usize, healthy: &mut Page| {
        while frames.len() < until {
            healthy.take().await.unwrap();
            let next = futures_util::StreamExt::next(&mut stalled.socket);
            let Ok(Some(Ok(Message::Text(text)))) =
                tokio::time::timeout(Duration::from_millis(1), next).await
            else {
                continue;
            };
            let message: Value = serde_json::from_str(&text).unwrap();
            if message["frame"].is_object() {
                frames.push(message["frame"].clone());
            }
        }
        if until == 2 {
            let first = healthy.frame["n"].as_u64().unwrap();
            while healthy.frame["n"].as_u64().unwrap() < first + 20 {
                healthy.take().await.unwrap();
            }
            stalled.say(&json!({ "seen": 2 })).await;
        }
        frames.last().unwrap().clone()
    };
    let second = read(2, &mut healthy).await;
    assert_eq!((&second["n"], &second["skipped"]), (&json!(2), &json!(0)));
    let third = read(3, &mut healthy).await;
    assert_eq!(third["n"], json!(3));
    assert!(third["skipped"].as_u64().unwrap() >= 15, "{}", third["skipped"]);
    assert!(metric(address, "xtb_dashboard_frames_skipped_total").await >= 15.0);
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_that_reads_nothing_is_closed_and_holds_up_nobody() {
    let fleet = Fleet::start(Setup { robots: 3, speed: 1.0, ..Setup::default() }).await;
    let (process, address) = dashboard(&fleet);
    let mut healthy = Page::open(address).await;
    healthy
        .until("robots", |page| (page.rows().filter(|row| row["stale"] == false).count() == 3).then_some(()))
        .await;
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    let stream = socket.connect(address).await.unwrap();
    let mut stalled = connect_on(stream, address, &[("origin", &format!("http://{address}"))]).await.unwrap();
    // Each frame is long, and all are answered unread.
    let watch = json!({ "watch": "xtb-1" }).to_string();
    stalled.send(Message::Text(watch.into())).await.unwrap();
    let before = fleet.state(1).await;
    let (began, memory_kib, first) = (Instant::now(), process.memory_kib(), healthy.frames);
    let (mut n, mut most_kib) = (0_u64, memory_kib);
    loop {
        healthy.take().await.unwrap();
        n += 1;
        // A number that was not sent yet counts for nothing, and it may have had fewer frames than the other.
        for seen in 1..=n {
            // Once it is closed, it can be told nothing more.
            let _ = stalled.feed(Message::Text(json!({ "seen": seen }).to_string().into())).await;
        }
        let _ = stalled.flush().await;
        most_kib = most_kib.max(process.memory_kib());
        if n.is_multiple_of(20) && metric(address, "xtb_dashboard_sockets_stalled_total").await == 1.0 {
            break;
        }
        assert!(began.elapsed() < fleet_tests::PATIENCE, "it was not closed");
    }
    let after = fleet.state(1).await;
    let took_s = began.elapsed().as_secs_f64();
    let hz = (healthy.frames - first) as f64 / took_s;
    let (states, ticks_ms) = (after.seq - before.seq, after.tick_ms - before.tick_ms);
    let states_hz = states as f64 * 1000.0 / ticks_ms as f64;
    let (late, grown_kib) = (after.turns_late - before.turns_late, most_kib.saturating_sub(memory_kib));
    eprintln!(
        "closed after {took_s:.1} s; the other page had {hz:.1} frames/s, a robot {states_hz:.1} states/s and {late} \
         late turns; memory grew by {grown_kib} KiB"
    );
    assert!(hz > 10.0, "{hz} frames/s");
    assert!(states_hz > 18.0, "{states_hz} states/s");
    assert!(grown_kib < 32 * 1024, "{grown_kib} KiB");
    eventually("one page is left", || async {
        (metric(address, "xtb_dashboard_sockets").await == 1.0).then_some(())
    })
    .await;
    fleet.end().await;
}
