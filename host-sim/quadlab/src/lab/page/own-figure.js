// The columns of an effect over the shown flight, axis by axis, beside what the model leaves there.

import { axisUnit } from "./api.js";
import { withUnit } from "./numbers.js";
import { CONFIG, axis, layout, line, plain, plotly } from "./plots.js";

/** @typedef {Parameters<typeof line>[0]} Role */
/** @typedef {{from: number, to: number, t: number[], axes: {id: string, name: string, unit: string, residual: (number|null)[],
 *   columns: {coefficient: string, values: (number|null)[]}[]}[]}} Preview */

const ROW = 150;
const BOTTOM = 30;

/** Looks of the coefficients, in their order; a fifth one looks as the first. @type {Role[]} */
const LOOKS = ["predicted", "second", "difference", "measured"];

/** How the lines of a coefficient look. @param {Preview} preview @param {string} name @returns {Role} */
export function lookOf(preview, name) {
  const names = [...new Set(preview.axes.flatMap((one) => one.columns.map((column) => column.coefficient)))];
  return LOOKS[names.indexOf(name) % LOOKS.length];
}

/** @param {import("./main.js").App} app @param {any} plot @param {Preview} preview @param {number} width */
export async function drawColumns(app, plot, preview, width) {
  const Plotly = await plotly();
  const { traces, shape } = figure(preview);
  const fresh = !plot.data;
  const height = ROW * preview.axes.length + BOTTOM;
  await Plotly.react(plot, traces, { ...layout(), ...shape, width, height, hovermode: false }, CONFIG);
  if (!fresh) return;
  plot.on("plotly_relayout", (/** @type {Record<string, any>} */ change) => {
    const [from, to] = [change["xaxis.range[0]"], change["xaxis.range[1]"]];
    if (typeof from === "number" && typeof to === "number") app.look({ from, to });
  });
  plot.on("plotly_doubleclick", () => app.look({ from: null, to: null }));
}

/** @param {Preview} preview */
function figure(preview) {
  const count = preview.axes.length;
  /** @type {any[]} */
  const traces = [];
  /** @type {Record<string, any>} */
  const shape = {
    margin: { l: 64, r: 12, t: 4, b: BOTTOM },
    annotations: [],
    xaxis: axis({ range: [preview.from, preview.to], anchor: count > 1 ? `y${count}` : "y", ticksuffix: " s", zeroline: false }),
  };
  preview.axes.forEach((one, n) => {
    const name = n ? `y${n + 1}` : "y";
    const [bottom, top] = [1 - (n + 1) / count, 1 - n / count];
    shape[n ? `yaxis${n + 1}` : "yaxis"] = axis({ domain: [bottom + 0.04 / count, top - 0.16 / count], fixedrange: true, nticks: 5 });
    shape.annotations.push({
      text: plain(withUnit(`${one.id}, ${one.name}`, axisUnit(one.id))),
      xref: "paper",
      yref: "paper",
      x: 0,
      y: top,
      xanchor: "left",
      yanchor: "top",
      showarrow: false,
    });
    const trace = (/** @type {Role} */ role, /** @type {(number|null)[]} */ y) =>
      traces.push({ type: "scatter", mode: "lines", x: preview.t, y, yaxis: name, line: line(role), connectgaps: false });
    trace("residual", one.residual);
    for (const column of one.columns) trace(lookOf(preview, column.coefficient), column.values);
  });
  return { traces, shape };
}
