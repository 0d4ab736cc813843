//! A client of the fleet, for programs of your own: who is there, how robots stand, and control of one.
//!
//! ```no_run
//! use xtb_client::goal::{GoalRequest, drive};
//! use xtb_client::{Client, Control, Settings};
//!
//! #[tokio::main]
//! async fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let client = Client::open(&Settings::new("lab")?).await?;
//!     for robot in client.alive().await? {
//!         println!("{robot}");
//!     }
//!     let robot = "xtb-1".parse()?;
//!     let control = Control::acquire(&client, &robot, false).await?; // a lease, kept until it is released
//!     let end = drive(&client, &control, &GoalRequest::to(1.0, 2.0)).await?;
//!     println!("{robot}: {:?}", end.status); // reached, cancelled, failed, …
//!     control.release().await;
//!     client.close().await;
//!     Ok(())
//! }
//! ```
//!
//! * [`Client`]: a session; presence, roster, factsheets, requests that are asked until they are answered.
//! * [`StateFeed`], [`Events`]: what robots say, each value with its age.
//! * [`Control`]: a lease, acquired, retained and released. [`goal`]: goto and wander. [`TeleopSession`]: driving
//!   by hand.
//! * [`stop`], [`estop`], [`reset`]: of one robot or all; each must show by its own state that it stands.
//! * [`cars`]: what car each robot says it is, for whoever plans for others.
//! * [`params`]: settings of running robots.
//! * [`scene`]: the whole fleet as screens show it. [`text`]: states in words.
//! * [`rights`]: what the client's role allows. Who may not is told at once, without a message.
//! * [`DispatcherClient`]: tasks for whoever is free. [`map_source`]: the fleet's map; [`map_edit`]: changes of it.
//! * [`subscription`], [`messages`]: every message on the fleet's keys, for recorders and screens.
//!
//! A package outside this workspace names it by path (`xtb-client = { path = "…/core/client" }`). For links over TLS
//! it also needs this workspace's `[patch.crates-io]` in its own manifest: Cargo does not inherit that.
//!
//! A goal's walk begins here: [`goal`] → [`Control`] → `xtb-robot`'s operator → `xtb-bus` → Zenoh.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod cars;
pub mod client;
mod confirm;
pub mod control;
mod crowd;
pub mod dispatcher_client;
mod error;
pub mod estop;
#[cfg(any(test, feature = "testing"))]
#[allow(missing_docs, clippy::unwrap_used)]
pub mod fake;
pub mod fleet_view;
pub mod goal;
mod heard;
pub mod map_edit;
pub mod map_source;
pub mod messages;
pub mod multi_robot;
pub mod params;
pub mod reset;
pub mod rights;
pub mod scene;
mod settings;
pub mod state_feed;
pub mod stop;
pub mod subscription;
pub mod teleop;
pub mod text;

pub use client::{Client, LastState, STALE};
pub use control::Control;
pub use dispatcher_client::DispatcherClient;
pub use error::{Error, ErrorKind, Result};
pub use fleet_view::{FleetView, RobotView};
pub use settings::{DEFAULT_ENDPOINT, DEFAULT_FLEET, DEFAULT_TIMEOUT, Settings, unique_name};
pub use state_feed::{Events, StateFeed};
pub use teleop::TeleopSession;
pub use xtb_identity::Action;
