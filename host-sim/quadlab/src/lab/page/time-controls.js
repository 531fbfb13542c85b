// The controls above the linked plots.

import { choice, el } from "./dom.js";
import { withUnit } from "./numbers.js";

/** @typedef {import("./api.js").Channel} Channel */

const MOST_AHEAD = 50;
const FIRST_AHEAD = 10;

/**
 * What is compared: accelerations, or predictions so many samples ahead.
 * @param {{ahead: number}} view
 * @param {(ahead: number, other: boolean) => void} change number of samples, 0 for accelerations; whether the channels are others now
 */
export function modeOf(view, change) {
  const ahead = view.ahead > 0;
  const fields = el("fieldset", {}, el("legend", { class: "hidden" }, "What is compared"));
  const mode = (/** @type {string} */ text, /** @type {number} */ value) =>
    el(
      "label",
      {},
      el("input", {
        type: "radio",
        name: "mode",
        checked: ahead === value > 0,
        "data-key": `mode ${text}`,
        change: () => change(value, true),
      }),
      " ",
      text,
    );
  const samples = (/** @type {string} */ type) =>
    el("input", {
      type,
      min: 1,
      max: MOST_AHEAD,
      step: 1,
      value: view.ahead || FIRST_AHEAD,
      disabled: !ahead,
      id: `ahead-${type}`,
      "aria-label": "Samples ahead",
      "data-key": `ahead ${type}`,
      input: (/** @type {any} */ event) => {
        for (const other of fields.querySelectorAll("#ahead-range, #ahead-number")) other.value = event.target.value;
      },
      change: (/** @type {any} */ event) =>
        change(Math.max(1, Math.min(MOST_AHEAD, Math.round(Number(event.target.value)) || 1)), false),
    });
  fields.append(
    mode("accelerations", 0),
    mode("predicted ahead", FIRST_AHEAD),
    samples("range"),
    samples("number"),
    " samples",
  );
  return fields;
}

/**
 * A second flight, and by how much it is drawn later.
 * @param {string[]} names of the other flights @param {{beside: string, shift: number}} view
 * @param {(change: {beside?: string, shift?: number}) => void} change
 */
export function besideOf(names, view, change) {
  const flights = choice(
    "beside flight",
    "beside",
    [["", "none"], ...names.map((name) => /** @type {[string, string]} */ ([name, name]))],
    view.beside,
    (beside) => change({ beside, shift: 0 }),
  );
  if (!view.beside) return flights;
  const shift = el("input", {
    type: "number",
    id: "shift",
    step: 0.1,
    value: view.shift,
    "data-key": "shift",
    change: (/** @type {any} */ event) => change({ shift: Number(event.target.value) || 0 }),
  });
  return el("span", { class: "pair" }, flights, el("label", {}, " starting later by ", shift, " s"));
}

/** A button for the range of time. @param {string} id @param {string} text @param {string} label @param {() => void} click */
export function tool(id, text, label, click) {
  return el(
    "button",
    { type: "button", id, "aria-label": /\w/.test(text) ? null : label, title: label, "data-key": id, click },
    text,
  );
}

/**
 * A button for each channel, by group.
 * @param {Channel[]} channels @param {string[]} on ids of those that are shown @param {(ids: string[]) => void} change
 */
export function chipsOf(channels, on, change) {
  const inOrder = (/** @type {string[]} */ ids) => change(channels.map((c) => c.id).filter((id) => ids.includes(id)));
  const chip = (/** @type {Channel} */ c) =>
    el(
      "button",
      {
        type: "button",
        class: "chip",
        "data-key": `channel ${c.id}`,
        "data-channel": c.id,
        "aria-pressed": String(on.includes(c.id)),
        title: `${withUnit(c.name, c.unit)}; double click to see it alone`,
        click: () => inOrder(on.includes(c.id) ? on.filter((id) => id !== c.id) : [...on, c.id]),
        dblclick: () => inOrder([c.id]),
      },
      c.id.replace(/_/g, " "),
    );
  const groups = [...new Set(channels.map((c) => c.group))];
  return groups.flatMap((group) => [
    groups.length > 1 && el("span", { class: "quiet" }, group),
    ...channels.filter((c) => c.group === group).map(chip),
  ]);
}
