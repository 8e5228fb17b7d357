// What can be taken away from the page: the text, the picture, and the diagram as mermaid.

/** Offer a file to be saved. */
export function save(name, text, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Return a graph as mermaid, as `snr machine draw` prints it. */
export function mermaidOf(graph) {
  const lines = ["stateDiagram-v2"];
  for (const one of graph) {
    lines.push(`    state "${one.name}" as ${id(one.name)} {`, ...machineLines(one, id(one.name), "        "), "    }");
  }
  return `${lines.join("\n")}\n`;
}

function machineLines(machine, prefix, indent) {
  const lines = [`${indent}[*] --> ${prefix}_${id(machine.initial)}`];
  for (const { name, machines } of machine.states) {
    const own = `${prefix}_${id(name)}`;
    lines.push(`${indent}state "${name}" as ${own}`);
    if (!machines.length) continue;
    lines.push(`${indent}state ${own} {`);
    machines.forEach((inner, i) => {
      if (i) lines.push(`${indent}    --`);
      lines.push(...machineLines(inner, `${own}_${id(inner.name)}`, `${indent}    `));
    });
    lines.push(`${indent}}`);
  }
  for (const { name } of machine.states) {
    const own = `${prefix}_${id(name)}`;
    for (const { kind, source, target, label } of machine.transitions) {
      if (source !== name && (source !== "*" || target === name)) continue;
      const text = label.replaceAll(":", " ");
      if (kind === "exit") lines.push(`${indent}note right of ${own} : ${text}, leaves to ${target}`);
      else lines.push(`${indent}${own} --> ${prefix}_${id(target)} : ${text}`);
    }
  }
  return lines;
}

const id = (name) => name.replaceAll(/[-#]/g, "_");
