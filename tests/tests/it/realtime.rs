//! `robot-agent --realtime`: what the factsheet says is what the system does.

use fleet_tests::processes::{Process, RouterProcess, program};
use fleet_tests::{eventually, name};
use robot_agent::realtime::PRIORITY;
use std::process::Command;
use std::time::Duration;
use xtb_bus::SessionRole;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{About, REALTIME_OFF, REALTIME_ON};

/// The kernel's number for `SCHED_FIFO`.
const FIFO: u32 = 1;
const ASK_WITHIN: Duration = Duration::from_secs(1);

/// A thread of a process with a real-time priority.
#[derive(Debug, PartialEq, Eq)]
struct Prioritized {
    name: String,
    priority: u32,
}

/// Those of a process; any policy but `SCHED_FIFO` is none.
fn prioritized(process: &Process) -> Vec<Prioritized> {
    let tasks = std::fs::read_dir(format!("/proc/{}/task", process.0.id())).unwrap();
    let thread = |stat: &str| {
        // 20 (control-xtb-1) S 19 …: the state is the third field.
        let (name, rest) = stat.split_once('(')?.1.rsplit_once(") ")?;
        let field = |number: usize| rest.split_whitespace().nth(number - 3)?.parse::<u32>().ok();
        let (priority, policy) = (field(40)?, field(41)?);
        (policy == FIFO).then(|| Prioritized { name: name.to_owned(), priority })
    };
    // A thread may end meanwhile.
    let stats = tasks.filter_map(|task| std::fs::read_to_string(task.ok()?.path().join("stat")).ok());
    stats.filter_map(|stat| thread(&stat)).collect()
}

/// An agent that is on the network, and its factsheet.
async fn agent(router: &RouterProcess, flags: &[&str]) -> (Process, About) {
    let mut command = Command::new(program("robot-agent"));
    command.args(["--hardware", "simulated", "--connect", router.endpoint()]).args(flags);
    let process = Process::start(&mut command);
    let role = SessionRole::Client { connect: vec![router.endpoint().to_owned()] };
    let bus = eventually("a session", || async { xtb_bus::open(&role).await.ok() }).await;
    let key = FleetKeys::new(name("lab")).robot(&name("xtb-1")).about();
    let about = eventually("the factsheet", || async {
        bus.get(&key, ASK_WITHIN).await.ok()?.first()?.decode::<About>().ok()
    })
    .await;
    bus.close().await;
    (process, about)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_loops_thread_alone_has_the_priority_that_the_factsheet_says_or_the_refusal_is_named() {
    let router = RouterProcess::start(None);
    let (process, about) = agent(&router, &["--realtime"]).await;
    let said = about.realtime().unwrap();
    let [refused, unlocked] = ["SCHED_FIFO refused: ", "memory not locked: "].map(|what| said.contains(what));
    assert_eq!(said == REALTIME_ON, !refused && !unlocked, "{said}");
    let thread = || Prioritized { name: "control-xtb-1".into(), priority: PRIORITY.into() };
    let expected: Vec<_> = (!refused).then(thread).into_iter().collect();
    assert_eq!(prioritized(&process), expected, "{said}");
    assert_eq!(process.locked_memory_kib() == 0, unlocked, "{said}");
}

#[tokio::test(flavor = "multi_thread")]
async fn without_the_flag_no_thread_is_prioritized_and_no_memory_locked() {
    let router = RouterProcess::start(None);
    let (process, about) = agent(&router, &[]).await;
    assert_eq!(about.realtime(), Some(REALTIME_OFF));
    assert_eq!(prioritized(&process), []);
    assert_eq!(process.locked_memory_kib(), 0);
}
