// Where states and arrows are drawn. A worker of its own: the layout of 50 states takes a second.
//
// dagre cannot lay out an arrow that ends at a cluster. But arrows of a machine never leave it: so each machine is laid
// out by itself, the innermost first, and its state gets the size of what is in it.

import { Graph, layout } from "./lib/dagre.js";

const STATE_PX = 40; // height of a state, without what is inside
const TITLE_PX = 24;
const [CHAR_PX, SMALL_CHAR_PX] = [7.3, 6.7]; // of a monospaced font at 12 and 11 px
const MAX_LABEL = 26; // characters
const MAX_STATES = 40; // in a machine, before what is inside its states is collapsed
const GAP_PX = 10;

/** Return where everything of machines side by side is. `isOpen` holds choices of the user by state. */
function place(machines, isOpen = {}) {
  const placed = machines.map((one) => placeMachine(one, isOpen));
  let x = 0;
  for (const one of placed) {
    Object.assign(one, { x, y: 0 });
    x += one.width + 2 * GAP_PX;
  }
  const height = Math.max(0, ...placed.map((one) => one.height));
  return { machines: placed, width: Math.max(0, x - 2 * GAP_PX), height };
}

function placeMachine(machine, isOpen) {
  const graph = new Graph({ multigraph: true });
  graph.setGraph({ nodesep: 18, ranksep: 26, edgesep: 14, marginx: GAP_PX, marginy: GAP_PX });
  graph.setDefaultEdgeLabel(() => ({}));
  for (const state of machine.states) graph.setNode(`s ${state.name}`, sizeOfState(machine, state, isOpen));
  machine.transitions.forEach((one, i) => {
    const [source, target] = ends(graph, one, i);
    const text = one.label.replace(/\s+/g, " ");
    const label = text.length <= MAX_LABEL ? text : `${text.slice(0, MAX_LABEL - 1)}…`;
    const size = { width: SMALL_CHAR_PX * label.length + 6, height: 16 };
    graph.setEdge(source, target, { i, label, labelpos: "c", ...size }, `${i}`);
  });
  layout(graph);
  const nodes = graph.nodes().map((key) => {
    const one = graph.node(key);
    return { ...one, x: one.x - one.width / 2, y: one.y - one.height / 2 + TITLE_PX };
  });
  const edges = graph.edges().map((key) => {
    const edge = graph.edge(key);
    const points = key.v === key.w ? loop(graph.node(key.v), edge) : edge.points;
    return { ...edge, y: edge.y + TITLE_PX, points: points.map(({ x, y }) => ({ x, y: y + TITLE_PX })) };
  });
  const width = Math.max(graph.graph().width, CHAR_PX * machine.name.length + 2 * GAP_PX);
  return { path: machine.path, name: machine.name, nodes, edges, width, height: graph.graph().height + TITLE_PX };
}

function sizeOfState(machine, { name, machines }, isOpen) {
  const key = `${machine.path}/${name}`;
  const isCollapsible = machines.length > 0;
  const isShown = isOpen[key] ?? machine.states.length <= MAX_STATES;
  const inner = isCollapsible && isShown ? place(machines, isOpen) : null;
  const own = CHAR_PX * name.length + (isCollapsible ? 100 : 78); // the time in the state, a button
  const width = Math.max(own, inner ? inner.width + 2 * GAP_PX : 0);
  const height = STATE_PX + (inner ? inner.height + GAP_PX : 0);
  return { kind: "state", key, name, inner, innerY: STATE_PX, isCollapsible, width, height };
}

/** Return the points of an arrow from a state to itself: dagre keeps room for it, and returns points beside that. */
function loop(node, { x, y }) {
  const right = node.x + node.width / 2;
  return [[right, y - 10], [x, y - 26], [x, y + 26], [right, y + 10]].map(([x, y]) => ({ x, y }));
}

/** Return the nodes at the ends of an arrow; "from any state" and "out of the machine" are nodes of their own. */
function ends(graph, one, i) {
  const source = one.source === "*" ? "any" : `s ${one.source}`;
  if (one.source === "*" && !graph.hasNode(source)) {
    graph.setNode(source, { kind: "any", name: "any state", width: 84, height: 26 });
  }
  if (one.kind !== "exit") return [source, `s ${one.target}`];
  graph.setNode(`exit ${i}`, { kind: "exit", name: one.target, width: CHAR_PX * one.target.length + 40, height: 24 });
  return [source, `exit ${i}`];
}

self.onmessage = ({ data }) => self.postMessage({ key: data.key, placed: place(data.machines, data.isOpen) });
