// The speed limit of all robots: a number and a button.

import { html, nothing } from "./vendor/lit-html.js";

const limit = { mps: 0.2, said: "", pending: false };

// `send(mps)` asks every robot, and gives {ok: {set, refused}, error}.
export function speedLimit(store, send, changed) {
  if (!store.writable()) return nothing;
  const submit = async (event) => {
    event.preventDefault();
    limit.pending = true;
    changed();
    const { ok, error } = await send(limit.mps);
    [limit.pending, limit.said] = [false, error ? error.message : outcome(ok)];
    changed();
  };
  const typed = (event) => { limit.mps = event.target.valueAsNumber; };
  return html`<form @submit=${submit}>
    <label for="speed-limit">Speed limit</label>
    <input id="speed-limit" type="number" min="0.1" max="1" step="0.05" required .value=${limit.mps.toFixed(2)}
      @input=${typed}> m/s
    <button type="submit" ?disabled=${limit.pending} title="Of all robots, until they restart">Set for all</button>
    <span role="status">${limit.said}</span>
  </form>`;
}

function outcome({ set, refused }) {
  const left = Object.entries(refused).map(([robot, why]) => `${robot}: ${why}`);
  return [`set on ${set.length}`, ...left].join("; ");
}
