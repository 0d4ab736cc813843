//! What a device has sent and nobody has read yet: bounded like the buffer of a serial port.

use crate::faults::InjectedLineFault;
use crate::rng::Rng;

/// About three seconds of either device.
const CAPACITY: usize = 4096;
/// No frame of either device is longer.
const MAX_FRAME: usize = 64;

/// Bytes on their way to the agent. When full, the oldest are dropped and counted: the reader finds
/// the next frame by its delimiter or check sum.
#[derive(Debug, Clone)]
pub(crate) struct Outbox {
    bytes: Vec<u8>,
    dropped: u64,
    fault: InjectedLineFault,
    noise: Rng,
    /// The frame at which the device froze.
    frozen: [u8; MAX_FRAME],
    frozen_len: usize,
}

impl Outbox {
    /// `noise` is for faults alone.
    pub(crate) fn new(noise: Rng) -> Self {
        Self {
            bytes: Vec::with_capacity(CAPACITY),
            dropped: 0,
            fault: InjectedLineFault::None,
            noise,
            frozen: [0; MAX_FRAME],
            frozen_len: 0,
        }
    }

    /// What happens to frames from now on.
    pub(crate) fn set_fault(&mut self, fault: InjectedLineFault) {
        self.fault = fault;
        self.frozen_len = 0;
    }

    pub(crate) fn fault(&self) -> InjectedLineFault {
        self.fault
    }

    /// One whole frame of the line's own device.
    pub(crate) fn send(&mut self, frame: &[u8]) {
        match self.fault {
            InjectedLineFault::None => self.pass(frame),
            InjectedLineFault::Silent | InjectedLineFault::WrongDevice => {}
            InjectedLineFault::Garbage => {
                for _ in frame {
                    let byte = self.noise.up_to(255) as u8;
                    self.pass(&[byte]);
                }
            }
            InjectedLineFault::HalfFrames => {
                let quarter = frame.len() / 4;
                self.pass(&frame[..quarter]);
                self.pass(&frame[frame.len() - quarter..]);
            }
            InjectedLineFault::Lossy(part) => {
                if !self.noise.chance(part) {
                    self.pass(frame);
                }
            }
            InjectedLineFault::Frozen => self.repeat_frozen(frame),
        }
    }

    fn repeat_frozen(&mut self, frame: &[u8]) {
        if self.frozen_len == 0 && frame.len() <= MAX_FRAME {
            self.frozen[..frame.len()].copy_from_slice(frame);
            self.frozen_len = frame.len();
        }
        let copy = self.frozen;
        self.pass(&copy[..self.frozen_len]);
    }

    /// Bytes past any fault.
    pub(crate) fn pass(&mut self, bytes: &[u8]) {
        let excess = (self.bytes.len() + bytes.len()).saturating_sub(CAPACITY);
        if excess > 0 {
            self.bytes.drain(..excess.min(self.bytes.len()));
            self.dropped += excess as u64;
        }
        self.bytes.extend_from_slice(bytes);
    }

    /// Moves everything to the end of `into`.
    pub(crate) fn take(&mut self, into: &mut Vec<u8>) {
        into.append(&mut self.bytes);
    }

    /// Bytes dropped so far.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outbox() -> Outbox {
        Outbox::new(Rng::new(2, 0))
    }

    /// What arrives of ten frames `0, 1, … 11` each.
    fn arrives(fault: InjectedLineFault) -> Vec<u8> {
        let (mut outbox, mut bytes) = (outbox(), Vec::new());
        outbox.set_fault(fault);
        let frame: Vec<u8> = (0..12).collect();
        (0..10).for_each(|_| outbox.send(&frame));
        outbox.take(&mut bytes);
        bytes
    }

    #[test]
    fn the_oldest_bytes_are_dropped_and_counted() {
        let mut outbox = outbox();
        for i in 0..=4096_u32 {
            outbox.send(&[(i % 251) as u8]);
        }
        let mut bytes = Vec::new();
        outbox.take(&mut bytes);
        assert_eq!((bytes.len(), bytes[0], outbox.dropped()), (4096, 1, 1));
        outbox.take(&mut bytes);
        assert_eq!(bytes.len(), 4096, "taken once only");
    }

    #[test]
    fn every_fault_does_to_frames_what_it_says() {
        let whole = arrives(InjectedLineFault::None);
        assert_eq!(whole.len(), 120);
        assert!(arrives(InjectedLineFault::Silent).is_empty());
        let garbage = arrives(InjectedLineFault::Garbage);
        assert!(garbage.len() == 120 && garbage != whole, "as many bytes");
        assert_eq!(arrives(InjectedLineFault::HalfFrames), [0, 1, 2, 9, 10, 11].repeat(10));
        assert_eq!(arrives(InjectedLineFault::Lossy(0.0)), whole);
        assert!(arrives(InjectedLineFault::Lossy(1.0)).is_empty());
        let some = arrives(InjectedLineFault::Lossy(0.5)).len();
        assert!(some > 12 && some < 108 && some.is_multiple_of(12), "whole frames: {some}");
    }

    #[test]
    fn a_frozen_device_repeats_one_frame_until_it_recovers() {
        let (mut outbox, mut bytes) = (outbox(), Vec::new());
        outbox.set_fault(InjectedLineFault::Frozen);
        (1..4).for_each(|i| outbox.send(&[i; 3]));
        outbox.set_fault(InjectedLineFault::None);
        outbox.send(&[9; 3]);
        outbox.take(&mut bytes);
        assert_eq!(bytes, [1, 1, 1, 1, 1, 1, 1, 1, 1, 9, 9, 9]);
    }
}
