//! The agent's life on Zenoh: connect, make sure of the name, declare, serve, withdraw.

use crate::clock::Clock;
use crate::config::AgentConfig;
use crate::inbox::Inbox;
use crate::mailbox::SessionEnds;
use crate::neighbours::{self, Listener};
use crate::recording_server::{self, RecordingServer};
use crate::snapshot::Snapshot;
use crate::{AgentError, Host, Shutdown, VERSION, downlink, nav_inputs, ros2, uplink};
use crc::{CRC_32_ISO_HDLC, Crc};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio::time::Instant;
use xtb_bus::{Bus, BusError};
use xtb_nav::geometry::Car;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{About, Limits, MAX_COORDINATE_M, NEXT_LEG, ParameterInfo, RobotState};
use xtb_robot::RobotIdentity;

/// A name that is alive elsewhere for this long is taken. (An agent killed just before leaves its
/// token behind until its link is noticed to be lost: 2 s.)
const NAME_TAKEN_AFTER: Duration = Duration::from_secs(3);
const NAME_CHECK_EVERY: Duration = Duration::from_millis(250);
const INPUTS_WITHIN: Duration = Duration::from_secs(2);
const ASK_WITHIN: Duration = Duration::from_millis(1000);

/// The requests that it understands, and what goes beyond a request's first meaning.
const CAPABILITIES: [&str; 10] =
    ["goto", "wander", "teleop", "stop", "estop", "reset", "cancel", "set_pose", "assign", NEXT_LEG];

/// What the robot says of itself when asked.
pub(crate) fn about(config: &AgentConfig, identity: &RobotIdentity, hardware: &str) -> About {
    let vehicle = &config.vehicle;
    let parameters = vehicle.parameters();
    let text = xtb_control::config::render_toml("", &parameters);
    let hash = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(text.as_bytes());
    let info = parameters.into_iter().map(|p| ParameterInfo {
        name: p.name,
        value: p.value,
        unit: p.unit.to_owned(),
        origin: p.origin.to_string(),
    });
    About {
        robot: identity.robot.clone(),
        fleet: identity.fleet.clone(),
        version: VERSION.to_owned(),
        epoch: identity.epoch,
        hardware: hardware.to_owned(),
        start_pose: identity.start_pose,
        limits: Limits {
            max_rpm: vehicle.teleop.max_rpm,
            admitted_mps: vehicle.admitted_mps(),
            setpoint_lifetime_ms: vehicle.teleop.lifetime_ms,
            max_coordinate_m: MAX_COORDINATE_M,
        },
        capabilities: CAPABILITIES.map(str::to_owned).to_vec(),
        vehicle_hash: format!("{hash:08x}"),
        vehicle: info.chain([ParameterInfo::speaks()]).collect(),
    }
}

/// Serves the robot on Zenoh until `shutdown`; calls `stop_motors` first when that comes.
pub(crate) async fn run(
    config: &AgentConfig,
    clock: &Clock,
    ends: SessionEnds,
    about: About,
    mut shutdown: Shutdown,
    stop_motors: impl Fn(),
    host: Host,
) -> Result<(), AgentError> {
    let opening = config.opening().link_lease(host.link_lease);
    let mut told = false;
    let sessions = host.shared.sessions.clone();
    let opening = sessions.open(&opening, |error| {
        if !std::mem::replace(&mut told, true) {
            tracing::warn!("{error}; trying again, the controller keeps running");
        }
    });
    // The motors stop inside this future: `select` drops the others before it goes on.
    let mut ending = std::pin::pin!(async {
        let _ = shutdown.wait_for(|end| *end).await;
        stop_motors();
    });
    let part = tokio::select! {
        part = opening => part?,
        () = &mut ending => return Ok(()),
    };
    let bus = part.bus.clone();
    ends.counters.follow_foreign_keys(bus.foreign_keys_counter());
    let served = tokio::select! {
        // Also when it ends by an error: motors first, and nobody could stop them any more.
        served = async {
            let served = serve(config, clock, &bus, ends, about, host).await;
            stop_motors();
            served
        } => served,
        () = ending => Ok(()),
    };
    drop(bus);
    part.close().await;
    served
}

/// Declares everything, presence last, and publishes until the control loop ends.
async fn serve(
    config: &AgentConfig,
    clock: &Clock,
    bus: &Bus,
    mut ends: SessionEnds,
    about: About,
    host: Host,
) -> Result<(), AgentError> {
    let fleet = FleetKeys::new(config.fleet.clone());
    let keys = fleet.robot(&config.robot);
    let epoch = about.epoch;
    let starting = host.shared.starting.acquire().await;
    wait_for_name(config, bus, &keys.alive()).await?;
    let _uplink = uplink::declare(bus, &keys, &ends.snapshot, &ends.counters, about).await?;
    let _nav_inputs = nav_inputs::declare(bus, &fleet, config, clock, &ends, &host.shared.maps).await?;
    let inbox = Arc::new(Inbox::of(&ends, clock));
    let _downlink = downlink::declare(bus, &fleet, &config.robot, &inbox).await?;
    let _recording_server = recording_server::declare(
        bus,
        &keys,
        RecordingServer::new(config.record.clone(), config.robot.clone()),
    )
    .await?;
    let link = bus.watch_link().await?;
    drop(starting);
    wait_for_inputs(&mut ends.snapshot, clock).await;
    let _token = bus.declare_alive(&keys.alive()).await?;
    tracing::info!("{} of fleet {} is online", config.robot, config.fleet);
    (host.alive)();
    let state_key = keys.state();
    // Tasks of their own: a message that has to wait must not hold up the others. Dropping the set
    // ends them.
    let mut tasks = JoinSet::new();
    tasks.spawn(uplink::publish_states(bus.clone(), keys.clone(), ends.snapshot.clone()));
    tasks.spawn(neighbours::tell(bus.clone(), keys.clone(), ends.snapshot.clone()));
    tasks.spawn(uplink::publish_events(bus.clone(), keys.clone(), ends.events));
    let saving =
        downlink::Saving { file: config.settings_file.clone(), saved: ends.saved, turn: Arc::default() };
    tasks.spawn(async move {
        downlink::send_replies(ends.replies, saving).await;
        Ok(())
    });
    let listener = Listener {
        bus: bus.clone(),
        fleet,
        me: config.robot.clone(),
        car: Car::of(&config.vehicle),
        clock: clock.clone(),
        slot: ends.neighbours,
        counters: ends.counters,
    };
    let snapshots = ends.snapshot.clone();
    tasks.spawn(listener.run(ends.listens, ends.snapshot));
    tasks.spawn(follow_link(link.up.clone(), ends.link_up));
    if let Some(ros2) = &config.ros2 {
        let parts = ros2::Parts {
            bus: bus.clone(),
            robot: config.robot.clone(),
            vehicle: config.vehicle.clone(),
            inbox,
            snapshots,
            stamps: ros2::Stamps { clock: clock.clone(), simulated: config.world_speed != 1.0 },
        };
        tasks.spawn(ros2::run(parts, ros2.clone()));
    }
    tokio::select! {
        Some(ended) = tasks.join_next() => match ended {
            Ok(result) => Ok(result?),
            Err(panic) => Err(std::io::Error::other(panic).into()),
        },
        () = find_rival(bus, &state_key, link.up.clone(), epoch) => {
            Err(AgentError::NameTaken(config.robot.clone()))
        }
    }
}

/// Tells the control loop whether the session stands.
async fn follow_link(mut up: watch::Receiver<bool>, link_up: Arc<AtomicBool>) -> Result<(), BusError> {
    loop {
        let stands = *up.borrow_and_update();
        if link_up.swap(stands, Ordering::Relaxed) != stands {
            tracing::info!("the link to the router is {}", if stands { "up" } else { "lost" });
        }
        if up.changed().await.is_err() {
            return Ok(());
        }
    }
}

/// Alive means commandable: board and gyro have been heard. One that stays silent must be visible
/// too, so after a while of its own clock (a simulated world may be slow) the robot shows itself as it is.
async fn wait_for_inputs(snapshots: &mut watch::Receiver<Option<Snapshot>>, clock: &Clock) {
    let give_up = clock.now().plus_ns(INPUTS_WITHIN.as_nanos() as u64);
    let heard = |snapshot: &Option<Snapshot>| {
        snapshot.as_ref().is_some_and(|now| {
            let ages = now.state.input_age_ms;
            ages.gyro.is_some() && ages.encoder.is_some() && ages.adc.is_some()
        })
    };
    // The control loop shows a snapshot 20 times a second of that clock.
    let shown = snapshots.wait_for(|snapshot| heard(snapshot) || clock.now() >= give_up).await;
    if !shown.is_ok_and(|snapshot| heard(&snapshot)) {
        tracing::warn!("no data from board or gyro: the robot cannot be commanded yet");
    }
}

async fn wait_for_name(config: &AgentConfig, bus: &Bus, alive: &str) -> Result<(), AgentError> {
    let give_up = Instant::now() + NAME_TAKEN_AFTER;
    loop {
        match bus.alive(alive, ASK_WITHIN).await {
            Ok(others) if others.is_empty() => return Ok(()),
            Ok(_) if Instant::now() >= give_up => return Err(AgentError::NameTaken(config.robot.clone())),
            Ok(_) => {}
            Err(error) => tracing::debug!("{error}; trying to claim the name again"),
        }
        tokio::time::sleep(NAME_CHECK_EVERY).await;
    }
}

/// Two agents that start at the same moment, or meet when a link returns, have both found the name
/// free: of those, the one with the smaller epoch stays. Returns only when this one has to leave.
async fn find_rival(bus: &Bus, state: &str, mut up: watch::Receiver<bool>, epoch: u64) {
    loop {
        let settled = Instant::now() + NAME_TAKEN_AFTER;
        while Instant::now() < settled {
            tokio::time::sleep(NAME_CHECK_EVERY).await;
            // A question that cannot be sent says nothing of rivals.
            let states = bus.get(state, ASK_WITHIN).await.unwrap_or_default();
            if states.iter().filter_map(|s| s.decode::<RobotState>().ok()).any(|s| s.epoch < epoch) {
                return;
            }
        }
        // Again when the link has been lost and has come back.
        let lost = up.wait_for(|up| !up).await.is_ok();
        if !lost || up.wait_for(|up| *up).await.is_err() {
            return std::future::pending().await;
        }
    }
}
