// The problems: mistakes in the text, and blocks that have failed, at their lines and as a list.

import { make, part } from "./dom.js";

export class Problems {
  shown = { ofText: [], ofRun: [], isSameText: true };

  constructor(editor) {
    this.editor = editor;
  }

  /** Show mistakes of the text, and blocks that failed; `isSameText` if the lines of these are those in the editor. */
  show(changes) {
    const shown = { ...this.shown, ...changes };
    if (JSON.stringify(shown) === JSON.stringify(this.shown)) return;
    this.shown = shown;
    const { ofText, ofRun, isSameText } = shown;
    this.editor.showProblems(isSameText ? [...ofText, ...ofRun] : ofText);
    const rows = [...ofText.map((one) => this.row(one, "")), ...ofRun.map((one) => this.row(one, "failed: "))];
    part("problems").replaceChildren(...rows);
    part("problems").hidden = rows.length === 0;
  }

  row({ line, message, fix, is_error }, before) {
    const goTo = () => this.editor.goTo(line, true);
    const button = make("button", { type: "button", class: "moment", onclick: goTo }, `line ${line}`);
    const hint = make("em", {}, fix && `Try: ${fix}`);
    return make("li", { class: is_error ? "error" : "warning" }, button, ` ${before}${message} `, hint);
  }
}
