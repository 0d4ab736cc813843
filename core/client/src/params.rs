//! Settings of robots that may change while they run: read, changed, saved.

use crate::client::Client;
use crate::control::Control;
use crate::error::{Error, ErrorKind, Result};
use std::time::{Duration, Instant};
use xtb_bus::Incoming;
use xtb_identity::Action;
use xtb_protocol::keys::Channel;
use xtb_protocol::messages::{
    Lease, Message, ParamBody, ParamCode, ParamError, ParamList, ParamOutcome, ParamReply, ParamRequest,
    ParamValue,
};
use xtb_protocol::{Name, Uuid};

/// A robot that has not answered is asked again after this.
const ASK_AGAIN: Duration = Duration::from_millis(500);

/// The settings of a robot that may change, and the last changes.
///
/// # Errors
/// [`ErrorKind::NoRobot`]: no answer; [`ErrorKind::NotAllowed`].
pub async fn list(client: &Client, robot: &Name) -> Result<ParamList> {
    ask(client, robot, None, ParamBody::List {}).await
}

/// Changes settings, all or none. Control of the robot is acquired only if the robot asks for it: it does not for what
/// makes it more careful. With `take` it is taken from its holder. The same again changes nothing.
///
/// # Errors
/// The robot's refusal ([`ErrorKind::ParamRefused`]), as [`Control::acquire`], or [`ErrorKind::OutcomeUnknown`].
pub async fn set(client: &Client, robot: &Name, values: Vec<ParamValue>, take: bool) -> Result<ParamList> {
    match set_without_control(client, robot, values.clone()).await {
        Err(Error { kind: ErrorKind::ParamRefused(ParamCode::LeaseRequired), .. }) => {
            with_control(client, robot, ParamBody::Set { values }, take).await
        }
        done => done,
    }
}

/// As [`set`] for what needs no control of the robot: what makes it more careful.
///
/// # Errors
/// The robot's refusal ([`ErrorKind::ParamRefused`]), or [`ErrorKind::OutcomeUnknown`].
pub async fn set_without_control(
    client: &Client,
    robot: &Name,
    values: Vec<ParamValue>,
) -> Result<ParamList> {
    ask(client, robot, None, ParamBody::Set { values }).await
}

/// Has the robot write what was changed into its own settings file.
///
/// # Errors
/// As [`set`].
pub async fn save(client: &Client, robot: &Name, take: bool) -> Result<ParamList> {
    with_control(client, robot, ParamBody::Save {}, take).await
}

async fn with_control(client: &Client, robot: &Name, body: ParamBody, take: bool) -> Result<ParamList> {
    let control = Control::acquire(client, robot, take).await?;
    let done = ask(client, robot, control.lease(), body).await;
    control.release().await;
    done
}

/// The setting that `name` means: all of its name, or its last part if no other one ends so.
///
/// # Errors
/// [`ErrorKind::Invalid`], with those that there are.
pub fn resolve<'a>(list: &'a ParamList, name: &str) -> Result<&'a str> {
    let full = list.params.iter().map(|param| param.name.as_str());
    let is_meant = |full: &&str| *full == name || full.rsplit('.').next() == Some(name);
    let meant: Vec<&str> = full.clone().filter(is_meant).collect();
    match meant[..] {
        [one] => Ok(one),
        _ => {
            let all = full.collect::<Vec<_>>().join(", ");
            let message = format!("{name} is no setting that may change while the robot runs");
            Err(Error::new(ErrorKind::Invalid, message).hint(format!("there are: {all}")))
        }
    }
}

async fn ask(client: &Client, robot: &Name, lease: Option<Lease>, body: ParamBody) -> Result<ParamList> {
    client.may(Action::Drive)?;
    let changes = !matches!(body, ParamBody::List {});
    let request = ParamRequest { id: Uuid::new_v4(), lease, body };
    request.validate().map_err(|error| Error::new(ErrorKind::Invalid, error.to_string()))?;
    let key = client.keys().robot(robot).param(Some(client.name()));
    let channel = Channel::Param(client.name().clone());
    let until = Instant::now() + client.patience();
    while let Some(left) = until.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
        let asked = Instant::now();
        let mut reply = None;
        let each = |answer: Incoming| match answer.decode::<ParamReply>() {
            Ok(read) => reply = Some(read),
            Err(error) => tracing::debug!("on {}: {error}", answer.key),
        };
        client.bus().ask_each(&key, &channel, &request, left, each).await?;
        match reply.map(|reply| reply.result) {
            Some(ParamOutcome::Ok(list)) => return Ok(list),
            Some(ParamOutcome::Error(error)) => return Err(refused(robot, error)),
            None => tokio::time::sleep(ASK_AGAIN.saturating_sub(asked.elapsed()).min(left)).await,
        }
    }
    let (kind, unknown) = match changes {
        true => (ErrorKind::OutcomeUnknown, ": outcome unknown"),
        false => (ErrorKind::NoRobot, ""),
    };
    let message = format!("{robot} does not answer questions about its settings{unknown}");
    let error = Error::new(kind, message)
        .hint("`fleet-cli list` shows the robots present; an older robot-agent has no such settings");
    Err(client.explained(error).await)
}

fn refused(robot: &Name, error: ParamError) -> Error {
    Error::new(ErrorKind::ParamRefused(error.code), format!("{robot} refuses: {}", error.message))
        .hint(error.hint)
}
