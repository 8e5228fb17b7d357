// Edits on their way to the robot: one at a time, each made from the program that runs, the newest text last.

const WAIT_MS = 30; // for the next key
const REFUSED_MS = 1000;

export class Edits {
  base = null; // text and sha256 of the program that runs
  other = null; // those of another edit that came first
  inFlight = null;
  number = 0;

  /**
   * `editor` has `text` and `replace(text)`; `problems` has `show({ ofText })`; `showConflict` is called with whether
   * there is one; `send` sends an edit and returns whether there is a connection.
   */
  constructor(parts) {
    Object.assign(this, parts);
  }

  get isDirty() {
    return this.base !== null && this.editor.text !== this.base.text;
  }

  /** Begin with the program that runs, and with an unfinished text from before, if it was made from this program. */
  begin({ text, sha256, is_editable }, draft) {
    const isSame = this.base === null || this.base.sha256 === sha256;
    Object.assign(this, { inFlight: null, isAllowed: is_editable });
    if (this.isDirty && !isSame) this.conflict({ text, sha256 });
    else if (this.isDirty) this.sendNow();
    else {
      this.take({ text, sha256 });
      if (draft?.base_sha256 !== sha256) return;
      this.editor.replace(draft.text);
      this.sendNow();
    }
  }

  /** The user has changed the text: wait for the next key, then send it. */
  onKey() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.sendNow(), WAIT_MS);
  }

  sendNow() {
    if (!this.isAllowed || this.inFlight || this.other) return;
    const { text } = this.editor;
    const edit = { number: this.number + 1, text, base_sha256: this.base.sha256 };
    if (text === this.base.text) this.problems.show({ ofText: [] });
    else if (this.send(edit)) Object.assign(this, { inFlight: edit, number: edit.number });
  }

  /** The answer to an edit or to an undo. */
  onEdited({ number, ok, is_stale, sha256, text, problems }) {
    if (number === null && ok) this.take({ text, sha256 }, problems);
    if (number !== this.inFlight?.number) return;
    const sent = this.inFlight.text;
    this.inFlight = null;
    if (ok) this.base = { text: sent, sha256 };
    if (is_stale) this.conflict({ text, sha256 });
    else if (this.editor.text === sent) this.problems.show({ ofText: problems });
    else this.sendNow();
  }

  /** An edit was not carried out, because there were too many: try again. */
  onRefused() {
    this.inFlight = null;
    setTimeout(() => this.sendNow(), REFUSED_MS);
  }

  /** Another program runs: ours, or from another page or an editor that has saved the file. */
  onProgram({ text, sha256 }) {
    // An edit in flight is answered, by success or by what came first.
    if (this.inFlight || sha256 === this.base.sha256) return;
    if (this.isDirty) this.conflict({ text, sha256 });
    else this.take({ text, sha256 });
  }

  /** Return whether an undo is to be sent: a text that does not run is replaced by the one that does. */
  undo() {
    if (!this.isDirty) return true;
    this.take(this.base);
    return false;
  }

  /** Continue with another text. */
  take(base, problems = []) {
    this.base = base;
    this.editor.replace(base.text);
    this.problems.show({ ofText: problems });
  }

  conflict(other) {
    this.other = other;
    this.showConflict(true);
  }

  /** Continue with the other text, or with ours in its place. */
  resolve(isOursKept) {
    Object.assign(this, { base: this.other, other: null });
    this.showConflict(false);
    if (isOursKept) this.sendNow();
    else this.take(this.base);
  }
}
