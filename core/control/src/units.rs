//! Physical quantities as newtypes: checked where a value comes in, plain `f64` inside formulas.
//!
//! The first stop of every sample (see [`crate::controller`]): what the decoders hand over is
//! already one of these, so no stage has to doubt a range again.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Length of one PWM count: 0.4 µs (40 MHz / 16), TM 2004-262 §4.1 read by its own neutral values.
pub const PWM_COUNT_US: f64 = 0.4;
/// The PWM period in counts: 22.2 ms (§4.1).
pub const PWM_PERIOD_COUNTS: f64 = 55_500.0;

/// A value was outside the range that its type allows.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("{quantity} {value} is outside {min}..={max} {unit}")]
pub struct OutOfRange {
    /// What was being read.
    pub quantity: &'static str,
    /// What came.
    pub value: f64,
    /// Smallest value allowed.
    pub min: f64,
    /// Largest value allowed.
    pub max: f64,
    /// The unit of all three.
    pub unit: &'static str,
}

/// The value, if it is finite and in its range.
///
/// # Errors
/// [`OutOfRange`] otherwise.
pub fn check(
    quantity: &'static str,
    value: f64,
    min: f64,
    max: f64,
    unit: &'static str,
) -> Result<f64, OutOfRange> {
    if value.is_finite() && (min..=max).contains(&value) {
        Ok(value)
    } else {
        Err(OutOfRange { quantity, value, min, max, unit })
    }
}

/// Monotonic time in nanoseconds since an origin of the caller's choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
pub struct Stamp(u64);

impl Stamp {
    /// The origin.
    pub const ZERO: Self = Self(0);

    /// From nanoseconds.
    #[must_use]
    pub const fn from_ns(ns: u64) -> Self {
        Self(ns)
    }

    /// From milliseconds.
    #[must_use]
    pub const fn from_ms(ms: u64) -> Self {
        Self(ms * 1_000_000)
    }

    /// From seconds; negative or non-finite values give zero.
    #[must_use]
    pub fn from_s(s: f64) -> Self {
        Self((s * 1e9) as u64)
    }

    /// Nanoseconds since the origin.
    #[must_use]
    pub const fn ns(self) -> u64 {
        self.0
    }

    /// Whole milliseconds since the origin.
    #[must_use]
    pub const fn ms(self) -> u64 {
        self.0 / 1_000_000
    }

    /// Seconds since the origin.
    #[must_use]
    pub fn s(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Seconds from `earlier` to `self`; 0 when `earlier` is later.
    #[must_use]
    pub fn since_s(self, earlier: Self) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }

    /// Whole milliseconds from `earlier` to `self`; 0 when `earlier` is later.
    #[must_use]
    pub const fn since_ms(self, earlier: Self) -> u64 {
        self.0.saturating_sub(earlier.0) / 1_000_000
    }

    /// This moment plus `ns` nanoseconds.
    #[must_use]
    pub const fn plus_ns(self, ns: u64) -> Self {
        Self(self.0.saturating_add(ns))
    }

    /// This moment plus `ms` milliseconds.
    #[must_use]
    pub const fn plus_ms(self, ms: u64) -> Self {
        self.plus_ns(ms * 1_000_000)
    }
}

/// A servo or motor pulse in counts of 0.4 µs, always inside 4.2 %..9.5 % of the period (§4.1):
/// no value of this type is outside 2331..=5272.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(try_from = "u16", into = "u16")]
pub struct PwmCount(u16);

impl PwmCount {
    /// 4.2 % of the period.
    pub const MIN: Self = Self(2331);
    /// 9.5 % of the period.
    pub const MAX: Self = Self(5272);
    /// 1.5 ms: motor neutral and servo centre (§2.1: "1.5 ms when the arm is centered").
    pub const NEUTRAL: Self = Self(3750);

    /// The nearest count (ties away from zero) inside the limits; a non-finite value is neutral.
    #[must_use]
    pub fn saturating(counts: f64) -> Self {
        if !counts.is_finite() {
            return Self::NEUTRAL;
        }
        let counts = counts.clamp(f64::from(Self::MIN.0), f64::from(Self::MAX.0));
        let whole = counts as u16;
        // The rest is exact.
        Self(whole + u16::from(counts - f64::from(whole) >= 0.5))
    }

    /// The count, in 0.4 µs.
    #[must_use]
    pub const fn get(self) -> u16 {
        self.0
    }

    /// The count as a number for formulas.
    #[must_use]
    pub fn as_f64(self) -> f64 {
        f64::from(self.0)
    }
}

impl Default for PwmCount {
    /// Neutral.
    fn default() -> Self {
        Self::NEUTRAL
    }
}

impl TryFrom<u16> for PwmCount {
    type Error = OutOfRange;

    fn try_from(count: u16) -> Result<Self, OutOfRange> {
        let (min, max) = (Self::MIN.as_f64(), Self::MAX.as_f64());
        check("PWM count", f64::from(count), min, max, "counts").map(|_| Self(count))
    }
}

impl From<PwmCount> for u16 {
    fn from(count: PwmCount) -> u16 {
        count.0
    }
}

/// Full scale of the 10-bit converter (§4.5).
pub const ADC_FULL_SCALE: f64 = 1024.0;
/// Supply of the converter in volts (§4.5).
pub const ADC_SUPPLY_V: f64 = 5.0;

/// One conversion of the 10-bit converter, or the mean of several (so not whole), 0..=1023 (§4.5).
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct AdcCount(f64);

impl AdcCount {
    /// 0 V.
    pub const ZERO: Self = Self(0.0);

    /// volts = counts · 5 / 1024 (§4.5).
    #[must_use]
    pub fn volts(self) -> f64 {
        self.0 * ADC_SUPPLY_V / ADC_FULL_SCALE
    }

    /// The count.
    #[must_use]
    pub const fn get(self) -> f64 {
        self.0
    }
}

impl TryFrom<f64> for AdcCount {
    type Error = OutOfRange;

    fn try_from(counts: f64) -> Result<Self, OutOfRange> {
        check("ADC count", counts, 0.0, 1023.0, "counts").map(Self)
    }
}

impl TryFrom<u16> for AdcCount {
    type Error = OutOfRange;

    fn try_from(counts: u16) -> Result<Self, OutOfRange> {
        Self::try_from(f64::from(counts))
    }
}

impl From<AdcCount> for f64 {
    fn from(count: AdcCount) -> f64 {
        count.0
    }
}

/// Wheel speed in revolutions per minute, + = ahead; within ±353 (12,000 motor rpm / 34, §2.2).
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct WheelRpm(f64);

impl WheelRpm {
    /// The encoder's limit: 12,000 rpm of the shaft through 34:1.
    pub const MAX: f64 = 353.0;
    /// Standstill.
    pub const ZERO: Self = Self(0.0);

    /// The value.
    #[must_use]
    pub const fn get(self) -> f64 {
        self.0
    }
}

impl TryFrom<f64> for WheelRpm {
    type Error = OutOfRange;

    fn try_from(rpm: f64) -> Result<Self, OutOfRange> {
        check("wheel speed", rpm, -Self::MAX, Self::MAX, "rpm").map(Self)
    }
}

impl From<WheelRpm> for f64 {
    fn from(rpm: WheelRpm) -> f64 {
        rpm.0
    }
}

/// Steering command as a fraction of full lock, −1..=1, + = right.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct Steering(f64);

impl Steering {
    /// Straight.
    pub const CENTRED: Self = Self(0.0);

    /// The value.
    #[must_use]
    pub const fn get(self) -> f64 {
        self.0
    }
}

impl TryFrom<f64> for Steering {
    type Error = OutOfRange;

    fn try_from(fraction: f64) -> Result<Self, OutOfRange> {
        check("steering", fraction, -1.0, 1.0, "of full lock").map(Self)
    }
}

impl From<Steering> for f64 {
    fn from(steering: Steering) -> f64 {
        steering.0
    }
}

/// A compass heading: degrees in [0, 360), clockwise from +y.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
pub struct Heading(f64);

impl Heading {
    /// Wraps any finite angle; a non-finite one gives 0.
    #[must_use]
    pub fn from_deg(deg: f64) -> Self {
        Self(wrap_deg(deg))
    }

    /// Degrees in [0, 360).
    #[must_use]
    pub const fn deg(self) -> f64 {
        self.0
    }

    /// Radians in [0, 2π).
    #[must_use]
    pub fn rad(self) -> f64 {
        self.0.to_radians()
    }
}

/// An angle in degrees brought into [0, 360) (§4.10: "for negative angles γ = γ + 360").
#[must_use]
pub(crate) fn wrap_deg(deg: f64) -> f64 {
    if !deg.is_finite() {
        return 0.0;
    }
    // The remainder of what is less than a turn is itself.
    let wrapped = if deg.abs() < 360.0 { deg } else { libm::fmod(deg, 360.0) };
    let wrapped = if wrapped < 0.0 { wrapped + 360.0 } else { wrapped };
    // −1e-20 + 360 rounds to 360 exactly.
    if wrapped >= 360.0 { 0.0 } else { wrapped }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pwm_count_saturates_at_the_servo_limits_and_rounds_ties_away_from_zero() {
        assert_eq!(PwmCount::saturating(-1e9), PwmCount::MIN);
        assert_eq!(PwmCount::saturating(1e9), PwmCount::MAX);
        assert_eq!(PwmCount::saturating(3222.5).get(), 3223);
        assert_eq!(PwmCount::saturating(f64::NAN), PwmCount::NEUTRAL);
        assert!(PwmCount::try_from(2330).is_err());
        assert!(PwmCount::try_from(5273).is_err());
    }

    #[test]
    fn heading_wraps_into_one_turn() {
        assert_eq!(Heading::from_deg(-90.0).deg(), 270.0);
        assert_eq!(Heading::from_deg(720.0).deg(), 0.0);
        assert!(Heading::from_deg(-1e-20).deg() < 360.0);
    }

    #[test]
    fn out_of_range_names_quantity_value_and_range() {
        let error = AdcCount::try_from(1024.0).unwrap_err();
        assert_eq!(error.to_string(), "ADC count 1024 is outside 0..=1023 counts");
        assert!(AdcCount::try_from(f64::NAN).is_err());
    }
}
