// What the checks found in a flight: each a button that shows the flight where it is.

import { el } from "./dom.js";
import { prose, short } from "./numbers.js";
import { there } from "./used.js";

/** @typedef {import("./api.js").Flight} Flight */
/** @typedef {import("./api.js").Fault} Fault */
/** @typedef {import("./main.js").App} App */

/** What is shown on either side of a place, as a share of its length, and at least, s. */
const SIDE = 0.5;
const LEAST_SIDE_S = 1;
/** Places of one fault that have a button of their own. */
const MOST_PLACES = 12;

/** How grave a fault is, in words. */
export const GRAVITY = { note: "note", warning: "warning", refused: "error" };

/** The faults of a file, each a button. @param {App} app @param {Flight} file */
export function faultList(app, file) {
  return el(
    "ul",
    { class: "faults" },
    file.faults.map((fault, n) => el("li", {}, button(app, file, fault, n), more(app, file, fault, n))),
  );
}

/** @param {App} app @param {Flight} file @param {Fault} fault @param {number} n */
function button(app, file, fault, n) {
  const [first] = fault.places;
  return el(
    "button",
    {
      type: "button",
      class: "fault",
      title: first ? `Show ${fault.flight} at ${short(first[0], 4)} s` : `Show ${fault.flight}`,
      "data-key": `fault ${file.name} ${n}`,
      click: () => show(app, file, fault, first),
    },
    el("b", {}, `${GRAVITY[fault.severity]}: `),
    prose(fault.sentence),
  );
}

/** Buttons for the further places of a fault. @param {App} app @param {Flight} file @param {Fault} fault @param {number} n */
function more(app, file, fault, n) {
  if (fault.places.length < 2) return null;
  const places = fault.places.slice(1, MOST_PLACES);
  const left = fault.places.length - 1 - places.length;
  return el(
    "span",
    { class: "places" },
    "also at ",
    places.map((place, at) =>
      el(
        "button",
        {
          type: "button",
          "data-key": `place ${file.name} ${n} ${at}`,
          click: () => show(app, file, fault, place),
        },
        `${place[0].toFixed(2)} s`,
      ),
    ),
    left > 0 && ` and ${left} more`,
  );
}

/** @param {App} app @param {Flight} file @param {Fault} fault @param {[number, number]|undefined} place */
function show(app, file, fault, place) {
  const used = file.used.find((one) => one.flight === fault.flight);
  const [from, to] = place && used ? about(place, there(used)) : [null, null];
  app.look({ tab: "time", flight: fault.flight, from, to });
  if (place && from !== null) app.point(Math.min(Math.max(place[0], from), to), true);
  else app.point(null);
}

/**
 * The range about a place, within what of the flight can be looked at.
 * @param {[number, number]} place @param {[number, number][]} ranges @returns {[number, number]}
 */
function about([from, to], ranges) {
  const side = Math.max(SIDE * (to - from), LEAST_SIDE_S);
  const [first, last] = [ranges[0][0], ranges[ranges.length - 1][1]];
  const inside = (/** @type {number} */ t) => Math.min(Math.max(t, first), last);
  return [inside(inside(from) - side), inside(inside(to) + side)];
}
