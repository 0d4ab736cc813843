// PWM EN: rp2040js 1.4.1 reads it as 0, so that setting one bit through the register's SET alias
// switches all other slices off.

const EN = 0xa0, CSR_EN = 1;

/** Lets EN be read. */
export function pwmEnable(pwm) {
  const read = pwm.readUint32;
  pwm.readUint32 = (offset) =>
    offset === EN
      ? pwm.channels.reduce((bits, { csr }, slice) => bits | (csr & CSR_EN ? 1 << slice : 0), 0)
      : read.call(pwm, offset);
}
