//! One page's commands: taken on, carried out beside each other, answered.
//!
//! Whatever is under way when the page leaves goes on to its end; only the wheel is let go at once.

use super::access::Visitor;
use super::app::App;
use super::commands::{Answer, Command, Order};
use super::frames::ToPage;
use super::orders::{MOST, MOST_ESTOPS, Orders, Ticket};
use super::teleop::{Hand, Said, State};
use crate::execute::{self, Point};
use crate::teleop_session::{PageSession, Steered};
use serde_json::{Value, json};
use std::sync::Arc;
use tokio::sync::{mpsc, oneshot, watch};
use xtb_client::client::Client;
use xtb_client::map_edit::MapDraft;
use xtb_client::{Error, ErrorKind, Result, Settings};
use xtb_protocol::Name;
use xtb_protocol::messages::{DispatchBody, RejectCode};

/// The page does not read its answers, or the server ends.
pub(super) struct Gone;

/// Something that has ended.
pub(super) enum Done {
    /// A command.
    Command { id: u64, name: &'static str, ticket: Ticket, result: Result<Value> },
    /// The attempt to take a wheel.
    Taken { id: u64, result: Result<PageSession> },
    /// A wheel was let go.
    LetGo { why: Option<String> },
}

/// The page's hand on a wheel.
enum Grip {
    /// On none.
    Off,
    /// On its way to one; not `wanted` any more: it is let go as soon as it is taken.
    Taking { robot: Name, wanted: bool },
    /// On one; `end` is gone once it is being let go.
    On { robot: Name, hands: watch::Sender<Option<Steered>>, end: Option<oneshot::Sender<()>> },
}

/// A wish to drive.
struct Wish {
    id: u64,
    robot: Name,
    take: bool,
}

/// See the module.
pub(super) struct CommandSession {
    app: Arc<App>,
    visitor: Visitor,
    commands: Option<Client>,
    orders: Orders,
    grip: Grip,
    /// Waits until the last wheel is let go.
    next: Option<Wish>,
    answers: mpsc::Sender<ToPage>,
    ended: mpsc::Sender<Done>,
    done: mpsc::Receiver<Done>,
}

impl CommandSession {
    /// For a page that commands as `name`.
    pub(super) fn new(app: Arc<App>, name: &Name, visitor: Visitor, answers: mpsc::Sender<ToPage>) -> Self {
        let commands = app.commands().map(|client| {
            let settings = Settings { client: name.clone(), ..client.settings().clone() };
            Client::on(&settings, client.bus().clone())
        });
        // Room for everything that can be under way: nobody who ends has to wait.
        let (ended, done) = mpsc::channel(MOST + MOST_ESTOPS + 4);
        let (orders, grip) = (Orders::default(), Grip::Off);
        Self { app, visitor, commands, orders, grip, next: None, answers, ended, done }
    }

    /// The next thing that has ended.
    pub(super) async fn next(&mut self) -> Done {
        match self.done.recv().await {
            Some(done) => done,
            // A sender lives in here.
            None => std::future::pending().await,
        }
    }

    /// Takes a command on, or answers why not.
    pub(super) fn order(&mut self, order: Order) -> std::result::Result<(), Gone> {
        let Order { id, command } = order;
        let name = command.name();
        match self.begin(id, command) {
            Ok(None) => Ok(()),
            Ok(Some(value)) => self.answer(id, name, Ok(value)),
            Err(failure) => self.answer(id, name, Err(failure)),
        }
    }

    fn begin(&mut self, id: u64, command: Command) -> Result<Option<Value>> {
        let Some(client) = self.commands.clone() else {
            let message = "this dashboard accepts no commands";
            return Err(Error::new(ErrorKind::Refused(RejectCode::Unsupported), message)
                .hint("it plays a recording, or was started with --read-only"));
        };
        self.app.may(&self.visitor, command.action())?;
        if let Some(robot) = command.robot() {
            Name::robot(robot.as_str()).map_err(|error| Error::new(ErrorKind::Invalid, error.to_string()))?;
        }
        match command {
            Command::Teleop { robot, take } => self.take_wheel(Wish { id, robot, take }).map(|()| None),
            Command::TeleopEnd {} => {
                self.let_go();
                Ok(Some(json!({})))
            }
            command => {
                let driving = self.driving().cloned();
                let (ticket, halted) = self.orders.admit(&command, driving.as_ref())?;
                let stops = matches!(command, Command::Stop { .. } | Command::Estop { .. });
                let stopped = command.robot().cloned();
                if stops {
                    self.orders.halt(stopped.as_ref());
                }
                let (ended, name, driven) = (self.ended.clone(), command.name(), driving.clone());
                let known: Vec<Name> = self.app.shown.scene.lock().robots().keys().cloned().collect();
                tokio::spawn(async move {
                    let result = tokio::select! {
                        biased;
                        Ok(()) = halted => Err(overtaken()),
                        result = carry_out(&client, &known, driven.as_ref(), command) => result,
                    };
                    // The page may have left.
                    let _ = ended.send(Done::Command { id, name, ticket, result }).await;
                });
                if stops && driving.is_some_and(|robot| stopped.is_none_or(|name| name == robot)) {
                    self.let_go();
                }
                Ok(None)
            }
        }
    }

    fn driving(&self) -> Option<&Name> {
        match &self.grip {
            Grip::Off => None,
            Grip::Taking { robot, .. } | Grip::On { robot, .. } => Some(robot),
        }
    }

    fn take_wheel(&mut self, wish: Wish) -> Result<()> {
        let is_leaving = match &self.grip {
            Grip::Off => {
                self.reach_out(wish);
                return Ok(());
            }
            Grip::Taking { wanted, .. } => !wanted,
            Grip::On { end, .. } => end.is_none(),
        };
        if is_leaving && self.next.is_none() {
            self.next = Some(wish);
            return Ok(());
        }
        let robot = self.driving().map_or_else(String::new, ToString::to_string);
        Err(Error::new(ErrorKind::Refused(RejectCode::Busy), format!("this page is already driving {robot}"))
            .hint("end that first"))
    }

    fn reach_out(&mut self, wish: Wish) {
        let Some(client) = self.commands.clone() else { return };
        let Wish { id, robot, take } = wish;
        self.grip = Grip::Taking { robot: robot.clone(), wanted: true };
        let (ended, busy) = (self.ended.clone(), self.app.busy());
        tokio::spawn(async move {
            let result = PageSession::take(&client, robot, take).await;
            if let Err(mpsc::error::SendError(Done::Taken { result: Ok(at_wheel), .. })) =
                ended.send(Done::Taken { id, result }).await
            {
                at_wheel.leave().await;
            }
            drop(busy);
        });
    }

    /// Lets the wheel go, now or as soon as it is taken.
    pub(super) fn let_go(&mut self) {
        match &mut self.grip {
            Grip::Off => {}
            Grip::Taking { wanted, .. } => *wanted = false,
            Grip::On { end, .. } => drop(end.take()),
        }
        if let Some(Wish { id, .. }) = self.next.take() {
            // A page that reads nothing is closed by its next answer.
            let _ = self.answer(id, "teleop", Err(overtaken()));
        }
    }

    /// A setpoint of the page, and how old the picture was that it acted on.
    pub(super) fn hand(&self, hand: Hand, picture_ms: Option<u64>) {
        if let Grip::On { hands, end: Some(_), .. } = &self.grip {
            hands.send_replace(Some((hand, picture_ms)));
        }
    }

    /// Says what has ended.
    pub(super) fn ended(&mut self, done: Done) -> std::result::Result<(), Gone> {
        match done {
            Done::Command { id, name, ticket, result } => {
                self.orders.ended(ticket);
                self.answer(id, name, result)
            }
            Done::Taken { id, result } => self.taken(id, result),
            Done::LetGo { why } => {
                let robot = self.driving().cloned();
                self.grip = Grip::Off;
                if let Some(robot) = robot {
                    self.say(ToPage::Teleop(Said { robot, state: State::Ended, why }))?;
                }
                if let Some(wish) = self.next.take() {
                    self.reach_out(wish);
                }
                Ok(())
            }
        }
    }

    fn taken(&mut self, id: u64, result: Result<PageSession>) -> std::result::Result<(), Gone> {
        let Grip::Taking { robot, wanted } = std::mem::replace(&mut self.grip, Grip::Off) else {
            return Ok(());
        };
        let at_wheel = match result {
            Ok(at_wheel) => at_wheel,
            Err(failure) => {
                self.answer(id, "teleop", Err(failure))?;
                if let Some(wish) = self.next.take() {
                    self.reach_out(wish);
                }
                return Ok(());
            }
        };
        let taken_from = at_wheel.taken_from().map(str::to_owned);
        let (hands, steered) = watch::channel(None);
        let (end, told) = oneshot::channel();
        let (ended, busy) = (self.ended.clone(), self.app.busy());
        tokio::spawn(async move {
            let why = at_wheel.drive(steered, told).await;
            let _ = ended.send(Done::LetGo { why }).await;
            drop(busy);
        });
        let end = wanted.then_some(end);
        self.grip = Grip::On { robot: robot.clone(), hands, end };
        if wanted {
            self.say(ToPage::Teleop(Said { robot: robot.clone(), state: State::Driving, why: None }))?;
        }
        self.answer(id, "teleop", Ok(json!({ "robot": robot, "taken_from": taken_from })))
    }

    fn answer(&self, id: u64, name: &'static str, result: Result<Value>) -> std::result::Result<(), Gone> {
        self.app.metrics.answered(name, result.is_ok());
        self.say(ToPage::Answer(Answer::new(id, result)))
    }

    fn say(&self, message: ToPage) -> std::result::Result<(), Gone> {
        self.answers.try_send(message).map_err(|_| Gone)
    }
}

fn overtaken() -> Error {
    Error::new(ErrorKind::Refused(RejectCode::Overtaken), "interrupted by a stop: not executed, or stopped")
}

async fn carry_out(
    client: &Client,
    known: &[Name],
    driving: Option<&Name>,
    command: Command,
) -> Result<Value> {
    match command {
        Command::Goto { robot, x_m, y_m, yaw_rad, via, take } => {
            execute::goto(client, robot, Point { x_m, y_m, yaw_rad, via }, take).await
        }
        Command::Stop { robot } => execute::stop(client, known, robot).await,
        Command::Estop { robot } => execute::estop(client, known, robot).await,
        Command::Reset { robot, take } => execute::reset(client, robot, take).await,
        Command::ResetAll { shown } => execute::reset_all(client, shown).await,
        Command::SpeedLimit { mps } => execute::speed_limit(client, mps, driving).await,
        Command::Submit { spec } => execute::submit(client, *spec).await,
        Command::SetPose { robot, x_m, y_m, yaw_rad, take } => {
            execute::set_pose(client, robot, [x_m, y_m, yaw_rad], take).await
        }
        Command::Cancel { task } => {
            execute::change(client, task, |tasks| DispatchBody::Cancel { tasks }).await
        }
        Command::Pause { task } => execute::change(client, task, |tasks| DispatchBody::Pause { tasks }).await,
        Command::Resume { task } => {
            execute::change(client, task, |tasks| DispatchBody::Resume { tasks }).await
        }
        Command::Retry { task } => execute::change(client, task, |tasks| DispatchBody::Retry { tasks }).await,
        Command::EditMap { base, zones, places, why } => {
            execute::edit_map(client, MapDraft { base, zones, places }, &why).await
        }
        Command::MapHistory {} => execute::map_history(client).await,
        Command::Activate {} => execute::activate(client).await,
        Command::Adopt {} => execute::adopt(client).await,
        Command::Acknowledge { ids } => execute::acknowledge(client, ids).await,
        Command::Events { search } => execute::events(client, search).await,
        Command::Teleop { .. } | Command::TeleopEnd {} => Ok(json!({})),
    }
}
