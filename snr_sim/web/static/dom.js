// Elements of the page. Text becomes text nodes only: nothing in a program is ever read as HTML.

/** Return a new element; attributes that begin with "on" are listeners. */
export function make(name, attributes = {}, ...children) {
  return fill(document.createElement(name), attributes, children);
}

/** Return a new element of a drawing. */
export function draw(name, attributes = {}, ...children) {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
}

/** Return the element of the page with an id. */
export const part = (id) => document.getElementById(id);

export const seconds = (t_s, digits = 2) => `${t_s.toFixed(digits)} s`;

/** Change an element's text, if it is another one. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}
