// PWM inputs: in rp2040js 1.4.1 `gpioOnInput` says `direction && 1 << pin` where `&` is meant, so with
// any output at all no slice sees an edge of its B pin.

/** Lets slices count edges and levels of pins that are inputs. */
export function pwmInputs(pwm) {
  pwm.gpioOnInput = (pin) => {
    if (pwm.gpioDirection & (1 << pin)) return;
    for (const channel of pwm.channels) {
      if (channel.pinB1 === pin || channel.pinB2 === pin) channel.gpioBChanged();
    }
  };
}
