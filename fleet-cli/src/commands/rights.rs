//! What each verb needs, so that who may not is told before anything is sent.

use super::Verb;
use super::alerts::{AlertsArgs, AlertsVerb};
use super::dispatch::DispatchVerb;
use super::map::MapVerb;
use super::traffic::TrafficVerb;
use xtb_client::{Action, Client, Error, ErrorKind, Result, Settings};

/// What it needs of the fleet; `None` = nothing.
#[must_use]
pub fn needed(verb: &Verb) -> Option<Action> {
    match verb {
        Verb::List(_)
        | Verb::Status(_)
        | Verb::Why(_)
        | Verb::Doctor(_)
        | Verb::Top(_)
        | Verb::Watch(_)
        | Verb::Record(_)
        | Verb::Tasks(_)
        | Verb::Names(_) => Some(Action::Look),
        Verb::Goto(_)
        | Verb::Wander(_)
        | Verb::Stop(_)
        | Verb::Reset(_)
        | Verb::SetPose(_)
        | Verb::Param(_)
        | Verb::Teleop(_) => Some(Action::Drive),
        Verb::Estop(_) => Some(Action::EmergencyStop),
        Verb::FetchLog(_) => Some(Action::FetchRecordings),
        Verb::Map(args) => match &args.verb {
            MapVerb::Serve(_) => Some(Action::ServeMap),
            MapVerb::Show(args) => args.live.then_some(Action::Look),
            MapVerb::History(args) => args.file.is_none().then_some(Action::Look),
            MapVerb::Check(_) | MapVerb::Import(_) => None,
        },
        Verb::Alerts(AlertsArgs { verb: Some(AlertsVerb::Ack(_)), .. }) => Some(Action::ChangeTasks),
        Verb::Alerts(_) | Verb::Events(_) | Verb::Report(_) => Some(Action::Look),
        Verb::Place(args) if args.changes_fleets_map() => Some(Action::ChangeMap),
        Verb::Place(args) => args.needs_session().then_some(Action::Look),
        Verb::Traffic(args) => Some(match &args.verb {
            TrafficVerb::Serve(_) => Action::ServeTraffic,
            TrafficVerb::Status => Action::Look,
        }),
        Verb::Dispatch(args) => match &args.verb {
            DispatchVerb::Serve(_) => Some(Action::ServeDispatcher),
            DispatchVerb::Goto(_)
            | DispatchVerb::Route(_)
            | DispatchVerb::Patrol(_)
            | DispatchVerb::Wander(_)
            | DispatchVerb::Submit(_)
            | DispatchVerb::Activate
            | DispatchVerb::Adopt
            // The dispatcher is asked on the key of its commands.
            | DispatchVerb::Status => Some(Action::ChangeTasks),
            DispatchVerb::Compact(_) | DispatchVerb::Export(_) => None,
        },
        Verb::Home(_)
        | Verb::Task(_)
        | Verb::Cancel(_)
        | Verb::Pause(_)
        | Verb::Resume(_)
        | Verb::Retry(_)
        | Verb::Extend(_)
        | Verb::Vda5050(_) => Some(Action::ChangeTasks),
        Verb::Dashboard(_) => Some(Action::ServeDashboard),
        // Only with an identity, which they use only if asked to.
        Verb::Sim(_) | Verb::Demo(_) => Some(Action::Simulate),
        Verb::Play(_)
        | Verb::Export(_)
        | Verb::Audit(_)
        | Verb::Pki(_)
        | Verb::Enrol(_)
        | Verb::Router(_)
        | Verb::Plan(_)
        | Verb::Schema(_)
        | Verb::Man(_)
        | Verb::Completions(_) => None,
    }
}

/// What a verb needs, and what is allowed in its place to some who may not.
#[derive(Debug, Clone, Copy)]
pub struct Rights {
    needed: Option<Action>,
    instead: Option<(Action, &'static str)>,
}

impl Rights {
    /// Of this verb.
    #[must_use]
    pub fn of(verb: &Verb) -> Self {
        let instead = match verb {
            Verb::Stop(_) => Some((Action::EmergencyStop, "`fleet-cli estop` is allowed")),
            Verb::Task(_) => Some((Action::Look, "`fleet-cli tasks` shows all tasks")),
            Verb::Dashboard(_) => Some((Action::Look, "`fleet-cli top` shows the fleet in the terminal")),
            _ => None,
        };
        Self { needed: needed(verb), instead }
    }

    /// Whether this client may do what the verb needs. Asks nobody.
    ///
    /// # Errors
    /// [`NotAllowed`](xtb_client::ErrorKind::NotAllowed), with who can, and what is allowed instead.
    pub fn check(self, settings: &Settings) -> Result<()> {
        let Some(Err(error)) = self.needed.map(|action| settings.may(action)) else { return Ok(()) };
        let instead = self.instead.filter(|(action, _)| settings.may(*action).is_ok());
        let hint =
            instead.map_or_else(|| error.hint.clone(), |(_, allowed)| format!("{allowed}; {}", error.hint));
        Err(error.hint(hint))
    }
}

/// The reason why nobody has answered, if it is that the router does not admit this client: asked on a session of its
/// own, since that of the verb has ended with it.
pub(super) async fn explained(settings: &Settings, error: Error) -> Error {
    let unanswered = matches!(
        error.kind,
        ErrorKind::NoRobot | ErrorKind::NoDispatcher | ErrorKind::NoMap | ErrorKind::OutcomeUnknown
    );
    if settings.identity.is_none() || !unanswered {
        return error;
    }
    match Client::open(settings).await {
        Ok(client) => {
            let error = client.explained(error).await;
            client.close().await;
            error
        }
        Err(_) => error,
    }
}
