//! A router with identities. Zenoh takes its rules when it is opened, so whenever somebody has to leave, it is
//! opened anew: links break for about a second, which ends teleoperation and goals that stop on a lost link, and
//! goals that are to be finished go on. Who is added waits until no robot is driven, or until it is asked for.

use super::change::AdmissionChange;
use super::check_port;
use super::files::{Folder, Texts};
use super::quiet::Listening;
use super::status::{self, Known};
use super::visitors::Visitors;
use std::path::Path;
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_bus::{AccessControl, Bus, BusError, LINK_LEASE, Links, Opening, Ros2Domain, Service, SessionRole};
use xtb_client::{Error, ErrorKind, Result};
use xtb_identity::Registry;
use xtb_protocol::Name;
use xtb_protocol::keys::FleetKeys;
use xtb_ros2::RosName;

/// Between two looks at the registry.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// Between two attempts to open it anew.
const AGAIN_AFTER: Duration = Duration::from_millis(100);
/// News that wait to be read; more are dropped.
const NEWS: usize = 16;

/// What happened to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum News {
    /// It was opened anew, with these rules; it was closed for so long.
    Reopened {
        /// What is different.
        change: AdmissionChange,
        /// How long nobody could be linked.
        closed: Duration,
    },
    /// Some are added, and wait until no robot is driven.
    Waiting(AdmissionChange),
    /// The registry cannot be read; the rules before are in force.
    Unreadable(String),
}

/// A router with identities; it runs until it is closed.
pub struct GuardedRouter {
    endpoint: String,
    bus: watch::Receiver<Bus>,
    news: mpsc::Receiver<News>,
    stop: watch::Sender<bool>,
    task: JoinHandle<()>,
}

impl GuardedRouter {
    /// Where it can be reached, with the real port.
    #[must_use]
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// Its own session, which is under no rule; another one after it was opened anew.
    #[must_use]
    pub fn bus(&self) -> Bus {
        self.bus.borrow().clone()
    }

    /// The same, followed.
    #[must_use]
    pub fn bus_watch(&self) -> watch::Receiver<Bus> {
        self.bus.clone()
    }

    /// What happens to it next. (Cancelling loses nothing.)
    pub async fn news(&mut self) -> News {
        match self.news.recv().await {
            Some(news) => news,
            None => std::future::pending().await,
        }
    }

    /// Ends it.
    pub async fn close(self) {
        self.stop.send_replace(true);
        let _ = self.task.await;
    }
}

/// Opens a router that admits whom the registry in the PKI folder names, and routes together with those at
/// `connect`. It follows the registry.
///
/// # Errors
/// [`ErrorKind::Config`]: no registry, or one that cannot be read; [`ErrorKind::PortTaken`]; endpoints without TLS.
pub async fn open_with_registry(listen: &str, connect: &[String], pki: &Path) -> Result<GuardedRouter> {
    open_leased_with_registry(listen, connect, pki, LINK_LEASE, None).await
}

/// The same; others take it for lost after so much silence, and it carries this `ROS_DOMAIN_ID` of ROS 2 too.
///
/// # Errors
/// As [`open_with_registry`].
pub async fn open_leased_with_registry(
    listen: &str,
    connect: &[String],
    pki: &Path,
    link_lease: Duration,
    ros2: Option<u32>,
) -> Result<GuardedRouter> {
    let folder = Folder::new(pki);
    let (texts, registry) = read(&folder)?;
    let mut own = Own {
        listen: listen.to_owned(),
        connect: connect.to_vec(),
        link_lease,
        ros2,
        keys: FleetKeys::new(registry.fleet.clone()),
        known: Known::new(registry.clone()),
        visitors: Visitors::new(&folder),
        folder,
    };
    own.opening(&registry).to_json()?; // what is not allowed is said before what is taken
    check_port(listen)?;
    let running = own.open(&registry).await?;
    let locators = running.bus.locators().await;
    let endpoint = locators.into_iter().next().unwrap_or_else(|| listen.to_owned());
    own.listen = with_port_of(listen, &endpoint);
    let ((sender, bus), (news_sender, news)) = (watch::channel(running.bus.clone()), mpsc::channel(NEWS));
    let (stop, stopped) = watch::channel(false);
    let following = Following { own, in_force: registry, texts, waits: None, bus: sender, news: news_sender };
    let task = tokio::spawn(following.run(running, stopped));
    Ok(GuardedRouter { endpoint, bus, news, stop, task })
}

/// The configuration of a zenohd that does the same, from a PKI folder; it does not follow the registry.
///
/// # Errors
/// As [`open_with_registry`], but for the port.
pub fn zenohd_config(
    listen: &str,
    connect: &[String],
    pki: &Path,
    ros2: Option<u32>,
) -> Result<serde_json::Value> {
    let folder = Folder::new(pki);
    let (_, registry) = read(&folder)?;
    let role = SessionRole::Router { listen: vec![listen.to_owned()], connect: connect.to_vec() };
    let opening = Opening::of(role).tls(Some(folder.tls())).access(Some(rules(&registry, ros2)));
    Ok(opening.to_json()?)
}

fn rules(registry: &Registry, ros2: Option<u32>) -> AccessControl {
    let namespace = |robot: &Name| RosName::robot(robot).relative().to_owned();
    AccessControl::of(registry, ros2.map(|domain| Ros2Domain { domain, namespace }).as_ref())
}

fn read(folder: &Folder) -> Result<(Texts, Registry)> {
    let file = folder.registry_file();
    let texts = folder.read().map_err(|error| {
        Error::new(ErrorKind::Config, format!("cannot read {}: {error}", file.display())).hint(
            "`fleet-cli pki init` makes a PKI; --pki or XTB_PKI names its folder, of which a router on another \
             computer has a copy without ca.key",
        )
    })?;
    let registry = folder
        .registry(&texts)
        .map_err(|error| Error::new(ErrorKind::Config, format!("{}: {error}", file.display())))?;
    Ok((texts, registry))
}

/// `tls/0.0.0.0:0` and where it was opened → the same with that port, to be opened there again.
fn with_port_of(listen: &str, endpoint: &str) -> String {
    match (listen.strip_suffix(":0"), endpoint.rsplit_once(':')) {
        (Some(address), Some((_, port))) => format!("{address}:{port}"),
        _ => listen.to_owned(),
    }
}

/// What stays the same while it is opened again and again.
struct Own {
    listen: String,
    connect: Vec<String>,
    link_lease: Duration,
    ros2: Option<u32>,
    keys: FleetKeys,
    known: Known,
    visitors: Visitors,
    folder: Folder,
}

/// One of its sessions.
struct Running {
    bus: Bus,
    _status: Service,
    _links: Links,
}

impl Own {
    fn opening(&self, registry: &Registry) -> Opening {
        let role = SessionRole::Router { listen: vec![self.listen.clone()], connect: self.connect.clone() };
        Opening::of(role)
            .link_lease(self.link_lease)
            .tls(Some(self.folder.tls()))
            .access(Some(rules(registry, self.ros2)))
    }

    async fn open(&self, registry: &Registry) -> std::result::Result<Running, BusError> {
        let bus = self.opening(registry).once().await?;
        let _status = status::serve(&bus, &self.keys, self.known.clone()).await?;
        let _links = self.visitors.watch(&bus).await?;
        Ok(Running { bus, _status, _links })
    }
}

/// Follows the registry.
struct Following {
    own: Own,
    in_force: Registry,
    texts: Texts,
    /// Additions that wait, and for what.
    waits: Option<(Registry, Listening)>,
    bus: watch::Sender<Bus>,
    news: mpsc::Sender<News>,
}

impl Following {
    async fn run(mut self, mut running: Running, mut stopped: watch::Receiver<bool>) {
        let mut look = tokio::time::interval(LOOK_EVERY);
        look.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                _ = look.tick() => {}
                _ = stopped.wait_for(|stopped| *stopped) => break,
            }
            if let Some(registry) = self.look(&running.bus).await {
                tokio::select! {
                    anew = self.reopen(running, registry) => running = anew,
                    // Closed in the middle of it.
                    _ = stopped.wait_for(|stopped| *stopped) => return self.own.visitors.note(true),
                }
            }
            self.own.visitors.note(false);
        }
        self.own.visitors.note(true);
        running.bus.close().await;
    }

    /// The registry that is to be in force now, if it is another one.
    async fn look(&mut self, bus: &Bus) -> Option<Registry> {
        let folder = self.own.folder.clone();
        let texts = tokio::task::spawn_blocking(move || folder.read()).await.ok()?;
        match texts {
            Err(error) => self.tell_unreadable(error.to_string()),
            Ok(texts) if texts != self.texts => {
                let asked = texts.apply != self.texts.apply;
                let registry = self.own.folder.registry(&texts);
                self.texts = texts;
                match registry {
                    Err(error) => self.tell_unreadable(error),
                    Ok(registry) => return self.take(registry, asked, bus).await,
                }
            }
            Ok(_) => {}
        }
        let (_, listening) = self.waits.as_ref()?;
        if listening.is_quiet() { self.waits.take().map(|(registry, _)| registry) } else { None }
    }

    async fn take(&mut self, registry: Registry, asked: bool, bus: &Bus) -> Option<Registry> {
        self.own.known.read(registry.clone());
        let change = AdmissionChange::between(&self.in_force, &registry);
        self.waits = None;
        if change.is_empty() {
            self.own.known.in_force(registry.clone());
            self.in_force = registry;
            return None;
        }
        if change.is_urgent() || asked {
            return Some(registry);
        }
        match Listening::open(bus, &self.own.keys).await {
            Ok(listening) => {
                tracing::info!("{change}: waiting until no robot is driven");
                self.tell(News::Waiting(change));
                self.waits = Some((registry, listening));
                None
            }
            Err(error) => {
                tracing::warn!("cannot tell whether a robot is driven: {error}");
                Some(registry)
            }
        }
    }

    /// Closes it and opens it again, with these rules; tries until it is open.
    async fn reopen(&mut self, running: Running, registry: Registry) -> Running {
        let change = AdmissionChange::between(&self.in_force, &registry);
        tracing::info!("{change}: opening the router anew");
        let closed = Instant::now();
        let Running { bus, .. } = running;
        bus.close().await;
        let mut said = false;
        let anew = loop {
            match self.own.open(&registry).await {
                Ok(anew) => break anew,
                Err(error) if !said => {
                    said = true;
                    tracing::warn!("cannot open the router anew, trying again: {error}");
                }
                Err(error) => tracing::debug!("{error}"),
            }
            tokio::time::sleep(AGAIN_AFTER).await;
        };
        self.own.known.in_force(registry.clone());
        self.in_force = registry;
        self.bus.send_replace(anew.bus.clone());
        let closed = closed.elapsed();
        tracing::info!(closed_ms = closed.as_millis() as u64, "the router is open again");
        self.tell(News::Reopened { change, closed });
        anew
    }

    fn tell_unreadable(&mut self, reason: String) {
        tracing::warn!("the registry cannot be read, the rules before are in force: {reason}");
        self.tell(News::Unreadable(reason));
    }

    /// Nobody has to listen.
    fn tell(&self, news: News) {
        let _ = self.news.try_send(news);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_opened_again_on_the_port_that_it_got() {
        assert_eq!(with_port_of("tls/127.0.0.1:0", "tls/127.0.0.1:4711"), "tls/127.0.0.1:4711");
        assert_eq!(with_port_of("tls/0.0.0.0:7447", "tls/10.0.0.1:7447"), "tls/0.0.0.0:7447");
    }
}
