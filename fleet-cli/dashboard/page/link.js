// The WebSocket to the dashboard's server: connects again by itself, answers frames, sends commands.
// Nothing is kept for later: what cannot be sent now is not sent.

const AGAIN_MS = [250, 500, 1000, 2000];
const ANSWER_WITHIN_MS = 15_000;
const CONGESTED_BYTES = 4096; // more than this unsent: a setpoint would arrive late

export class Link {
  #socket = null;
  #tries = 0;
  #next = 1;
  #waiting = new Map(); // id → {resolve, timer}
  #url;
  #told;
  openedMs = null; // when the socket was opened last

  // `told`: {open(), message(kindObject), closed()}
  constructor(url, told) {
    this.#url = url;
    this.#told = told;
    this.#connect();
  }

  get open() {
    return this.#socket !== null && this.#socket.readyState === WebSocket.OPEN;
  }

  send(message) {
    if (!this.open) return false;
    this.#socket.send(JSON.stringify(message));
    return true;
  }

  // A setpoint goes out at once or never.
  setpoint(setpoint) {
    if (!this.open || this.#socket.bufferedAmount > CONGESTED_BYTES) return false;
    this.#socket.send(JSON.stringify({ setpoint }));
    return true;
  }

  // Sends a command; resolves to {ok} or {error: {message, hint}}, never rejects.
  command(command) {
    const id = this.#next++;
    if (!this.send({ do: { id, command } })) {
      return Promise.resolve({ error: { message: "not sent: no connection to the dashboard", hint: null } });
    }
    return new Promise((resolve) => {
      const late = { message: "no answer: outcome unknown", hint: "check the robot" };
      const timer = setTimeout(() => this.#answer({ id, error: late }), ANSWER_WITHIN_MS);
      this.#waiting.set(id, { resolve, timer });
    });
  }

  #answer(answer) {
    const waiting = this.#waiting.get(answer.id);
    if (!waiting) return;
    this.#waiting.delete(answer.id);
    clearTimeout(waiting.timer);
    waiting.resolve(answer);
  }

  #connect() {
    const socket = new WebSocket(this.#url);
    this.#socket = socket;
    socket.addEventListener("open", () => {
      this.#tries = 0;
      this.openedMs = performance.now();
      this.#told.open();
    });
    socket.addEventListener("message", (event) => {
      const message = JSON.parse(event.data);
      if (message.answer) this.#answer(message.answer);
      else this.#told.message(message);
    });
    socket.addEventListener("close", () => {
      const lost = { message: "connection lost: outcome unknown", hint: null };
      for (const id of [...this.#waiting.keys()]) this.#answer({ id, error: lost });
      this.#told.closed();
      const wait = AGAIN_MS[Math.min(this.#tries++, AGAIN_MS.length - 1)];
      setTimeout(() => this.#connect(), wait);
    });
  }
}
