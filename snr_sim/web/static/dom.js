// Elements of the page. Text becomes text nodes only: nothing in a program is ever read as HTML.

/** Return a new element; attributes that begin with "on" are listeners. */
export const make = (name, ...content) => fill(document.createElement(name), ...content);

/** Return a new element of a drawing. */
export const draw = (name, ...content) => fill(document.createElementNS("http://www.w3.org/2000/svg", name), ...content);

/** Return the element of the page with an id. */
export const part = (id) => document.getElementById(id);

export const seconds = (t_s, digits = 2) => `${t_s.toFixed(digits)} s`;

/** Change an element's text, if it is another one. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function fill(element, attributes = {}, ...children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** Offer a text to be saved as a file. */
export function save(name, text) {
  const link = make("a", { download: name, href: URL.createObjectURL(new Blob([text], { type: "text/plain" })) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
