//! Orders, updates, pauses, kills and lost answers in any order: nodes are driven once, in their order.

use crate::bench::Bench;
use proptest::prelude::*;
use xtb_vda5050::{Answer, Protocol};

#[derive(Debug, Clone)]
enum Step {
    /// The master sends its order as it is now, so many nodes longer.
    Extend(u32, u32),
    Repeat,
    Drive,
    Kill,
    /// An answer is lost, after it was carried out or before.
    Lose(bool),
    Pause,
    Unpause,
    Turns(u8),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        3 => (1_u32..4, 0_u32..3).prop_map(|(base, horizon)| Step::Extend(base, horizon)),
        1 => Just(Step::Repeat),
        4 => Just(Step::Drive),
        2 => Just(Step::Kill),
        2 => any::<bool>().prop_map(Step::Lose),
        1 => Just(Step::Pause),
        1 => Just(Step::Unpause),
        3 => (1_u8..30).prop_map(Step::Turns),
    ]
}

fn run(steps: Vec<Step>, protocol: Protocol) -> Result<(), TestCaseError> {
    let mut bench = Bench::new(protocol);
    let (mut base, mut update, mut actions) = (1, 0, 0);
    let mut message = bench.order("a", 0, 0, 1, 1);
    bench.send(&message);
    for step in steps {
        match step {
            Step::Extend(more, horizon) => {
                // A master goes on when its last update was accepted.
                if bench.state()["orderUpdateId"] == update {
                    update += 1;
                    message = bench.order("a", update, 2 * (base - 1), 1 + more + horizon, 1 + more);
                    base += more;
                    bench.vehicle.order(message.to_string().as_bytes());
                }
            }
            Step::Repeat => bench.vehicle.order(message.to_string().as_bytes()),
            Step::Drive => {
                bench.dispatcher.drive();
            }
            Step::Kill => bench.kill(),
            Step::Lose(carried_out) => {
                bench.silent = true;
                bench.turn();
                if let Some(ask) = bench.unanswered.take() {
                    if carried_out {
                        bench.dispatcher.ask(&ask);
                    }
                    bench.vehicle.answered(bench.now_ms, Answer::Unreachable("lost".to_owned()));
                }
                bench.silent = false;
            }
            Step::Pause | Step::Unpause => {
                actions += 1;
                let kind = if matches!(step, Step::Pause) { "startPause" } else { "stopPause" };
                bench.act(kind, &format!("i{actions}"), &serde_json::json!([]));
            }
            Step::Turns(turns) => (0..turns).for_each(|_| bench.turn()),
        }
    }
    bench.act("stopPause", "end", &serde_json::json!([]));
    for _ in 0..3 * base {
        bench.vehicle.robot(Some(&bench.robot), true);
        bench.vehicle.order(message.to_string().as_bytes());
        bench.run();
        bench.drive();
    }
    let expected: Vec<(f64, f64)> = (1..base).map(|x| (f64::from(x), 0.0)).collect();
    prop_assert_eq!(&bench.dispatcher.driven, &expected);
    prop_assert_eq!(bench.last().1, u64::from(2 * (base - 1)));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_node_is_driven_twice_and_none_is_left_out(steps in prop::collection::vec(step(), 1..40)) {
        run(steps, Protocol::V2_1)?;
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let mut bench = Bench::new(Protocol::V3_0);
        bench.vehicle.order(&bytes);
        bench.vehicle.instant_actions(&bytes);
        bench.run();
        prop_assert!(!bench.errors().is_empty());
    }
}
