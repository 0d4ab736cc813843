//! What car each robot is: its factsheet, asked for once a boot.

use crate::client::Client;
use crate::state_feed;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use xtb_nav::Car;
use xtb_protocol::Name;
use xtb_protocol::messages::About;

/// Robots that are asked at the same time.
const QUESTIONS: usize = 16;
/// One that has not said is asked again this much later.
const AGAIN: Duration = Duration::from_secs(2);
/// Robots that are remembered; beyond, the one that nobody has asked about for longest is forgotten.
const MOST: usize = 1024;
// Whoever asks about every robot of a feed in turn loses none of them: they all have room.
const _: () = assert!(MOST >= state_feed::MOST_ROBOTS);

/// The cars of the robots that were asked about.
#[derive(Debug)]
pub struct Cars {
    client: Client,
    known: BTreeMap<Name, Known>,
    asking: JoinSet<(Name, Option<About>)>,
}

#[derive(Debug)]
struct Known {
    epoch: u64,
    since: Instant,
    used: Instant,
    asked: Option<Instant>,
    car: Option<Car>,
}

impl Cars {
    /// Nobody's is known yet.
    #[must_use]
    pub fn new(client: &Client) -> Self {
        Self { client: client.clone(), known: BTreeMap::new(), asking: JoinSet::new() }
    }

    /// The car of a robot in this boot. One that is not known is asked; this does not wait for its answer, but
    /// says for how long there has been none.
    ///
    /// # Errors
    /// For how long it has not said.
    pub fn of(&mut self, robot: &Name, epoch: u64) -> Result<Car, Duration> {
        while let Some(answer) = self.asking.try_join_next() {
            let Ok((robot, Some(about))) = answer else { continue };
            self.hear(&robot, &about);
        }
        let now = Instant::now();
        if !self.known.contains_key(robot) && self.known.len() == MOST {
            let unused = self.known.iter().min_by_key(|(_, known)| known.used);
            let unused = unused.map(|(robot, _)| robot.clone());
            if let Some(unused) = unused {
                self.known.remove(&unused);
            }
        }
        let unknown = || Known { epoch, since: now, used: now, asked: None, car: None };
        let known = self.known.entry(robot.clone()).or_insert_with(unknown);
        if known.epoch != epoch {
            *known = unknown();
        }
        known.used = now;
        if let Some(car) = known.car {
            return Ok(car);
        }
        let is_due = known.asked.is_none_or(|asked| asked.elapsed() >= AGAIN);
        if is_due && self.asking.len() < QUESTIONS {
            known.asked = Some(now);
            let (client, robot) = (self.client.clone(), robot.clone());
            self.asking.spawn(async move {
                let about = client.about(&robot).await;
                let about = about.inspect_err(|error| tracing::debug!("{robot}: {error}"));
                (robot, about.ok().flatten())
            });
        }
        Err(known.since.elapsed())
    }

    fn hear(&mut self, robot: &Name, about: &About) {
        let Some(known) = self.known.get_mut(robot).filter(|known| known.epoch == about.epoch) else {
            return;
        };
        match Car::of_about(about) {
            Ok(car) => known.car = Some(car),
            Err(error) => tracing::warn!("the factsheet of {robot} has no valid vehicle data: {error}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake;
    use xtb_protocol::messages::ParameterInfo;

    fn about(epoch: u64, length_m: &str) -> About {
        let parameter = |(name, value): (&str, &str)| ParameterInfo {
            name: name.to_owned(),
            value: value.to_owned(),
            unit: String::new(),
            origin: String::new(),
        };
        let vehicle = [
            ("geometry.wheelbase_m", "0.3"),
            ("geometry.body_length_m", length_m),
            ("geometry.body_width_m", "0.4"),
            ("steering.stop_deg", "20.0"),
        ];
        About { epoch, vehicle: vehicle.map(parameter).to_vec(), ..fake::about("xtb-1", "") }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_car_that_is_asked_about_in_each_turn_is_not_forgotten_for_names_that_are_new() {
        let client = Client::alone(Duration::from_secs(1)).await;
        let mut cars = Cars::new(&client);
        let robot = fake::name("xtb-1");
        assert!(cars.of(&robot, 7).is_err());
        cars.hear(&robot, &about(7, "0.75"));
        for turn in 0..3 {
            assert!(cars.of(&robot, 7).is_ok(), "turn {turn}");
            for ghost in 0..MOST - 1 {
                // They stand behind it by name.
                assert!(cars.of(&fake::name(&format!("z-{turn}-{ghost}")), 7).is_err());
            }
        }
        assert!(cars.of(&robot, 7).is_ok());
        assert_eq!(cars.known.len(), MOST);
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_car_is_known_for_one_boot_and_only_if_it_is_possible() {
        let client = Client::alone(Duration::from_secs(1)).await;
        let robot = fake::name("xtb-1");
        let mut cars = Cars::new(&client);
        assert!(cars.of(&robot, 7).is_err());
        cars.hear(&robot, &about(6, "0.75"));
        assert!(cars.of(&robot, 7).is_err(), "another boot's");
        for bad in ["nine", "90.0", "NaN", "-1"] {
            cars.hear(&robot, &about(7, bad));
            assert!(cars.of(&robot, 7).is_err(), "{bad}");
        }
        cars.hear(&robot, &about(7, "0.75"));
        assert_eq!(cars.of(&robot, 7).unwrap().front_m, 0.375);
        assert!(cars.of(&robot, 8).is_err(), "it may be another car now");
    }
}
