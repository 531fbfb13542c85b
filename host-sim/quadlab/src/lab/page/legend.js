// What the lines of the shown tab stand for.

import { el, svg } from "./dom.js";
import { titleOf } from "./models.js";
import { prose } from "./numbers.js";
import { line } from "./plots.js";
import { outcome } from "./preview.js";
import { unused } from "./used.js";

/** @typedef {import("./main.js").App} App */

/** @param {App} app @param {HTMLElement} root */
export function drawLegend(app, root) {
  const entries = legendOf(app);
  root.hidden = !entries.length;
  const used = app.used();
  const isShaded = app.view.tab === "time" && used && unused(used, app.span()).length > 0;
  const shade = isShaded && el("span", {}, el("span", { class: "shade", "aria-hidden": "true" }), "not used");
  root.replaceChildren(...entries.map(([role, text]) => el("span", {}, swatch(role), text)), shade || "", ...trying(app));
}

/** What is to be said of an effect that is tried and is not drawn. @param {App} app */
function trying(app) {
  const one = outcome(app);
  if (!one || one.is === "drawn") return [];
  const words = one.is === "asked" ? `Trying ${one.effect} …` : `${one.effect} cannot be drawn: ${prose(one.why)}`;
  return [el("span", { id: "trying", class: one.is === "asked" ? "quiet" : "bad-text" }, words)];
}

/** @typedef {[Parameters<typeof line>[0], string]} Entry what a line looks like, and what it is */
/** @typedef {import("./api.js").Model} Model */

/** What the shown tab draws. @param {App} app @returns {Entry[]} */
export function legendOf(app) {
  const [model, second] = [app.current(), app.second()];
  const { tab } = app.view;
  if (!model || !["time", "where", "spectrum"].includes(tab)) return [];
  return tab === "time" ? ofTime(app, model, second) : ofOthers(app, tab, second);
}

/** @param {App} app @param {Model} model @param {Model|null} second @returns {Entry[]} */
function ofTime(app, model, second) {
  /** @type {Entry[]} */
  const own = [
    ["measured", "measured"],
    ["predicted", `predicted: ${titleOf(model)}`],
  ];
  const { beside, difference } = app.view;
  if (beside)
    return [
      ...own,
      ["residual", "residual"],
      ["beside-measured", `measured in ${beside}`],
      ["second", "predicted there"],
      ["second-residual", "residual there"],
      ...(difference ? [/** @type {Entry} */ (["difference", "residual there minus residual here"])] : []),
    ];
  const tried = withTried(app);
  if (tried) {
    // One entry for both lines, so that the legend does not grow by a row.
    own.push(["residual", "residual"], ["second", tried]);
    if (difference) own.push(["difference", `${tried} minus chosen`]);
    return own;
  }
  if (second) own.push(["second", `second: ${titleOf(second)}`]);
  own.push(["residual", "residual"]);
  if (second) own.push(["second-residual", "residual of the second"]);
  if (second && difference) own.push(["difference", "second minus chosen"]);
  return own;
}

/** What the lines of an effect that is tried are called, where they are drawn. @param {App} app */
export function withTried(app) {
  const one = outcome(app);
  return one?.is === "drawn" ? `with ${one.effect}` : null;
}

/** @param {App} app @param {string} tab @param {Model|null} second @returns {Entry[]} */
function ofOthers(app, tab, second) {
  const where = tab === "where";
  const tried = where ? withTried(app) : null;
  /** @type {(Entry|false|null)[]} */
  const entries = [
    !where && ["measured", "measured"],
    ["residual", where ? "mean residual" : "residual"],
    second && ["second-residual", where ? "mean residual of the second" : "residual of the second"],
    !where && ["difference", "bounds of what chance leaves"],
    tried !== null && ["difference", `mean residual ${tried}`],
  ];
  return entries.filter((entry) => entry !== null && entry !== false);
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
