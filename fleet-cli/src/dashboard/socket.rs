//! One page's socket: what it says comes in, frames and answers go out.

use super::commands::{Answer, Command, FromPage, Order};
use super::frames::{Hello, ToPage};
use super::server::App;
use super::session::Session;
use crate::error::{Failure, Kind};
use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use xtb_protocol::{Name, Uuid};

/// A page that does not take a message within this is closed.
const SEND_WITHIN: Duration = Duration::from_secs(5);
/// Answers that wait for the page.
const ANSWERS: usize = 64;

/// What the page has said of itself: the latest counts.
#[derive(Debug, Clone, Default, PartialEq)]
struct Page {
    seen: u64,
    watch: Option<Name>,
}

/// Serves one page until it leaves.
pub(super) async fn serve(app: Arc<App>, socket: WebSocket) {
    let (sink, stream) = socket.split();
    let (page, seen) = watch::channel(Page::default());
    let (answers, queue) = mpsc::channel(ANSWERS);
    let name = format!("web-{}", &Uuid::new_v4().simple().to_string()[..6]);
    let Ok(client) = Name::new(&name) else { return };
    let writer = Writer { app: Arc::clone(&app), sink, page: seen, answers: queue };
    let mut writer = tokio::spawn(writer.run(app.hello(client)));
    tokio::select! {
        _ = &mut writer => {}
        () = read(stream, &page, &answers) => {}
    }
    writer.abort();
}

async fn read(mut stream: SplitStream<WebSocket>, page: &watch::Sender<Page>, answers: &mpsc::Sender<ToPage>) {
    while let Some(Ok(message)) = stream.next().await {
        let Message::Text(text) = message else { continue };
        match serde_json::from_str(text.as_str()) {
            Ok(FromPage::Seen(n)) => drop(page.send_modify(|page| page.seen = n)),
            Ok(FromPage::Watch(robot)) => drop(page.send_modify(|page| page.watch = robot)),
            Ok(FromPage::Do(Order { id, command })) => {
                let failure = Failure::new(Kind::Failed, format!("not yet: {command:?}"));
                if answers.try_send(ToPage::Answer(Answer::new(id, Err(failure)))).is_err() {
                    return;
                }
                if let Command::TeleopEnd {} = command {}
            }
            Ok(FromPage::Setpoint(_)) => {}
            Err(error) => tracing::debug!("from a page: {error}"),
        }
    }
}

struct Writer {
    app: Arc<App>,
    sink: SplitSink<WebSocket, Message>,
    page: watch::Receiver<Page>,
    answers: mpsc::Receiver<ToPage>,
}

impl Writer {
    async fn run(mut self, hello: Hello) -> Option<()> {
        let mut session = Session::default();
        let mut ticks = self.app.ticks();
        self.send(&ToPage::Hello(hello)).await?;
        loop {
            tokio::select! {
                biased;
                answer = self.answers.recv() => self.send(&answer?).await?,
                ticked = ticks.changed() => {
                    ticked.ok()?;
                    let page = self.page.borrow_and_update().clone();
                    session.seen(page.seen);
                    let news = {
                        let scene = self.app.scene.lock();
                        session.tick(&scene, self.app.scene.now_ms(), page.watch.as_ref())
                    };
                    for message in &news {
                        self.send(message).await?;
                    }
                }
            }
        }
    }

    async fn send(&mut self, message: &ToPage) -> Option<()> {
        let text = serde_json::to_string(message).ok()?;
        tokio::time::timeout(SEND_WITHIN, self.sink.send(Message::Text(text.into()))).await.ok()?.ok()
    }
}
