// LRP in the editor: colours of the forms and of the Python in their blocks, and what can be completed where.

import { StreamLanguage } from "./lib/editor.js";

const words = (text) => text.trim().split(/\s+/);
const FORMS = words(`actions always break def event eps exit export import machine on onentry onerror onexit ontime
  running spawn state var`);
const KEYWORDS = words("and or not if elif else for in is pass None True False");
const NAMES = words(`robot now_ms in_state_ms signal random log math abs all any bool divmod enumerate float int len
  max min range round sorted str sum tuple zip`);

export const language = StreamLanguage.define({
  name: "lrp",
  // Brackets open in a block, its open quote, forms that are open, and whether the name of a form follows.
  startState: () => ({ depth: 0, quote: "", open: 0, isForm: false }),
  token: (stream, state) => {
    if (stream.eatSpace()) return null;
    return state.depth ? pythonToken(stream, state) : formToken(stream, state);
  },
  indent: (state, after, context) => {
    const closed = /^\)*/.exec(after)[0].length;
    return context.unit * Math.max(0, state.open + (state.depth ? 1 : 0) - closed);
  },
  languageData: { commentTokens: { line: ";" }, closeBrackets: { brackets: ["(", "[", '"'] } },
});

function formToken(stream, state) {
  if (stream.match(/^;.*/)) return "comment";
  if (stream.match(/^"[^"\n]*"?/)) return "string";
  if (stream.match(/^(?:->|:=|\*)/)) return "operator";
  if (stream.match(/^\d+/)) return "number";
  const { isForm } = state;
  state.isForm = false;
  if (stream.match(/^[A-Za-z_](?:\w|-(?!>))*/)) {
    return isForm ? (FORMS.includes(stream.current()) ? "keyword" : "invalid") : "variableName";
  }
  const char = stream.next();
  if (char === "(") Object.assign(state, { open: state.open + 1, isForm: true });
  else if (char === ")") state.open = Math.max(0, state.open - 1);
  else if (char === "[") state.depth = 1;
  return "bracket";
}

function pythonToken(stream, state) {
  if (state.quote) {
    let isClosed = false;
    while (!stream.eol() && !isClosed) {
      isClosed = stream.match(state.quote);
      if (!isClosed && stream.next() === "\\") stream.next();
    }
    if (isClosed || state.quote.length === 1) state.quote = "";
    return "string";
  }
  if (stream.match(/^#.*/)) return "comment";
  const quote = stream.match(/^f?('''|"""|'|")/);
  if (quote) {
    state.quote = quote[1];
    return "string";
  }
  if (stream.match(/^\d[\d_.]*(?:e[+-]?\d+)?/)) return "number";
  if (stream.match(/^\w+/)) {
    const word = stream.current();
    if (KEYWORDS.includes(word)) return "keyword";
    return NAMES.includes(word) ? "variableName.standard" : "variableName";
  }
  const char = stream.next();
  if ("[({".includes(char)) state.depth += 1;
  else if ("])}".includes(char)) state.depth -= 1;
  else return "operator";
  return "bracket";
}

/** Return what completes a word. `known()` returns the parts of the robot, names of machines and states, variables. */
export function completion(known) {
  return (context) => {
    const { parts, variables, names } = known();
    const found = (from, labels, type) => ({ from, options: [...new Set(labels)].map((label) => ({ label, type })) });
    const member = context.matchBefore(/\brobot\.(?:\w+\.)?\w*/);
    if (member) {
      const [, name, rest] = member.text.split(".");
      const from = member.from + member.text.lastIndexOf(".") + 1;
      if (rest === undefined) return found(from, [...parts.map((one) => one.name), "stop()"], "property");
      const functions = parts.find((one) => one.name === name)?.functions ?? [];
      return found(from, functions.map((one) => `${one}()`), "method");
    }
    const word = context.matchBefore(/\(?[\w-]*/);
    if (!word || (word.from === word.to && !context.explicit)) return null;
    if (word.text.startsWith("(")) return found(word.from + 1, FORMS, "keyword");
    const before = context.state.sliceDoc(0, context.pos);
    const isBlock = before.lastIndexOf("[") > before.lastIndexOf("]");
    return found(word.from, isBlock ? [...variables, ...NAMES] : names, "variable");
  };
}
