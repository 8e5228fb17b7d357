// The time: a slider over the run that is live at its right end, and steps from one change of state to the next.

import { part, seconds, setText } from "./dom.js";

const MARKS = 3000; // at most, of changes of state

export class Time {
  shown_s = null; // null: the newest moment
  end_s = 0;

  /** `show` is called with a time, or with null for the newest moment. */
  constructor(history, show) {
    Object.assign(this, { history, show });
    this.slider = part("slider");
    this.slider.addEventListener("input", () => {
      const t_s = Number(this.slider.value);
      this.go(t_s >= Number(this.slider.max) ? null : t_s);
    });
    // While the slider is moved its end stays, or it would move away under the hand.
    this.slider.addEventListener("pointerdown", () => (this.isDragged = true));
    for (const name of ["pointerup", "pointercancel", "blur"]) {
      this.slider.addEventListener(name, () => (this.isDragged = false));
    }
    this.slider.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      if (!step) return;
      this.step(step);
      event.preventDefault();
    });
    part("previous").addEventListener("click", () => this.step(-1));
    part("next").addEventListener("click", () => this.step(1));
    part("now").addEventListener("click", () => this.go(null));
  }

  go(t_s) {
    this.shown_s = t_s;
    this.update();
    this.show(t_s);
  }

  /** Go to the change of state before or after what is shown. */
  step(step) {
    const next = this.history.neighbour(this.shown_s ?? this.end_s, step);
    if (next !== undefined || step > 0) this.go(next ?? null);
  }

  setEnd(end_s) {
    this.end_s = end_s;
    this.update();
  }

  update() {
    const t_s = this.shown_s ?? this.end_s;
    if (!this.isDragged) {
      this.slider.max = this.end_s;
      this.slider.value = t_s;
      this.drawMarks();
    }
    this.slider.setAttribute("aria-valuetext", this.shown_s === null ? `${seconds(t_s)}, newest` : seconds(t_s));
    setText(part("shown"), seconds(t_s));
    setText(part("end"), `of ${seconds(this.end_s, 1)}`);
    part("now").setAttribute("aria-pressed", this.shown_s === null);
  }

  drawMarks() {
    part("track").firstElementChild.setAttribute("viewBox", `0 0 ${this.end_s || 1} 1`);
    const { changes } = this.history;
    if (changes.length === this.marked) return;
    this.marked = changes.length;
    let last_s = -1;
    const isApart = ({ t_s }) => t_s - last_s > this.end_s / MARKS && ((last_s = t_s), true);
    part("marks").setAttribute("d", changes.filter(isApart).map((one) => `M${one.t_s},0V1`).join(""));
  }
}
