//! One page's socket: what it says comes in, frames and answers go out.
//!
//! Two tasks, so that a page that takes nothing is still heard: an emergency stop comes in while a frame
//! is stuck on its way out.

use super::access::Visitor;
use super::app::App;
use super::command_session::CommandSession;
use super::commands::FromPage;
use super::frames::ToPage;
use super::hello::Hello;
use super::session::Session;
use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use tokio::time::Instant;
use xtb_client::unique_name;

/// A page that does not take a message within this is closed.
const SEND_WITHIN: Duration = Duration::from_secs(5);
/// A page answers each frame: one that ends no message for so long is gone, however many bytes it sends.
const SILENT: Duration = Duration::from_secs(60);
/// The last word may take this long.
const CLOSE_WITHIN: Duration = Duration::from_millis(500);
/// Answers that wait for the page; one that finds no room closes it.
const ANSWERS: usize = 64;

/// Serves one page until it leaves.
pub(super) async fn serve(app: Arc<App>, socket: WebSocket, visitor: Visitor) {
    // What a person does bears its name wherever the robots say who it was.
    let stem = visitor.person().map_or("web".to_owned(), |person| format!("web-{}", person.name));
    let Ok(name) = unique_name(&stem) else { return };
    let _busy = app.busy();
    let (sink, stream) = socket.split();
    let session = Arc::<Mutex<Session>>::default();
    let (answers, queue) = mpsc::channel(ANSWERS);
    let commands = CommandSession::new(Arc::clone(&app), &name, visitor.clone(), answers);
    let writer = Writer { app: Arc::clone(&app), sink, session: Arc::clone(&session), answers: queue };
    let mut writer = tokio::spawn(writer.run(app.hello(name, &visitor)));
    tokio::select! {
        _ = &mut writer => {}
        () = read(&app, stream, &session, commands) => {}
        () = app.left(&visitor) => {}
    }
    writer.abort();
}

/// Hears the page until it is gone; the wheel is let go with its command session.
async fn read(
    app: &App,
    mut stream: SplitStream<WebSocket>,
    session: &Mutex<Session>,
    mut commands: CommandSession,
) {
    let mut heard_at = Instant::now();
    loop {
        let heard = tokio::select! {
            message = tokio::time::timeout_at(heard_at + SILENT, stream.next()) => {
                heard_at = Instant::now();
                match message {
                    Ok(Some(Ok(Message::Text(text)))) => hear(app, session, &mut commands, text.as_str()),
                    // Bytes that make no message are no word either.
                    Ok(Some(Ok(Message::Close(_)) | Err(_)) | None) | Err(_) => return,
                    Ok(Some(Ok(_))) => Ok(()),
                }
            }
            done = commands.next() => commands.ended(done),
        };
        if heard.is_err() {
            return;
        }
    }
}

fn hear(
    app: &App,
    session: &Mutex<Session>,
    commands: &mut CommandSession,
    text: &str,
) -> Result<(), super::command_session::Gone> {
    match serde_json::from_str(text) {
        Ok(FromPage::Seen(n)) => lock(session).seen(n),
        Ok(FromPage::Watch(robot)) => lock(session).watch(robot),
        Ok(FromPage::Setpoint(hand)) => {
            let picture_ms = lock(session).picture_ms(hand.seen, app.clock_ms());
            commands.hand(hand, picture_ms);
        }
        Ok(FromPage::Do(order)) => return commands.order(order),
        Err(error) => {
            app.metrics.malformed.inc();
            tracing::debug!("from a page: {error}");
        }
    }
    Ok(())
}

struct Writer {
    app: Arc<App>,
    sink: SplitSink<WebSocket, Message>,
    session: Arc<Mutex<Session>>,
    answers: mpsc::Receiver<ToPage>,
}

impl Writer {
    /// Until the page is gone, takes nothing, or the server ends.
    async fn run(mut self, hello: Hello) -> Option<()> {
        let (mut ticks, mut stop) = (self.app.ticks(), self.app.stop());
        self.send(&ToPage::Hello(hello)).await?;
        loop {
            tokio::select! {
                biased;
                _ = stopped(&mut stop) => {
                    let frame = CloseFrame { code: close_code::AWAY, reason: "dashboard stopped".into() };
                    let close = self.sink.send(Message::Close(Some(frame)));
                    return tokio::time::timeout(CLOSE_WITHIN, close).await.ok()?.ok();
                }
                answer = self.answers.recv() => self.send(&answer?).await?,
                ticked = ticks.changed() => {
                    ticked.ok()?;
                    for message in self.news() {
                        self.send(&message).await?;
                    }
                }
            }
        }
    }

    fn news(&self) -> Vec<ToPage> {
        let mut session = lock(&self.session);
        if !session.is_due() {
            self.app.metrics.skipped.inc();
            return Vec::new();
        }
        self.app.metrics.sent.inc();
        let shown = &self.app.shown;
        session.rewound(shown.scene.rewinds());
        let scene = shown.scene.lock();
        session.tick(&scene, shown.scene.now_ms(), self.app.clock_ms(), self.app.is_linked())
    }

    async fn send(&mut self, message: &ToPage) -> Option<()> {
        let text = match serde_json::to_string(message) {
            Ok(text) => text,
            Err(error) => {
                tracing::error!("a message to a page cannot be written: {error}");
                return None;
            }
        };
        match tokio::time::timeout(SEND_WITHIN, self.sink.send(Message::Text(text.into()))).await {
            Ok(sent) => sent.ok(),
            Err(_) => {
                self.app.metrics.stalled.inc();
                tracing::debug!("a page reads nothing");
                None
            }
        }
    }
}

async fn stopped(stop: &mut watch::Receiver<bool>) {
    // Who stops it by dropping it says nothing.
    let _ = stop.wait_for(|stop| *stop).await;
}

/// A panic elsewhere does not make a session unreadable.
fn lock(session: &Mutex<Session>) -> MutexGuard<'_, Session> {
    session.lock().unwrap_or_else(PoisonError::into_inner)
}
