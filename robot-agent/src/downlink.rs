//! Requests, questions about settings, setpoints and emergency stops from Zenoh to the [`Inbox`], and replies back.
//!
//! The callbacks run on Zenoh's threads and never wait: they decode, check and hand over.

use crate::fast_path::{Answer, Response};
use crate::inbox::Inbox;
use crate::settings_file::{self, SettingChange};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use tokio::sync::mpsc;
use xtb_bus::{Bus, BusError, Incoming, Question, Service, Subscription};
use xtb_protocol::keys::{FleetKeys, Key, Name, RobotKeys};
use xtb_protocol::messages::{
    Estop, ParamCode, ParamOutcome, ParamReply, ParamRequest, ParamValue, RejectCode, Reply, Request,
    Setpoint,
};
use xtb_protocol::wire::CodecError;
use xtb_protocol::{Uuid, codec};

/// Holds the declarations; dropping it ends them.
pub(crate) struct Downlink {
    _requests: Service,
    _params: Service,
    _setpoints: Subscription,
    _estops: [Subscription; 2],
    _estops_asked: Service,
}

/// Declares `cmd/*`, `param/*`, `teleop/*` and `estop/*`, its own and everybody's.
///
/// # Errors
/// [`BusError`].
pub(crate) async fn declare(
    bus: &Bus,
    fleet: &FleetKeys,
    robot: &Name,
    inbox: &Arc<Inbox>,
) -> Result<Downlink, BusError> {
    let keys = &fleet.robot(robot);
    let reader = || Reader { keys: keys.clone(), inbox: inbox.clone() };
    let estop = |reader: Reader| move |incoming: Incoming| reader.estop_published(&incoming);
    let own = bus.subscribe(&keys.estop(None), estop(reader())).await?;
    let all = bus.subscribe(&fleet.estop_all(None), estop(reader())).await?;
    let of_estops = reader();
    let asked = bus.serve(&keys.estop(None), move |question| of_estops.estop_asked(question)).await?;
    let of_requests = reader();
    let requests = bus.serve(&keys.cmd(None), move |question| of_requests.request(question)).await?;
    let of_params = reader();
    let params = bus.serve(&keys.param(None), move |question| of_params.param(question)).await?;
    let of_setpoints = reader();
    let setpoints =
        bus.subscribe(&keys.teleop(None), move |incoming| of_setpoints.setpoint(&incoming)).await?;
    Ok(Downlink {
        _requests: requests,
        _params: params,
        _setpoints: setpoints,
        _estops: [own, all],
        _estops_asked: asked,
    })
}

/// Who put this. The bus lets only keys in that name their client.
fn client_of(incoming: &Incoming) -> Option<Name> {
    Key::parse(&incoming.key)?.channel.client().cloned()
}

/// Reads what comes in, and hands it over.
struct Reader {
    keys: RobotKeys,
    inbox: Arc<Inbox>,
}

impl Reader {
    fn setpoint(&self, incoming: &Incoming) {
        let Some(client) = client_of(incoming) else { return };
        match incoming.decode::<Setpoint>() {
            Ok(setpoint) => self.inbox.setpoint(client, setpoint),
            Err(error) => self.inbox.counters.rejected(&error),
        }
    }

    fn estop_published(&self, incoming: &Incoming) {
        if let Some(by) = client_of(incoming) {
            self.estop(by, incoming.decode::<Estop>(), None);
        }
    }

    fn estop_asked(&self, question: Question) {
        let Some(by) = question.client().cloned() else { return };
        let decoded = question.decode::<Estop>();
        let format =
            decoded.as_ref().map_or_else(|_| question.likely_format::<Estop>(), |(_, format)| *format);
        let key = self.keys.estop(Some(&by));
        let answer = Answer::Asked { question: Box::new(question), key, format };
        self.estop(by, decoded.map(|(estop, _)| estop), Some(answer));
    }

    /// One that cannot be read is counted, and stops the robot all the same.
    fn estop(&self, by: Name, read: Result<Estop, CodecError>, answer: Option<Answer>) {
        let id = match read {
            Ok(estop) => estop.id,
            Err(error) => {
                self.inbox.counters.rejected(&error);
                Uuid::new_v4()
            }
        };
        self.inbox.estop(by, id, answer);
    }

    fn request(&self, question: Question) {
        let Some(client) = question.client().cloned() else { return };
        let key = self.keys.cmd(Some(&client));
        match question.decode::<Request>() {
            Ok((request, format)) => {
                self.inbox.request(
                    client,
                    request,
                    Answer::Asked { question: Box::new(question), key, format },
                );
            }
            Err(error) => {
                self.inbox.counters.rejected(&error);
                let format = question.likely_format::<Request>();
                self.inbox
                    .reply(Answer::Asked { question: Box::new(question), key, format }, refusal(&error));
            }
        }
    }
}

impl Reader {
    fn param(&self, question: Question) {
        let Some(client) = question.client().cloned() else { return };
        let key = self.keys.param(Some(&client));
        match question.decode::<ParamRequest>() {
            Ok((request, format)) => {
                let answer = Answer::Asked { question: Box::new(question), key, format };
                self.inbox.param(client, request, answer);
            }
            Err(error) => {
                self.inbox.counters.rejected(&error);
                let format = question.likely_format::<ParamRequest>();
                let hint = "docs/protocol.md has the messages";
                let reply = ParamReply::refused(Uuid::nil(), ParamCode::Malformed, error.to_string(), hint);
                let answer = Answer::Asked { question: Box::new(question), key, format };
                self.inbox.reply_param(answer, reply);
            }
        }
    }
}

fn refusal(error: &CodecError) -> Reply {
    let hint = match error.code() {
        RejectCode::Malformed => {
            let (postcard, json) = (
                codec::encoding::<Request>(codec::Format::Postcard),
                codec::encoding::<Request>(codec::Format::Json),
            );
            format!("send {json} or {postcard}, see docs/protocol.md")
        }
        RejectCode::WrongVersion => "update the older of the two programs: docs/upgrade.md".to_owned(),
        RejectCode::Oversized => "no message for a robot is that long".to_owned(),
        _ => "`about` lists the limits".to_owned(),
    };
    Reply::refused(Uuid::nil(), error.code(), error.to_string(), hint)
}

/// Where settings are saved, and who has to know of it.
#[derive(Clone)]
pub(crate) struct Saving {
    /// The robot's settings file; `None` = it was started without one.
    pub(crate) file: Option<PathBuf>,
    /// To the control loop.
    pub(crate) saved: SyncSender<Vec<ParamValue>>,
    /// Who writes the file.
    pub(crate) turn: Arc<tokio::sync::Mutex<()>>,
}

impl Saving {
    /// Writes these, and answers what has come of it.
    async fn save(&self, reply: ParamReply, values: Vec<ParamValue>) -> ParamReply {
        let Some(file) = self.file.clone() else {
            let hint = "start robot-agent with --config FILE to have settings saved there";
            let message = "this robot was started without a settings file";
            return ParamReply::refused(reply.id, ParamCode::NoFile, message, hint);
        };
        let changes: Vec<SettingChange> =
            values.iter().map(|value| SettingChange::new(&value.name, value.value)).collect();
        // One after the other: each reads the file, changes it and writes it.
        let _turn = self.turn.lock().await;
        let written = tokio::task::spawn_blocking(move || settings_file::write(&file, &changes)).await;
        let failed = match written {
            Ok(Ok(())) => {
                let ParamOutcome::Ok(mut list) = reply.result else { return reply };
                list.params.iter_mut().for_each(|param| param.saved = param.value);
                let _ = self.saved.try_send(values);
                return ParamReply { result: ParamOutcome::Ok(list), ..reply };
            }
            Ok(Err(error)) => error.to_string(),
            Err(error) => error.to_string(),
        };
        let hint = "nothing was written; the settings in force stay as they are";
        ParamReply::refused(reply.id, ParamCode::SaveFailed, failed, hint)
    }
}

/// Sends replies until the loop's end is gone.
pub(crate) async fn send_replies(mut replies: mpsc::Receiver<(Answer, Response)>, saving: Saving) {
    while let Some((answer, response)) = replies.recv().await {
        let (question, key, format) = match answer {
            Answer::Asked { question, key, format } => (question, key, format),
            Answer::Inside(waiting) => {
                drop(waiting.send(response)); // It may have given up.
                continue;
            }
        };
        let sent = match response {
            Response::Reply(reply) => question.reply(&key, &reply, format).await,
            Response::Estopped(estopped) => question.reply(&key, &estopped, format).await,
            Response::Param(reply) => question.reply(&key, &reply, format).await,
            Response::Save(reply, values) => {
                // No other answer waits for the disk.
                let saving = saving.clone();
                tokio::spawn(async move {
                    let reply = saving.save(reply, values).await;
                    if let Err(error) = question.reply(&key, &reply, format).await {
                        tracing::debug!("cannot send a reply: {error}");
                    }
                });
                continue;
            }
        };
        if let Err(error) = sent {
            tracing::debug!("cannot send a reply: {error}");
        }
    }
}
