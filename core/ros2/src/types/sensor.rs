//! Range finders, inertia, battery. What is not measured is NaN, or −1 at the beginning of its covariance.

use super::{Header, Quaternion, Vector3, cdr_structs};

cdr_structs! {
    /// One reading of a range finder (with `variance`: Jazzy and later).
    ["sensor_msgs/msg/Range", "b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a"]
    Range {
        /// When, and the sensor's frame: it looks along x.
        header: Header,
        /// 0 ultrasound, 1 infrared.
        radiation_type: u8,
        /// Width of the beam, in rad.
        field_of_view: f32,
        /// Nearest that it measures, in m.
        min_range: f32,
        /// Farthest that it measures, in m.
        max_range: f32,
        /// In m; +Inf = nothing in range, −Inf = too near to measure (REP 117).
        range: f32,
        /// 0 = not known, in m².
        variance: f32,
    }

    /// A turn of a laser scanner.
    ["sensor_msgs/msg/LaserScan", "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"]
    LaserScan {
        /// When, and the scanner's frame.
        header: Header,
        /// Of the first beam, in rad.
        angle_min: f32,
        /// Of the last beam.
        angle_max: f32,
        /// From beam to beam.
        angle_increment: f32,
        /// From beam to beam, in s.
        time_increment: f32,
        /// From turn to turn, in s.
        scan_time: f32,
        /// Nearest that it measures, in m.
        range_min: f32,
        /// Farthest that it measures, in m.
        range_max: f32,
        /// In m.
        ranges: Vec<f32>,
        /// As the device has it; may be empty.
        intensities: Vec<f32>,
    }

    /// What an inertial sensor measures.
    ["sensor_msgs/msg/Imu", "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"]
    Imu {
        /// When, and the sensor's frame.
        header: Header,
        /// How it is turned.
        orientation: Quaternion,
        /// Begins with −1 if there is no orientation.
        orientation_covariance: [f64; 9],
        /// In rad/s.
        angular_velocity: Vector3,
        /// Begins with −1 if there is no angular velocity.
        angular_velocity_covariance: [f64; 9],
        /// In m/s².
        linear_acceleration: Vector3,
        /// Begins with −1 if there is no acceleration.
        linear_acceleration_covariance: [f64; 9],
    }

    /// How a battery is; NaN = not measured.
    ["sensor_msgs/msg/BatteryState", "4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741"]
    BatteryState {
        /// When, and in which frame it is.
        header: Header,
        /// In V.
        voltage: f32,
        /// In °C.
        temperature: f32,
        /// In A; negative while it is discharged.
        current: f32,
        /// In Ah.
        charge: f32,
        /// In Ah, of the last full charge.
        capacity: f32,
        /// In Ah.
        design_capacity: f32,
        /// 0 to 1.
        percentage: f32,
        /// 0 unknown, 1 charging, 2 discharging, 3 not charging, 4 full.
        power_supply_status: u8,
        /// 0 unknown, 1 good; more in the definition.
        power_supply_health: u8,
        /// 0 unknown, 1 nickel-metal hydride; more in the definition.
        power_supply_technology: u8,
        /// Whether there is one.
        present: bool,
        /// In V.
        cell_voltage: Vec<f32>,
        /// In °C.
        cell_temperature: Vec<f32>,
        /// Its slot.
        location: String,
        /// Its number.
        serial_number: String,
    }
}
