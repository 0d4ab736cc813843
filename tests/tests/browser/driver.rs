//! A headless Chromium under chromedriver, and the dashboard that it shows: for the tests, the screens
//! and the measurements of the page.

#![allow(dead_code)] // each of them uses a part

use fantoccini::actions::{InputSource, MouseActions, PointerAction};
use fantoccini::wd::Capabilities;
use fantoccini::{Client, ClientBuilder};
use fleet_tests::eventually;
use fleet_tests::processes::{self, Process, program};
use hyper_util::client::legacy::connect::HttpConnector;
use rustix::process::{Pid, Signal, kill_process_group};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

const CHROMIUM: &str = "/usr/bin/chromium";
const CHROMEDRIVER: &str = "/usr/bin/chromedriver";
const ARGUMENTS: [&str; 9] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1440,1000",
];

/// Whether there is a browser here; if not, says so.
pub(crate) fn is_there() -> bool {
    let missing = [CHROMIUM, CHROMEDRIVER].into_iter().find(|path| !Path::new(path).exists());
    if let Some(path) = missing {
        say(&format!("SKIP: no {path}; `apt-get install chromium chromium-driver` brings it"));
    }
    missing.is_none()
}

/// Says something to whoever runs this.
pub(crate) fn say(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// `fleet-cli dashboard` for a fleet.
pub(crate) struct Dashboard {
    process: Process,
    /// Where it is, such as `127.0.0.1:40001`.
    pub(crate) address: String,
}

impl Dashboard {
    /// Starts it on a free port.
    pub(crate) fn start(router: &str) -> Self {
        let mut command = Command::new(program("fleet-cli"));
        command.args(["--json", "--connect", router, "dashboard", "--listen", "127.0.0.1:0"]);
        let (process, line) = Process::start_ready(&mut command);
        let address = line.split("http://").nth(1).and_then(|rest| rest.split(['/', '"']).next());
        let address = address.unwrap_or_else(|| panic!("the dashboard says {line:?}")).to_owned();
        Self { process, address }
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}/", self.address)
    }

    /// Freezes the server, or wakes it.
    pub(crate) fn freeze(&self, is_frozen: bool) {
        self.process.signal(if is_frozen { processes::Signal::Stop } else { processes::Signal::Continue });
    }
}

/// Chromedriver and its browsers: a process group that ends with this.
struct Group(Child);

impl Group {
    /// Starts it on a free port; `None` = somebody else was faster there.
    fn start(home: &Path) -> Option<(Self, SocketAddr)> {
        let mut command = Command::new(CHROMEDRIVER);
        command.arg("--port=0").process_group(0).env("HOME", home);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let group = Self(child);
        // ChromeDriver was started successfully on port 40001.
        let port = lines.map_while(Result::ok).find_map(|line| {
            line.split("successfully on port ").nth(1)?.trim_end_matches('.').parse::<u16>().ok()
        });
        Some((group, SocketAddr::from(([127, 0, 0, 1], port?))))
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        let _ = kill_process_group(Pid::from_child(&self.0), Signal::KILL);
        let _ = self.0.wait();
    }
}

/// A browser.
pub(crate) struct Browser {
    /// Its window.
    pub(crate) page: Client,
    driver: SocketAddr,
    session: String,
    group: Group,
    _profile: TempDir,
}

impl Browser {
    /// Starts one with an empty profile.
    pub(crate) async fn start() -> Self {
        let profile = tempfile::tempdir().unwrap();
        let (group, driver) = eventually("a chromedriver", || async { Group::start(profile.path()) }).await;
        let mut arguments = ARGUMENTS.map(str::to_owned).to_vec();
        arguments.push(format!("--user-data-dir={}", profile.path().join("profile").display()));
        let wanted: Capabilities = serde_json::from_value(json!({
            "acceptInsecureCerts": true,
            "goog:chromeOptions": { "binary": CHROMIUM, "args": arguments },
            "goog:loggingPrefs": { "browser": "ALL" },
        }))
        .unwrap();
        let mut builder = ClientBuilder::new(HttpConnector::new());
        let page = builder.capabilities(wanted).connect(&format!("http://{driver}")).await.unwrap();
        let session = page.session_id().await.unwrap().unwrap();
        Self { page, driver, session, group, _profile: profile }
    }

    /// Opens the dashboard and waits until it shows this many robots that are heard.
    pub(crate) async fn open(&self, url: &str, robots: usize) {
        self.page.goto(url).await.unwrap();
        eventually("the robots on the page", || async {
            let fresh = "return [...store.robots.values()].filter((robot) => !robot.stale).length";
            (self.ask(fresh).await == robots as u64).then_some(())
        })
        .await;
    }

    /// What a script of the page's says, or what it threw; `store`, `view`, `aim`, `editor` and `pace` are the page's own.
    pub(crate) async fn ask(&self, script: &str) -> Value {
        let script = format!(
            "const tell = arguments[arguments.length - 1];
             import('/assets/main.js').then(({{store, view, aim, editor, pace}}) => tell((() => {{ {script} }})()))
                 .catch((error) => tell(`threw ${{error}}`));"
        );
        self.page.execute_async(&script, Vec::new()).await.unwrap()
    }

    /// Waits until a script says true.
    pub(crate) async fn until(&self, what: &str, script: &str) {
        eventually(what, || async { (self.ask(script).await == true).then_some(()) }).await;
    }

    /// Where a point of the floor is in the window, in px.
    pub(crate) async fn on_screen(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let script = format!(
            "const box = document.getElementById('floor').getBoundingClientRect();
             const [x, y] = view.toScreen({x_m}, {y_m});
             return [box.left + x, box.top + y];"
        );
        let at = self.ask(&script).await;
        (at[0].as_f64().unwrap(), at[1].as_f64().unwrap())
    }

    /// Presses and lets go with the mouse.
    pub(crate) async fn click_at(&self, (x, y): (f64, f64)) {
        let button = fantoccini::actions::MOUSE_BUTTON_LEFT;
        let click = MouseActions::new("mouse".into())
            .then(PointerAction::MoveTo { duration: None, x: x.round(), y: y.round() })
            .then(PointerAction::Down { button })
            .then(PointerAction::Up { button });
        self.page.perform_actions(click).await.unwrap();
    }

    /// Presses at one point and lets go at another.
    pub(crate) async fn drag(&self, from: (f64, f64), to: (f64, f64)) {
        let button = fantoccini::actions::MOUSE_BUTTON_LEFT;
        let at = |(x, y): (f64, f64)| PointerAction::MoveTo { duration: None, x: x.round(), y: y.round() };
        let middle = ((from.0 + to.0) / 2.0, (from.1 + to.1) / 2.0);
        let drag = MouseActions::new("mouse".into())
            .then(at(from))
            .then(PointerAction::Down { button })
            .then(at(middle))
            .then(at(to))
            .then(PointerAction::Up { button });
        self.page.perform_actions(drag).await.unwrap();
    }

    /// Puts a text into a field, as if typed and left.
    pub(crate) async fn fill(&self, css: &str, text: &str) {
        let script = format!(
            "const field = document.querySelector({css:?});
             if (!field) return false;
             field.value = {text:?};
             for (const kind of ['input', 'change']) field.dispatchEvent(new Event(kind, {{bubbles: true}}));
             return true;"
        );
        self.until(&format!("a field {css}"), &script).await;
    }

    /// Clicks what a CSS selector names, once it is there and nothing lies over it.
    pub(crate) async fn click(&self, css: &str) {
        eventually(&format!("a click on {css}"), || async {
            let element = self.page.find(fantoccini::Locator::Css(css)).await.ok()?;
            element.click().await.ok()
        })
        .await;
    }

    /// Errors and warnings on the page's console so far, its policy's refusals among them.
    pub(crate) async fn complaints(&self) -> Vec<String> {
        let log = self.driver("POST", "se/log", &json!({ "type": "browser" })).await;
        let entries = log.as_array().unwrap().clone();
        let bad =
            entries.into_iter().filter(|entry| entry["level"] == "SEVERE" || entry["level"] == "WARNING");
        bad.map(|entry| entry["message"].to_string()).collect()
    }

    /// A command of the Chrome DevTools protocol.
    pub(crate) async fn devtools(&self, command: &str, parameters: Value) -> Value {
        self.driver("POST", "goog/cdp/execute", &json!({ "cmd": command, "params": parameters })).await
    }

    /// Something of chromedriver's own.
    async fn driver(&self, method: &str, path: &str, body: &Value) -> Value {
        let path = format!("/session/{}/{path}", self.session);
        let answer =
            http(self.driver, method, &path, &[("Content-Type", "application/json")], &body.to_string())
                .await;
        let content = answer.split_once("\r\n\r\n").unwrap().1;
        let mut value: Value =
            serde_json::from_str(content).unwrap_or_else(|error| panic!("{error}: {answer}"));
        value["value"].take()
    }

    /// Freezes the browser with all its processes, or wakes it.
    pub(crate) fn freeze(&self, is_frozen: bool) {
        let signal = if is_frozen { Signal::STOP } else { Signal::CONT };
        kill_process_group(Pid::from_child(&self.group.0), signal).unwrap();
    }

    /// Ends it.
    pub(crate) async fn end(self) {
        let _ = self.page.close().await;
    }
}

/// One HTTP request; the whole answer, head and body.
pub(crate) async fn http(
    to: SocketAddr,
    method: &str,
    path: &str,
    headers: &[(&str, &str)],
    body: &str,
) -> String {
    let mut stream = TcpStream::connect(to).await.unwrap();
    let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let head = format!(
        "{method} {path} HTTP/1.1\r\nHost: {to}\r\nConnection: close\r\nContent-Length: {}\r\n{headers}\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    stream.write_all(body.as_bytes()).await.unwrap();
    // Not every server closes when it is asked to: it says how much there is.
    let mut answer = Vec::new();
    while !is_whole(&answer) && stream.read_buf(&mut answer).await.unwrap() > 0 {}
    String::from_utf8_lossy(&answer).into_owned()
}

fn is_whole(answer: &[u8]) -> bool {
    let text = String::from_utf8_lossy(answer).to_lowercase();
    let Some((head, _)) = text.split_once("\r\n\r\n") else { return false };
    let length =
        head.lines().find_map(|line| line.strip_prefix("content-length:")?.trim().parse::<usize>().ok());
    let begins = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n").map(|at| at + 4);
    begins.zip(length).is_some_and(|(begins, length)| answer.len() >= begins + length)
}
