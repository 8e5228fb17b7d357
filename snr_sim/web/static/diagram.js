// The diagram: machines side by side, nested ones inside their states. The layout comes from a worker.

import { draw, seconds, setText } from "./dom.js";
import { allMachines, keysOfChange, reachable, transitionsOf } from "./program.js";

const [MIN_SCALE, MAX_SCALE] = [0.62, 1.5]; // smaller text is not readable: the diagram scrolls instead

export class Diagram {
  program = { graph: [], number: 0 };
  isOpen = {}; // states whose nested machines the user has shown or hidden
  states = new Map();
  arrows = [];

  /** `onState` is called with a line and the file it is in, `onTransition` with a transition. */
  constructor(container, parts) {
    Object.assign(this, { container, ...parts });
    this.worker = new Worker(new URL("layout.js", import.meta.url), { type: "module" });
    this.worker.onmessage = ({ data }) => {
      if (data.key !== this.wanted) return; // another program came meanwhile
      Object.assign(this, { key: data.key, placed: data.placed });
      this.redraw();
    };
    new ResizeObserver(() => this.fit()).observe(container);
    container.addEventListener("keydown", (event) => this.onKey(event));
  }

  /** Draw a program. The layout is kept if only blocks have changed. */
  setProgram(program) {
    this.program = program;
    const key = JSON.stringify([program.graph, this.isOpen], (name, value) => (name === "line" ? undefined : value));
    this.wanted = key;
    if (key === this.key) this.redraw();
    else this.worker.postMessage({ key, machines: program.graph, isOpen: this.isOpen });
  }

  redraw() {
    const focused = this.container.querySelector(":focus")?.dataset.key;
    const { width, height, machines } = this.placed;
    this.states.clear();
    this.arrows = [];
    this.machines = new Map(allMachines(this.program.graph).map((one) => [one.path, one]));
    this.transitions = Map.groupBy(transitionsOf(this.program), ({ path }) => path);
    this.svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, role: "group", "aria-label": "State machines" });
    this.svg.append(...machines.map((one) => this.drawMachine(one, one.x, one.y)));
    this.container.replaceChildren(this.svg);
    const first = this.items().find((one) => one.dataset.key === focused) ?? this.items()[0];
    first?.setAttribute("tabindex", "0");
    if (focused) first?.focus();
    this.fit();
    this.lastChange = null;
    this.show(this.moment, this.program);
  }

  fit() {
    if (!this.svg) return;
    const { clientWidth, clientHeight } = this.container;
    const { width, height } = this.placed;
    const scale = Math.max(MIN_SCALE, Math.min(MAX_SCALE, (clientWidth - 16) / width, (clientHeight - 16) / height));
    this.svg.setAttribute("width", width * scale);
    this.svg.setAttribute("height", height * scale);
  }

  drawMachine({ path, name, width, height, nodes, edges }, x, y) {
    const machine = this.machines.get(path);
    const isReached = reachable(machine);
    return draw(
      "g",
      { transform: `translate(${x},${y})` },
      draw("rect", { width, height, rx: 8, class: "border" }),
      draw("text", { x: 10, y: 17, class: "title" }, name),
      ...edges.map((one) => this.drawArrow(one, this.transitions.get(path)[one.i])),
      ...nodes.map((one) => (one.kind === "state" ? this.drawState(one, machine, isReached) : drawOutside(one))),
    );
  }

  drawState({ key, name, x, y, width, height, inner, innerY, isCollapsible }, machine, isReached) {
    const state = machine.states.find((one) => one.name === name);
    const held = draw("text", { x: width - (isCollapsible ? 30 : 8), y: 18, class: "held" });
    const share = draw("rect", { x: 8, y: 30, height: 3, width: 0, class: "share" });
    const kind = isReached.has(name) ? "state" : "state unreachable";
    const group = this.button(
      { class: kind, "data-key": key, transform: `translate(${x},${y})` },
      () => this.onState(state.line, machine.file),
      draw("rect", { width, height, rx: 10, class: "box" }),
      draw("path", { d: "M8,8l9,5.5l-9,5.5z", class: "mark" }),
      draw("text", { x: 22, y: 18, class: "name" }, name),
      held,
      draw("rect", { x: 8, y: 30, height: 3, width: width - 16, class: "whole" }),
      share,
    );
    if (isCollapsible) group.append(this.drawToggle(key, width - 24, !inner));
    group.append(...(inner?.machines ?? []).map((one) => this.drawMachine(one, one.x + 10, innerY)));
    this.states.set(key, { group, held, share, width: width - 16, state, path: machine.path });
    return group;
  }

  drawToggle(key, x, willOpen) {
    const toggle = (event) => {
      event.stopPropagation();
      this.isOpen[key] = willOpen;
      this.setProgram(this.program);
    };
    return draw(
      "g",
      { class: "toggle", onclick: toggle, transform: `translate(${x},6)` },
      draw("title", {}, `${willOpen ? "Show" : "Hide"} the machines inside`),
      draw("rect", { width: 16, height: 16, rx: 3 }),
      draw("text", { x: 8, y: 12 }, willOpen ? "+" : "−"),
    );
  }

  drawArrow({ points, x, y, label, width, i }, transition) {
    const { name, source, target, path, key } = transition;
    const group = this.button(
      {
        class: "arrow",
        "data-key": `${path} ${name} ${i}`,
        "aria-label": `${name}: from ${source} to ${target}, ${transition.label}. Ask why.`,
      },
      () => this.onTransition(transition),
      draw("title", {}, `${name}: ${transition.label}`),
      draw("path", { d: curve(points), class: "wide" }),
      draw("path", { d: curve(points), class: "line" }),
      draw("path", { d: head(points), class: "head" }),
      draw("rect", { x: x - width / 2, y: y - 8, width, height: 16, class: "paper" }),
      draw("text", { x, y: y + 4, class: "label" }, label),
    );
    this.arrows.push({ group, source, key });
    return group;
  }

  button(attributes, action, ...children) {
    const onclick = (event) => {
      event.stopPropagation(); // a state may be inside another one
      action();
    };
    return draw("g", { ...attributes, tabindex: "-1", role: "button", onclick }, ...children);
  }

  /** Show a moment of a program: active states, how long they have been held, the last transition. */
  show(moment, program) {
    this.moment = moment;
    if (program !== this.program) this.setProgram(program);
    for (const [key, { group, held, share, width, state, path }] of this.states) {
      const isActive = moment.active[path] === state.name;
      group.classList.toggle("active", isActive);
      group.setAttribute("aria-label", `State ${state.name}${isActive ? ", active" : ""}, line ${state.line}`);
      setText(held, isActive ? seconds(moment.t_s - moment.entered_s[path], 1) : "");
      share.setAttribute("width", width * (moment.shares.get(key) ?? 0));
    }
    const { last, isLive } = moment;
    const change = JSON.stringify([last, isLive]);
    if (change === this.lastChange) return;
    this.lastChange = change;
    const entered = this.states.get(`${last?.machine}/${last?.target}`)?.group;
    const isFree = !this.container.matches(":hover, :focus-within");
    if (isFree) entered?.scrollIntoView({ block: "nearest", inline: "nearest" });
    for (const { group, source, key } of this.arrows) {
      const isSource = last?.kind === "exit" || ["*", last?.source].includes(source);
      const isLast = last && isSource && keysOfChange(last).includes(key);
      group.classList.remove("last", "fading");
      group.getBoundingClientRect(); // so that the animation begins again
      if (isLast) group.classList.add("last", ...(isLive ? ["fading"] : []));
    }
  }

  items() {
    return [...this.container.querySelectorAll("[data-key]")];
  }

  /** Arrow keys go from one state or transition to the next; Enter chooses it, + and - show and hide what is inside. */
  onKey(event) {
    const items = this.items();
    const now = items.indexOf(document.activeElement);
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (now < 0 || !(step || ["Enter", " ", "+", "-"].includes(event.key))) return;
    event.preventDefault();
    if (step) {
      const next = items[(now + step + items.length) % items.length];
      items[now].setAttribute("tabindex", "-1");
      next.setAttribute("tabindex", "0");
      next.focus();
      return;
    }
    const isToggle = "+-".includes(event.key);
    const chosen = isToggle ? items[now].querySelector(":scope > .toggle") : items[now];
    chosen?.dispatchEvent(new MouseEvent("click", { bubbles: true }));
  }
}

/** Draw "any state", or the state of the machine around to which an exit leads: its point shows the direction. */
function drawOutside({ kind, name, x, y, width: w, height: h }) {
  const flag = () => draw("path", { d: `M0,0H${w - 12}L${w},${h / 2}L${w - 12},${h}H0Z`, class: "outside" });
  const shape = kind === "exit" ? flag() : draw("rect", { width: w, height: h, rx: h / 2, class: "outside" });
  const text = draw("text", { x: w / 2, y: h / 2 + 4, class: "note" }, name);
  return draw("g", { transform: `translate(${x},${y})` }, shape, text);
}

function curve([first, ...points]) {
  const end = points.pop();
  const parts = points.map((one, i) => {
    const next = points[i + 1];
    const to = next ? { x: (one.x + next.x) / 2, y: (one.y + next.y) / 2 } : end;
    return `Q${one.x},${one.y} ${to.x},${to.y}`;
  });
  return `M${first.x},${first.y}${parts.join("") || `L${end.x},${end.y}`}`;
}

function head(points) {
  const [from, to] = points.slice(-2);
  const length = Math.hypot(to.x - from.x, to.y - from.y) || 1;
  const [dx, dy] = [(8 * (to.x - from.x)) / length, (8 * (to.y - from.y)) / length];
  return `M${to.x},${to.y}l${-dx - dy / 2},${-dy + dx / 2}l${dy},${-dx}Z`;
}
