// Try: while it is on, edits are only checked; a simulation of the run shows what they would do, and what happens without.

import { make, part, seconds } from "./dom.js";

const MAX_ROWS = 40;

export class Try {
  /** `edits` holds the text back; `ask` sends the question; `now_s` returns what is shown. */
  constructor(edits, { ask, now_s }) {
    Object.assign(this, { edits, ask, now_s });
  }

  /** Forget what was tried. */
  discard() {
    this.edits.undo();
    this.edits.hold(false);
  }

  show(isHeld) {
    part("try").setAttribute("aria-pressed", isHeld);
    part("trial").hidden = !isHeld;
    part("rehearsed").replaceChildren();
  }

  rehearse() {
    const { file, editor: { text } } = this.edits;
    const isSent = this.ask({ text, file, at_s: this.now_s() });
    part("rehearsed").textContent = isSent ? "The run is simulated again…" : "There is no connection.";
  }

  onAnswer({ at_s, until_s, unchanged, edited, error }) {
    if (error) return void (part("rehearsed").textContent = error);
    const rows = [unchanged, edited].map(rowsOf);
    const count = Math.max(...rows.map((one) => one.length));
    const first = [...Array(count).keys()].find((i) => rows[0][i] !== rows[1][i]);
    const found = `From ${seconds(at_s)} to ${seconds(until_s)}${first === undefined ? ": no difference" : ""}`;
    const lists = make("div", {}, list("without", rows[0], first), list("with this text", rows[1], first));
    part("rehearsed").replaceChildren(found, lists);
  }
}

function rowsOf({ changes, end }) {
  const rows = changes.map(({ t_s, source, target }) => `${seconds(t_s)} ${source || "start"} → ${target || "end"}`);
  if (end) rows.push(`the run is over: ${end}`);
  return rows.length ? rows : ["no change of state"];
}

function list(title, rows, first) {
  const shown = rows.slice(0, MAX_ROWS).map((text, i) => make("li", i === first ? { class: "first" } : {}, text));
  if (rows.length > MAX_ROWS) shown.push(make("li", {}, `${rows.length - MAX_ROWS} more`));
  return make("div", {}, make("h3", {}, title), make("ol", {}, ...shown));
}
