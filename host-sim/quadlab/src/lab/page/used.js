// Which parts of the shown flight are used: what is said of it, the buttons that change it, and the shades of what is not used.

import { el } from "./dom.js";
import { faint } from "./plots.js";

/** @typedef {[number, number]} Range first and last time, s */
/** @typedef {import("./api.js").Used} Used */

/** Shorter parts are none, s. */
const LEAST_S = 0.05;
/** Parts that are named; there may be hundreds. */
const NAMED = 4;

/** What lies in ranges and within another. @param {Range[]} ranges @param {Range} within @returns {Range[]} */
export const within = (ranges, [from, to]) =>
  clean(ranges.map(([a, b]) => /** @type {Range} */ ([Math.max(a, from), Math.min(b, to)])));

/** What lies in ranges and not in another. @param {Range[]} ranges @param {Range} other @returns {Range[]} */
export const without = (ranges, [from, to]) =>
  clean(ranges.flatMap(([a, b]) => /** @type {Range[]} */ ([[a, Math.min(b, from)], [Math.max(a, to), b]])));

/** What lies in either of two rows of ranges. @param {Range[]} ranges @param {Range[]} others @returns {Range[]} */
export function either(ranges, others) {
  /** @type {Range[]} */
  const all = [];
  for (const [from, to] of [...ranges, ...others].sort((a, b) => a[0] - b[0])) {
    const last = all[all.length - 1];
    if (last && from <= last[1]) last[1] = Math.max(last[1], to);
    else all.push([from, to]);
  }
  return all;
}

/** @param {Range[]} ranges */
const clean = (ranges) => ranges.filter(([from, to]) => to - from >= LEAST_S);

/** What of a flight can be looked at: all that flies, and what else is used. @param {Used} used */
export const there = (used) => either(used.flown, used.parts);

/** What of a range is not used. @param {Used} used @param {Range} range */
export const unused = (used, range) => used.parts.reduce((left, part) => without(left, part), [range]);

/** @param {Range} range */
const said = ([from, to]) => `${from.toFixed(2)} to ${to.toFixed(2)} s`;

/** What is used of a flight, as a sentence. @param {Used} used */
export function saidOf(used) {
  if (!used.chosen) return `All airborne parts of ${used.flight} are used.`;
  const more = used.parts.length > NAMED ? ` and ${used.parts.length - NAMED} more` : "";
  return `Used of ${used.flight}: ${used.parts.slice(0, NAMED).map(said).join(", ")}${more}. The rest is shaded.`;
}

/**
 * Buttons that change which parts are used.
 * @param {Used} used @param {Range} range which they are about @param {boolean} dragged whether the user has dragged over it
 * @param {Range} whole the range of all that is drawn @param {boolean} busy @param {(parts: Range[]|null) => void} change
 */
export function usedButtons(used, range, dragged, whole, busy, change) {
  const same = (/** @type {Range[]} */ one, /** @type {Range[]} */ other) => JSON.stringify(one) === JSON.stringify(other);
  const button = (
    /** @type {string} */ id,
    /** @type {string} */ text,
    /** @type {string} */ title,
    /** @type {Range[]|null} */ wanted,
  ) => {
    const parts = wanted && same(wanted, used.flown) ? null : wanted;
    const isNothing = parts ? !parts.length || same(parts, used.parts) : !used.chosen;
    return el(
      "button",
      { type: "button", id, title, "data-key": id, disabled: busy || isNothing, click: () => change(parts) },
      text,
    );
  };
  // Filters take the first and last samples of a flight, which are drawn nowhere and belong to what begins or ends there.
  const [from, to] = range;
  const about = /** @type {Range} */ ([from <= whole[0] ? -Infinity : from, to >= whole[1] ? Infinity : to]);
  const here = within(there(used), about);
  return [
    el("span", {}, `${dragged ? "Dragged" : "Shown"} range, ${said(range)}:`),
    button("use-only", "Use only this range", "Nothing else of this flight is used", here),
    button("use-not", "Leave this range out", "What else is used of this flight stays", without(used.parts, about)),
    used.chosen && button("use-too", "Use this range too", "Beside what is used already", either(used.parts, here)),
    button("use-all", "Use all airborne parts", "Removes the file that says which parts are used", null),
  ];
}

/**
 * Shades of what is not used, over all panels.
 * @param {Range[]} ranges @param {number} panels
 */
export function shades(ranges, panels) {
  const axis = (/** @type {string} */ name, /** @type {number} */ n) => (n ? `${name}${n + 1}` : name);
  return Array.from({ length: 2 * panels }, (_, n) =>
    ranges.map(([x0, x1]) => ({
      type: "rect",
      xref: axis("x", n),
      yref: `${axis("y", n)} domain`,
      x0,
      x1,
      y0: 0,
      y1: 1,
      fillcolor: faint("measured", 0.2),
      line: { width: 0 },
      layer: "below",
    })),
  ).flat();
}
