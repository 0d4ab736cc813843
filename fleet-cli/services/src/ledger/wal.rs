//! Reads SQLite's log (`LEDGER-wal`) before SQLite does, for damage that SQLite takes for an end.
//!
//! SQLite plays the log back up to the first page whose check sum is wrong, and forgets the rest: right for
//! the torn end that a power cut leaves, and a silent loss if a byte in the middle went bad. The two can
//! be told apart: every commit is on the disk before the next begins. So if behind the broken place a
//! commit ends and another page follows, what is broken had been on the disk.
//! The format is described at <https://www.sqlite.org/fileformat2.html#the_write_ahead_log>.

use super::error::{Damage, LedgerFault};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

const HEAD: u64 = 32;
const FRAME_HEAD: usize = 24;
/// The magic number of a log whose check sums read words as little-endian; with the last bit, big-endian.
const MAGIC: u32 = 0x377f_0682;

/// Looks a log through; none, an empty one and one with a torn end are fine.
pub(super) fn check(log: &Path) -> Result<(), LedgerFault> {
    let file = match File::open(log) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(LedgerFault::io("opening the log", error)),
    };
    let length = file.metadata().map_err(|error| LedgerFault::io("opening the log", error))?.len();
    match look(BufReader::new(file), length).map_err(|error| LedgerFault::io("reading the log", error))? {
        Some(damage) => Err(LedgerFault::Damaged(damage)),
        None => Ok(()),
    }
}

fn look(mut log: impl Read, length: u64) -> io::Result<Option<Damage>> {
    let mut head = [0; HEAD as usize];
    if length < HEAD {
        return Ok(None); // Nothing was written behind a head that is not there.
    }
    log.read_exact(&mut head)?;
    let Some((order, page_bytes, seed)) = read_head(&head) else {
        // The head is on the disk before the first page is written.
        let pages = (length - HEAD) / (FRAME_HEAD as u64 + 512);
        return Ok((pages > 0).then_some(Damage::LogHead { pages }));
    };
    let salts: [u8; 8] = array(&head[16..24]);
    let mut sum = seed;
    let mut frame = vec![0; FRAME_HEAD + page_bytes];
    let (mut page, mut broken, mut ended) = (0, None, false);
    loop {
        let filled = fill(&mut log, &mut frame)?;
        if filled < FRAME_HEAD {
            return Ok(None);
        }
        page += 1;
        let ours = frame[8..16] == salts;
        if broken.is_none() {
            sum = order.sum(order.sum(sum, &frame[..8]), &frame[FRAME_HEAD..]);
            let whole = filled == frame.len() && word(&frame, 0) != 0;
            let right = (word(&frame, 16), word(&frame, 20)) == sum;
            if !(whole && ours && right) {
                broken = Some(page);
            }
        } else if let (true, true, Some(page)) = (ours, ended, broken) {
            return Ok(Some(Damage::Log { page }));
        }
        ended |= broken.is_some() && ours && word(&frame, 4) != 0;
    }
}

/// Order of words, length of a page and check sum; none if the head is not right.
fn read_head(head: &[u8; HEAD as usize]) -> Option<(Order, usize, (u32, u32))> {
    let order = match word(head, 0) {
        MAGIC => Order::Little,
        magic if magic == MAGIC | 1 => Order::Big,
        _ => return None,
    };
    let page_bytes = word(head, 8) as usize;
    let sum = order.sum((0, 0), &head[..24]);
    let right = (word(head, 24), word(head, 28)) == sum;
    let sized = page_bytes.is_power_of_two() && (512..=65536).contains(&page_bytes);
    (right && sized).then_some((order, page_bytes, sum))
}

#[derive(Clone, Copy)]
enum Order {
    Little,
    Big,
}

impl Order {
    fn sum(self, seed: (u32, u32), bytes: &[u8]) -> (u32, u32) {
        let read = |bytes: &[u8]| match self {
            Self::Little => u32::from_le_bytes(array(bytes)),
            Self::Big => u32::from_be_bytes(array(bytes)),
        };
        bytes.chunks_exact(8).fold(seed, |(a, b), pair| {
            let a = a.wrapping_add(read(&pair[..4])).wrapping_add(b);
            (a, b.wrapping_add(read(&pair[4..])).wrapping_add(a))
        })
    }
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_be_bytes(array(&bytes[at..at + 4]))
}

fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    std::array::from_fn(|n| bytes[n])
}

/// As much as there is; less than the buffer only at the end.
fn fill(log: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match log.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(read) => filled += read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}
