// What a program consists of, and the names under which its transitions are counted.

/** Return all machines of a graph, nested ones too. */
export function allMachines(graph) {
  return graph.flatMap((one) => [one, ...one.states.flatMap((state) => allMachines(state.machines))]);
}

/**
 * Return all transitions, each with path and file of its machine and with its key. The key is the same in another program,
 * whose lines may have moved; only if several transitions have the same name and target, it is by line.
 */
export function transitionsOf({ graph, number }) {
  const found = allMachines(graph).flatMap(({ path, file, transitions }) =>
    transitions.map((one) => ({ ...one, path, file, key: keyOf(machineOf(path, one), one) })),
  );
  const count = new Map();
  for (const { key } of found) count.set(key, (count.get(key) ?? 0) + 1);
  return found.map((one) => (count.get(one.key) > 1 ? { ...one, key: exactKey(one.key, number, one.line) } : one));
}

/** Return the two keys of a change of state: by name, and by line. */
export function keysOfChange(change) {
  const key = keyOf(change.machine, change);
  return [key, exactKey(key, change.number, change.line)];
}

/** Return the names of the states that some sequence of transitions reaches, whatever their conditions are. */
export function reachable({ initial, states, transitions }) {
  const found = new Set([initial]);
  for (const name of found) {
    const inside = states.find((one) => one.name === name)?.machines.flatMap((one) => one.transitions) ?? [];
    const own = transitions.filter(({ kind, source }) => kind !== "exit" && ["*", name].includes(source));
    for (const { target } of [...own, ...inside.filter(({ kind }) => kind === "exit")]) found.add(target);
  }
  return found;
}

const keyOf = (machine, { name, target }) => `${machine} ${name} ${target}`;
const exactKey = (key, number, line) => `${key} ${number} ${line}`;
// An exit is a change of the machine around.
const machineOf = (path, { kind }) => (kind === "exit" ? path.split("/").slice(0, -2).join("/") : path);
