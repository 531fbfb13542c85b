// The coefficients of the chosen model, each flight by itself, in small plots.

import { flightsOf, get, newest } from "./api.js";
import { el } from "./dom.js";
import { known, short, unit, withError, withUnit } from "./numbers.js";
import { CONFIG, axis, colour, faint, layout, plain, plotly, small } from "./plots.js";
import { saveButtons } from "./save.js";

/** @typedef {import("./main.js").App} App */
/** @typedef {"train"|"validate"|"later"|"none"} Use */
/** @typedef {{effect: string, name: string, unit: string, value: number, std_error: number|null, scatter: number|null,
 *   flights: {flight: string, value: number, std_error: number|null}[]}} Row */
/** @typedef {{coefficients: Row[], flights: {flight: string, problem: string|null}[]}} Timeline */

/** How flights of a use are marked. @type {Record<Use, {symbol: string, sign: string, colour: string, text: string}>} */
const MARKS = {
  train: { symbol: "circle", sign: "●", colour: "predicted", text: "training" },
  validate: { symbol: "circle-open", sign: "○", colour: "measured", text: "held out" },
  later: { symbol: "diamond", sign: "◆", colour: "residual", text: "flown later" },
  none: { symbol: "x-thin-open", sign: "×", colour: "quiet", text: "left out" },
};
/** Lengths, px. */
const ROW = 170;
const LEAST_WIDTH = 300;
const LEFT = 62;
/** Most names of flights below a plot. */
const NAMES = 10;

/** @param {App} app */
export function timelineSection(app) {
  const summary = el("p", { class: "quiet", id: "timeline-summary", role: "status" });
  const key = el("p", { class: "legend", hidden: true });
  const save = el("span", { role: "group", "aria-label": "Save this figure", hidden: true });
  const plot = el("div", { id: "timeline-plot", class: "plot", "aria-hidden": "true", hidden: true });
  const button = el(
    "button",
    {
      type: "button",
      id: "timeline",
      title: "Fit every coefficient of this model to each flight alone",
      click: () => {
        wanted = true;
        app.wait(update());
      },
    },
    "Fit each flight alone",
  );
  const element = el(
    "section",
    { id: "by-flight", "aria-label": "Coefficients flight by flight" },
    el("h3", {}, "Coefficients flight by flight"),
    el("div", { class: "controls" }, button, save),
    summary,
    key,
    el("div", { role: "img", "aria-label": "Each coefficient with its standard error, flight by flight" }, plot),
  );
  save.append(...saveButtons(app, picture, "timeline"));
  /** @type {ReturnType<typeof newest<Timeline>>} */
  const ask = newest();
  /** @type {Timeline|null} */
  let timeline = null;
  let wanted = false;
  /** The model that is drawn, or was asked for. @type {number|null} */
  let of = null;

  async function update() {
    const model = app.current();
    if (!model) return;
    // It may take long: it is asked for anew for another model.
    if (of !== model.id && of !== null && timeline) wanted = false;
    if (!wanted) {
      timeline = null;
      show();
      return;
    }
    of = model.id;
    if (!timeline) summary.textContent = "Fitting each flight …";
    const given = await ask([model.id, app.state?.readings], (signal) => get("/api/timeline", { model: model.id }, signal));
    if (!given) return;
    timeline = given;
    await draw();
  }

  function show() {
    const there = timeline !== null;
    for (const part of [key, save, plot]) part.hidden = !there;
    button.hidden = there;
    if (!there) summary.textContent = "Whether they are the craft's, or follow how each flight was flown.";
  }

  /** Flights in their order, those flown later at the end. */
  function order() {
    const files = app.state?.flights ?? [];
    const all = files.flatMap((file) => flightsOf(file).map((name) => ({ name, use: /** @type {Use} */ (file.set) })));
    const fitted = all.filter(({ name }) => timeline?.flights.some((flight) => flight.flight === name));
    return [...fitted.filter((flight) => flight.use !== "later"), ...fitted.filter((flight) => flight.use === "later")];
  }

  async function draw() {
    const Plotly = await plotly();
    if (!timeline || !element.clientWidth) return;
    show();
    const flights = order();
    summary.textContent = said(timeline);
    key.replaceChildren(...legend(flights));
    const { traces, shape } = figure(timeline.coefficients, flights, plot.clientWidth || element.clientWidth);
    await Plotly.react(plot, traces, { ...layout(), ...shape }, CONFIG);
  }

  /** @returns {import("./save.js").Picture|null} */
  function picture() {
    const marks = usesOf(order()).map((use) => ({ ...MARKS[use], colour: colour(MARKS[use].colour) }));
    return timeline ? { plot, of: "coefficients flight by flight", marks } : null;
  }

  return { element, update, draw };
}

/** @param {Timeline} timeline */
function said(timeline) {
  const problems = timeline.flights.filter((flight) => flight.problem);
  const left = problems.map((flight) => ` ${flight.flight} alone does not determine the model: ${flight.problem}.`).join("");
  const rows = timeline.coefficients.filter((row) => known(row.scatter));
  if (!rows.length) return `Fewer than two flights determine the model alone.${left}`;
  const top = rows.reduce((a, b) => ((b.scatter ?? 0) > (a.scatter ?? 0) ? b : a));
  return (
    `Bars are standard errors; the line is the chosen model. Flights are in the order of the list, without times between them. ` +
    `${top.name} of ${top.effect} scatters most: ${short(top.scatter, 2)} times its standard errors about the model (1 where there is nothing but error).${left}`
  );
}

/** @param {{use: Use}[]} flights */
const usesOf = (flights) =>
  /** @type {Use[]} */ (Object.keys(MARKS)).filter((use) => flights.some((flight) => flight.use === use));

/** @param {{use: Use}[]} flights */
function legend(flights) {
  const marks = usesOf(flights).map((use) =>
    el("span", {}, el("span", { style: `color: var(--${MARKS[use].colour})`, "aria-hidden": "true" }, MARKS[use].sign), ` ${MARKS[use].text}`),
  );
  return [...marks, el("span", {}, "━ chosen model, with its standard error")];
}

/** @param {Row[]} rows @param {{name: string, use: Use}[]} flights @param {number} width */
function figure(rows, flights, width) {
  const columns = Math.max(1, Math.min(4, Math.floor(width / LEAST_WIDTH)));
  const lines = Math.ceil(rows.length / columns);
  const bottom = 80;
  const height = lines * ROW + bottom;
  // Those flown later stand apart.
  const firstLater = flights.findIndex((flight) => flight.use === "later");
  const place = (/** @type {number} */ n) => n + 1 + (firstLater > 0 && n >= firstLater ? 1 : 0);
  /** @type {any[]} */
  const traces = [];
  /** @type {Record<string, any>} */
  const shape = { width, height, margin: { l: 0, r: 0, t: 0, b: bottom }, annotations: [], shapes: [], hovermode: "closest" };
  rows.forEach((row, n) => {
    const id = n ? String(n + 1) : "";
    const [column, line] = [n % columns, Math.floor(n / columns)];
    const left = (column * width) / columns + LEFT;
    const domain = [left / width, ((column + 1) * width) / columns / width - 8 / width];
    const [top, low] = [line * ROW + 26, (line + 1) * ROW - 8].map((y) => 1 - y / (lines * ROW));
    const lowest = n + columns >= rows.length;
    shape[`xaxis${id}`] = axis({
      domain,
      anchor: `y${id}`,
      range: [0.4, place(flights.length - 1) + 0.6],
      showticklabels: lowest,
      ...names(flights, place),
      zeroline: false,
      fixedrange: true,
    });
    shape[`yaxis${id}`] = axis({ domain: [low, top], anchor: `x${id}`, nticks: 5, zeroline: false, fixedrange: true });
    shape.annotations.push({
      text: plain(withUnit(`${row.effect}: ${row.name}`, row.unit)),
      x: domain[0],
      y: top,
      xref: "paper",
      yref: "paper",
      xanchor: "left",
      yanchor: "bottom",
      showarrow: false,
      font: { color: colour("text"), size: small() },
    });
    shape.shapes.push(...lineOf(row, id), ...(firstLater > 0 ? [divide(place(firstLater) - 1, id)] : []));
    traces.push(...points(row, flights, place, id));
  });
  return { traces, shape };
}

/** Names below a plot, as many as there is room for. @param {{name: string}[]} flights @param {(n: number) => number} place */
function names(flights, place) {
  const each = Math.ceil(flights.length / NAMES);
  const shown = flights.map((flight, n) => ({ flight, n })).filter(({ n }) => n % each === 0);
  const brief = (/** @type {string} */ name) => plain(name.length > 14 ? `${name.slice(0, 13)}…` : name);
  return {
    tickvals: shown.map(({ n }) => place(n)),
    ticktext: shown.map(({ flight }) => brief(flight.name)),
    tickangle: flights.length > 6 ? -60 : -30,
  };
}

/** The model's own value. @param {Row} row @param {string} id */
function lineOf(row, id) {
  const across = { xref: `x${id} domain`, x0: 0, x1: 1, yref: `y${id}`, layer: "below" };
  const error = row.std_error ?? 0;
  return [
    { type: "rect", ...across, y0: row.value - error, y1: row.value + error, fillcolor: faint("count", 0.12), line: { width: 0 } },
    { type: "line", ...across, y0: row.value, y1: row.value, line: { color: colour("control"), width: 1.5 } },
  ];
}

/** Between the flights before and those flown later. @param {number} at @param {string} id */
function divide(at, id) {
  return {
    type: "line",
    xref: `x${id}`,
    yref: `y${id} domain`,
    x0: at,
    x1: at,
    y0: 0,
    y1: 1,
    line: { color: colour("control"), width: 1, dash: "2px,3px" },
  };
}

/** @param {Row} row @param {{name: string, use: Use}[]} flights @param {(n: number) => number} place @param {string} id */
function points(row, flights, place, id) {
  return /** @type {Use[]} */ (Object.keys(MARKS)).flatMap((use) => {
    const all = flights.flatMap((flight, n) => {
      const found = flight.use === use ? row.flights.find((one) => one.flight === flight.name) : undefined;
      return found ? [{ ...found, x: place(n) }] : [];
    });
    if (!all.length) return [];
    return [
      {
        type: "scatter",
        mode: "markers",
        name: MARKS[use].text,
        x: all.map((one) => one.x),
        y: all.map((one) => one.value),
        error_y: { type: "data", array: all.map((one) => one.std_error ?? 0), color: colour(MARKS[use].colour), thickness: 1.3, width: 3 },
        marker: { symbol: MARKS[use].symbol, size: 8, color: colour(MARKS[use].colour), line: { width: 1.6 } },
        xaxis: `x${id}`,
        yaxis: `y${id}`,
        text: all.map((one) => plain(`${one.flight}: ${withError(one.value, one.std_error)} ${unit(row.unit)}`)),
        hovertemplate: "%{text}<extra></extra>",
      },
    ];
  });
}
