// What has happened: changes of state, how often each transition was taken, how long each state was held.

import { keysOfChange } from "./program.js";

const addTo = (map, key, amount) => map.set(key, (map.get(key) ?? 0) + amount);

class Totals {
  taken = new Map(); // number by key
  held = new Map(); // seconds by "path/state"
  active = new Map();

  add(change) {
    for (const [path, { state, since_s }] of [...this.active]) {
      if (!`${path}/`.startsWith(`${change.machine}/`)) continue;
      this.active.delete(path); // machines inside are left, too
      addTo(this.held, `${path}/${state}`, change.t_s - since_s);
    }
    if (change.target) this.active.set(change.machine, { state: change.target, since_s: change.t_s });
    for (const key of keysOfChange(change)) addTo(this.taken, key, 1);
  }

  /** Return the fraction of the time until now that each state was held. */
  shares(now_s) {
    const found = new Map(this.held);
    for (const [path, { state, since_s }] of this.active) addTo(found, `${path}/${state}`, now_s - since_s);
    for (const [key, t_s] of found) found.set(key, now_s > 0 ? t_s / now_s : 0);
    return found;
  }
}

export class History {
  constructor() {
    this.clear();
  }

  clear() {
    Object.assign(this, { changes: [], totals: new Totals(), before: { t_s: -1 } });
  }

  add(changes) {
    this.changes.push(...changes);
    for (const one of changes) this.totals.add(one);
    this.before = { t_s: -1 };
  }

  /** Return the totals until a time. */
  until(t_s) {
    if (!this.changes.length || this.changes.at(-1).t_s <= t_s) return this.totals;
    if (this.before.t_s !== t_s) {
      this.before = { t_s, totals: new Totals() };
      for (const one of this.changes) if (one.t_s <= t_s) this.before.totals.add(one);
    }
    return this.before.totals;
  }

  /** Return the newest transition until a time; a machine that begins inside the new state is none. */
  transitionUntil(t_s) {
    return this.changes.findLast((one) => one.t_s <= t_s && one.kind !== "spawn") ?? null;
  }

  /** Return the time of the change before or after a time; undefined if there is none. */
  neighbour(t_s, step) {
    const isBeyond = step > 0 ? (one) => one.t_s > t_s : (one) => one.t_s < t_s;
    return (step > 0 ? this.changes.find(isBeyond) : this.changes.findLast(isBeyond))?.t_s;
  }

  /** Return the times at which a transition was taken. */
  timesOf(key) {
    return this.changes.filter((one) => keysOfChange(one).includes(key)).map((one) => one.t_s);
  }
}
