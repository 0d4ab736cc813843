// WFI: an interrupt that is pending already (PRIMASK holds it back) lets the core go on at once;
// rp2040js 1.4.1 sleeps until the next new one, which may be never.

/** Whether the core really sleeps; wakes it if an interrupt is pending. */
export function isAsleep(core) {
  if (core.waiting && core.pendingInterrupts & core.enabledInterrupts) core.waiting = false;
  return core.waiting;
}
