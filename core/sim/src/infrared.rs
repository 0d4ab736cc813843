//! The range finders at the bumper faces: true curve, fold-back, noise, own refresh. Of a GP2D12:
//!
//! ```text
//!   V │    ·     peak at 8 cm
//!     │   / \
//!     │  /    ` .
//!     │ /          ` · . _ _ floor, nothing in sight
//!     └──┬──────────────┬── cm
//!        8             80
//! ```
//! Each looks ahead (front) or back (rear), tilted with its bumper: an upright surface at the
//! distance d is then d / cos θ away, so that hyp · cos θ (§4.5) gives d back. Floor and ceiling are
//! not seen. They are listed left to right, seen from above with the truck pointing up.
//!
//! A beam is as wide as its lens at the sensor and (an XTB's) 6 cm at 80 cm, 2.4 cm at 25 cm: between
//! beams 7 cm apart there are strips that none looks at. Three rays stand for it, in the middle and at both
//! edges. What comes back of each is its part of the light by the square of the distance, and the
//! sensor, which triangulates the spot's middle, shows the mean of their voltages weighted with that
//! light: a leg before a wall reads a little too far. Too little light is nothing at all.

use crate::faults::RangeFinderFault;
use crate::geometry::{Beam, OrientedBox};
use crate::parameters::{Body, InfraredTruth};
use crate::range_curves::{curve_v, sight_m};
use crate::rng::Rng;
use crate::scene::StepContext;
use std::fmt;
use xtb_control::range_curve::RangeCurve;
use xtb_control::units::{ADC_FULL_SCALE, ADC_SUPPLY_V, AdcCount};
use xtb_control::vehicle::{RangeFinder, RangeFinders as Fitted, SLOTS, USUAL_SLOTS};

/// Channels of both bumpers.
const SENSORS: usize = 2 * SLOTS;
/// The distance that the beam's width is given for, in m.
const WIDE_AT_M: f64 = 0.8;
/// The rays of a beam: where in its half width, + = left, and their part of the light.
const RAYS: [(f64, f64); 3] = [(-1.0, 0.25), (0.0, 0.5), (1.0, 0.25)];

/// A ray of a beam, on the body.
#[derive(Debug, Clone, Copy)]
struct Ray {
    /// Where it begins, to the left of the body's centre.
    left_m: f64,
    /// Its direction: ahead and to the left.
    ahead: f64,
    left: f64,
    /// The part of its length that lies along the beam's middle.
    along: f64,
}

impl Ray {
    /// `beside`: where in the beam's half width, + = left.
    fn new(truth: &InfraredTruth, facing: f64, finder: &RangeFinder, beside: f64) -> Self {
        let widens = beside * (finder.beam_m - truth.lens_m) / 2.0 / WIDE_AT_M;
        let along = 1.0 / libm::sqrt(1.0 + widens * widens);
        let left_m = finder.left_m + beside * truth.lens_m / 2.0;
        let (sin, cos) = libm::sincos(finder.turned_deg.to_radians());
        let side = widens * along;
        Self { left_m, ahead: facing * (along * cos - side * sin), left: along * sin + side * cos, along }
    }

    fn beam(&self, (ahead_m, sight_m): (f64, f64), body: &OrientedBox) -> Beam {
        let ((x_m, y_m), (cos, sin)) = (body.centre_m(), body.direction());
        Beam::new(
            x_m + cos * ahead_m - sin * self.left_m,
            y_m + sin * ahead_m + cos * self.left_m,
            cos * self.ahead - sin * self.left,
            sin * self.ahead + cos * self.left,
            sight_m,
        )
    }
}

/// No ray of a beam is farther from the one in the middle; a millimetre more than rounding needs.
fn beside_m(truth: &InfraredTruth, finder: &RangeFinder) -> f64 {
    let widens = (finder.beam_m - truth.lens_m).abs() / 2.0 / WIDE_AT_M;
    truth.lens_m / 2.0 + widens * sight_m(finder.curve) + 0.001
}

#[derive(Debug, Clone, Copy)]
struct Sensor {
    curve: RangeCurve,
    /// Of the rear bumper.
    is_rear: bool,
    /// Where it sits on the body, in m ahead of the centre, and how far it sees at most.
    place_m: (f64, f64),
    rays: [Ray; 3],
    /// No ray goes farther from the one in the middle.
    beside_m: f64,
    /// What it shows with nothing in sight.
    floor_v: f64,
    period_ns: u64,
    /// 0 V until the first measurement, as a sensor that is just being switched on.
    volts: f64,
    fault: RangeFinderFault,
}

/// The two bumpers.
#[derive(Debug, Clone)]
pub(crate) struct RangeFinders {
    truth: InfraredTruth,
    /// By their channels; `None` where none is fitted.
    sensors: [Option<Sensor>; SENSORS],
    /// When each of them measures again.
    next_ns: [u64; SENSORS],
    /// The first of these moments.
    due_ns: u64,
    looked: Looked,
}

/// What the range finders of a truck that stands have seen of the world, so that none looks again. What is kept depends
/// on how far ahead the lists of what is near look, so it is no part of what a truck shows: what is seen does not.
#[derive(Clone, Default)]
struct Looked {
    /// The body's centre and direction.
    from: [(f64, f64); 2],
    /// With which stretch each has looked since the truck is there, without anything near that may move, and the voltage
    /// that comes of it.
    seen: [Option<(f64, Option<f64>)>; SENSORS],
}

impl fmt::Debug for Looked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Looked")
    }
}

impl Looked {
    fn come(&mut self, body: &OrientedBox) {
        let from = [body.centre_m(), body.direction()];
        if from != self.from {
            *self = Self { from, ..Self::default() };
        }
    }
}

impl RangeFinders {
    /// Each of an XTB's channels takes its share of the noise, whatever is fitted there, and a seventh and eighth if one
    /// is fitted.
    pub(crate) fn new(truth: &InfraredTruth, fitted: &Fitted, body: &Body, noise: &mut Rng) -> Self {
        let mut next_ns = [u64::MAX; SENSORS];
        let sensors = std::array::from_fn(|i| {
            let (is_rear, slot) = (i >= SLOTS, i % SLOTS);
            let (bumper, facing) = if is_rear { (&fitted.rear, -1.0) } else { (&fitted.front, 1.0) };
            let finder = bumper.get(slot);
            if slot >= USUAL_SLOTS && finder.is_none() {
                return None;
            }
            let spread = truth.refresh_tolerance_s;
            let period_s = truth.refresh_s + noise.uniform(-spread, spread);
            let period_ns = (period_s * 1e9) as u64;
            let floor_v = noise.uniform(truth.floor_min_v, truth.floor_max_v);
            next_ns[i] = noise.up_to(period_ns);
            let finder = finder?;
            let ahead_m = facing * (body.length_m / 2.0 + finder.ahead_m);
            Some(Sensor {
                curve: finder.curve,
                is_rear,
                place_m: (ahead_m, sight_m(finder.curve)),
                rays: RAYS.map(|(beside, _)| Ray::new(truth, facing, finder, beside)),
                beside_m: beside_m(truth, finder),
                floor_v,
                period_ns,
                volts: 0.0,
                fault: RangeFinderFault::None,
            })
        });
        Self { truth: truth.clone(), sensors, next_ns, due_ns: 0, looked: Looked::default() }
    }

    /// Lets every sensor measure whose time has come. `stretch` is 1 / cos θ of front and rear bumper.
    pub(crate) fn step(
        &mut self,
        context: &StepContext<'_>,
        me: usize,
        body: &OrientedBox,
        stretch: [f64; 2],
        noise: &mut Rng,
    ) {
        let now_ns = context.now().ns();
        if now_ns < self.due_ns {
            return;
        }
        self.looked.come(body);
        self.due_ns = u64::MAX;
        for i in 0..SENSORS {
            if self.next_ns[i] <= now_ns {
                self.next_ns[i] = self.look(i, context, me, body, stretch, noise);
            }
            self.due_ns = self.due_ns.min(self.next_ns[i]);
        }
    }

    /// One of them measures: when it does so again.
    fn look(
        &mut self,
        i: usize,
        context: &StepContext<'_>,
        me: usize,
        body: &OrientedBox,
        stretch: [f64; 2],
        noise: &mut Rng,
    ) -> u64 {
        let Some(sensor) = &mut self.sensors[i] else { return u64::MAX };
        let stretch = stretch[usize::from(sensor.is_rear)];
        let seen = &mut self.looked.seen[i];
        let known = seen.filter(|(with, _)| *with == stretch && context.is_alone(me));
        let seen_v = known
            .map_or_else(|| sensor.seen_v(&self.truth, context, me, body, stretch), |(_, seen_v)| seen_v);
        *seen = context.is_alone(me).then_some((stretch, seen_v));
        sensor.measure(&self.truth, seen_v, noise);
        self.next_ns[i] + sensor.period_ns
    }

    /// The world has changed: what was seen of it may be gone.
    pub(crate) fn look_again(&mut self) {
        self.looked = Looked::default();
    }

    /// No ray ends farther from the body's centre.
    pub(crate) fn sight_m(&self) -> f64 {
        let fitted = self.sensors.iter().flatten();
        let rays = fitted.flat_map(|sensor| sensor.rays.iter().map(|ray| (sensor.place_m, ray.left_m)));
        rays.map(|((ahead_m, sight_m), left_m)| sight_m + libm::hypot(ahead_m, left_m)).fold(0.0, f64::max)
    }

    /// Breaks or mends them: front, then rear, left to right.
    pub(crate) fn set_faults(&mut self, faults: &[RangeFinderFault; SENSORS]) {
        for (sensor, fault) in self.sensors.iter_mut().zip(faults) {
            if let Some(sensor) = sensor {
                sensor.fault = *fault;
            }
        }
    }

    /// What the converter gets of the front and then of the rear bumper, left to right; 0 of a channel without a range
    /// finder.
    pub(crate) fn volts(&self) -> [f64; SENSORS] {
        self.sensors.each_ref().map(|sensor| sensor.as_ref().map_or(0.0, Sensor::shown_v))
    }

    /// What the converter makes of the front and the rear bumper, left to right.
    pub(crate) fn readings(&self) -> ([AdcCount; SLOTS], [AdcCount; SLOTS]) {
        let volts = self.volts();
        let side = |first: usize| std::array::from_fn(|i| adc_count(volts[first + i], 1.0));
        (side(0), side(SLOTS))
    }
}

impl Sensor {
    /// The voltage that comes of what the beam falls on; `None` = nothing in sight.
    fn seen_v(
        &self,
        truth: &InfraredTruth,
        context: &StepContext<'_>,
        me: usize,
        body: &OrientedBox,
        stretch: f64,
    ) -> Option<f64> {
        let [_, middle, _] = self.rays;
        if context.is_free(me, &middle.beam(self.place_m, body), self.beside_m) {
            return None;
        }
        let ways_m = context.nearest_m(me, self.rays.map(|ray| ray.beam(self.place_m, body)));
        let (mut light, mut light_v) = (0.0, 0.0);
        for ((ray, (_, part)), way_m) in self.rays.iter().zip(RAYS).zip(ways_m) {
            if let Some(way_m) = way_m {
                // Along the beam's middle.
                let range_m = way_m * ray.along * stretch;
                // Nearer than the peak it is as bright as can be.
                let bright_m = range_m.max(truth.fold_back_cm / 100.0);
                let bright = part / (bright_m * bright_m);
                light += bright;
                light_v += bright * curve_v(truth, self.curve, range_m * 100.0);
            }
        }
        (light >= 1.0 / (self.place_m.1 * self.place_m.1)).then(|| light_v / light)
    }

    fn measure(&mut self, truth: &InfraredTruth, seen_v: Option<f64>, noise: &mut Rng) {
        // Far away the curve sinks below what the sensor shows of nothing at all.
        let seen_v = seen_v.map_or(self.floor_v, |seen_v| seen_v.max(self.floor_v));
        let volts = seen_v + noise.bell(truth.noise_v);
        if self.fault != RangeFinderFault::Frozen {
            self.volts = volts;
        }
    }

    /// What the converter gets of it.
    fn shown_v(&self) -> f64 {
        match self.fault {
            RangeFinderFault::BrokenWire => 0.0,
            RangeFinderFault::Short => ADC_SUPPLY_V,
            RangeFinderFault::None | RangeFinderFault::Frozen => self.volts,
        }
    }
}

/// What the 10-bit converter makes of a voltage; `scans` > 1 means a mean with finer steps.
pub(crate) fn adc_count(volts: f64, scans: f64) -> AdcCount {
    // Whole ones: below 0 it shows 0 anyway.
    let counts = (volts * ADC_FULL_SCALE / ADC_SUPPLY_V * scans) as i64 as f64 / scans;
    AdcCount::try_from(counts.clamp(0.0, ADC_FULL_SCALE - 1.0)).unwrap_or(AdcCount::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::units::Stamp;

    #[test]
    fn each_sensor_has_its_own_period_within_the_data_sheet() {
        let finders = RangeFinders::new(
            &InfraredTruth::default(),
            &Fitted::default(),
            &Body::default(),
            &mut Rng::new(3, 0),
        );
        let mut periods: Vec<_> =
            finders.sensors.iter().flatten().map(|s| Stamp::from_ns(s.period_ns)).collect();
        for period in &periods {
            assert!((0.0287..=0.0479).contains(&period.s()), "{period:?}");
        }
        periods.dedup();
        assert_eq!(periods.len(), 2 * USUAL_SLOTS);
    }

    #[test]
    fn the_converter_saturates_instead_of_wrapping() {
        assert_eq!(adc_count(-1.0, 1.0).get(), 0.0);
        assert_eq!(adc_count(9.0, 1.0).get(), 1023.0);
        assert_eq!(adc_count(2.5, 1.0).get(), 512.0);
        assert_eq!(adc_count(f64::NAN, 1.0), AdcCount::ZERO);
    }
}
