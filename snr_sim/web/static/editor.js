// The text: an editor with the problems at their lines, the line of the last transition, and how often each was taken.

import {
  Annotation, Decoration, EditorState, EditorView, GutterMarker, HighlightStyle, RangeSet, StateEffect, StateField,
  autocompletion, bracketMatching, closeBrackets, closeBracketsKeymap, completionKeymap, defaultKeymap, drawSelection,
  gutter, highlightActiveLine, history, historyKeymap, keymap, lineNumbers, lintGutter, lintKeymap, setDiagnostics,
  syntaxHighlighting, tags,
} from "./lib/editor.js";
import { completion, language } from "./lrp.js";

const byProgram = Annotation.define(); // a change that is not the user's
const setMarks = StateEffect.define();

/** How often the transition was taken that is declared in a line of the program that runs. */
class Count extends GutterMarker {
  constructor(count, line) {
    super();
    Object.assign(this, { count, line });
  }

  eq(other) {
    return this.count === other.count && this.line === other.line;
  }

  toDOM() {
    return document.createTextNode(this.count < 10_000 ? `${this.count}×` : `${Math.floor(this.count / 1000)}k×`);
  }
}

/** The line of the last transition, and the counts beside the lines. They move with the text. */
const marks = StateField.define({
  create: () => ({ lines: Decoration.none, counts: RangeSet.empty }),
  update({ lines, counts }, { changes, effects, state: { doc } }) {
    const wanted = effects.find((one) => one.is(setMarks))?.value;
    if (!wanted) return { lines: lines.map(changes), counts: counts.map(changes) };
    const found = [...wanted.counts].filter(([line]) => line <= doc.lines).sort(([one], [other]) => one - other);
    const isThere = wanted.lastLine >= 1 && wanted.lastLine <= doc.lines;
    return {
      lines: Decoration.set(isThere ? Decoration.line({ class: "cm-last" }).range(doc.line(wanted.lastLine).from) : []),
      counts: RangeSet.of(found.map(([line, count]) => new Count(count, line).range(doc.line(line).from))),
    };
  },
  provide: (field) => EditorView.decorations.from(field, ({ lines }) => lines),
});

const colours = HighlightStyle.define([
  { tag: tags.keyword, color: "var(--code-keyword)", fontWeight: "600" },
  { tag: tags.comment, color: "var(--code-comment)", fontStyle: "italic" },
  { tag: tags.number, color: "var(--code-number)" },
  { tag: tags.string, color: "var(--code-string)" },
  { tag: [tags.operator, tags.bracket], color: "var(--code-operator)" },
  { tag: tags.standard(tags.variableName), color: "var(--code-standard)" },
  { tag: tags.invalid, color: "var(--bad)" },
]);

export class Editor {
  isReadOnly = true;
  present = null; // the state of the text that runs, while an older text is shown
  marked = "";

  /**
   * `onKey` is called when the user has changed the text, `onTransition` with the line whose transition is asked for;
   * `known` returns what can be completed.
   */
  constructor(parent, parts) {
    Object.assign(this, parts);
    this.view = new EditorView({ parent, state: this.newState("", true) });
  }

  newState(doc, isReadOnly) {
    const ask = ({ state }, { from }) => {
      let line = state.doc.lineAt(from).number;
      // Lines above that have been inserted do not run yet: the mark knows which line it is of.
      state.field(marks).counts.between(from, from, (_from, _to, count) => void (line = count.line));
      return this.onTransition(line) ?? true;
    };
    const whyKey = { key: "Alt-Enter", run: (view) => ask(view, view.lineBlockAt(view.state.selection.main.head)) };
    return EditorState.create({
      doc,
      extensions: [
        lintGutter(),
        lineNumbers(),
        gutter({
          class: "cm-counts",
          markers: (view) => view.state.field(marks).counts,
          initialSpacer: () => new Count(888),
          domEventHandlers: { click: ask },
        }),
        [marks, history(), drawSelection(), highlightActiveLine(), bracketMatching(), closeBrackets()],
        [language, syntaxHighlighting(colours), autocompletion({ override: [completion(this.known)] })],
        EditorView.lineWrapping,
        EditorState.readOnly.of(isReadOnly),
        EditorView.contentAttributes.of({ "aria-label": isReadOnly ? "Program, read only" : "Program" }),
        keymap.of([whyKey, closeBracketsKeymap, completionKeymap, lintKeymap, historyKeymap, defaultKeymap].flat()),
        EditorView.updateListener.of(({ docChanged, transactions }) => {
          if (docChanged && !transactions.some((one) => one.annotation(byProgram))) this.onKey();
        }),
      ],
    });
  }

  /** The state of the text that runs or shall run, also while an older one is shown. */
  get state() {
    return this.present ?? this.view.state;
  }

  get text() {
    return this.state.doc.toString();
  }

  begin(isReadOnly) {
    this.showPast(null);
    if (isReadOnly === this.isReadOnly) return;
    this.isReadOnly = isReadOnly;
    this.open(this.text);
  }

  /** Edit another text, without what could be undone in this one. */
  open(text) {
    this.showPast(null);
    this.view.setState(this.newState(text, this.isReadOnly));
    this.marked = "";
  }

  /** Change only what differs, so that the cursor stays where it is. */
  replace(text) {
    const before = this.text;
    let [from, end, to] = [0, text.length, before.length];
    while (from < Math.min(end, to) && text[from] === before[from]) from += 1;
    while (Math.min(end, to) > from && text[end - 1] === before[to - 1]) [end, to] = [end - 1, to - 1];
    if (text === before) return;
    this.dispatch({ changes: { from, to, insert: text.slice(from, end) }, annotations: byProgram.of(true) });
  }

  showProblems(problems) {
    const { doc } = this.state;
    const at = (line, column) => {
      const one = doc.line(Math.max(1, Math.min(line, doc.lines)));
      return Math.min(one.from + Math.max(0, column - 1), one.to);
    };
    const found = problems.map(({ line, column, end_line, end_column, message, fix, is_error }) => {
      const from = at(line, column);
      const to = Math.max(from, at(end_line || line, end_line ? end_column : column + 1));
      const severity = is_error ? "error" : "warning";
      return { from, to, severity, message: fix ? `${message}\nTry: ${fix}` : message };
    });
    this.dispatch(setDiagnostics(this.state, found));
  }

  /** Mark the line of the last transition, and scroll to it if asked; write how often each was taken at its line. */
  mark({ lastLine, counts, isScrolled }) {
    const marked = JSON.stringify([lastLine, ...counts]);
    if (marked === this.marked) return;
    this.marked = marked;
    const { doc } = this.view.state;
    const effects = [setMarks.of({ lastLine, counts })];
    if (isScrolled && lastLine >= 1 && lastLine <= doc.lines) {
      effects.push(EditorView.scrollIntoView(doc.line(lastLine).from, { yMargin: 60 }));
    }
    this.view.dispatch({ effects });
  }

  /** Show the text of an older moment, which cannot be changed; null shows the present one again. */
  showPast(text) {
    if (text === null ? this.present === null : this.view.state.doc.toString() === text && this.present) return;
    const { state } = this;
    this.view.setState(text === null ? state : this.newState(text, true));
    this.present = text === null ? null : state;
    this.marked = "";
  }

  /** Show a line, and put the cursor there. */
  goTo(line, isFocused = false) {
    const { doc } = this.view.state;
    if (line < 1 || line > doc.lines) return;
    const { from } = doc.line(line);
    this.view.dispatch({ selection: { anchor: from }, effects: EditorView.scrollIntoView(from, { y: "center" }) });
    if (isFocused) this.view.focus();
  }

  /** Where the user is in the text, to return to after a reload. */
  get place() {
    return { anchor: this.state.selection.main.head, top: this.view.scrollDOM.scrollTop };
  }

  set place({ anchor, top }) {
    this.dispatch({ selection: { anchor: Math.min(anchor, this.state.doc.length) } });
    requestAnimationFrame(() => (this.view.scrollDOM.scrollTop = top));
  }

  dispatch(spec) {
    if (this.present === null) this.view.dispatch(spec);
    else this.present = this.present.update(spec).state;
  }
}
