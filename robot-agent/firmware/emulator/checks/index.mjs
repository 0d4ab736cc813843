// All checks, in the order in which they run.

export { pulses } from './pulses.mjs';
export { watchdog } from './watchdog.mjs';
export { setup } from './setup.mjs';
export { encoder } from './encoder.mjs';
export { ranges } from './ranges.mjs';
export { receiver } from './receiver.mjs';
export { stop } from './stop.mjs';
export { imu } from './imu.mjs';
export { garbage } from './garbage.mjs';
export { hang } from './hang.mjs';
