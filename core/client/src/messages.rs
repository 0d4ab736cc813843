//! What came in, read: one type over all messages on our keys, for `watch`, `record`, `play` and the
//! screens.

use crate::subscription::Item;
use serde::Serialize;
use thiserror::Error;
use xtb_bus::Incoming;
use xtb_protocol::keys::{Channel, Key};
use xtb_protocol::messages::{
    About, DispatchRequest, Estop, Event, Fix, FleetHomes, FleetMap, FleetPlaces, IdentityStatus, LogRequest,
    Message, NearState, ParamRequest, Request, RobotState, Roster, Route, Sensors, Setpoint, SimStats,
    StandbyRequest, TaskEvent, TaskList, TrafficState, Truth,
};
use xtb_protocol::wire::CodecError;

/// Why something that came in says nothing to us.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Unreadable {
    /// Somebody else's key.
    #[error("not a key of this project")]
    Foreign,
    /// Bytes on a key that stands for presence only.
    #[error("presence has no payload")]
    Presence,
    /// Not the message that belongs on this key.
    #[error(transparent)]
    Codec(#[from] CodecError),
}

macro_rules! any_message {
    ($($(#[$doc:meta])* $variant:ident($message:ty),)*) => {
        /// A message on one of our keys, or presence. Serializes as the message itself.
        #[derive(Debug, Clone, PartialEq, Serialize)]
        #[serde(untagged)]
        pub enum AnyMessage {
            $($(#[$doc])* $variant(Box<$message>),)*
            /// Whether the one whose presence the key stands for is there.
            Alive(bool),
        }

        impl AnyMessage {
            /// The type's name, as on the wire.
            #[must_use]
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$variant(_) => <$message>::NAME,)*
                    Self::Alive(_) => "Alive",
                }
            }
        }

        $(impl From<$message> for AnyMessage {
            fn from(message: $message) -> Self {
                Self::$variant(Box::new(message))
            }
        })*
    };
}

any_message! {
    /// Everything about a robot.
    State(RobotState),
    /// What it measures.
    Sensors(Sensors),
    /// What happened to it.
    Event(Event),
    /// Its factsheet.
    About(About),
    /// What a client asks of it.
    Request(Request),
    /// A teleoperation's setpoint.
    Setpoint(Setpoint),
    /// An emergency stop.
    Estop(Estop),
    /// A measured pose.
    Fix(Fix),
    /// Path and release from traffic control.
    Route(Route),
    /// What a robot tells those near it.
    Near(NearState),
    /// What traffic control does.
    Traffic(TrafficState),
    /// The fleet's floor.
    Map(FleetMap),
    /// Places of the fleet's floor.
    Places(FleetPlaces),
    /// Where simulated robots really are.
    Truth(Truth),
    /// Which robots should be there.
    Roster(Roster),
    /// How fast the simulator runs.
    SimStats(SimStats),
    /// What a client asks of the dispatcher.
    DispatchRequest(DispatchRequest),
    /// What a stand-by asks of the dispatcher.
    StandbyRequest(StandbyRequest),
    /// What a client asks of a robot's recordings.
    LogRequest(LogRequest),
    /// What a client asks of a robot's settings.
    ParamRequest(ParamRequest),
    /// Whether the router admits an identity.
    Identity(IdentityStatus),
    /// The dispatcher's tasks.
    Tasks(TaskList),
    /// Who is at a dock or on the way to one.
    Homes(FleetHomes),
    /// A change of a task.
    TaskEvent(TaskEvent),
}

impl AnyMessage {
    /// Reads an item: on which key, and what.
    ///
    /// # Errors
    /// Every [`Unreadable`].
    pub fn of(item: &Item) -> Result<(Key, Self), Unreadable> {
        match item {
            Item::Message(incoming) => Self::read(incoming),
            Item::Presence(key, there) => {
                Ok((Key::parse(key).ok_or(Unreadable::Foreign)?, Self::Alive(*there)))
            }
        }
    }

    /// Reads a message.
    ///
    /// # Errors
    /// Every [`Unreadable`].
    pub fn read(incoming: &Incoming) -> Result<(Key, Self), Unreadable> {
        let key = Key::parse(&incoming.key).ok_or(Unreadable::Foreign)?;
        let message = Self::on(&key.channel, incoming)?;
        Ok((key, message))
    }

    /// Reads the JSON of a message of this channel, as recordings hold it: however long, as JSON is
    /// longer than what is sent.
    ///
    /// # Errors
    /// [`Unreadable::Presence`] or [`Unreadable::Codec`].
    pub fn of_json(channel: &Channel, json: &[u8]) -> Result<Self, Unreadable> {
        Self::on(channel, &Json(json))
    }

    fn on(channel: &Channel, bytes: &impl Readable) -> Result<Self, Unreadable> {
        Ok(match channel {
            Channel::State | Channel::StateJson => bytes.read::<RobotState>()?.into(),
            Channel::Sensors => bytes.read::<Sensors>()?.into(),
            Channel::Event | Channel::EventJson => bytes.read::<Event>()?.into(),
            Channel::About => bytes.read::<About>()?.into(),
            Channel::Cmd(_) => bytes.read::<Request>()?.into(),
            Channel::Teleop(_) => bytes.read::<Setpoint>()?.into(),
            Channel::Estop(_) | Channel::EstopAll(_) => bytes.read::<Estop>()?.into(),
            Channel::Fix => bytes.read::<Fix>()?.into(),
            Channel::Log(_) => bytes.read::<LogRequest>()?.into(),
            Channel::Param(_) => bytes.read::<ParamRequest>()?.into(),
            Channel::Route => bytes.read::<Route>()?.into(),
            Channel::Near(_) => bytes.read::<NearState>()?.into(),
            Channel::TrafficState => bytes.read::<TrafficState>()?.into(),
            Channel::Map => bytes.read::<FleetMap>()?.into(),
            Channel::Places => bytes.read::<FleetPlaces>()?.into(),
            Channel::SimTruth => bytes.read::<Truth>()?.into(),
            Channel::SimRoster => bytes.read::<Roster>()?.into(),
            Channel::SimStats => bytes.read::<SimStats>()?.into(),
            Channel::DispatchCmd(_) => bytes.read::<DispatchRequest>()?.into(),
            Channel::DispatchStandby(_) => bytes.read::<StandbyRequest>()?.into(),
            Channel::Identity(_) => bytes.read::<IdentityStatus>()?.into(),
            Channel::DispatchTasks => bytes.read::<TaskList>()?.into(),
            Channel::DispatchHomes => bytes.read::<FleetHomes>()?.into(),
            Channel::DispatchEvent => bytes.read::<TaskEvent>()?.into(),
            Channel::Alive | Channel::TrafficAlive | Channel::DispatchAlive => {
                return Err(Unreadable::Presence);
            }
        })
    }
}

/// Bytes that a message can be read from.
trait Readable {
    fn read<M: Message>(&self) -> Result<M, CodecError>;
}

impl Readable for Incoming {
    fn read<M: Message>(&self) -> Result<M, CodecError> {
        self.decode()
    }
}

/// JSON of any length.
struct Json<'a>(&'a [u8]);

impl Readable for Json<'_> {
    fn read<M: Message>(&self) -> Result<M, CodecError> {
        let malformed =
            |error: serde_json::Error| CodecError::Malformed { name: M::NAME, reason: error.to_string() };
        let message: M = serde_json::from_slice(self.0).map_err(malformed)?;
        message.validate()?;
        Ok(message)
    }
}
