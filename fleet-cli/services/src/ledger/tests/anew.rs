//! Beginning anew: nothing of the ledger of before is lost, and nothing else is moved.

use super::*;

/// 2026-11-22, 16:15.
const NOW_MS: u64 = 1_795_364_100_000;

type Anew = Result<(Ledger<Value>, Option<PathBuf>), LedgerError>;

fn anew(place: &Place) -> Anew {
    Ledger::begin_anew(&place.path(), "lab", NOW_MS)
}

fn read_aside(place: &Place, aside: &Path) -> Vec<Value> {
    let (_, recovered) = Ledger::<Value>::create_or_open(aside, "lab").unwrap();
    assert_eq!(aside.parent(), place.path().parent());
    records(recovered)
}

#[test]
fn the_ledger_of_before_is_kept_whole_under_a_name_with_its_date() {
    let place = Place::filled(3);
    let (mut ledger, aside) = anew(&place).unwrap();
    assert_eq!(ledger.append(&[task(1)]).unwrap(), 1, "numbers begin again");
    let aside = aside.unwrap();
    assert_eq!(aside.file_name().unwrap().to_str(), Some("lab.before-20261122T161500Z.ledger"));
    assert_eq!(read_aside(&place, &aside), tasks(3));
    drop(ledger);
    assert_eq!(records(place.open().unwrap().1), tasks(1));
    let (_, second) = anew(&place).unwrap();
    assert_eq!(second.unwrap().file_name().unwrap().to_str(), Some("lab.before-20261122T161500Z-2.ledger"));
}

#[test]
fn a_log_that_a_kill_left_behind_goes_with_its_ledger() {
    let place = Place::filled(3);
    let kept = tempfile::tempdir_in(place.folder.path()).unwrap();
    let (mut ledger, _) = place.open().unwrap();
    ledger.append(&[task(4)]).unwrap();
    // As a kill leaves it: with a log, unlocked.
    for end in ["", "-wal"] {
        let name = format!("lab.ledger{end}");
        fs::copy(place.beside(end), kept.path().join(name)).unwrap();
    }
    drop(ledger);
    let path = kept.path().join("lab.ledger");
    assert!(fs::metadata(beside(&path, "-wal")).unwrap().len() > 0);
    let (_, aside) = Ledger::<Value>::begin_anew(&path, "lab", NOW_MS).unwrap();
    let (_, recovered) = Ledger::<Value>::create_or_open(&aside.unwrap(), "lab").unwrap();
    assert_eq!(records(recovered), tasks(4));
}

#[test]
fn where_none_was_a_new_one_is_nothing_special() {
    let place = Place::new();
    let (ledger, aside) = anew(&place).unwrap();
    assert_eq!((ledger.last_seq(), aside), (0, None));
}

#[test]
fn a_damaged_one_and_one_that_is_gone_do_not_keep_it_from_beginning() {
    let place = Place::filled(3);
    let mut bytes = fs::read(place.path()).unwrap();
    let half = bytes.len() / 2;
    bytes[half..].fill(0xff);
    fs::write(place.path(), &bytes).unwrap();
    assert!(place.open().is_err());
    let (ledger, aside) = anew(&place).unwrap();
    drop(ledger);
    assert_eq!(fs::read(aside.unwrap()).unwrap(), bytes);
    fs::remove_file(place.path()).unwrap();
    fs::write(place.beside("-lock"), "").unwrap();
    assert!(anew(&place).is_ok());
}

#[test]
fn what_is_held_another_fleets_or_no_ledger_is_not_moved() {
    let place = Place::filled(1);
    let held = place.open().unwrap();
    assert!(matches!(anew(&place).unwrap_err().fault, LedgerFault::Held { .. }));
    drop(held);
    let other = Ledger::<Value>::begin_anew(&place.path(), "barn", NOW_MS).unwrap_err();
    assert!(matches!(other.fault, LedgerFault::OtherFleet { .. }), "{other}");
    assert_eq!(records(place.open().unwrap().1), tasks(1));
    let letter = Place::new();
    fs::write(letter.path(), "Dear Sir or Madam, ".repeat(20)).unwrap();
    assert!(matches!(anew(&letter).unwrap_err().fault, LedgerFault::NotALedger { .. }));
    assert!(fs::read_to_string(letter.path()).unwrap().starts_with("Dear"));
}

/// A kill between the steps leaves what the next start refuses, and what beginning anew goes on from.
#[test]
fn a_kill_in_between_loses_nothing() {
    let place = Place::filled(2);
    fs::rename(place.path(), place.beside(".moved")).unwrap();
    assert!(matches!(place.fault(), LedgerFault::Gone { acknowledged: 2 }));
    assert!(anew(&place).is_ok());
    assert_eq!(place.open().unwrap().0.last_seq(), 0);
}
