// Why a transition was taken, or not: all its moments, and what a repetition of the run finds in its condition.

import { make, part, seconds } from "./dom.js";

const MAX_MOMENTS = 200; // in the list; the newest ones

export class Why {
  asked = null;

  /** `go` is called with a time that is to be shown, `ask` sends the question, `now_s` returns what is shown. */
  constructor(history, parts) {
    Object.assign(this, { history, ...parts });
    part("why-range").addEventListener("change", () => this.open(this.asked));
    part("why-close").addEventListener("click", () => this.close());
    part("why").addEventListener("keydown", ({ key }) => key === "Escape" && this.close());
  }

  /** Open the panel of a transition. */
  open(transition) {
    if (this.asked === null) this.focusBefore = document.activeElement;
    this.asked = transition;
    part("why").hidden = false;
    part("why-title").textContent = `${transition.name}: ${transition.source} → ${transition.target}`;
    part("why-label").textContent = `${transition.path}, line ${transition.line}: ${transition.label}`;
    this.listMoments(this.history.timesOf(transition.key));
    const [range, until_s] = [part("why-range").value, this.now_s()];
    const from_s = range === "all" ? 0 : Math.max(0, until_s - Number(range));
    const isSent = this.ask({ machine: transition.path, transition: transition.name, from_s, until_s });
    part("why-rows").textContent = isSent ? "The run is executed again…" : "There is no connection.";
    part("why-close").focus();
  }

  close() {
    this.asked = null;
    part("why").hidden = true;
    this.focusBefore?.focus();
  }

  listMoments(times) {
    const count = times.length ? `Taken at these moments (${times.length}): ` : "Never taken so far.";
    const attributes = (t_s) => ({ type: "button", class: "moment", onclick: () => this.go(t_s) });
    const buttons = times.slice(-MAX_MOMENTS).reverse().map((t_s) => make("button", attributes(t_s), seconds(t_s)));
    part("why-moments").replaceChildren(count, ...buttons);
  }

  /** Show the answer, if it is that of what is open. */
  onAnswer({ machine, transition, from_s, until_s, rows, left_out, error }) {
    if (this.asked?.name !== transition || this.asked.path !== machine) return;
    const never = rows.length ? "" : " it was never looked at: the machine was in no state that it leaves";
    const found = [`From ${seconds(from_s)} to ${seconds(until_s)}${never}:`, ...rows.map(rowOf)];
    if (left_out) found.push(`${left_out} more evaluations were left out.`);
    part("why-rows").replaceChildren(...(error ? [error] : found));
  }
}

function rowOf(row) {
  const facts = [[`in ${row.state}`, `looked at ${row.evaluated}×, taken ${row.taken}×`]];
  const longest = `the longest time in the state was ${seconds(row.longest_s, 3)}`;
  if (row.after_s !== null) facts.push(["after", `${seconds(row.after_s, 3)}; ${longest}`]);
  facts.push(...Object.entries(row.values));
  for (const [error, count] of Object.entries(row.errors)) facts.push(["failed", `${count}×: ${error}`]);
  return make("dl", {}, ...facts.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
}
