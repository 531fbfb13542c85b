// What the user looks at: kept in the address after the `#`, so that a reload shows the same.

import { AXES } from "./api.js";

/**
 * @typedef {object} View
 * @property {string} tab
 * @property {string} flight
 * @property {number|null} compare  the second model
 * @property {number|null} from  s; null: from the beginning
 * @property {number|null} to
 * @property {number} ahead  samples; 0: accelerations
 * @property {string[]|null} channels  shown ones; null: those of the first choice
 * @property {string} beside  a second flight over time; empty: none
 * @property {number} shift  s by which it is drawn later than its start at the shown one's start
 * @property {boolean} difference  whether the difference of two predictions, or of two flights' residuals, is drawn
 * @property {string} axis
 * @property {string} quantity
 * @property {string} over  flight of the residual's map; empty: all of them
 * @property {string} space  how a flight is drawn in space, one of SPACES
 */

export const TABS = ["time", "where", "spectrum", "path", "model", "own"];

/** The first is the one without a choice. */
const SPACES = ["path", "flat", "map", "map-all"];

/** @returns {View} */
export function readView() {
  const fields = new URLSearchParams(location.hash.slice(1));
  const number = (/** @type {string} */ name) => {
    const text = fields.get(name);
    const value = Number(text);
    return text !== null && text !== "" && Number.isFinite(value) ? value : null;
  };
  const tab = fields.get("tab") ?? "";
  return {
    tab: TABS.includes(tab) ? tab : "time",
    flight: fields.get("flight") ?? "",
    compare: number("compare"),
    from: number("from"),
    to: number("to"),
    ahead: Math.max(0, Math.min(50, Math.round(number("ahead") ?? 0))),
    channels: fields.get("channels")?.split(" ") ?? null,
    beside: fields.get("beside") ?? "",
    shift: number("shift") ?? 0,
    difference: fields.get("difference") === "1",
    axis: AXES.find((axis) => axis === fields.get("axis")) ?? "w",
    quantity: fields.get("quantity") ?? "height",
    over: fields.get("over") ?? "",
    space: SPACES.find((space) => space === fields.get("space")) ?? SPACES[0],
  };
}

/** @param {View} view */
export function writeView(view) {
  const fields = new URLSearchParams({ tab: view.tab });
  if (view.flight) fields.set("flight", view.flight);
  if (view.compare !== null) fields.set("compare", String(view.compare));
  if (view.from !== null && view.to !== null) {
    fields.set("from", view.from.toFixed(3));
    fields.set("to", view.to.toFixed(3));
  }
  if (view.ahead) fields.set("ahead", String(view.ahead));
  if (view.channels) fields.set("channels", view.channels.join(" "));
  if (view.beside) fields.set("beside", view.beside);
  if (view.beside && view.shift) fields.set("shift", String(view.shift));
  if (view.difference) fields.set("difference", "1");
  if (view.axis !== "w") fields.set("axis", view.axis);
  if (view.quantity !== "height") fields.set("quantity", view.quantity);
  if (view.over) fields.set("over", view.over);
  if (view.space !== SPACES[0]) fields.set("space", view.space);
  history.replaceState(null, "", `#${fields}`);
}
