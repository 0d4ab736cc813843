//! Who may use which channel, and how: the one table from which the rules follow.
//!
//! | | ingress (what it sends) | egress (what it is sent) |
//! | --- | --- | --- |
//! | `Put`, from | put | |
//! | `Put`, to | declare_subscriber | put |
//! | `Ask`, from | query | reply |
//! | `Ask`, to | declare_queryable, reply | query |
//! | `Alive`, from | liveliness_token | |
//! | `Alive`, to | liveliness_query, declare_liveliness_subscriber | liveliness_token |
//! | `AliveNow`, to | liveliness_query | liveliness_token |
//!
//! Events are put, and on the keys of their recovery put, asked and alive.

use xtb_identity::Role;
use xtb_protocol::keys::Kind;

/// How a channel is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    /// Some publish, others listen.
    Put,
    /// The same, and lost or late messages are sent again.
    Event,
    /// Some ask, others answer.
    Ask,
    /// Some are there, others see that.
    Alive,
    /// The same, seen at one moment only.
    AliveNow,
}

/// What somebody takes part in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Party {
    /// A robot, on the keys of its own name.
    Robot,
    /// A robot, on the keys of all.
    Neighbour,
    /// Who looks at the fleet.
    Look,
    /// Who may call an emergency stop, under the own name.
    Stop,
    /// Who may drive, change tasks and the map, and fetch recordings, under the own name.
    Drive,
    /// The dispatcher and its stand-by.
    Dispatcher,
    /// Traffic control.
    Traffic,
    /// Who serves the map.
    Map,
    /// Who measures where robots are.
    Fixes,
    /// A simulator.
    Simulator,
    /// Whoever has a certificate of the fleet, admitted or not.
    Anybody,
    /// The router. (Its own session is under no rule.)
    Router,
}

/// `use`, by whom, for whom.
pub(super) struct Row(pub(super) Use, pub(super) &'static [Party], pub(super) &'static [Party]);

/// What each role takes part in.
pub(super) fn parties(role: Role) -> &'static [Party] {
    use Party as P;
    match role {
        Role::Robot => &[P::Robot, P::Neighbour],
        Role::Viewer => &[P::Look, P::Stop],
        Role::Operator | Role::Dashboard => &[P::Look, P::Stop, P::Drive],
        // It includes traffic control, and serves the map if it is given one.
        Role::Dispatcher => &[P::Look, P::Dispatcher, P::Traffic, P::Map],
        Role::Traffic => &[P::Look, P::Traffic],
        Role::Map => &[P::Look, P::Map],
        Role::Tracker => &[P::Fixes],
        Role::Recorder => &[P::Look],
        // Its robots have any name.
        Role::Simulator => &[P::Robot, P::Neighbour, P::Simulator, P::Map, P::Fixes],
        Role::Router => &[P::Router],
    }
}

/// Who uses this channel, and how.
pub(super) fn rows(kind: Kind) -> &'static [Row] {
    use Party as P;
    use Use::{Alive, AliveNow, Ask, Event, Put};
    match kind {
        // A robot looks whether its name is free.
        Kind::Alive => &[Row(Alive, &[P::Robot], &[P::Look]), Row(AliveNow, &[P::Robot], &[P::Robot])],
        Kind::State => &[Row(Put, &[P::Robot], &[P::Look]), Row(Ask, &[P::Look, P::Robot], &[P::Robot])],
        Kind::StateJson | Kind::Sensors => &[Row(Put, &[P::Robot], &[P::Look])],
        Kind::Event | Kind::EventJson => &[Row(Event, &[P::Robot], &[P::Look])],
        Kind::About => &[Row(Ask, &[P::Look], &[P::Robot])],
        Kind::Fix => &[Row(Put, &[P::Fixes], &[P::Robot, P::Look])],
        Kind::Route => &[Row(Put, &[P::Traffic], &[P::Robot, P::Look])],
        Kind::Near => &[Row(Put, &[P::Robot], &[P::Neighbour, P::Look])],
        Kind::Param => &[Row(Ask, &[P::Drive], &[P::Robot])],
        Kind::Cmd => &[Row(Ask, &[P::Drive, P::Dispatcher], &[P::Robot])],
        Kind::Log => &[Row(Ask, &[P::Drive], &[P::Robot])],
        Kind::Teleop => &[Row(Put, &[P::Drive], &[P::Robot])],
        Kind::Estop => &[Row(Put, &[P::Stop], &[P::Robot]), Row(Ask, &[P::Stop], &[P::Robot])],
        Kind::TrafficAlive => &[Row(Alive, &[P::Traffic], &[P::Look])],
        Kind::TrafficState => &[Row(Put, &[P::Traffic], &[P::Look])],
        Kind::Map => {
            &[Row(Put, &[P::Map], &[P::Look, P::Robot]), Row(Ask, &[P::Look, P::Robot, P::Map], &[P::Map])]
        }
        Kind::Places => &[Row(Put, &[P::Map], &[P::Look]), Row(Ask, &[P::Look], &[P::Map])],
        Kind::MapHistory => &[Row(Ask, &[P::Look], &[P::Map])],
        Kind::MapEdit => &[Row(Ask, &[P::Drive], &[P::Map])],
        Kind::DispatchAlive => &[Row(Alive, &[P::Dispatcher], &[P::Look])],
        Kind::DispatchTasks | Kind::DispatchAlerts => {
            &[Row(Put, &[P::Dispatcher], &[P::Look]), Row(Ask, &[P::Look], &[P::Dispatcher])]
        }
        Kind::DispatchHomes => &[Row(Ask, &[P::Look], &[P::Dispatcher])],
        Kind::DispatchEvent => &[Row(Event, &[P::Dispatcher], &[P::Look])],
        Kind::DispatchHistory => &[Row(Ask, &[P::Look], &[P::Dispatcher])],
        // Simulators of one world meet each other's robots.
        Kind::SimTruth => &[Row(Put, &[P::Simulator], &[P::Look, P::Simulator])],
        Kind::SimRoster => &[Row(Ask, &[P::Look], &[P::Simulator])],
        Kind::SimStats => &[Row(Put, &[P::Simulator], &[P::Look]), Row(Ask, &[P::Look], &[P::Simulator])],
        // The dispatcher suspends itself.
        Kind::EstopAll => &[Row(Put, &[P::Stop], &[P::Robot, P::Dispatcher])],
        Kind::DispatchCmd | Kind::DispatchAck => &[Row(Ask, &[P::Drive], &[P::Dispatcher])],
        // Anybody who drives may ask how it stands; a stand-by has to be a dispatcher.
        Kind::DispatchStandby => &[Row(Ask, &[P::Drive, P::Dispatcher], &[P::Dispatcher])],
        Kind::Identity => &[Row(Ask, &[P::Anybody], &[P::Router])],
    }
}
