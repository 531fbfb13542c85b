// Where the model fails: the conditions of the worst errors, and the residual against any quantity.

import { axisUnit, flightsOf, get, newest } from "./api.js";
import { axisChoice } from "./controls.js";
import { choice, el, redraw } from "./dom.js";
import { titleOf } from "./models.js";
import { known, minus, percent, short, unit, withUnit } from "./numbers.js";
import { CONFIG, axis, colour, faint, layout, line, plain, plotly, room } from "./plots.js";
import { trialOf } from "./trial.js";

/** @typedef {import("./main.js").App} App */

/** @param {App} app @param {HTMLElement} root */
export function whereTab(app, root) {
  const worst = el("div", { id: "worst" });
  const controls = el("div", { class: "controls" });
  const summary = el("p", { class: "quiet", id: "where-summary" });
  const plot = el("div", { id: "where-plot", class: "plot", "aria-hidden": "true" });
  root.append(worst, controls, summary, el("div", { role: "img", "aria-label": "The residual against the chosen quantity" }, plot));
  /** @type {{name: string, unit: string}[]} */
  let quantities = [];
  /** @type {ReturnType<typeof newest<any[]>>} */
  const ask = newest();
  /** The model whose worst conditions are shown. @type {number|null} */
  let drawnWorst = null;
  /** @type {any[]} */
  let maps = [];
  const trial = trialOf(app, "/api/residual", () => draw());

  /** What residual is drawn. */
  const asked = () => ({ axis: app.view.axis, quantity: app.view.quantity, flight: app.view.over || null });

  /** The chosen and the second model, the older first: before and after. */
  function pair() {
    const both = [app.current(), app.second()].filter((model) => model !== null);
    return both.sort((a, b) => a.id - b.id);
  }

  async function update() {
    const [model, second] = [app.current(), app.second()];
    if (!model) return;
    quantities = await app.quantities();
    if (quantities.length && !quantities.some((q) => q.name === app.view.quantity))
      app.view.quantity = quantities[0].name;
    drawControls();
    const query = asked();
    trial.update(query, query);
    const given = await ask([model.id, model.judged_on, second?.id, query, app.state?.readings], (signal) =>
      Promise.all(pair().map((m) => get("/api/residual", { model: m.id, ...query }, signal))),
    );
    if (!given) return;
    maps = given;
    await draw();
    if (drawnWorst !== model.id) drawWorst(null);
    drawnWorst = model.id;
    const comparison = await app.comparison(model.id);
    if (app.current()?.id === model.id) drawWorst(comparison.worst ?? []);
  }

  function drawControls() {
    const { view } = app;
    const flights = (app.state?.flights ?? []).filter((flight) => !flight.problem);
    redraw(controls, [
      axisChoice(app, "Residual of", "where-axis"),
      choice(
        "against",
        "where-quantity",
        quantities.map((q) => [q.name, withUnit(q.name, q.unit)]),
        view.quantity,
        (value) => app.look({ quantity: value }),
      ),
      choice(
        "in",
        "where-flight",
        [
          ["", "all flights"],
          ...flights.flatMap(flightsOf).map((name) => /** @type {[string, string]} */ ([name, name])),
        ],
        view.over,
        (value) => app.look({ over: value }),
      ),
    ]);
  }

  /** @param {any[]|null} rows nothing while they are computed */
  function drawWorst(rows) {
    const title = el("h3", {}, "Where the error is largest: share of an axis' squared error, and rms");
    if (!rows) {
      redraw(worst, [title, el("p", { class: "quiet" }, "All flights are being predicted.")]);
      return;
    }
    const most = Math.max(1, ...rows.map((row) => row.share_percent ?? 0));
    redraw(worst, [
      title,
      rows.length
        ? el(
            "ul",
            { class: "worst" },
            rows.slice(0, 12).map((row) =>
              el(
                "li",
                {},
                el(
                  "button",
                  {
                    type: "button",
                    "data-key": `worst ${row.axis} ${row.condition}`,
                    "aria-pressed": String(app.view.axis === row.axis && app.view.quantity === row.quantity),
                    title: "Show the residual against this quantity",
                    click: () => app.look({ axis: row.axis, quantity: row.quantity, over: "" }),
                  },
                  el("b", {}, row.axis),
                  el("span", { class: "condition" }, minus(row.condition)),
                  el(
                    "span",
                    { class: "track", "aria-hidden": "true" },
                    el("i", { style: `width: ${(100 * row.share_percent) / most}%` }),
                  ),
                  el("span", {}, `${percent(row.share_percent)}, ${short(row.rms)} ${unit(axisUnit(row.axis))}`),
                ),
              ),
            ),
          )
        : el("p", { class: "quiet" }, "No condition stands out."),
    ]);
  }

  async function draw() {
    const Plotly = await plotly();
    if (root.hidden || !maps.length || !root.clientWidth) return;
    const both = pair();
    if (both.length !== maps.length) return;
    const looks = both.map((model) => ({
      title: titleOf(model),
      second: model === app.second(),
    }));
    const { traces, shape } = figure(maps, looks, app.view);
    const tried = trial.answer(asked());
    if (tried) traces.push(meanWith(tried, looks.findIndex((look) => !look.second)));
    await Plotly.react(
      plot,
      traces,
      { ...layout(), ...shape, width: root.clientWidth, height: Math.max(340, room(plot)) },
      { ...CONFIG, doubleClick: "reset" },
    );
    summary.textContent = said(maps[looks.findIndex((look) => !look.second)], app.view);
  }

  const picture = () => ({ plot, of: app.view.over || "all flights" });

  return { update, picture, resize: draw, theme: draw };
}

/** The largest mean residual as a sentence. @param {any} map @param {import("./view.js").View} view */
function said(map, view) {
  const row = (map.mean ?? []).filter((/** @type {any} */ m) => known(m.mean));
  if (!row.length) return "There is no residual over this quantity.";
  const top = row.reduce((/** @type {any} */ a, /** @type {any} */ b) => (Math.abs(b.mean) > Math.abs(a.mean) ? b : a));
  return (
    `The line is the mean residual of ${view.axis}, the band its standard deviation. The mean is largest, ${short(top.mean)} ${unit(map.unit)}, ` +
    `at ${view.quantity} ${short(top.x)} ${unit(map.quantity_unit)} (${top.count} samples). Stronger cells hold more samples.`
  );
}

/** Maps side by side, with one scale. @param {any[]} maps @param {{title: string, second: boolean}[]} looks @param {import("./view.js").View} view */
function figure(maps, looks, view) {
  const share = 1 / maps.length;
  const most = Math.max(1, ...maps.flatMap((map) => map.count.flat()));
  /** @type {any[]} */
  const traces = [];
  /** @type {Record<string, any>} */
  const shape = { annotations: [], margin: { l: 72, r: 12, t: 30, b: 52 }, hovermode: "closest" };
  maps.forEach((map, n) => {
    const id = n ? String(n + 1) : "";
    const domain = [n * share + (n ? 0.02 : 0), (n + 1) * share - (n < maps.length - 1 ? 0.02 : 0)];
    shape[`xaxis${id}`] = axis({
      domain,
      matches: n ? "x" : undefined,
      title: { text: plain(withUnit(view.quantity, map.quantity_unit)) },
    });
    shape[`yaxis${id}`] = axis({
      matches: n ? "y" : undefined,
      anchor: `x${id}`,
      showticklabels: !n,
      title: n ? undefined : { text: plain(withUnit(`residual of ${view.axis}`, map.unit)) },
    });
    shape.annotations.push({
      text: plain(looks[n].title),
      x: domain[0],
      y: 1,
      xref: "paper",
      yref: "paper",
      xanchor: "left",
      yanchor: "bottom",
      showarrow: false,
    });
    traces.push(cells(map, id, most), ...means(map, id, looks[n].second));
  });
  return { traces, shape };
}

/** How many samples lie where. @param {any} map @param {string} id @param {number} most */
function cells(map, id, most) {
  return {
    type: "heatmap",
    x: map.x,
    y: map.y,
    z: map.count.map((/** @type {number[]} */ row) => row.map((count) => (count > 0 ? Math.log10(count + 1) : null))),
    customdata: map.count,
    zmin: 0,
    zmax: Math.log10(most + 1),
    colorscale: [
      [0, faint("count", 0.08)],
      [1, faint("count", 0.75)],
    ],
    showscale: false,
    xaxis: `x${id}`,
    yaxis: `y${id}`,
    hovertemplate: `%{x:.3g} ${unit(map.quantity_unit)}, %{y:.3g} ${unit(map.unit)}: %{customdata} samples<extra></extra>`,
  };
}

/** The running mean with an effect that is tried, in the panel of the chosen model. @param {any} map @param {number} panel */
function meanWith(map, panel) {
  const id = panel ? String(panel + 1) : "";
  return {
    type: "scatter",
    mode: "lines",
    x: map.mean.map((/** @type {any} */ m) => m.x),
    y: map.mean.map((/** @type {any} */ m) => m.mean),
    xaxis: `x${id}`,
    yaxis: `y${id}`,
    hoverinfo: "skip",
    line: { ...line("difference"), width: 2.5 },
  };
}

/** The running mean and its band. @param {any} map @param {string} id @param {boolean} second */
function means(map, id, second) {
  const role = second ? "second" : "residual";
  const x = map.mean.map((/** @type {any} */ m) => m.x);
  const curve = (/** @type {string} */ field, /** @type {any} */ more) => ({
    type: "scatter",
    mode: "lines",
    x,
    y: map.mean.map((/** @type {any} */ m) => m[field]),
    xaxis: `x${id}`,
    yaxis: `y${id}`,
    hoverinfo: "skip",
    ...more,
  });
  const edge = { color: colour(role), width: 0.7 };
  return [
    curve("low", { line: edge }),
    curve("high", { line: edge, fill: "tonexty", fillcolor: faint(role, 0.15) }),
    curve("mean", { line: { color: colour(role), width: 2.5, dash: second ? "6px,3px" : "solid" } }),
  ];
}
