// Editing the map: the draft, the tool that draws it, and the server that saves it as a new version.

import { EditTool } from "./edit_tool.js";
import { MapDraft } from "./map_draft.js";

export class MapEditor {
  draft = null; // null = not editing
  tool;
  why = ""; // the reason, as it is typed
  error = null; // {message, hint}
  said = null; // what came of the last saving
  saving = false;
  history = null; // {name, stored, versions}
  lost = []; // what somebody else's version has overruled
  #store;
  #link;
  #do;

  // `act`: {changed(), say(text), began(), ended()}
  constructor(canvas, view, store, link, act) {
    [this.#store, this.#link, this.#do] = [store, link, act];
    this.tool = new EditTool(canvas, view, { draft: () => this.draft, changed: act.changed, say: act.say });
    window.addEventListener("keydown", (event) => this.#key(event));
    // A tab that is closed by mistake: the browser asks.
    window.addEventListener("beforeunload", (event) => {
      if (this.dirty) event.preventDefault();
    });
  }

  get dirty() {
    return this.draft !== null && this.draft.dirty;
  }

  // Whether somebody else has saved another version meanwhile.
  get isOld() {
    return this.draft !== null && this.draft.isOld(this.#store.mapContent);
  }

  begin() {
    const { map, mapContent, places } = this.#store;
    if (!map || !mapContent) return;
    this.draft = new MapDraft(mapContent, map.zones ?? [], places);
    [this.error, this.said, this.lost] = [null, null, []];
    this.#do.began();
    this.readHistory();
    this.#do.changed();
  }

  // Without saving.
  end() {
    if (this.tool.armed) this.tool.arm(this.tool.armed);
    [this.draft, this.error, this.said, this.lost] = [null, null, null, []];
    this.#do.ended();
    this.#do.changed();
  }

  // Any change by the panel.
  change(how) {
    this.error = this.said = null;
    how(this.draft);
    this.#do.changed();
  }

  // Takes the version that is served; what was changed here goes on top of it, or is dropped.
  takeTheirs(keepMine) {
    const { map, mapContent, places } = this.#store;
    if (!map || !mapContent) return;
    this.lost = [];
    if (keepMine) this.lost = this.draft.rebase(mapContent, map.zones ?? [], places);
    else this.draft = new MapDraft(mapContent, map.zones ?? [], places);
    this.error = this.said = null;
    this.readHistory();
    this.#do.changed();
  }

  async save() {
    const { draft, why } = this;
    [this.error, this.said, this.saving] = [null, null, true];
    this.#do.changed();
    const { zones, places } = draft.now;
    const { ok, error } = await this.#link.command({ edit_map: { base: draft.base, zones, places, why } });
    this.saving = false;
    if (ok) {
      draft.saved(ok.version.content);
      this.said = `Saved as version ${ok.version.number}${ok.stored ? "" : "; it ends with the program that serves the map"}.`;
      [this.why, this.lost] = ["", []];
      this.readHistory();
    } else {
      this.error = error;
    }
    this.#do.changed();
  }

  async readHistory() {
    const { ok } = await this.#link.command({ map_history: {} });
    if (ok) this.history = ok;
    this.#do.changed();
  }

  // Undo and redo, wherever no text is edited.
  #key(event) {
    if (this.draft === null || !(event.ctrlKey || event.metaKey) || event.target.matches?.("input, textarea")) return;
    const key = event.key.toLowerCase();
    const step = { z: event.shiftKey ? "redo" : "undo", y: "redo" }[key];
    if (!step) return;
    event.preventDefault();
    this.change((draft) => draft[step]());
  }
}
