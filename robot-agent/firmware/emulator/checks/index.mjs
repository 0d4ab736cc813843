// All checks by name, in the order in which they run.

import { bridge } from './bridge.mjs';
import { encoder } from './encoder.mjs';
import { garbage } from './garbage.mjs';
import { hang } from './hang.mjs';
import { imu } from './imu.mjs';
import { pulses } from './pulses.mjs';
import { ranges } from './ranges.mjs';
import { receiver } from './receiver.mjs';
import { setup } from './setup.mjs';
import { stop } from './stop.mjs';
import { watchdog } from './watchdog.mjs';

export const CHECKS = { pulses, watchdog, setup, encoder, ranges, receiver, stop, imu, hang, garbage, bridge };
