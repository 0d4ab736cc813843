//! The range finder's characteristic (§4.5): distance over voltage. It holds for 0.42..=2.35 V only, see
//! [`infrared`](crate::infrared).

/// The published fit: hypotenuse in cm from volts (§4.5).
#[must_use]
pub fn fit_cm(volts: f64) -> f64 {
    const POLYNOMIAL: [f64; 7] = [0.9195, 1.6166, -40.426, 125.12, -131.76, 2.4594, 69.999];
    POLYNOMIAL.iter().fold(0.0, |sum, c| sum * volts + c)
}
