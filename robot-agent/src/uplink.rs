//! State, samples, events and the factsheet from the control loop to Zenoh.

use crate::counters::Counters;
use crate::snapshot::Snapshot;
use std::sync::Arc;
use tokio::sync::{mpsc, watch};
use xtb_bus::{Bus, BusError, Question, Service};
use xtb_protocol::board::Firmware;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, RobotKeys};
use xtb_protocol::messages::{About, BOARD_FIRMWARE, Event, ParameterInfo, RobotState, Sensors};

/// Samples go out with every second state: 10 Hz.
const STATES_A_SAMPLE: u64 = 2;
/// Answers to `state` and `about` that wait to be sent; more are dropped and asked again.
const ANSWERS: usize = 64;

/// Holds the queryables; dropping it ends them.
pub(crate) struct Uplink {
    _state: Service,
    _about: Service,
}

/// Declares the queryables on `state` and `about`.
///
/// # Errors
/// [`BusError`].
pub(crate) async fn declare(
    bus: &Bus,
    keys: &RobotKeys,
    snapshots: &watch::Receiver<Option<Snapshot>>,
    counters: &Arc<Counters>,
    about: About,
) -> Result<Uplink, BusError> {
    let (sender, mut receiver) = mpsc::channel::<(Question, What)>(ANSWERS);
    let ask = |what: What| {
        let (sender, counters) = (sender.clone(), counters.clone());
        move |question| {
            if sender.try_send((question, what)).is_err() {
                counters.overloaded();
            }
        }
    };
    let state = bus.serve(&keys.state(), ask(What::State)).await?;
    let about_service = bus.serve(&keys.about(), ask(What::About)).await?;
    let (keys, snapshots) = (keys.clone(), snapshots.clone());
    tokio::spawn(async move {
        while let Some((question, what)) = receiver.recv().await {
            let format = question.wanted_format();
            let snapshot = snapshots.borrow().clone();
            let sent = match (what, snapshot) {
                (What::State, Some(snapshot)) => question.reply(&keys.state(), &snapshot.state, format).await,
                (What::State, None) => Ok(()),
                (What::About, snapshot) => {
                    let word = snapshot.and_then(|snapshot| snapshot.sensors?.board_firmware);
                    let about = with_firmware(about.clone(), word.map(Firmware));
                    question.reply(&keys.about(), &about, format).await
                }
            };
            if let Err(error) = sent {
                tracing::debug!("cannot send an answer: {error}");
            }
        }
    });
    Ok(Uplink { _state: state, _about: about_service })
}

/// The factsheet with the firmware of the board, once that has been heard.
fn with_firmware(mut about: About, firmware: Option<Firmware>) -> About {
    if let Some(firmware) = firmware {
        about.vehicle.push(ParameterInfo {
            name: BOARD_FIRMWARE.to_owned(),
            value: firmware.to_string(),
            unit: String::new(),
            origin: "ours".to_owned(),
        });
    }
    about
}

#[derive(Clone, Copy)]
enum What {
    State,
    About,
}

/// Publishes states and samples until the control loop ends.
///
/// # Errors
/// [`BusError`] if a publisher cannot be declared; a message that cannot be sent is only logged.
pub(crate) async fn publish_states(
    bus: Bus,
    keys: RobotKeys,
    mut snapshots: watch::Receiver<Option<Snapshot>>,
) -> Result<(), BusError> {
    let state = bus.publisher::<RobotState>(&keys.state(), &Channel::State, Format::Postcard).await?;
    let json = bus.publisher::<RobotState>(&keys.state_json(), &Channel::StateJson, Format::Json).await?;
    let sensors = bus.publisher::<Sensors>(&keys.sensors(), &Channel::Sensors, Format::Postcard).await?;
    while snapshots.changed().await.is_ok() {
        let snapshot = snapshots.borrow_and_update().clone();
        let Some(Snapshot { state: now, sensors: sampled, .. }) = snapshot else { continue };
        if now.seq % STATES_A_SAMPLE == 0
            && let Some(sampled) = sampled
            && sensors.has_listeners().await
        {
            note(sensors.put(&sampled).await);
        }
        note(state.put(&now).await);
        if json.has_listeners().await {
            note(json.put(&now).await);
        }
    }
    Ok(())
}

/// Publishes events until the control loop ends. A task of its own: events wait where states are
/// dropped.
///
/// # Errors
/// [`BusError`] if the publisher cannot be declared.
pub(crate) async fn publish_events(
    bus: Bus,
    keys: RobotKeys,
    mut events: mpsc::Receiver<Event>,
) -> Result<(), BusError> {
    let publisher = bus.event_publisher::<Event>(&keys.event(), Format::Postcard).await?;
    // Also while nobody listens: who comes later gets the last ones.
    let json = bus.event_publisher::<Event>(&keys.event_json(), Format::Json).await?;
    while let Some(event) = events.recv().await {
        note(publisher.put(&event).await);
        note(json.put(&event).await);
    }
    Ok(())
}

fn note(sent: Result<(), BusError>) {
    if let Err(error) = sent {
        tracing::debug!("{error}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ConfigFile;
    use crate::session;
    use xtb_robot::RobotIdentity;

    #[test]
    fn the_factsheet_names_the_boards_firmware_once_it_has_been_heard() {
        let config = ConfigFile::default().agent().unwrap();
        let (fleet, robot, start_pose) = (config.fleet.clone(), config.robot.clone(), config.start_pose);
        let identity = RobotIdentity { fleet, robot, epoch: 1, start_pose };
        let about = session::about(&config, &identity, "serial");
        assert_eq!(with_firmware(about.clone(), None), about);
        let told = with_firmware(about.clone(), Some(Firmware(0x0101)));
        assert_eq!(told.board_firmware(), Some("1.1"));
        assert_eq!(told.vehicle_hash, about.vehicle_hash, "it is none of the vehicle's");
    }
}
