// The page: takes what the server sends, and gives each part what it shows.

import { Connection } from "./connection.js";
import { Diagram } from "./diagram.js";
import { make, part, save, setText } from "./dom.js";
import { Edits, textOf } from "./edits.js";
import { Editor } from "./editor.js";
import { History } from "./history.js";
import { Problems } from "./problems.js";
import { allMachines, keysOfChange, transitionsOf } from "./program.js";
import { Time } from "./time.js";
import { Try } from "./try.js";
import { Values } from "./values.js";
import { Why } from "./why.js";

const ANNOUNCE_MS = 1000; // a screen reader needs time for each change of state
const MESSAGE_MS = 8000;
const PLACE = `place of ${location.pathname}`; // of the user, kept while the page is loaded again

class Page {
  programs = new Map(); // by number
  hello = null;
  live = null; // newest state of a run that continues
  past = null; // state of the moment that was asked for
  status = "connecting";
  question = null; // about a moment, which waits for the answer to the one before

  constructor() {
    const send = (kind, fields) => this.connection.send(kind, fields);
    this.history = new History();
    this.time = new Time(this.history, (t_s) => this.ask(t_s));
    this.editor = new Editor(part("text"), {
      onKey: () => this.edits.onKey(),
      onTransition: (line) => this.openWhy(this.transitions().find((one) => one.line === line)),
      known: () => this.known(),
    });
    this.problems = new Problems(this.editor);
    this.edits = new Edits({
      editor: this.editor,
      problems: this.problems,
      send: (fields) => send("edit", fields),
      showConflict: (isShown) => (part("conflict").hidden = !isShown),
      showHeld: (isHeld) => this.trial.show(isHeld),
    });
    const now_s = () => this.time.shown_s ?? this.time.end_s;
    this.why = new Why(this.history, { go: (t_s) => this.time.go(t_s), ask: (fields) => send("why", fields), now_s });
    this.trial = new Try(this.edits, { ask: (fields) => send("try", fields), now_s });
    this.diagram = new Diagram(part("diagram"), {
      onState: (line, file) => this.openFile(file) && this.editor.goTo(line, true),
      onTransition: (transition) => this.openWhy(transition),
    });
    this.values = new Values((path, value) => send("set", { path, value }), (text) => this.say(text));
    this.connectButtons();
    this.connection = new Connection((message) => this.receive(message), (status) => this.onStatus(status));
    addEventListener("pagehide", () => this.keepPlace());
  }

  connectButtons() {
    const act = (what) => this.connection.send("do", { what });
    const actions = {
      pause: () => act("pause"),
      go: () => act("go"),
      step: () => act("step"),
      undo: () => this.edits.undo() && act("undo"),
      try: () => this.edits.hold(!this.edits.isHeld),
      rehearse: () => this.trial.rehearse(),
      commit: () => this.edits.hold(false),
      discard: () => this.trial.discard(),
      theirs: () => this.edits.resolve(false),
      ours: () => this.edits.resolve(true),
      save: () => save(this.edits.file || `${this.hello.name}.lrp`, this.editor.view.state.doc.toString()),
    };
    for (const [id, action] of Object.entries(actions)) part(id).addEventListener("click", action);
    part("file").addEventListener("change", ({ target }) => this.openFile(target.value));
    addEventListener("keydown", (event) => {
      const button = event.altKey && document.querySelector(`button[data-code="${event.code}"]`);
      if (!button) return;
      button.click();
      event.preventDefault();
    });
  }

  /** Call `onHello` and so on, by the kind of the message. */
  receive(message) {
    const asked = { why: this.why, tried: this.trial }[message.kind];
    if (asked) asked.onAnswer(message);
    else this[`on${message.kind[0].toUpperCase()}${message.kind.slice(1)}`]?.(message);
  }

  onHello(message) {
    const kept = this.hello === null ? JSON.parse(sessionStorage.getItem(PLACE) ?? "{}") : {};
    this.programs = new Map([[message.number, message]]);
    Object.assign(this, { hello: message, live: null, past: null, isAsking: false });
    this.units = new Map(message.parts.map((one) => [one.name, one.unit]));
    document.title = message.title;
    setText(part("title"), message.title);
    this.history.clear();
    this.time.setEnd(message.until_s);
    this.editor.begin(!message.is_editable);
    this.edits.begin(message, kept.draft);
    if (kept.place) this.editor.place = kept.place;
    if (kept.shown_s !== undefined || !message.is_live) this.time.go(kept.shown_s ?? null);
  }

  onTimeline({ moments, until_s }) {
    this.history.add(moments);
    this.time.setEnd(until_s);
    this.render();
  }

  onState(state) {
    if (state.is_live) {
      this.live = state;
      this.history.add(state.changes);
      this.time.setEnd(state.t_s);
      this.announce(state.changes.at(-1));
      document.body.dataset.program = state.number;
    } else {
      this.past = state;
      this.onAnswered();
    }
    this.render();
  }

  onProgram(program) {
    const isNewest = program.number > this.newest;
    this.programs.set(program.number, program);
    if (isNewest) this.edits.onProgram(program);
  }

  onEdited(message) {
    this.edits.onEdited(message);
    if (message.notes.length) this.say(message.notes.join(" "));
  }

  onRefused({ message, reason }) {
    this.say(reason);
    if (message === "edit") this.edits.onRefused();
    else if (message === "try") this.trial.onAnswer({ error: reason });
    else if (message === "show") this.onAnswered();
  }

  onStatus(status) {
    this.status = status;
    if (!["open", "lost"].includes(status)) this.say(status);
    this.render();
  }

  get newest() {
    return Math.max(...this.programs.keys());
  }

  /** Ask for the state of a moment; null for the newest one, which comes by itself while the run continues. */
  ask(t_s) {
    const isAsked = t_s !== null || !this.hello?.is_live;
    this.question = isAsked ? { t_s: t_s ?? this.time.end_s } : null;
    if (!this.isAsking) this.onAnswered();
    this.render();
  }

  /** A question is answered: ask the newest one that came meanwhile, while a slider is moved. */
  onAnswered() {
    this.isAsking = this.question !== null && this.connection.send("show", this.question);
    this.question = null;
  }

  /** Draw in the next frame: several messages may come before it. */
  render() {
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.showStatus();
    const isNow = this.time.shown_s === null && this.live !== null;
    const state = isNow ? this.live : this.past;
    const program = this.programs.get(state?.number);
    if (!program) return;
    const totals = this.history.until(state.t_s);
    const last = this.history.transitionUntil(state.t_s);
    this.diagram.show({ ...state, last, isLive: isNow, shares: totals.shares(state.t_s) }, program);
    this.showSignals(program.signals);
    this.values.show(state, this.units, isNow && this.hello.rights === "change");
    const isNewest = program.number === this.newest;
    this.editor.showPast(isNewest ? null : textOf(program, this.edits.file));
    this.showFiles(program);
    setText(part("number"), `number ${program.number}${isNewest ? "" : ", of that moment"}`);
    const isSameText = !isNewest || !this.edits.isDirty;
    this.problems.show({ ofRun: state.problems, isSameText: isSameText && isNewest && !this.edits.file });
    const marks = marksOf(this.transitions(program), last, totals.taken);
    if (isSameText) this.editor.mark({ ...marks, isScrolled: this.time.shown_s !== null });
  }

  showStatus() {
    const { status, time, hello } = this;
    const isPaused = this.live?.is_paused ?? false;
    const run = isPaused ? "paused" : hello?.is_live ? "live" : "recorded";
    const words = { connecting: "connecting", lost: "no connection", open: time.shown_s === null ? run : "past" };
    part("status").dataset.word = words[status] ?? "ended";
    setText(part("status"), words[status] ?? "ended");
    const canChange = status === "open" && hello?.is_live && hello.rights === "change";
    part("pause").disabled = !canChange || isPaused;
    part("go").disabled = part("step").disabled = !canChange || !isPaused;
    part("signals").disabled = !canChange;
    part("undo").disabled = part("try").disabled = !canChange || !hello.is_editable;
    part("rehearse").disabled = part("commit").disabled = !canChange;
  }

  /** Offer the program, and the files that it imports. */
  showFiles({ files }) {
    const names = ["", ...Object.keys(files)];
    if (`${names}` !== this.files) {
      this.files = `${names}`;
      part("file").hidden = names.length === 1;
      part("file").replaceChildren(...names.map((one) => make("option", { value: one }, one || "program")));
    }
    part("file").value = this.edits.file;
  }

  /** Show a file in the editor; return whether it is shown. */
  openFile(file) {
    const isOpen = this.edits.open(file);
    if (!isOpen) this.say("This text does not run yet: finish it, or Undo.");
    this.render();
    return isOpen;
  }

  /** Return the transitions that are declared in the file that is shown. */
  transitions(program = this.diagram.program) {
    return transitionsOf(program).filter((one) => one.file === this.edits.file);
  }

  showSignals(signals) {
    if (`${signals}` === this.signals) return;
    this.signals = `${signals}`;
    const give = (signal) => () => this.connection.send("give", { signal });
    const buttons = signals.map((one) => make("button", { type: "button", onclick: give(one) }, one));
    part("signals").replaceChildren(...buttons);
  }

  openWhy(transition) {
    if (!transition) return; // the line has none
    this.why.open(transition);
    if (this.openFile(transition.file)) this.editor.goTo(transition.line);
  }

  /** What the editor offers while the user writes. */
  known() {
    const machines = allMachines(this.diagram.program.graph);
    const names = machines.flatMap((one) => [one, ...one.states]).map(({ name }) => name);
    const variables = Object.keys(this.live?.variables ?? {}).map((path) => path.split(".").at(-1));
    return { parts: this.hello.parts, names: [...names, ...this.hello.signals], variables };
  }

  announce(change) {
    if (!change || performance.now() < (this.quietUntil_ms ?? 0)) return;
    this.quietUntil_ms = performance.now() + ANNOUNCE_MS;
    setText(part("announcement"), `${change.machine}: ${change.source || "start"} to ${change.target || "end"}`);
  }

  say(text) {
    setText(part("message"), text);
    clearTimeout(this.messageTimer);
    this.messageTimer = setTimeout(() => setText(part("message"), ""), MESSAGE_MS);
  }

  keepPlace() {
    const [{ place }, { draft }] = [this.editor, this.edits];
    sessionStorage.setItem(PLACE, JSON.stringify({ shown_s: this.time.shown_s ?? undefined, place, draft }));
  }
}

/** Return the line of the last transition, and how often each of the ones found was taken by line. */
function marksOf(found, last, taken) {
  const counts = new Map(found.filter(({ key }) => taken.has(key)).map(({ key, line }) => [line, taken.get(key)]));
  const lastLine = last && found.find(({ key }) => keysOfChange(last).includes(key))?.line;
  return { lastLine: lastLine ?? 0, counts };
}

new Page();
