//! Nodes of ROS 2 as a test plays them: publishers that say when their samples were made, and callers of services.

use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;
use tokio::time::{MissedTickBehavior, interval};
use xtb_bus::{AttachedPublisher, Bus, PresenceToken, SessionRole};
use xtb_ros2::cdr::{Cdr, from_bytes, to_bytes};
use xtb_ros2::offer::{CMD_VEL_STAMPED, Channel};
use xtb_ros2::token::{self, Kind};
use xtb_ros2::types::{Header, Service, Twist, TwistStamped, Vector3};
use xtb_ros2::{Attachment, Gid, Key, RosName};
use xtb_ros2_node::now_ns;

/// Domain of these tests.
pub(super) const DOMAIN: u32 = 7;

/// A session of its own.
pub(super) async fn session(endpoint: &str) -> Bus {
    xtb_bus::open(&SessionRole::Client { connect: vec![endpoint.to_owned()] }).await.unwrap()
}

fn node(bus: &Bus, name: &str) -> token::Node {
    let namespace = RosName::new("/").unwrap();
    token::Node { domain: DOMAIN, zid: bus.zid(), nid: bus.next_number(), namespace, name: name.into() }
}

/// The name of a channel of xtb-1.
fn of_robot(channel: &Channel) -> RosName {
    RosName::new("/xtb_1").unwrap().resolve(channel.name).unwrap()
}

/// A publisher of velocity commands.
pub(super) struct Talker {
    publisher: AttachedPublisher,
    tokens: Vec<PresenceToken>,
    gid: Gid,
    sequence: AtomicI64,
}

impl Talker {
    /// `name` is its node's.
    pub(super) async fn new(bus: &Bus, name: &str) -> Self {
        let topic = of_robot(&CMD_VEL_STAMPED);
        let key = Key::new(DOMAIN, topic.clone(), CMD_VEL_STAMPED.ros_type).to_string();
        let publisher = bus.attached_publisher(&key, None).await.unwrap();
        let node = node(bus, name);
        let id = bus.next_number();
        let token = node.endpoint(id, Kind::Publisher, topic, CMD_VEL_STAMPED.ros_type, CMD_VEL_STAMPED.qos);
        let (gid, own) = (token.gid(), node.token().to_string());
        let tokens = vec![
            bus.declare_alive(&own).await.unwrap(),
            bus.declare_alive(&token.to_string()).await.unwrap(),
        ];
        Self { publisher, tokens, gid, sequence: AtomicI64::new(1) }
    }

    /// A velocity that was made at this time.
    pub(super) async fn say_at(&self, source_ns: i64, speed_mps: f64, yaw_rate_radps: f64) {
        let linear = Vector3 { x: speed_mps, ..Vector3::default() };
        let angular = Vector3 { z: yaw_rate_radps, ..Vector3::default() };
        let message = TwistStamped { header: Header::default(), twist: Twist { linear, angular } };
        let sequence = self.sequence.fetch_add(1, Ordering::Relaxed);
        let attachment = Attachment { sequence, source_ns, gid: self.gid }.to_bytes();
        self.publisher.put(to_bytes(&message), &attachment).await.unwrap();
    }

    /// One that is made now.
    pub(super) async fn say(&self, speed_mps: f64) {
        self.say_at(now_ns(), speed_mps, 0.0).await;
    }

    /// Says it ten times a second, until this is dropped or `until` is true.
    pub(super) async fn hold(&self, speed_mps: f64, mut until: impl FnMut() -> bool) {
        let mut tick = interval(Duration::from_millis(100));
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        while !until() {
            tick.tick().await;
            self.say(speed_mps).await;
        }
    }

    /// Its tokens go; the publisher stays, silent.
    pub(super) fn vanish(&mut self) {
        self.tokens.clear();
    }
}

/// Calls services.
pub(super) struct Caller {
    session: zenoh::Session,
    _tokens: Vec<PresenceToken>,
    gid: Gid,
}

impl Caller {
    pub(super) async fn new(endpoint: &str, name: &str, channel: &Channel) -> Self {
        let mut config = zenoh::Config::default();
        for (name, value) in [
            ("mode", "\"client\"".to_owned()),
            ("connect/endpoints", format!("[{endpoint:?}]")),
            ("scouting/multicast/enabled", "false".to_owned()),
        ] {
            config.insert_json5(name, &value).unwrap();
        }
        let session = zenoh::open(config).await.unwrap();
        let bus = self::session(endpoint).await;
        let node = node(&bus, name);
        let token =
            node.endpoint(bus.next_number(), Kind::Client, of_robot(channel), channel.ros_type, channel.qos);
        let gid = token.gid();
        let tokens = vec![bus.declare_alive(&token.to_string()).await.unwrap()];
        Self { session, _tokens: tokens, gid }
    }

    /// Asks, as rmw_zenoh does; `None` = no answer within a minute.
    pub(super) async fn call<S: Service>(
        &self,
        channel: &Channel,
        request: &S::Request,
    ) -> Option<S::Response>
    where
        S::Response: Cdr,
    {
        let key = Key::new(DOMAIN, of_robot(channel), S::TYPE).to_string();
        let attachment = Attachment { sequence: 1, source_ns: now_ns(), gid: self.gid }.to_bytes();
        let replies = self
            .session
            .get(key)
            .payload(to_bytes(request))
            .attachment(&attachment[..])
            .target(zenoh::query::QueryTarget::AllComplete)
            .consolidation(zenoh::query::ConsolidationMode::None)
            .timeout(Duration::from_secs(60))
            .await
            .unwrap();
        let reply = replies.recv_async().await.ok()?;
        let sample = reply.into_result().ok()?;
        let attached = sample.attachment().unwrap().to_bytes();
        let answered = Attachment::from_bytes(&attached).unwrap();
        assert_eq!((answered.gid, answered.sequence), (self.gid, 1));
        Some(from_bytes(&sample.payload().to_bytes()).unwrap())
    }
}
