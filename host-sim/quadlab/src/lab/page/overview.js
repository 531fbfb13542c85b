// A flight before there is a model: what was logged, what the checks say, height and battery over time.

import { el, redraw } from "./dom.js";
import { hasPosition } from "./flights.js";
import { faultList } from "./faults.js";
import { short } from "./numbers.js";
import { CONFIG, axis, colour, faint, layout, plotly, room } from "./plots.js";

/** @typedef {import("./main.js").App} App */
/** @typedef {import("./api.js").Flight} Flight */

/** @param {App} app @param {HTMLElement} root */
export function flightOverview(app, root) {
  const text = el("div", {});
  const plot = el("div", { id: "overview-plot", class: "plot", "aria-hidden": "true" });
  root.append(text, el("div", { role: "img", "aria-label": "Height and battery voltage of the flight over time" }, plot));

  async function update() {
    const flight = app.flight();
    redraw(text, [
      el(
        "p",
        {},
        app.state?.problem
          ? "There is no model yet. What it takes is said on the right."
          : "There is no model yet. Choose on the left the training flights and the held-out ones, then press Identify.",
      ),
      flight && el("h3", {}, flight.name),
      flight &&
        el(
          "p",
          { class: "quiet" },
          `${flight.rows} rows in ${short(flight.duration_s)} s: ${flight.columns.join(", ")}.`,
        ),
      flight?.faults.length ? faultList(app, flight) : null,
    ]);
    if (flight) await draw(flight);
    else plot.replaceChildren();
  }

  /** @param {Flight} flight */
  async function draw(flight) {
    const Plotly = await plotly();
    if (root.hidden || !root.clientWidth || app.flight() !== flight) return;
    const { from, to } = app.view;
    const { traces, shape } = figure(flight, from === null || to === null ? undefined : [from, to]);
    await Plotly.react(
      plot,
      traces,
      { ...layout(), ...shape, width: root.clientWidth, height: Math.max(320, Math.min(700, room(plot))) },
      CONFIG,
    );
  }

  return { update, resize: update, theme: update };
}

/** @param {Flight} flight @param {[number, number]} [range] of time; the whole flight without */
function figure(flight, range) {
  const curve = (/** @type {[number, number][]} */ points, /** @type {string} */ id, /** @type {string} */ name) => ({
    type: "scatter",
    mode: "lines",
    x: points.map(([t]) => t),
    y: points.map(([, y]) => y),
    xaxis: `x${id}`,
    yaxis: `y${id}`,
    line: { color: colour(name), width: 1.6 },
    hoverinfo: "x+y",
  });
  const parts = flight.used.flatMap((used) => used.parts);
  const air = parts.map(([x0, x1]) => ({
    type: "rect",
    x0,
    x1,
    y0: 0,
    y1: 1,
    xref: "x",
    yref: "paper",
    fillcolor: faint("predicted", 0.07),
    line: { width: 0 },
    layer: "below",
  }));
  return {
    traces: [
      curve(hasPosition(flight) ? flight.height : [], "", "predicted"),
      curve(flight.battery, "2", "difference"),
    ],
    shape: {
      shapes: air,
      margin: { l: 64, r: 12, t: 26, b: 44 },
      hovermode: "closest",
      annotations: [
        {
          text: flight.used.some((used) => used.chosen) ? "shaded: used" : "shaded: in the air",
          x: 1,
          y: 1,
          xref: "paper",
          yref: "paper",
          xanchor: "right",
          yanchor: "bottom",
          showarrow: false,
        },
      ],
      xaxis: axis({ anchor: "y", range, matches: "x2", showticklabels: false, zeroline: false }),
      yaxis: axis({ domain: [0.54, 1], title: { text: "height [m]" } }),
      xaxis2: axis({ anchor: "y2", range, title: { text: "time [s]" }, zeroline: false }),
      yaxis2: axis({ domain: [0, 0.46], anchor: "x2", title: { text: "battery [V]" }, zeroline: false }),
    },
  };
}
