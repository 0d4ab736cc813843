//! What came in, read: one type over all messages on our keys, for `watch`, `record`, `play` and the
//! screens.

use crate::listen::Item;
use serde::Serialize;
use thiserror::Error;
use xtb_bus::Incoming;
use xtb_protocol::codec::CodecError;
use xtb_protocol::keys::{Channel, Key};
use xtb_protocol::messages::{
    About, DispatchRequest, Estop, Event, Fix, FleetMap, LogRequest, Message, Request, RobotState, Roster,
    Route, Sensors, Setpoint, TaskEvent, TaskList, TrafficState, Truth,
};

/// Why something that came in says nothing to us.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Unreadable {
    /// Somebody else's key.
    #[error("not a key of this project")]
    Foreign,
    /// Bytes on a key that stands for presence only.
    #[error("presence carries no payload")]
    Presence,
    /// Not the message that belongs on this key.
    #[error(transparent)]
    Codec(#[from] CodecError),
}

macro_rules! news {
    ($($(#[$doc:meta])* $variant:ident($message:ty),)*) => {
        /// A message on one of our keys, or presence. Serializes as the message itself.
        #[derive(Debug, Clone, PartialEq, Serialize)]
        #[serde(untagged)]
        pub enum News {
            $($(#[$doc])* $variant(Box<$message>),)*
            /// Whether the one whose presence the key stands for is there.
            Alive(bool),
        }

        impl News {
            /// The type's name, as on the wire.
            #[must_use]
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$variant(_) => <$message>::NAME,)*
                    Self::Alive(_) => "Alive",
                }
            }
        }

        $(impl From<$message> for News {
            fn from(message: $message) -> Self {
                Self::$variant(Box::new(message))
            }
        })*
    };
}

news! {
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
    /// What traffic control does.
    Traffic(TrafficState),
    /// The fleet's floor.
    Map(FleetMap),
    /// Where simulated robots really are.
    Truth(Truth),
    /// Which robots should be there.
    Roster(Roster),
    /// What a client asks of the dispatcher.
    DispatchRequest(DispatchRequest),
    /// What a client asks of a robot's recordings.
    LogRequest(LogRequest),
    /// The dispatcher's tasks.
    Tasks(TaskList),
    /// A change of a task.
    TaskEvent(TaskEvent),
}

impl News {
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
        let news = match key.channel {
            Channel::State => incoming.decode::<RobotState>()?.into(),
            Channel::Sensors => incoming.decode::<Sensors>()?.into(),
            Channel::Event => incoming.decode::<Event>()?.into(),
            Channel::About => incoming.decode::<About>()?.into(),
            Channel::Cmd(_) => incoming.decode::<Request>()?.into(),
            Channel::Teleop(_) => incoming.decode::<Setpoint>()?.into(),
            Channel::Estop(_) | Channel::EstopAll(_) => incoming.decode::<Estop>()?.into(),
            Channel::Fix => incoming.decode::<Fix>()?.into(),
            Channel::Log(_) => incoming.decode::<LogRequest>()?.into(),
            Channel::Route => incoming.decode::<Route>()?.into(),
            Channel::TrafficState => incoming.decode::<TrafficState>()?.into(),
            Channel::Map => incoming.decode::<FleetMap>()?.into(),
            Channel::SimTruth => incoming.decode::<Truth>()?.into(),
            Channel::SimRoster => incoming.decode::<Roster>()?.into(),
            Channel::DispatchCmd(_) => incoming.decode::<DispatchRequest>()?.into(),
            Channel::DispatchTasks => incoming.decode::<TaskList>()?.into(),
            Channel::DispatchEvent => incoming.decode::<TaskEvent>()?.into(),
            Channel::Alive | Channel::TrafficAlive | Channel::DispatchAlive => {
                return Err(Unreadable::Presence);
            }
        };
        Ok((key, news))
    }
}
