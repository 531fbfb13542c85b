// The list of flights: what each is like, and what it is used for.

import { flightsOf } from "./api.js";
import { el, redraw, redrawItems, svg } from "./dom.js";
import { GRAVITY, faultList } from "./faults.js";
import { noteOf } from "./notes.js";
import { short } from "./numbers.js";
import { saidOf, unused } from "./used.js";

/** @typedef {import("./api.js").Flight} Flight */
/** @typedef {import("./main.js").App} App */

/** @type {[string, string][]} */
const SETS = [
  ["train", "training"],
  ["validate", "held out"],
  ["later", "flown later"],
  ["none", "leave out"],
];

/** @param {App} app @param {HTMLElement} root */
export function drawFlights(app, root) {
  const flights = app.state?.flights ?? [];
  if (flights.length) redrawItems(root, flights.map((flight) => entry(app, flight)));
  else
    redraw(root, [
      el(
        "li",
        { class: "quiet" },
        "There is no flight in this folder. Drop flights or logs on the page, or press Add files.",
      ),
      demonstration(app),
    ]);
}

/** To try the lab without flights of one's own. @param {App} app */
function demonstration(app) {
  if (app.state?.reading || app.state?.vehicle) return null;
  return el(
    "li",
    {},
    el(
      "button",
      {
        type: "button",
        id: "demo",
        title: "Fly a simulated craft five times: it has an effect that the basic model lacks, and you find it",
        "data-key": "demo",
        click: () => app.choose("/api/demo", {}),
      },
      "Try it on a simulated craft",
    ),
  );
}

/** @param {App} app @param {Flight} flight */
function entry(app, flight) {
  const shown = flightsOf(flight).includes(app.view.flight);
  const use = el(
    "select",
    {
      "aria-label": `Use of ${flight.name}`,
      "data-key": `set ${flight.name}`,
      disabled: Boolean(app.state?.job) || Boolean(flight.problem),
      change: (/** @type {any} */ event) => app.choose("/api/sets", { name: flight.name, set: event.target.value }),
    },
    SETS.map(([value, text]) => el("option", { value, selected: value === flight.set }, text)),
  );
  const show = el(
    "button",
    {
      type: "button",
      class: "name",
      title: flight.name,
      "aria-current": shown ? "true" : null,
      "data-key": `show ${flight.name}`,
      disabled: Boolean(flight.problem),
      click: () => app.look({ flight: flightsOf(flight)[0], from: null, to: null }),
    },
    flight.name,
  );
  const about = el(
    "div",
    { class: "entry" },
    show,
    use,
    !flight.problem &&
      el(
        "div",
        { class: "sparks" },
        spark(flight, hasPosition(flight) ? flight.height : [], "height", "m", 2),
        spark(flight, flight.battery, "battery", "V", 3),
      ),
    !flight.problem &&
      el(
        "p",
        { class: "facts", title: `${flight.rows} rows: ${flight.columns.join(", ")}` },
        `${short(flight.duration_s)} s, ${short(flight.rate_hz)} Hz`,
        flightsOf(flight).length > 1 && `, ${flightsOf(flight).length} flights`,
      ),
    flight.problem && el("p", { class: "bad-text" }, flight.problem),
    parts(app, flight),
    faults(app, flight),
  );
  return {
    key: flight.name,
    attributes: { class: `flight ${flight.set}`, "data-name": flight.name },
    children: [about, noteOf(app, { flight: flight.name }, flight.name, flight.note)],
  };
}

/** Which parts are used, where the user has chosen some; and how to use all again. @param {App} app @param {Flight} flight */
function parts(app, flight) {
  const chosen = flight.used.filter((used) => used.chosen);
  return chosen.map((used) =>
    el(
      "p",
      { class: "parts" },
      flight.problem ? "Parts of it are chosen. " : `${saidOf(used)} `,
      el(
        "button",
        {
          type: "button",
          disabled: Boolean(app.state?.job) || app.state?.reading,
          "data-key": `all of ${used.flight}`,
          click: () => app.choose("/api/use", { name: used.flight, parts: null }),
        },
        "Use all airborne parts",
      ),
    ),
  );
}

/** Without a position, the height that comes is none. @param {Flight} flight */
export const hasPosition = (flight) => flight.columns.includes("position");

/** @param {App} app @param {Flight} flight */
function faults(app, flight) {
  if (!flight.faults.length) return null;
  const severities = [...new Set(flight.faults.map((fault) => fault.severity))];
  const counts = severities.map((severity) => {
    const count = flight.faults.filter((fault) => fault.severity === severity).length;
    return `${count} ${GRAVITY[severity]}${count > 1 ? "s" : ""}`;
  });
  const errors = severities.includes("refused");
  return el(
    "details",
    { "data-key": `faults ${flight.name}` },
    el(
      "summary",
      { class: errors ? "bad-text" : "", "data-key": `unfold ${flight.name}` },
      `${errors ? "⚠ " : ""}${counts.join(", ")} of the checks`,
    ),
    faultList(app, flight),
  );
}

/**
 * A curve without axes; what is not used of the flight is shaded.
 * @param {Flight} flight @param {[number, number][]} points @param {string} name @param {string} unit @param {number} digits
 */
function spark(flight, points, name, unit, digits) {
  const there = points.filter(([t, y]) => Number.isFinite(t) && Number.isFinite(y) && y !== null);
  if (there.length < 2) return el("span", { class: "spark quiet" }, `no ${name}`);
  const ys = there.map(([, y]) => y);
  const [low, high] = [Math.min(...ys), Math.max(...ys)];
  const [first, last] = [there[0][0], there[there.length - 1][0]];
  const x = (/** @type {number} */ t) => (100 * (t - first)) / (last - first || 1);
  const y = (/** @type {number} */ v) => 21 - (18 * (v - low)) / (high - low || 1);
  const text = `${name} ${short(low, digits)} to ${short(high, digits)} ${unit}`;
  // Flights of a log have clocks of their own, and lie over each other here.
  const [used] = flight.used;
  const shaded = flight.used.length === 1 && used.chosen ? unused(used, [first, last]) : [];
  return el(
    "span",
    { class: `spark ${name}`, title: text },
    svg(
      "svg",
      { viewBox: "0 0 100 24", preserveAspectRatio: "none", role: "img", "aria-label": text },
      shaded.map(([from, to]) =>
        svg("rect", { x: x(from).toFixed(1), y: 0, width: (x(to) - x(from)).toFixed(1), height: 24 }),
      ),
      svg("polyline", { points: there.map(([t, v]) => `${x(t).toFixed(1)},${y(v).toFixed(1)}`).join(" ") }),
    ),
    el("small", { "aria-hidden": "true" }, `${short(low, digits)}–${short(high, digits)} ${unit}`),
  );
}
