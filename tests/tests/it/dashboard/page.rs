//! A page without a browser: it answers frames, keeps the last of everything, and commands.

use fleet_tests::PATIENCE;
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::http::{HeaderName, HeaderValue};
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{WebSocketStream, client_async};

/// See the module.
pub(super) struct Page<S = TcpStream> {
    pub(super) socket: WebSocketStream<S>,
    /// The last of each kind, `teleop` and `hello` too.
    pub(super) hello: Value,
    pub(super) map: Option<Value>,
    pub(super) frame: Value,
    pub(super) frames: u64,
    pub(super) teleop: Value,
    pub(super) happenings: Vec<Value>,
    answers: Vec<Value>,
    next: u64,
    seq: u64,
}

/// Opens a socket with these headers; the refusal's status and body if it is refused.
pub(super) async fn connect(
    address: SocketAddr,
    headers: &[(&str, &str)],
) -> Result<WebSocketStream<TcpStream>, (u16, String)> {
    let stream = TcpStream::connect(address).await.unwrap();
    connect_on(stream, address, headers).await
}

/// The same over this connection.
pub(super) async fn connect_on(
    stream: TcpStream,
    address: SocketAddr,
    headers: &[(&str, &str)],
) -> Result<WebSocketStream<TcpStream>, (u16, String)> {
    upgrade(stream, &format!("ws://{address}/ws"), headers).await
}

/// The same over any stream, at this address.
pub(super) async fn upgrade<S: AsyncRead + AsyncWrite + Unpin>(
    stream: S,
    url: &str,
    headers: &[(&str, &str)],
) -> Result<WebSocketStream<S>, (u16, String)> {
    let mut request = url.into_client_request().unwrap();
    for (name, value) in headers {
        let name: HeaderName = name.parse().unwrap();
        request.headers_mut().insert(name, HeaderValue::from_str(value).unwrap());
    }
    match client_async(request, stream).await {
        Ok((socket, _)) => Ok(socket),
        Err(Error::Http(answer)) => {
            let body = answer.body().clone().unwrap_or_default();
            Err((answer.status().as_u16(), String::from_utf8_lossy(&body).into_owned()))
        }
        Err(other) => panic!("{other}"),
    }
}

/// Status, headers and body of a plain request.
pub(super) async fn request(
    address: SocketAddr,
    method: &str,
    path: &str,
    headers: &[(&str, &str)],
) -> (u16, String) {
    let mut text = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\nContent-Length: 0\r\n");
    if !headers.iter().any(|(name, _)| *name == "Host") {
        text.push_str(&format!("Host: {address}\r\n"));
    }
    headers.iter().for_each(|(name, value)| text.push_str(&format!("{name}: {value}\r\n")));
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(format!("{text}\r\n").as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).await.unwrap();
    let answer = String::from_utf8_lossy(&answer).into_owned();
    let status = answer.split(' ').nth(1).and_then(|status| status.parse().ok());
    (status.unwrap_or_else(|| panic!("{answer:?}")), answer)
}

/// A number out of `/metrics`.
pub(super) async fn metric(address: SocketAddr, name: &str) -> f64 {
    let (_, text) = request(address, "GET", "/metrics", &[]).await;
    let value = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    value.and_then(|value| value.trim().parse().ok()).unwrap_or_else(|| panic!("no {name} in {text}"))
}

impl Page {
    /// As the page at this address.
    pub(super) async fn open(address: SocketAddr) -> Self {
        let socket = connect(address, &[("origin", &format!("http://{address}"))]).await.unwrap();
        Self::on(socket)
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> Page<S> {
    /// Over this socket.
    pub(super) fn on(socket: WebSocketStream<S>) -> Self {
        Self {
            socket,
            hello: Value::Null,
            map: None,
            frame: Value::Null,
            frames: 0,
            teleop: Value::Null,
            happenings: Vec::new(),
            answers: Vec::new(),
            next: 1,
            seq: 0,
        }
    }

    /// Takes in one message; frames are answered. `None` = the socket was closed.
    pub(super) async fn take(&mut self) -> Option<()> {
        let message = tokio::time::timeout(PATIENCE, self.socket.next()).await.expect("silence");
        let Message::Text(text) = message?.ok()? else { return Some(()) };
        let Value::Object(message) = serde_json::from_str(&text).unwrap() else { panic!("{text}") };
        let (kind, value) = message.into_iter().next().unwrap();
        match kind.as_str() {
            "hello" => self.hello = value,
            "map" => self.map = Some(value),
            "frame" => {
                self.frames += 1;
                self.say(&json!({ "seen": value["n"] })).await;
                self.frame = value;
            }
            "teleop" => self.teleop = value,
            "happenings" => self.happenings.extend(value.as_array().unwrap().iter().cloned()),
            "answer" => self.answers.push(value),
            "tasks" | "places" | "map_content" => {}
            other => panic!("what is {other}?"),
        }
        Some(())
    }

    /// The robots of the last frame.
    pub(super) fn rows(&self) -> impl Iterator<Item = &Value> {
        self.frame["robots"].as_array().into_iter().flatten()
    }

    /// A robot of the last frame.
    pub(super) fn row(&self, robot: &str) -> &Value {
        self.rows().find(|row| row["name"] == robot).unwrap_or(&Value::Null)
    }

    /// Takes messages in until `look` finds something.
    pub(super) async fn until<T>(&mut self, what: &str, mut look: impl FnMut(&Self) -> Option<T>) -> T {
        let looking = async {
            loop {
                if let Some(found) = look(self) {
                    return found;
                }
                self.take().await.unwrap_or_else(|| panic!("closed while waiting for {what}"));
            }
        };
        tokio::time::timeout(PATIENCE, looking).await.unwrap_or_else(|_| panic!("waited in vain for {what}"))
    }

    /// Sends something.
    pub(super) async fn say(&mut self, message: &Value) {
        // A socket that was closed meanwhile shows when it is read.
        let _ = self.socket.send(Message::Text(message.to_string().into())).await;
    }

    /// Sends a command; its number.
    pub(super) async fn order(&mut self, command: Value) -> u64 {
        let id = self.next;
        self.next += 1;
        self.say(&json!({ "do": { "id": id, "command": command } })).await;
        id
    }

    /// The answer to a command.
    pub(super) async fn answer(&mut self, id: u64) -> Value {
        self.until("an answer", |page| page.answers.iter().find(|answer| answer["id"] == id).cloned()).await
    }

    /// Sends a command and waits for its answer.
    pub(super) async fn ask(&mut self, command: Value) -> Value {
        let id = self.order(command).await;
        self.answer(id).await
    }

    /// Sends a setpoint made by the last frame.
    pub(super) async fn steer(&mut self, throttle: f64) {
        self.steer_by(self.frame["n"].as_u64().unwrap(), throttle).await;
    }

    /// Sends a setpoint made by this frame.
    pub(super) async fn steer_by(&mut self, seen: u64, throttle: f64) {
        self.seq += 1;
        let setpoint = json!({ "seq": self.seq, "seen": seen, "throttle": throttle, "steering": 0.0 });
        self.say(&json!({ "setpoint": setpoint })).await;
    }

    /// Takes in what comes within `for_ms`.
    pub(super) async fn take_for(&mut self, for_ms: u64) {
        let taking = async { while self.take().await.is_some() {} };
        let _ = tokio::time::timeout(Duration::from_millis(for_ms), taking).await;
    }
}
