//! Whole bring-ups: scripted trucks and people without lines, and simulated trucks on their lines.

mod runs;
mod scripted;

use super::session::{Event, Session, Then};
use super::*;
use scripted::{Fake, Person as Scripted};
use std::collections::BTreeSet;
use xtb_control::VehicleConfig;
use xtb_control::vehicle::{Drivetrain, Platform};

fn small() -> VehicleConfig {
    let mut vehicle =
        VehicleConfig { platform: Platform::Off, drivetrain: Drivetrain::FrontAxle, ..Default::default() };
    vehicle.range_finders.front.0.truncate(2);
    vehicle.range_finders.rear.0.truncate(1);
    vehicle
}

fn report(vehicle: &VehicleConfig) -> Report {
    let mut report = Report::new("xtb-1", "1.0.0");
    report.begin("1.0.0", vehicle, &steps(vehicle));
    report.keep_private("/dev/serial/by-id/usb-1", "the board's port");
    report
}

/// What the steps have come to, as `name: outcome`, in their order.
fn outcomes(report: &Report) -> Vec<(String, String)> {
    let json: serde_json::Value = serde_json::from_str(&report.json()).unwrap();
    let entry = |entry: &serde_json::Value| {
        (entry["step"].as_str().unwrap().to_owned(), entry["outcome"].as_str().unwrap().to_owned())
    };
    json["steps"].as_array().unwrap().iter().map(entry).collect()
}

/// Runs a session to its end; the report, and everything that was said.
fn run(session: &mut Session, fake: &mut Fake, person: &mut Scripted) -> String {
    let (mut event, mut said) = (Event::Begin, String::new());
    for _ in 0..2_000_000 {
        let next = session.on(event);
        said += &next.say;
        event = match next.then {
            Then::End => return said,
            Then::GoOn => Event::Look(Box::new(fake.look())),
            Then::Look(chore) => {
                fake.begin(chore);
                Event::Look(Box::new(fake.look()))
            }
            Then::Answer(question) => person.answer(&question, fake),
            Then::Decide => person.decide(),
            Then::Check => Event::Did(fake.does("check")),
            Then::Move(motion) => Event::Did(fake.moves(motion)),
            Then::Calibrate(what) => Event::Did(fake.does(&format!("calibrate-{what}"))),
            Then::Write(_) => Event::Did(Ok("written".into())),
        };
    }
    panic!("no end:\n{said}");
}

#[test]
fn every_single_fault_fails_its_own_step_and_no_other() {
    let vehicle = small();
    let plan = steps(&vehicle);
    for broken in &plan {
        let id = broken.id();
        if id == "measures" || id == "board" {
            continue; // cannot fail by itself here; a lost board fails everything (below)
        }
        let mut session = Session::new(vehicle.clone(), report(&vehicle), plan.clone(), 20.0);
        let mut fake = Fake::new(vehicle.clone(), [id.clone()].into());
        run(&mut session, &mut fake, &mut Scripted::truthful());
        let bad: Vec<_> =
            outcomes(session.report()).into_iter().filter(|(_, outcome)| outcome != "passed").collect();
        assert_eq!(bad, [(id, "failed".to_owned())]);
        assert!(!session.report().is_complete());
    }
}

#[test]
fn any_number_of_faults_and_wrong_answers_ends_with_exactly_these_steps_failed() {
    for seed in 0..200 {
        let vehicle = if seed % 2 == 0 { small() } else { VehicleConfig::default() };
        let plan = steps(&vehicle);
        let mut person = Scripted::hasty(seed);
        let can_fail = |id: &String| id != "measures" && id != "board";
        let all = plan.iter().map(|step| step.id()).filter(can_fail);
        let broken: BTreeSet<_> = all.filter(|_| person.chance(0.1)).collect();
        let mut fake = Fake::new(vehicle.clone(), broken.clone());
        let mut session = Session::new(vehicle.clone(), report(&vehicle), plan.clone(), 20.0);
        run(&mut session, &mut fake, &mut person);
        let outcomes = outcomes(session.report());
        assert_eq!(outcomes.len(), plan.len(), "seed {seed}");
        for (id, outcome) in outcomes {
            let expected = if broken.contains(&id) { "failed" } else { "passed" };
            assert_eq!(outcome, expected, "seed {seed}, {id}");
        }
    }
}

#[test]
fn a_bring_up_that_is_broken_off_anywhere_goes_on_there_and_comes_to_the_same() {
    let vehicle = small();
    let plan = steps(&vehicle);
    for seed in 0..60 {
        let mut so_far = report(&vehicle);
        let mut runs = 0;
        while !so_far.is_complete() {
            runs += 1;
            assert!(runs < 200, "seed {seed}: no progress");
            let open: Vec<_> = plan.iter().copied().filter(|step| !so_far.is_well(&step.id())).collect();
            let mut session = Session::new(vehicle.clone(), so_far, open, 20.0);
            let mut person = Scripted::who_quits(seed * 1000 + runs, 0.2);
            run(&mut session, &mut Fake::new(vehicle.clone(), BTreeSet::new()), &mut person);
            // As if the program had ended: only the file stays.
            so_far = Report::read(&session.report().json()).unwrap();
            so_far.begin("1.0.0", &vehicle, &plan);
        }
        assert!(runs > 1 || seed > 0, "somebody quits");
        assert_eq!(outcomes(&so_far).len(), plan.len());
    }
}

#[test]
fn a_board_that_is_lost_fails_the_step_by_its_fault_and_no_port_is_told_to_others() {
    let vehicle = small();
    let mut session = Session::new(vehicle.clone(), report(&vehicle), [Step::Encoder, Step::Yaw], 20.0);
    let mut fake = Fake::new(vehicle, BTreeSet::new());
    fake.lost_after_s = Some(0.2);
    let said = run(&mut session, &mut fake, &mut Scripted::truthful());
    assert!(said.contains("FAILED: board_unplugged: /dev/serial/by-id/usb-1: no such device"), "{said}");
    for text in [session.report().json(), session.report().text()] {
        assert!(text.contains("board_unplugged: the board's port: no such device"), "{text}");
        assert!(!text.contains("/dev"), "{text}");
    }
    assert_eq!(outcomes(session.report()).len(), 2);
}

#[test]
fn a_gyro_that_is_lost_is_nobodys_business_but_the_yaws() {
    let vehicle = small();
    let plan = steps(&vehicle);
    let mut session = Session::new(vehicle.clone(), report(&vehicle), plan, 20.0);
    let mut fake = Fake::new(vehicle, BTreeSet::new());
    fake.gyro_lost = true;
    let said = run(&mut session, &mut fake, &mut Scripted::truthful());
    let bad: Vec<_> =
        outcomes(session.report()).into_iter().filter(|(_, outcome)| outcome != "passed").collect();
    assert_eq!(bad, [("yaw".to_owned(), "failed".to_owned())]);
    assert!(said.contains("FAILED: gyro_silent"), "{said}");
}

#[test]
fn what_is_mended_passes_when_it_is_tried_again() {
    let vehicle = small();
    let mut session = Session::new(vehicle.clone(), report(&vehicle), [Step::Encoder], 20.0);
    let mut fake = Fake::new(vehicle, ["encoder".to_owned()].into());
    fake.mends_after_s = Some(15.0);
    let said = run(&mut session, &mut fake, &mut Scripted::who_tries_again());
    assert!(said.contains("FAILED: 0 of 255 pulses") && said.contains("ok: some"), "{said}");
    let json: serde_json::Value = serde_json::from_str(&session.report().json()).unwrap();
    assert_eq!((&json["steps"][0]["outcome"], &json["steps"][0]["tries"]), (&"passed".into(), &2.into()));
}

#[test]
fn a_neighbour_that_answers_a_reversed_axis_and_a_missing_receiver_are_named() {
    let vehicle = VehicleConfig::default();
    let place = plan::Place { is_rear: false, slot: 2 };
    let steps =
        [Step::Range(place), Step::Yaw, Step::Pitch, Step::Stick(plan::Stick::Steering), Step::Selector];
    let mut session = Session::new(vehicle.clone(), report(&vehicle), steps, 20.0);
    let mut fake = Fake::new(vehicle, BTreeSet::new());
    (fake.swapped, fake.reversed, fake.no_receiver) = (true, true, true);
    let said = run(&mut session, &mut fake, &mut Scripted::truthful());
    for words in [
        "front 4 sees it, front 3 does not",
        "a turn to the right for one to the left",
        "it reads the other way round",
        "not fitted: the board has no receiver",
    ] {
        assert!(said.contains(words), "{words} is missing from\n{said}");
    }
}

#[test]
fn without_anybody_to_answer_nothing_moves() {
    let vehicle = small();
    let plan = steps(&vehicle);
    let mut session = Session::new(vehicle.clone(), report(&vehicle), plan, 20.0);
    let mut fake = Fake::new(vehicle, BTreeSet::new());
    let said = run(&mut session, &mut fake, &mut Scripted::gone());
    assert!(said.contains("The input ended") && fake.moved == 0, "{said}");
}

#[test]
fn a_report_of_another_format_or_with_nonsense_is_refused() {
    let text = report(&small()).json();
    assert!(Report::read(&text).is_ok());
    let error = Report::read(&text.replace("\"format\": 1", "\"format\": 7")).unwrap_err();
    assert!(error.contains('7'), "{error}");
    assert!(Report::read("{").is_err());
}
