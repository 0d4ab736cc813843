//! One robot between broker and fleet: everything of it happens here, in its order.

use super::asks::{self, Answered};
use super::link::{Link, News};
use super::{Shared, broker, count};
use rumqttc::QoS;
use serde_json::Value;
use std::future::pending;
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_client::Result;
use xtb_nav::Car;
use xtb_protocol::Name;
use xtb_protocol::messages::{About, DispatchCode, TaskId};
use xtb_vda5050::factsheet::Body;
use xtb_vda5050::{Answer, Effect, Serial, Topic, Vehicle};

/// It decides this often, and after anything that should not wait.
const STEP: Duration = Duration::from_millis(50);
/// A robot that has not said what it is is asked again this much later.
const ASK_AGAIN: Duration = Duration::from_secs(2);

pub(super) struct Session {
    shared: Arc<Shared>,
    robot: Name,
    vehicle: Vehicle,
    link: Link,
    connected: bool,
    asking: Option<JoinHandle<Answered>>,
    about: Option<JoinHandle<Option<About>>>,
    /// In which boot its factsheet was read, and when it was asked for last.
    known_epoch: Option<u64>,
    asked_about: Option<Instant>,
}

fn now_ms() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(now.as_millis()).unwrap_or(u64::MAX)
}

impl Session {
    /// Goes on from what was kept of a robot.
    ///
    /// # Errors
    /// What was kept cannot be read.
    pub(super) fn open(shared: &Arc<Shared>, robot: Name) -> Result<Self> {
        let options = &shared.options;
        let serial = Serial {
            protocol: options.protocol,
            interface: options.interface.clone(),
            manufacturer: options.manufacturer.clone(),
            robot: robot.clone(),
        };
        let vehicle = Vehicle::new(serial, shared.records.read(&robot)?);
        let will = broker::will(vehicle.serial().topic(Topic::Connection.name()), &vehicle.will(now_ms()));
        let client_id = format!("{}-{}-{robot}", xtb_vda5050::operating::CLIENT, shared.client.fleet());
        let link = Link::open(options.broker.options(&client_id, will), Arc::clone(&shared.counters));
        let shared = Arc::clone(shared);
        Ok(Self {
            shared,
            robot,
            vehicle,
            link,
            connected: false,
            asking: None,
            about: None,
            known_epoch: None,
            asked_about: None,
        })
    }

    /// Until it is stopped: then it says so.
    pub(super) async fn run(mut self, mut stop: watch::Receiver<bool>) {
        let mut tick = tokio::time::interval(STEP);
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        while !*stop.borrow() {
            tokio::select! {
                news = self.link.news.recv() => match news {
                    Some(news) => self.hear(news),
                    None => return,
                },
                answered = ended(&mut self.asking) => self.answered(answered),
                about = ended(&mut self.about) => self.learn(about.flatten()),
                _ = tick.tick() => {}
                _ = stop.changed() => {}
            }
            self.turn().await;
        }
        let offline = self.vehicle.offline(now_ms());
        if self.connected && self.publish(Topic::Connection, &offline) {
            self.link.close().await;
        }
    }

    fn hear(&mut self, news: News) {
        match news {
            News::Connected => {
                let topics = ["order", "instantActions"].map(|name| self.vehicle.serial().topic(name));
                self.connected = self.link.subscribe(topics);
                self.vehicle.connected();
            }
            News::Lost => self.connected = false,
            News::Message(topic, bytes) => {
                if topic == self.vehicle.serial().topic("order") {
                    self.vehicle.order(&bytes);
                } else if topic == self.vehicle.serial().topic("instantActions") {
                    self.vehicle.instant_actions(&bytes);
                }
            }
        }
    }

    fn answered(&mut self, answered: Option<Answered>) {
        let (answer, fact) =
            answered.unwrap_or((Answer::Unreachable("the question has failed".to_owned()), None));
        if let Some((task, fact)) = fact {
            let reason = fact.reason.as_deref();
            // A task of another ledger is not the one that was asked for.
            let is_ours = self.vehicle.task((fact.ledger, task), fact.state, fact.legs_done, reason);
            if !is_ours {
                return self
                    .vehicle
                    .answered(now_ms(), Answer::Refused(DispatchCode::UnknownTask, String::new()));
            }
        }
        self.vehicle.answered(now_ms(), answer);
    }

    fn learn(&mut self, about: Option<About>) {
        let Some(about) = about else { return };
        self.known_epoch = Some(about.epoch);
        let car = Car::of_about(&about).ok();
        let body = car.map(|car| Body {
            length_m: car.front_m + car.rear_m,
            width_m: 2.0 * car.half_width_m,
            speed_mps: about.limits.admitted_mps,
        });
        self.vehicle.about(&about.version, body);
    }

    async fn turn(&mut self) {
        let seen = self.shared.feed.last(&self.robot);
        let is_fresh = seen.as_ref().is_some_and(|seen| seen.fresh().is_some());
        let present = is_fresh && self.shared.feed.alive().contains(&self.robot);
        self.vehicle.robot(seen.as_ref().map(|seen| &seen.state), present);
        self.ask_about(seen.as_ref().map(|seen| seen.state.epoch));
        self.look_at_task();
        let mut kept = true;
        for effect in self.vehicle.step(now_ms()) {
            match effect {
                Effect::Save(record) => kept = self.save(record).await,
                Effect::Ask(ask) if kept => {
                    let asking = asks::ask(Arc::clone(&self.shared), self.robot.clone(), ask);
                    self.asking = Some(tokio::spawn(asking));
                }
                Effect::Ask(_) => {}
                Effect::Publish(topic, message) => {
                    if self.connected && !self.publish(topic, &message) {
                        self.vehicle.connected(); // it is said again
                    }
                }
            }
        }
    }

    fn look_at_task(&mut self) {
        let Some(task): Option<TaskId> = self.vehicle.part_task() else { return };
        let facts = self.shared.facts.lock().unwrap_or_else(PoisonError::into_inner);
        let fact = facts.get(&task).cloned();
        drop(facts);
        if let Some(fact) = fact {
            self.vehicle.task((fact.ledger, task), fact.state, fact.legs_done, fact.reason.as_deref());
        }
    }

    /// Its factsheet, once a boot.
    fn ask_about(&mut self, epoch: Option<u64>) {
        let due = self.asked_about.is_none_or(|asked| asked.elapsed() >= ASK_AGAIN);
        if epoch.is_none() || epoch == self.known_epoch || self.about.is_some() || !due {
            return;
        }
        self.asked_about = Some(Instant::now());
        let (shared, robot) = (Arc::clone(&self.shared), self.robot.clone());
        self.about = Some(tokio::spawn(async move { shared.client.about(&robot).await.ok().flatten() }));
    }

    async fn save(&mut self, record: String) -> bool {
        let (records, robot) = (self.shared.records.clone(), self.robot.clone());
        let writing = tokio::task::spawn_blocking(move || records.write(&robot, &record)).await;
        let failure = match writing {
            Ok(Ok(())) => return true,
            Ok(Err(error)) => error.to_string(),
            Err(error) => error.to_string(),
        };
        tracing::error!("the order of {} cannot be kept: {failure}", self.robot);
        self.vehicle.not_saved(now_ms(), format!("the order cannot be kept: {failure}"));
        false
    }

    fn publish(&mut self, topic: Topic, message: &Value) -> bool {
        let (qos, retain) = match topic {
            Topic::Connection => (QoS::AtLeastOnce, true),
            Topic::Factsheet => (QoS::AtMostOnce, true),
            Topic::State => (QoS::AtMostOnce, false),
        };
        let topic = self.vehicle.serial().topic(topic.name());
        let sent = self.link.client.try_publish(topic, qos, retain, message.to_string()).is_ok();
        count(if sent { &self.shared.counters.published } else { &self.shared.counters.held_back });
        sent
    }
}

/// What a task came to, when it has ended; never without one.
async fn ended<T>(task: &mut Option<JoinHandle<T>>) -> Option<T> {
    let Some(running) = task else { return pending().await };
    let result = running.await;
    *task = None;
    result.ok()
}
