// Timer: rp2040js 1.4.1 cuts the fraction of a µs off an alarm's distance, so that it fires up to 1 µs
// before the counter has the alarm's value, and who then looks at the counter finds it too early.

const ALARM0 = 0x10, ALARM3 = 0x1c;

/** Lets alarms fire when the counter reaches their value. */
export function timerAlarms(timer) {
  const write = timer.writeUint32;
  timer.writeUint32 = (offset, value) => {
    write.call(timer, offset, value);
    if (offset >= ALARM0 && offset <= ALARM3) {
      const counter = Math.floor(timer.clock.nanos / 1000);
      const micros = (value - counter) >>> 0;
      timer.alarms[(offset - ALARM0) / 4].clockAlarm.schedule((counter + micros) * 1000 - timer.clock.nanos);
    }
  };
}
