//! A page of somebody else's, open in the same browser, can neither look nor command.

use crate::driver::{self, Browser};
use crate::{beside_another, fleet_on_page};
use std::net::SocketAddr;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;

/// A server of another origin with an empty page.
async fn foreign_page() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move {
        while let Ok((mut stream, _)) = listener.accept().await {
            let _ = stream.read(&mut [0; 4096]).await;
            let page = "<!doctype html><title>foreign</title>";
            let head =
                format!("HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nContent-Length: {}\r\n", page.len());
            let _ = stream.write_all(format!("{head}Connection: close\r\n\r\n{page}").as_bytes()).await;
        }
    });
    address
}

/// What becomes of a socket to `url` that sends an emergency stop as soon as it is open.
async fn socket(browser: &Browser, url: &str) -> String {
    let script = "const [url, tell] = arguments;
        const socket = new WebSocket(url);
        socket.onopen = () => {
            socket.send(JSON.stringify({do: {id: 1, command: {estop: {robot: null}}}}));
        };
        socket.onmessage = () => tell('open');
        socket.onclose = () => tell('closed');";
    let said = browser.page.execute_async(script, vec![url.into()]).await.unwrap();
    said.as_str().unwrap().to_owned()
}

/// What becomes of a request to `url` with a command in it.
async fn post(browser: &Browser, url: &str) -> String {
    let script = "const [url, tell] = arguments;
        fetch(url, {method: 'POST', body: '{\"estop\": {\"robot\": null}}'}).then((answer) => answer.text())
            .then(() => tell('read'), () => tell('refused'));";
    let said = browser.page.execute_async(script, vec![url.into()]).await.unwrap();
    said.as_str().unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_of_a_foreign_origin_sees_nothing_and_commands_nothing() {
    if !driver::is_there() {
        return;
    }
    let _room = beside_another().await;
    let (fleet, dashboard, browser) = fleet_on_page(1, 1.0).await;
    let socket_url = format!("ws://{}/ws", dashboard.address);
    assert_eq!(socket(&browser, &socket_url).await, "open", "the page's own origin may");
    fleet.until(1, "latched by the page's own origin", |state| !state.latches.is_empty()).await;
    browser.click("[data-reset=estop]").await;
    fleet.until(1, "reset", |state| state.latches.is_empty()).await;

    browser.page.goto(&format!("http://{}/", foreign_page().await)).await.unwrap();
    assert_eq!(socket(&browser, &socket_url).await, "closed");
    for path in ["", "ws", "metrics"] {
        assert_eq!(post(&browser, &format!("{}{path}", dashboard.url())).await, "refused", "/{path}");
    }
    // Nothing of that has reached the robot: a question that it answers afterwards says so.
    assert!(fleet.state(1).await.latches.is_empty());
    browser.end().await;
    fleet.end().await;
}
