// Telling a robot that stands where it is: what that does is said before it is done.

import { html, nothing } from "./vendor/lit-html.js";
import { degrees, point } from "./words.js";

const RUNNING = ["accepted", "running", "blocked"];

// What lies on the map while a pose is set.
export function poseNote(store, act, preview) {
  const robot = store.robot();
  if (robot === null) return html`<span>Select a robot first</span>`;
  if (preview === null) {
    return html`<span>Press where <strong>${robot.name}</strong> stands; drag for its heading</span>
      <button type="button" @click=${() => act.use("look")}>End</button>`;
  }
  const moves = RUNNING.includes(robot.goal?.status) || robot.mode === "teleop";
  return html`<div class="pose-note"><p><strong>${robot.name} stands at ${point(preview)}, ${degrees(preview.yaw_rad)}?</strong></p>
      <p>It does not move. It forgets where it believed to be: this counts as known to a few centimetres, also if it is wrong,
        until pose fixes correct it.</p>
      ${moves ? html`<p class="warn-text" role="alert">It is under way, and refuses until it stands; its goal does not go on by itself.</p>` : nothing}
      <div class="row">${moves ? html`<button type="button" id="pose-stop" @click=${() => act.stop(robot.name)}>Stop it first</button>` : nothing}
        <button type="button" class="main" id="pose-send" @click=${act.sendPose}>Set pose</button>
        <button type="button" id="pose-drop" @click=${act.dropGoal}>Discard</button></div></div>`;
}
