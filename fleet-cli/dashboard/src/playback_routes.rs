//! Where a recording that is played stands, and where the viewer wants it. Nothing of it reaches a robot.

use super::app::App;
use axum::extract::{DefaultBodyLimit, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use serde::Deserialize;
use std::sync::Arc;

/// Longest request, in bytes.
const MAX_BODY: usize = 256;

/// What a viewer wants.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Wish {
    Seek { position_ms: u64 },
    Pause { paused: bool },
}

/// Its routes. The guard has seen to host, origin and token before.
pub(super) fn routes() -> Router<Arc<App>> {
    Router::new().route("/playback", get(look).post(wish)).layer(DefaultBodyLimit::max(MAX_BODY))
}

async fn look(State(app): State<Arc<App>>) -> Response {
    answer(&app)
}

async fn wish(State(app): State<Arc<App>>, Json(wish): Json<Wish>) -> Response {
    if let Some(playback) = &app.shown.playback {
        match wish {
            Wish::Seek { position_ms } => playback.seek(position_ms),
            Wish::Pause { paused } => playback.pause(paused),
        }
    }
    answer(&app)
}

fn answer(app: &App) -> Response {
    match &app.shown.playback {
        Some(playback) => Json(playback.position()).into_response(),
        None => (StatusCode::NOT_FOUND, "no recording is played here\n").into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Playback, PlaybackPosition, Running, ServerSettings, Shown};
    use std::sync::Mutex;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use xtb_client::scene::Scene;
    use xtb_client::scene::live::SharedScene;
    use xtb_protocol::Name;

    struct Tape(Mutex<PlaybackPosition>);

    impl Playback for Tape {
        fn position(&self) -> PlaybackPosition {
            *self.0.lock().unwrap()
        }

        fn seek(&self, position_ms: u64) {
            self.0.lock().unwrap().position_ms = position_ms;
        }

        fn pause(&self, paused: bool) {
            self.0.lock().unwrap().paused = paused;
        }
    }

    async fn serve(playback: Option<Arc<dyn Playback>>) -> Running {
        let settings = ServerSettings {
            listen: "127.0.0.1:0".parse().unwrap(),
            secure: None,
            token: None,
            insecure: false,
            read_only: true,
            allow_origins: Vec::new(),
            proxies: Vec::new(),
            hz: 1.0,
        };
        let scene = Arc::new(SharedScene::played(Scene::new(Name::new("lab").unwrap())));
        Running::start(settings, Shown { scene, commands: None, playback }).await.unwrap()
    }

    /// Status and body.
    async fn ask(at: &Running, request: &str, origin: &str, body: &str) -> (u16, String) {
        let address = at.address();
        let mut stream = tokio::net::TcpStream::connect(address).await.unwrap();
        let head = format!(
            "{request} HTTP/1.1\r\nHost: {address}\r\nOrigin: {origin}\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\nConnection: close\r\n\r\n{body}",
            body.len()
        );
        stream.write_all(head.as_bytes()).await.unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.unwrap();
        let status = answer.split(' ').nth(1).unwrap().parse().unwrap();
        (status, answer.split_once("\r\n\r\n").unwrap().1.to_owned())
    }

    #[tokio::test]
    async fn a_viewer_sees_where_it_is_and_takes_it_elsewhere() {
        let position = PlaybackPosition {
            began_ms: 1_700_000_000_000,
            position_ms: 1500,
            duration_ms: 60_000,
            speed: 1.0,
            paused: false,
            ended: false,
        };
        let tape = Arc::new(Tape(Mutex::new(position)));
        let running = serve(Some(tape.clone())).await;
        let own = format!("http://{}", running.address());
        let (status, body) = ask(&running, "GET /playback", &own, "").await;
        let said: serde_json::Value = serde_json::from_str(&body).unwrap();
        assert_eq!((status, &said["position_ms"], &said["duration_ms"]), (200, &1500.into(), &60_000.into()));
        assert_eq!(ask(&running, "POST /playback", &own, r#"{"seek":{"position_ms":42000}}"#).await.0, 200);
        assert_eq!(ask(&running, "POST /playback", &own, r#"{"pause":{"paused":true}}"#).await.0, 200);
        assert_eq!(tape.position(), PlaybackPosition { position_ms: 42_000, paused: true, ..position });
        // Another site's page changes nothing.
        let theirs = ask(&running, "POST /playback", "http://evil.example", r#"{"seek":{"position_ms":1}}"#);
        assert_eq!(theirs.await.0, 403);
        assert_eq!(ask(&running, "POST /playback", &own, r#"{"rewind":{}}"#).await.0, 422);
        assert_eq!(tape.position().position_ms, 42_000);
        running.stop().await;
    }

    #[tokio::test]
    async fn a_live_fleet_cannot_be_played() {
        let running = serve(None).await;
        let own = format!("http://{}", running.address());
        assert_eq!(ask(&running, "GET /playback", &own, "").await.0, 404);
        assert_eq!(ask(&running, "POST /playback", &own, r#"{"pause":{"paused":true}}"#).await.0, 404);
        running.stop().await;
    }
}
