//! Clients that are slow on purpose shut nobody out.

use super::page::{Page, request};
use super::stalled::dashboard;
use fleet_tests::{Fleet, Setup};
use std::net::SocketAddr;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::task::JoinSet;

/// More than there are places for.
const CROWD: usize = 140;
/// Long enough for a request that is answered at all.
const ANSWERED: Duration = Duration::from_secs(4);

/// A client that sends a request byte by byte, five seconds each, and comes again when it is thrown out.
async fn trickle(address: SocketAddr, thrown_out: tokio::sync::mpsc::Sender<()>) {
    loop {
        let Ok(mut stream) = TcpStream::connect(address).await else { continue };
        let sending = async {
            for byte in b"GET / HTTP/1.1\r\nX-Slow: ".iter().chain(std::iter::repeat(&b'x')) {
                if stream.write_all(&[*byte]).await.is_err() {
                    return;
                }
                let mut answer = [0; 64];
                let heard = tokio::time::timeout(Duration::from_secs(5), stream.read(&mut answer));
                // Closed; silence is as it should be.
                if matches!(heard.await, Ok(Ok(0) | Err(_))) {
                    return;
                }
            }
        };
        sending.await;
        let _ = thrown_out.try_send(());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_crowd_that_sends_a_byte_each_5_s_shuts_nobody_out() {
    let fleet = Fleet::start(Setup::default()).await;
    let (_process, address) = dashboard(&fleet);
    let (thrown_out, mut thrown) = tokio::sync::mpsc::channel(CROWD);
    let mut crowd = JoinSet::new();
    for _ in 0..CROWD {
        crowd.spawn(trickle(address, thrown_out.clone()));
    }
    // The crowd is larger than there is room for: the first have to make room for the last.
    let made_room = tokio::time::timeout(3 * ANSWERED, thrown.recv()).await;
    made_room.expect("the crowd keeps all places").unwrap();
    for _ in 0..5 {
        let asked = tokio::time::timeout(ANSWERED, request(address, "GET", "/healthz", &[])).await;
        assert_eq!(asked.expect("another client is shut out").0, 200);
    }
    let page = tokio::time::timeout(ANSWERED, Page::open(address)).await;
    let mut page = page.expect("a page is shut out");
    // All of the crowd are thrown out within their five seconds, and the page is not.
    for _ in 0..2 * CROWD {
        let next = tokio::time::timeout(3 * ANSWERED, thrown.recv()).await;
        next.expect("one of the crowd keeps its place").unwrap();
    }
    page.until("a frame", |page| page.frame.is_object().then_some(())).await;
    drop(crowd);
    fleet.end().await;
}
