//! Signing in and out: a token becomes a cookie. The guard has seen to origin and host before.

use super::access::Visitor;
use super::app::App;
use super::assets::{self, SIGN_IN};
use super::hello::Who;
use super::listener::Peer;
use super::people::NotTaken;
use super::security::{Refusal, persons_cookie};
use axum::extract::{DefaultBodyLimit, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Extension, Json, Router};
use serde::Deserialize;
use serde_json::json;
use std::sync::Arc;
use std::time::Instant;

/// Longest request, in bytes.
const MAX_BODY: usize = 1024;

/// What a person shows.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Token {
    token: String,
}

/// Its routes.
pub(super) fn routes() -> Router<Arc<App>> {
    Router::new()
        .route(SIGN_IN, get(page).post(sign_in))
        .route("/sign-out", post(sign_out))
        .route("/who", get(who))
        .layer(DefaultBodyLimit::max(MAX_BODY))
}

/// To whom nobody knows, instead of the page.
pub(super) fn lead() -> Response {
    (StatusCode::SEE_OTHER, [(header::LOCATION, SIGN_IN)]).into_response()
}

async fn page(State(app): State<Arc<App>>, headers: HeaderMap) -> Response {
    let page = app.guard.people().and_then(|_| assets::answer(SIGN_IN, &headers));
    page.unwrap_or_else(|| (StatusCode::NOT_FOUND, "page not found\n").into_response())
}

async fn sign_in(
    State(app): State<Arc<App>>,
    Extension(Peer { from, .. }): Extension<Peer>,
    Json(Token { token }): Json<Token>,
) -> Response {
    let Some(people) = app.guard.people() else { return StatusCode::NOT_FOUND.into_response() };
    let now = Instant::now();
    let refused = |refusal: Refusal, status, text: &str| {
        app.metrics.refused(refusal.name());
        tracing::warn!("somebody at {from} was not let in: {text}");
        (status, Json(json!({ "error": text }))).into_response()
    };
    let person = match people.by_token(token.trim(), from, now) {
        Ok(person) => person,
        Err(NotTaken::Wrong) => {
            return refused(Refusal::SignIn, StatusCode::UNAUTHORIZED, "this token is not valid");
        }
        Err(NotTaken::TooMany) => {
            let text = "too many wrong tokens from this address; wait a minute";
            return refused(Refusal::Guesses, StatusCode::TOO_MANY_REQUESTS, text);
        }
    };
    let Some(cookie) = people.sign_in(&person, now) else {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    };
    tracing::info!("{} ({}) signed in from {from}", person.name, person.role);
    ([(header::SET_COOKIE, persons_cookie(Some(&cookie)))], Json(Who::from(&person))).into_response()
}

async fn sign_out(State(app): State<Arc<App>>, Extension(visitor): Extension<Visitor>) -> Response {
    if let Some((people, person)) = app.guard.people().zip(visitor.person()) {
        people.sign_out(person);
        tracing::info!("{} signed out", person.name);
    }
    ([(header::SET_COOKIE, persons_cookie(None))], StatusCode::NO_CONTENT).into_response()
}

/// Whom the browser stands for: the page asks when its socket was closed.
async fn who(Extension(visitor): Extension<Visitor>) -> Response {
    Json(json!({ "who": visitor.person().map(Who::from) })).into_response()
}
