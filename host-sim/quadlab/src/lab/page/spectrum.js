// At which frequencies the residual lives, and whether it remembers its past.

import { get, newest } from "./api.js";
import { axisChoice } from "./controls.js";
import { el, redraw } from "./dom.js";
import { known, percent, unit } from "./numbers.js";
import { CONFIG, axis, colour, layout, line, plotly, room } from "./plots.js";

/** @typedef {import("./main.js").App} App */

/** @param {App} app @param {HTMLElement} root */
export function spectrumTab(app, root) {
  const controls = el("div", { class: "controls" });
  const summary = el("p", { class: "quiet", id: "spectrum-summary" });
  const plot = el("div", { id: "spectrum-plot", class: "plot", "aria-hidden": "true" });
  root.append(controls, summary, el("div", { role: "img", "aria-label": "Spectrum of measurement and residual, and the residual's autocorrelation" }, plot));
  /** @type {ReturnType<typeof newest<any[]>>} */
  const ask = newest();
  /** @type {any[]} */
  let answers = [];

  async function update() {
    const [model, second, flight] = [app.current(), app.second(), app.flight()];
    if (!model || !flight) return;
    redraw(controls, [axisChoice(app, "Axis", "spectrum-axis")]);
    const models = second ? [model, second] : [model];
    const query = { flight: app.view.flight, axis: app.view.axis };
    const given = await ask([model.id, second?.id, query, app.state?.readings], (signal) =>
      Promise.all(models.map((m) => get("/api/spectrum", { model: m.id, ...query }, signal))),
    );
    if (!given) return;
    answers = given;
    await draw();
  }

  async function draw() {
    const Plotly = await plotly();
    if (root.hidden || !answers.length || !root.clientWidth) return;
    const { traces, shape } = figure(answers);
    await Plotly.react(
      plot,
      traces,
      { ...layout(), ...shape, width: root.clientWidth, height: Math.max(460, room(plot)) },
      { ...CONFIG, doubleClick: "reset" },
    );
    summary.textContent = said(answers[0]);
  }

  const picture = () => ({ plot, of: app.view.flight });

  return { update, picture, resize: draw, theme: draw };
}

/** @param {any} one */
function said(one) {
  const lags = one.autocorrelation.filter(
    (/** @type {any} */ r, /** @type {number} */ n) => known(r) && one.lag_s[n] > 0,
  );
  const outside = lags.filter((/** @type {number} */ r) => Math.abs(r) > one.bound).length;
  const share = lags.length ? (100 * outside) / lags.length : 0;
  return `${percent(share)} of the autocorrelation lies outside its bounds of ±${one.bound.toFixed(3)}; white noise leaves about 5 %.`;
}

/** @param {any[]} answers of the chosen model, and of the second */
function figure(answers) {
  const [first, second] = answers;
  const curve = (
    /** @type {string} */ name,
    /** @type {number[]} */ x,
    /** @type {number[]} */ y,
    /** @type {any} */ style,
    /** @type {boolean} */ lower,
  ) => ({
    type: "scatter",
    mode: "lines",
    name,
    x,
    y,
    line: style,
    xaxis: lower ? "x2" : "x",
    yaxis: lower ? "y2" : "y",
  });
  const traces = [
    curve("measured", first.frequency_hz, first.measured, { ...line("measured"), width: 1.4 }, false),
    curve("residual", first.frequency_hz, first.residual, line("residual"), false),
    curve("residual", first.lag_s, first.autocorrelation, line("residual"), true),
  ];
  if (second) {
    traces.push(
      curve("second's residual", second.frequency_hz, second.residual, line("second-residual"), false),
      curve("second's residual", second.lag_s, second.autocorrelation, line("second-residual"), true),
    );
  }
  const last = first.lag_s[first.lag_s.length - 1] ?? 0;
  const bound = (/** @type {number} */ y) => ({
    type: "line",
    x0: 0,
    x1: last,
    y0: y,
    y1: y,
    xref: "x2",
    yref: "y2",
    line: { color: colour("difference"), width: 1.5, dash: "2px,2px" },
  });
  const shape = {
    margin: { l: 76, r: 12, t: 12, b: 48 },
    hovermode: "x unified",
    shapes: [bound(first.bound), bound(-first.bound)],
    xaxis: axis({ type: "log", domain: [0, 1], anchor: "y", title: { text: "frequency [Hz]", standoff: 4 } }),
    yaxis: axis({
      type: "log",
      domain: [0.5, 1],
      title: { text: `amplitude density [${unit(first.unit)}/√Hz]` },
      exponentformat: "power",
    }),
    xaxis2: axis({ domain: [0, 1], anchor: "y2", title: { text: "lag [s]", standoff: 4 } }),
    yaxis2: axis({ domain: [0, 0.36], anchor: "x2", title: { text: "autocorrelation" } }),
  };
  return { traces, shape };
}
