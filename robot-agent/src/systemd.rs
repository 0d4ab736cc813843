//! What systemd is told of this robot: that it is under control (`Type=notify`), and that its control loop turns
//! (`WatchdogSec=`), so that a loop that hangs is restarted. Without systemd nobody is told anything.
//!
//! The loop's sign of life is its snapshot, 20 a second: whatever the other threads do, a loop that hangs makes none.

use sd_notify::NotifyState;
use std::time::Duration;
use tokio::sync::watch;

/// Between two signs of life where systemd waits for none.
const UNWATCHED: Duration = Duration::from_secs(10);

/// Tells systemd of the loop that makes these `snapshots`, to its end.
pub(crate) async fn follow<T>(snapshots: watch::Receiver<T>) {
    if std::env::var_os("NOTIFY_SOCKET").is_none() {
        return;
    }
    let pause = sd_notify::watchdog_enabled().map_or(UNWATCHED, |limit| limit / 4);
    relay(snapshots, pause, tell).await;
}

type States = &'static [NotifyState<'static>];

/// On a thread for what may block: a systemd that does not read must not keep Zenoh waiting.
async fn tell(states: States) {
    let told = tokio::task::spawn_blocking(move || sd_notify::notify(states)).await;
    if let Ok(Err(error)) = told {
        tracing::warn!("systemd cannot be told: {error}");
    }
}

/// At most one sign of life in each `pause`, and none without a new snapshot.
async fn relay<T, Told: Future<Output = ()>>(
    mut snapshots: watch::Receiver<T>,
    pause: Duration,
    tell: impl Fn(States) -> Told,
) {
    let mut states: States = &[NotifyState::Ready, NotifyState::Watchdog];
    while snapshots.changed().await.is_ok() {
        tell(states).await;
        states = &[NotifyState::Watchdog];
        tokio::time::sleep(pause).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::sync::mpsc;

    #[tokio::test]
    async fn each_snapshot_is_a_sign_of_life_and_without_one_there_is_none() {
        for snapshots in [0, 1, 4] {
            let (turns, seen) = watch::channel(0);
            let (tells, mut told) = mpsc::unbounded_channel();
            let relay = tokio::spawn(relay(seen, Duration::from_millis(1), move |states: States| {
                let words = states.iter().map(ToString::to_string).collect::<Vec<_>>();
                let _ = tells.send(words.join(" "));
                std::future::ready(())
            }));
            let mut heard = Vec::new();
            for number in 1..=snapshots {
                turns.send_replace(number);
                heard.push(told.recv().await.unwrap());
            }
            drop(turns);
            while let Some(words) = told.recv().await {
                heard.push(words);
            }
            relay.await.unwrap();
            let all = ["READY=1 WATCHDOG=1", "WATCHDOG=1", "WATCHDOG=1", "WATCHDOG=1"];
            assert_eq!(heard, all[..snapshots]);
        }
    }
}
