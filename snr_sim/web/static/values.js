// The values: variables by scope, readings with their age, commands with their delay.

import { make, part, setText } from "./dom.js";

const LATE_S = 0.1; // a command that takes longer is marked: at 0.5 m/s the robot has moved 5 cm meanwhile

export class Values {
  /** `set` is called with the path of a variable and its new value, `reject` with what is wrong with a value. */
  constructor(set, reject) {
    Object.assign(this, { set, reject, reads: new Rows("reads", barRow), drives: new Rows("drives", barRow) });
    this.variables = new Rows("variables", (path) => this.variableRow(path));
  }

  /** Show the values of a moment. */
  show({ variables, reads, drives }, units, canEdit) {
    this.variables.show(byScope(variables), (row, value) => showVariable(row, value, canEdit));
    const show = (row, one, t_s, limit_s, word) => showBar(row, one.value, units.get(row.name), t_s, limit_s, word);
    this.reads.show(Object.entries(reads), (row, one) => show(row, one, one.age_s, one.limit_s, "old"));
    this.drives.show(Object.entries(drives), (row, one) => show(row, one, one.delay_s, LATE_S, "late"));
  }

  variableRow(path) {
    const at = path.lastIndexOf(".") + 1;
    const input = make("input", { "aria-label": path, spellcheck: "false", autocomplete: "off" });
    const scope = make("span", { class: "scope" }, path.slice(0, at));
    const row = make("li", {}, make("span", { class: "name", title: path }, scope, path.slice(at)), input);
    input.addEventListener("change", () => this.commit(row, path));
    input.addEventListener("keydown", ({ key }) => {
      if (key === "Escape") showValue(input, row.value);
      if (key === "Escape" || key === "Enter") input.blur();
    });
    return Object.assign(row, { input });
  }

  commit({ input, value: before }, path) {
    if (input.type === "checkbox") this.set(path, input.checked);
    else if (typeof before === "string") this.set(path, input.value);
    else if (input.value.trim() !== "" && Number.isFinite(Number(input.value))) this.set(path, Number(input.value));
    else this.reject(`${path} must be a number, not '${input.value}'.`);
  }
}

/** A list whose rows stay the same elements while their values change, so that none loses the focus. */
class Rows {
  constructor(id, makeRow) {
    Object.assign(this, { list: part(id), makeRow, rows: new Map() });
  }

  show(entries, showRow) {
    const names = entries.map(([name]) => name);
    if (`${names}` !== this.names) {
      this.names = `${names}`;
      this.rows = new Map(names.map((name) => [name, this.rows.get(name) ?? this.makeRow(name)]));
      this.list.replaceChildren(...(names.length ? this.rows.values() : [make("li", { class: "none" }, "none")]));
    }
    for (const [name, value] of entries) showRow(this.rows.get(name), value);
  }
}

function showVariable(row, value, canEdit) {
  const { input } = row;
  row.value = value;
  input.disabled = !canEdit || (typeof value === "object" && value !== null);
  input.type = typeof value === "boolean" ? "checkbox" : "text";
  if (document.activeElement !== input || input.type === "checkbox") showValue(input, value);
}

function showValue(input, value) {
  if (input.type === "checkbox") input.checked = value;
  else if (input.value !== asText(value)) input.value = asText(value);
}

function barRow(name) {
  const [output, age] = [make("output", { class: "value" }), make("span", { class: "age" })];
  const fill = make("span", { class: "fill" });
  const title = make("span", { class: "name", title: name }, name);
  const row = make("li", {}, title, output, make("span", { class: "bar" }, fill), age);
  return Object.assign(row, { name, output, fill, age });
}

/** Show a value, and a bar of its age or delay that is full at the limit; beyond it a word is there, too. */
function showBar(row, value, unit, t_s, limit_s, word) {
  const isBeyond = t_s !== null && limit_s !== null && t_s > limit_s;
  const text = t_s === null ? "" : t_s < 10 ? `${Math.round(1000 * t_s)} ms` : `${t_s.toFixed(0)} s`;
  const number = Number.isFinite(value) ? `${Number(value.toPrecision(5))}` : asText(value);
  const hasUnit = unit && !/^\d/.test(unit); // "0 or 1" is none
  setText(row.output, value === null ? "—" : hasUnit ? `${number} ${unit}` : number);
  row.output.title = unit ?? "";
  setText(row.age, isBeyond ? `${text} ${word}` : text);
  row.fill.style.width = `${limit_s ? Math.min(100, (100 * (t_s ?? 0)) / limit_s) : 0}%`;
  row.classList.toggle("beyond", isBeyond);
  row.classList.toggle("unknown", t_s === null);
}

const asText = (value) => (typeof value === "string" ? value : value === null ? "None" : JSON.stringify(value));

function byScope(variables) {
  const depth = ([path]) => path.split(/[./]/).length;
  return Object.entries(variables).sort((one, other) => depth(one) - depth(other));
}
