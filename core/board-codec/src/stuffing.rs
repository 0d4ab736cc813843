//! Consistent overhead byte stuffing (S. Cheshire and M. Baker, SIGCOMM 1997) of bodies shorter than 254 bytes: what
//! was a zero says how far the next one is.
//!
//! The crate `cobs` does the same for bodies of any length and judges this in the tests; it looks at each byte of a
//! frame by a state machine, which cost a simulated fleet 4 % of its time.

use crate::{MAX_BODY, MAX_FRAME};

const _: () = assert!(MAX_BODY < 254);

/// Writes a body without zeros, from the second byte on; the first says where the first zero was. Its length.
#[inline]
pub(crate) fn encode(body: &[u8], frame: &mut [u8; MAX_FRAME]) -> usize {
    let len = body.len() + 1;
    frame[1..len].copy_from_slice(body);
    let mut code_at = 0;
    for (zero_at, _) in body.iter().enumerate().filter(|(_, byte)| **byte == 0) {
        frame[code_at] = (zero_at + 1 - code_at) as u8;
        code_at = zero_at + 1;
    }
    frame[code_at] = (len - code_at) as u8;
    len
}

/// Reads a body of one byte less than the frame, which has at most [`MAX_FRAME`]; `None` if it is none.
#[inline]
pub(crate) fn decode(frame: &[u8], body: &mut [u8; MAX_FRAME]) -> Option<usize> {
    let (first, rest) = frame.split_first()?;
    body[..rest.len()].copy_from_slice(rest);
    let (mut code, mut zero_at) = (*first, 0);
    while code > 0 {
        zero_at += usize::from(code);
        if zero_at >= frame.len() {
            return (zero_at == frame.len()).then_some(rest.len());
        }
        code = frame[zero_at];
        body[zero_at - 1] = 0;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::collection::vec;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_frame_is_that_of_the_crate_cobs(body in vec(prop_oneof![Just(0_u8), any::<u8>()], 1..=MAX_BODY)) {
            let (mut ours, mut theirs) = ([0; MAX_FRAME], [0; MAX_FRAME]);
            let len = encode(&body, &mut ours);
            prop_assert_eq!(len, cobs::encode(&body, &mut theirs));
            prop_assert_eq!(&ours[..len], &theirs[..len]);
            let mut back = [0; MAX_FRAME];
            prop_assert_eq!(decode(&ours[..len], &mut back), Some(body.len()));
            prop_assert_eq!(&back[..body.len()], &body[..]);
        }

        #[test]
        fn the_crate_cobs_takes_the_same_bytes(frame in vec(prop_oneof![1..5_u8, 1..=255_u8], 1..=MAX_FRAME)) {
            let (mut ours, mut theirs) = ([0; MAX_FRAME], [0; MAX_FRAME]);
            let (len, judged) = (decode(&frame, &mut ours), cobs::decode(&frame, &mut theirs).ok());
            prop_assert_eq!(len, judged);
            prop_assert_eq!(&ours[..len.unwrap_or(0)], &theirs[..judged.unwrap_or(0)]);
        }
    }

    #[test]
    fn neither_an_empty_frame_nor_one_with_a_zero_is_read() {
        let mut body = [0; MAX_FRAME];
        assert_eq!((decode(&[], &mut body), decode(&[0], &mut body)), (None, None));
        assert_eq!(decode(&[1, 0], &mut body), None);
    }
}
