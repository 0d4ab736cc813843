// Watchdog: in rp2040js 1.4.1 its alarm arms itself again for the very moment at which it fired, so
// that the clock never gets past it. On the chip the reset stops it.

/** Lets the watchdog fire once. */
export function watchdogFiresOnce(watchdog) {
  const { alarm, timer } = watchdog;
  const fired = alarm.callback;
  alarm.callback = () => {
    timer.enable = false;
    alarm.enable = false;
    fired();
  };
}
