//! Which faults a robot has now, since when, and which of them must stop it.

use crate::line::{Device, LineFault, PortTrouble};
use std::sync::Arc;
use xtb_control::Stamp;
use xtb_protocol::messages::{Fault, FaultState, InputAges, Latch, StopReason};

/// A kind of sample that was not heard for this long is lost: more than three windows of the encoder, which
/// comes least often.
pub const INPUT_LOST_MS: u64 = 200;

/// A board that speaks and sends none of a kind for this long has a fault: three encoder windows, with
/// the turn that notices it within 200 ms.
const KIND_SILENT_MS: u64 = 180;

/// The name of a line's fault.
#[must_use]
pub fn of_line(device: Device, fault: LineFault) -> Fault {
    use PortTrouble::{Broken, Busy, NoPermission, Unplugged};
    match (device, fault) {
        (Device::Board, LineFault::Port(Unplugged)) => Fault::BoardUnplugged,
        (Device::Board, LineFault::Port(Busy)) => Fault::BoardBusy,
        (Device::Board, LineFault::Port(NoPermission)) => Fault::BoardNoPermission,
        (Device::Board, LineFault::Port(Broken)) => Fault::BoardPortBroken,
        (Device::Board, LineFault::Silent) => Fault::BoardSilent,
        (Device::Board, LineFault::Garbage) => Fault::BoardGarbage,
        (Device::Board, LineFault::HalfFrames) => Fault::BoardHalfFrames,
        (Device::Board, LineFault::WrongDevice) => Fault::BoardWrongDevice,
        (Device::Board, LineFault::Frozen) => Fault::BoardFrozen,
        (Device::Gyro, LineFault::Frozen) => Fault::GyroFrozen,
        (Device::Gyro, LineFault::Port(Unplugged)) => Fault::GyroUnplugged,
        (Device::Gyro, LineFault::Port(Busy)) => Fault::GyroBusy,
        (Device::Gyro, LineFault::Port(NoPermission)) => Fault::GyroNoPermission,
        (Device::Gyro, LineFault::Port(Broken)) => Fault::GyroPortBroken,
        (Device::Gyro, LineFault::Silent) => Fault::GyroSilent,
        (Device::Gyro, LineFault::Garbage) => Fault::GyroGarbage,
        (Device::Gyro, LineFault::HalfFrames) => Fault::GyroHalfFrames,
        (Device::Gyro, LineFault::WrongDevice) => Fault::GyroWrongDevice,
    }
}

/// Why a fault makes the robot stand; `None` = it may go on.
#[must_use]
pub fn stops(fault: Fault) -> Option<StopReason> {
    match fault {
        Fault::RemoteLost => Some(StopReason::RemoteLost),
        Fault::Stalled => Some(StopReason::Stalled),
        Fault::TiltOutOfRange
        | Fault::RecordingFailed
        | Fault::BatteryLow
        | Fault::OdometryScale
        | Fault::FixesFrozen
        | Fault::FixesContradict => None,
        fault => latch_of(fault).map(Latch::reason),
    }
}

/// Which stop a fault latches; `None` = its stop ends with it, or it stops nothing.
#[must_use]
pub fn latch_of(fault: Fault) -> Option<Latch> {
    match fault {
        Fault::BoardUnplugged
        | Fault::BoardBusy
        | Fault::BoardNoPermission
        | Fault::BoardPortBroken
        | Fault::BoardSilent
        | Fault::BoardGarbage
        | Fault::BoardHalfFrames
        | Fault::BoardWrongDevice
        | Fault::BoardNotSetUp
        | Fault::EncoderSilent
        | Fault::ConverterSilent => Some(Latch::BoardLost),
        Fault::GyroUnplugged
        | Fault::GyroBusy
        | Fault::GyroNoPermission
        | Fault::GyroPortBroken
        | Fault::GyroSilent
        | Fault::GyroGarbage
        | Fault::GyroHalfFrames
        | Fault::GyroWrongDevice => Some(Latch::GyroLost),
        Fault::BoardFrozen
        | Fault::GyroFrozen
        | Fault::ConverterFrozen
        | Fault::EncoderOutOfRange
        | Fault::InfraredFrozen
        | Fault::InfraredOutOfRange => Some(Latch::SensorFault),
        Fault::Runaway => Some(Latch::Runaway),
        Fault::BatteryCritical => Some(Latch::BatteryCritical),
        Fault::RemoteLost
        | Fault::TiltOutOfRange
        | Fault::RecordingFailed
        | Fault::Stalled
        | Fault::BatteryLow
        | Fault::OdometryScale
        | Fault::FixesFrozen
        | Fault::FixesContradict => None,
    }
}

/// Kinds of samples that a board which speaks does not send. `speaking_ms`: for how long it speaks.
pub fn silent_kinds(ages: &InputAges, speaking_ms: u64) -> impl Iterator<Item = Fault> + use<> {
    let silent = move |age: Option<u64>| age.map_or(speaking_ms, |ms| ms.min(speaking_ms)) > KIND_SILENT_MS;
    [(ages.encoder, Fault::EncoderSilent), (ages.adc, Fault::ConverterSilent)]
        .into_iter()
        .filter_map(move |(age, fault)| silent(age).then_some(fault))
}

#[derive(Debug, Clone, PartialEq)]
struct Present {
    fault: Fault,
    since: Stamp,
    detail: Option<String>,
}

/// The faults of a robot, oldest first.
#[derive(Debug, Clone, Default)]
pub struct FaultBook(Vec<Present>);

impl FaultBook {
    /// A fault is there. True if that is news.
    pub fn begin(&mut self, now: Stamp, fault: Fault, detail: Option<&str>) -> bool {
        if self.0.iter().any(|known| known.fault == fault) {
            return false;
        }
        self.0.push(Present { fault, since: now, detail: detail.map(str::to_owned) });
        true
    }

    /// Ends the oldest fault that is not among `current`, if there is one.
    pub fn end_other_than<'a>(
        &mut self,
        current: impl Iterator<Item = &'a (Fault, Option<Arc<str>>)> + Clone,
    ) -> Option<Fault> {
        let gone = |known: &Present| !current.clone().any(|(fault, _)| *fault == known.fault);
        let place = self.0.iter().position(gone)?;
        Some(self.0.remove(place).fault)
    }

    /// Those that are present, oldest first.
    pub fn present(&self) -> impl Iterator<Item = Fault> + Clone {
        self.0.iter().map(|known| known.fault)
    }

    /// The oldest fault that makes the robot stand, with its reason.
    #[must_use]
    pub fn stopping(&self) -> Option<(Fault, StopReason)> {
        self.present().find_map(|fault| stops(fault).map(|reason| (fault, reason)))
    }

    /// For the state.
    #[must_use]
    pub fn states(&self, now: Stamp) -> Vec<FaultState> {
        let state = |known: &Present| FaultState {
            fault: known.fault,
            age_ms: now.since_ms(known.since),
            detail: known.detail.clone(),
        };
        self.0.iter().map(state).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_silent_after_three_encoder_windows_and_named_within_200_ms() {
        let window_ms = xtb_control::VehicleConfig::default().encoder.window_s * 1000.0;
        assert!((3.0 * window_ms..195.0).contains(&(KIND_SILENT_MS as f64)), "{window_ms} ms");
        assert!(3.0 * window_ms < INPUT_LOST_MS as f64);
    }

    #[test]
    fn what_latches_stops_and_what_stops_without_a_latch_is_named_here() {
        assert_eq!(latch_of(Fault::BoardSilent), Some(Latch::BoardLost));
        assert_eq!(latch_of(Fault::GyroUnplugged), Some(Latch::GyroLost));
        for fault in [Fault::BoardFrozen, Fault::GyroFrozen, Fault::ConverterFrozen, Fault::InfraredFrozen] {
            assert_eq!(
                (latch_of(fault), stops(fault)),
                (Some(Latch::SensorFault), Some(StopReason::SensorFault))
            );
        }
        assert_eq!(stops(Fault::Runaway), Some(StopReason::Runaway));
        assert_eq!(stops(Fault::BatteryCritical), Some(StopReason::BatteryCritical));
        for (fault, reason) in
            [(Fault::Stalled, StopReason::Stalled), (Fault::RemoteLost, StopReason::RemoteLost)]
        {
            assert_eq!((latch_of(fault), stops(fault)), (None, Some(reason)));
        }
        let harmless = [Fault::BatteryLow, Fault::TiltOutOfRange, Fault::RecordingFailed];
        let of_the_pose = [Fault::OdometryScale, Fault::FixesFrozen, Fault::FixesContradict];
        for fault in harmless.into_iter().chain(of_the_pose) {
            assert_eq!((latch_of(fault), stops(fault)), (None, None));
        }
    }
}
