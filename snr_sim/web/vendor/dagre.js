// What the page uses of the layout of graphs: a file of its own, because a worker loads it.
export { Graph, layout } from "@dagrejs/dagre";
