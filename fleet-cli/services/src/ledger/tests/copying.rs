//! Copies of a ledger: page by page, in pieces, over a snapshot, and when they are none.

use super::*;

/// Copies until there is nothing more, `most` bytes at a time; how the copy's last record stood at last.
fn follow(reader: &LedgerReader, copy: &mut Ledger<Value>, most: usize) -> CopyStanding {
    let mut begun = String::new();
    loop {
        let (last, sum) = (copy.last_seq(), copy.last_sum().unwrap());
        let (history, mut records) = reader.page(last, sum, begun.len() as u64, most).unwrap();
        if history == CopyStanding::Other || records.is_empty() {
            return history;
        }
        records[0].body.insert_str(0, &std::mem::take(&mut begun));
        if records[0].body.len() as u64 == records[0].bytes {
            copy.copy(records).unwrap();
        } else {
            begun = records.swap_remove(0).body;
        }
    }
}

#[test]
fn a_copy_has_the_same_records_under_the_same_numbers() {
    for most in [7, 100, 1 << 20] {
        let (place, other) = (Place::filled(20), Place::new());
        let (mut ledger, _) = place.open().unwrap();
        let reader = LedgerReader::open(&place.path()).unwrap();
        let (mut copy, _) = other.open().unwrap();
        assert_eq!(follow(&reader, &mut copy, most), CopyStanding::Same);
        assert_eq!(copy.last_seq(), 20);
        ledger.append(&[task(21)]).unwrap();
        assert_eq!(follow(&reader, &mut copy, most), CopyStanding::Same);
        drop(copy);
        assert_eq!(records(other.open().unwrap().1), tasks(21), "{most}");
    }
}

#[test]
fn a_snapshot_replaces_what_a_copy_has() {
    let (place, other) = (Place::filled(20), Place::new());
    let (mut ledger, _) = place.open().unwrap();
    let reader = LedgerReader::open(&place.path()).unwrap();
    let (mut copy, _) = other.open().unwrap();
    follow(&reader, &mut copy, 100);
    ledger.append(&[task(21)]).unwrap();
    ledger.compact(&task(22)).unwrap();
    ledger.append(&[task(23)]).unwrap();
    assert_eq!(reader.page(20, copy.last_sum().unwrap(), 0, 100).unwrap().0, CopyStanding::Replaced);
    follow(&reader, &mut copy, 100);
    drop(copy);
    let (copy, recovered) = other.open().unwrap();
    assert_eq!((copy.last_seq(), recovered.rows[0].seq, recovered.rows[0].snapshot), (23, 22, true));
    assert_eq!(records(recovered), [task(22), task(23)]);
}

#[test]
fn records_of_another_history_are_noticed_and_never_mixed() {
    let (place, other) = (Place::filled(5), Place::filled(4));
    let (_ledger, _) = place.open().unwrap();
    let reader = LedgerReader::open(&place.path()).unwrap();
    let (mut copy, _) = other.open().unwrap();
    copy.append(&[task(99)]).unwrap();
    assert_eq!(follow(&reader, &mut copy, 100), CopyStanding::Other);
    copy.append(&[task(6)]).unwrap();
    assert_eq!(follow(&reader, &mut copy, 100), CopyStanding::Other, "it is longer");
    let (_, records) = reader.page(0, 0, 0, 1000).unwrap();
    assert!(matches!(copy.copy(records).unwrap_err().fault, LedgerFault::Damaged(Damage::Gap { .. })));
    assert_eq!(copy.last_seq(), 6);
}

#[test]
fn a_file_says_whether_it_is_a_copy() {
    let place = Place::filled(1);
    let (mut ledger, _) = place.open().unwrap();
    assert_eq!(ledger.copy_id().unwrap(), None);
    ledger.set_copy_id(Some(1)).unwrap();
    ledger.set_copy_id(Some((1 << 48) - 1)).unwrap();
    drop(ledger);
    let (mut ledger, _) = place.open().unwrap();
    assert_eq!(ledger.copy_id().unwrap(), Some((1 << 48) - 1));
    ledger.set_copy_id(None).unwrap();
    assert_eq!(ledger.copy_id().unwrap(), None);
}
