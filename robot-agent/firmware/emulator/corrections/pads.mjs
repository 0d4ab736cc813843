// Pads: after a reset they have 0x56 (input enabled, pull-down, Schmitt trigger, 4 mA; RP2040 data
// sheet, 2.19.6.3); rp2040js 1.4.1 begins with 0x36, whose inputs are dead.

const AFTER_RESET = 0x56;

/** Gives the pins their pads as after a reset. */
export function padsAfterReset(gpio) {
  for (const pin of gpio) pin.padValue = AFTER_RESET;
}
