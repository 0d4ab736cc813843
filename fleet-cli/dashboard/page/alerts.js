// What needs a person: the list, the count in the title, a short sound, and the browser's notifications.

import { html, nothing } from "./vendor/lit-html.js";
import { repeat } from "./vendor/directives/repeat.js";
import { plain } from "./words.js";

const MUTED = "xtb-alerts-muted";
const BEEPS = [[0, 880], [0.22, 660]]; // s, Hz
const BEEP_S = 0.16;
const LOUD = 0.12; // 1 = as loud as the computer is

export function open(store) {
  return (store.alerts?.alerts ?? []).filter((alert) => !alert.acknowledged && !alert.ended_ms);
}

// Calls for the person: `update` whenever alerts may have changed.
export class Alarm {
  #told = 0; // number of the newest alert that was told of
  #sound = null; // browsers allow none before the user has touched the page
  muted = remembered();

  constructor() {
    const allow = () => {
      this.#sound ??= new AudioContext();
      this.#sound.resume();
    };
    for (const event of ["pointerdown", "keydown"]) window.addEventListener(event, allow, { once: true });
  }

  // Says what the title begins with.
  update(store) {
    const alerts = open(store);
    const newest = store.alerts?.alerts.at(-1)?.id ?? this.#told;
    this.#told = Math.min(this.#told, newest); // another dispatcher counts anew
    const fresh = alerts.filter((alert) => alert.id > this.#told);
    if (fresh.length > 0) {
      this.#told = Math.max(...fresh.map((alert) => alert.id));
      if (!this.muted) this.#beep();
      if (document.hidden) this.#notify(fresh);
    }
    return alerts.length > 0 ? `(${alerts.length}) ` : "";
  }

  mute() {
    this.muted = !this.muted;
    try {
      localStorage.setItem(MUTED, String(this.muted));
    } catch {
      // then it holds for this page only
    }
    if (!this.muted) this.#beep();
  }

  async askForNotifications(changed) {
    if (canNotify()) await Notification.requestPermission();
    changed();
  }

  #beep() {
    if (this.#sound?.state !== "running") return;
    for (const [after, hertz] of BEEPS) {
      const [from, tone, volume] = [this.#sound.currentTime + after, this.#sound.createOscillator(), this.#sound.createGain()];
      tone.frequency.value = hertz;
      volume.gain.setValueAtTime(LOUD, from);
      volume.gain.exponentialRampToValueAtTime(0.001, from + BEEP_S);
      tone.connect(volume).connect(this.#sound.destination);
      tone.start(from);
      tone.stop(from + BEEP_S);
    }
  }

  #notify(alerts) {
    if (!canNotify() || Notification.permission !== "granted") return;
    for (const alert of alerts.slice(-3)) {
      new Notification("XTB fleet: alert", { body: alert.text, tag: `xtb-alert-${alert.id}` });
    }
  }
}

function canNotify() {
  return "Notification" in window;
}

function remembered() {
  try {
    return localStorage.getItem(MUTED) === "true";
  } catch {
    return false; // storage may be forbidden
  }
}

// In the header: how many, and the way to the list.
export function alertBadge(store, act) {
  const count = open(store).length;
  if (count === 0) return nothing;
  return html`<button type="button" class="alert-badge" id="alert-badge" @click=${() => act.tab("alerts")}>
    ${count} ${count === 1 ? "alert" : "alerts"}</button>`;
}

export function alertPanel(store, act, alarm) {
  if (!store.alerts || !store.dispatcher()) {
    return html`<h2>Alerts</h2><p class="empty">Unknown: no dispatcher is there.</p>`;
  }
  const left = store.alerts.alerts.filter((alert) => !alert.ended_ms).reverse();
  const ended = store.alerts.alerts.filter((alert) => alert.ended_ms).reverse();
  const unseen = open(store);
  const denied = store.denied();
  const ack = (ids, label, id) => store.controls()
    ? html`<button type="button" id=${id ?? nothing} aria-label=${label} title=${denied ?? nothing} ?disabled=${denied !== null}
        @click=${() => act.acknowledge(ids)}>${id ? "Acknowledge all" : "Acknowledge"}</button>`
    : nothing;
  return html`<h2>Alerts (${unseen.length} open)</h2>
    <div class="row">
      ${unseen.length > 1 ? ack(unseen.map((alert) => alert.id), "Acknowledge all alerts", "alerts-ack") : nothing}
      <button type="button" id="alerts-sound" aria-pressed=${!alarm.muted} @click=${act.muteAlerts}>
        Sound ${alarm.muted ? "off" : "on"}</button>
      ${canNotify() && Notification.permission === "default"
        ? html`<button type="button" @click=${act.notifyAlerts}>Notify me</button>` : nothing}
    </div>
    <ul class="alert-list">${repeat(left, (alert) => alert.id, (alert) => html`<li class="box ${alert.acknowledged ? "warn" : "bad"}" data-alert=${alert.id}>
      <p><strong>${alert.text}</strong></p>
      <p class="todo">${alert.remedy.split("`").map((part, i) => (i % 2 ? html`<code>${part}</code>` : part))}</p>
      <p class="hint">${plain(alert.kind)}, since ${clock(alert.since_ms)}${seen(alert)}</p>
      ${alert.acknowledged ? nothing : ack([alert.id], `Acknowledge alert ${alert.id}`)}</li>`)}</ul>
    ${left.length === 0 ? html`<p class="empty">No alerts.</p>` : nothing}
    ${store.alerts.left_out > 0 ? html`<p class="error">${store.alerts.left_out} more found no room.</p>` : nothing}
    ${ended.length === 0 ? nothing : html`<details><summary>${ended.length} ended</summary>
      <ol class="event-list">${ended.map((alert) => html`<li><time>${clock(alert.ended_ms)}</time>
        <span>${alert.text}${seen(alert)}</span></li>`)}</ol></details>`}`;
}

function seen({ acknowledged }) {
  if (!acknowledged) return "";
  const who = acknowledged.person ? `${acknowledged.by} (${acknowledged.person})` : acknowledged.by;
  return `, acknowledged by ${who} at ${clock(acknowledged.at_ms)}`;
}

// Wall time: of another day with its date.
export function clock(ms) {
  const at = new Date(ms);
  const time = at.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit" });
  return at.toDateString() === new Date().toDateString() ? time : `${at.toLocaleDateString()} ${time}`;
}
