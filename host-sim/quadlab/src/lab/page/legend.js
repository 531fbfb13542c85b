// What the lines of the shown tab stand for.

import { el, svg } from "./dom.js";
import { titleOf } from "./models.js";
import { line } from "./plots.js";

/** @typedef {import("./main.js").App} App */

/** @param {App} app @param {HTMLElement} root */
export function drawLegend(app, root) {
  const [model, second] = [app.current(), app.second()];
  const { tab } = app.view;
  root.hidden = !model || !["time", "where", "spectrum"].includes(tab);
  if (root.hidden || !model) return;
  /** @type {[Parameters<typeof line>[0], string][]} */
  const entries = [];
  if (tab !== "where") entries.push(["measured", "measured"]);
  if (tab === "time") {
    entries.push(["predicted", `predicted: ${titleOf(model)}`]);
    if (second) entries.push(["second", `second: ${titleOf(second)}`]);
  }
  entries.push(["residual", tab === "where" ? "mean residual" : "residual"]);
  if (second)
    entries.push(["second-residual", tab === "where" ? "mean residual of the second" : "residual of the second"]);
  if (tab === "time" && second && app.view.difference) entries.push(["difference", "second minus chosen"]);
  if (tab === "spectrum") entries.push(["difference", "bounds of what chance leaves"]);
  root.replaceChildren(...entries.map(([role, text]) => el("span", {}, swatch(role), text)));
}

/** @param {Parameters<typeof line>[0]} role */
export function swatch(role) {
  const look = line(role);
  return svg(
    "svg",
    { width: 28, height: 8, "aria-hidden": "true" },
    svg("line", {
      x1: 0,
      x2: 28,
      y1: 4,
      y2: 4,
      stroke: look.color,
      "stroke-width": look.width + 0.8,
      "stroke-dasharray": look.dash?.replace(/px/g, ""),
    }),
  );
}
