// Edits on their way to the robot: one at a time, each made from the program that runs, the newest text last.

const WAIT_MS = 30; // for the next key
const REFUSED_MS = 1000;

export class Edits {
  base = null; // text, files and sha256 of the program that runs
  file = ""; // that is edited: the program, or one that it imports
  isHeld = false; // whether edits are only checked, until they are committed
  other = null; // as `base`, of another edit that came first
  inFlight = null;
  number = 0;

  /**
   * `editor` has `text`, `replace(text)` and `open(text)`; `problems` has `show({ ofText })`; `showConflict` and
   * `showHeld` are called with whether there is a conflict, and whether edits are held; `send` sends an edit and returns
   * whether there is a connection.
   */
  constructor(parts) {
    Object.assign(this, parts);
  }

  get isDirty() {
    return this.base !== null && this.editor.text !== textOf(this.base, this.file);
  }

  /** Begin with the program that runs, and with an unfinished text from before, if it was made from this program. */
  begin(program, draft) {
    const isSame = this.base === null || this.base.sha256 === program.sha256;
    Object.assign(this, { inFlight: null, isAllowed: program.is_editable });
    if (this.isDirty && !isSame) this.conflict(program);
    else if (this.isDirty) this.sendNow();
    else {
      this.take(program);
      if (draft?.base_sha256 !== program.sha256) return;
      this.hold(draft.isHeld);
      this.open(draft.file);
      this.editor.replace(draft.text);
      this.sendNow();
    }
  }

  /** What a reload of the page would lose. */
  get draft() {
    const { file, isHeld, base } = this;
    return this.isDirty ? { text: this.editor.text, base_sha256: base.sha256, file, isHeld } : undefined;
  }

  /** Edit another file; return whether that is possible: the text of this one must run. */
  open(file) {
    if (file === this.file) return true;
    if (this.isDirty || this.inFlight) return false;
    this.file = file;
    this.editor.open(textOf(this.base, file));
    this.problems.show({ ofText: [] });
    return true;
  }

  /** The user has changed the text: wait for the next key, then send it. */
  onKey() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.sendNow(), WAIT_MS);
  }

  sendNow() {
    if (!this.isAllowed || this.inFlight || this.other) return;
    const { file, isHeld: is_tried, editor: { text } } = this;
    const edit = { number: this.number + 1, text, base_sha256: this.base.sha256, file, is_tried };
    if (!this.isDirty) this.problems.show({ ofText: [] });
    else if (this.send(edit)) Object.assign(this, { inFlight: edit, number: edit.number });
  }

  /** Hold edits back, or send what was held. */
  hold(isHeld) {
    this.isHeld = isHeld;
    this.showHeld(isHeld);
    if (!isHeld) this.sendNow();
  }

  /** The answer to an edit or to an undo. */
  onEdited({ number, ok, is_stale, sha256, text, files, problems }) {
    if (number === null && ok) this.take({ text, files, sha256 }, problems);
    if (number !== this.inFlight?.number) return;
    const { text: sent, file, is_tried } = this.inFlight;
    this.inFlight = null;
    if (ok) this.base = { ...withText(this.base, file, sent), sha256 };
    if (is_stale) this.conflict({ text, files, sha256 });
    else if (this.editor.text === sent && is_tried === this.isHeld) this.problems.show({ ofText: problems });
    else this.sendNow();
  }

  /** An edit was not carried out, because there were too many: try again. */
  onRefused() {
    this.inFlight = null;
    setTimeout(() => this.sendNow(), REFUSED_MS);
  }

  /** Another program runs: ours, or from another page or an editor that has saved the file. */
  onProgram(program) {
    if (program.sha256 === this.base.sha256) this.base = program; // other files may be imported
    // An edit in flight is answered, by success or by what came first.
    else if (this.inFlight && !this.inFlight.is_tried) return;
    else if (this.isDirty) this.conflict(program);
    else this.take(program);
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
    if (this.file && !(this.file in base.files)) this.file = "";
    this.editor.replace(textOf(base, this.file));
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

/** Return the text of a program, or of a file that it imports. */
export const textOf = ({ text, files }, file) => (file ? (files[file] ?? "") : text);

const withText = (program, file, text) =>
  file ? { ...program, files: { ...program.files, [file]: text } } : { ...program, text };
