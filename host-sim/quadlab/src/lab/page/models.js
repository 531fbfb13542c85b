// The tree of models: each made from its parent by one effect. Choosing the parent is the undo.

import { AXES, axisUnit } from "./api.js";
import { byId, el, redrawItems } from "./dom.js";
import { noteOf } from "./notes.js";
import { known, percent, rmsFall, short, unit } from "./numbers.js";

/** @typedef {import("./api.js").Model} Model */
/** @typedef {import("./main.js").App} App */

/** Verdicts in words. @type {Record<string, string>} */
export const VERDICTS = {
  adequate: "adequate",
  "missing-effect": "an effect is missing",
  unexplained: "something is unexplained",
  "not-identified": "not identified",
};

/** A model's name in a legend: labels may be the same. @param {Model} model */
export const titleOf = (model) => `${model.label} (model ${model.id})`;

/** @param {App} app @param {HTMLElement} root */
export function drawModels(app, root) {
  const models = app.state?.models ?? [];
  redrawItems(
    root,
    inTreeOrder(models).map(([model, depth]) => entry(app, model, depth)),
  );
  byId("no-models").hidden = models.length > 0;
  const parent = app.current()?.parent ?? null;
  const undo = byId("undo");
  undo.disabled = parent === null || Boolean(app.state?.job);
  undo.onclick = () => app.choose("/api/current", { model: parent });
}

/** Parents before their children. @param {Model[]} models @returns {[Model, number][]} */
function inTreeOrder(models) {
  const ids = new Set(models.map((model) => model.id));
  /** @type {[Model, number][]} */
  const row = [];
  const add = (/** @type {number|null} */ parent, /** @type {number} */ depth) => {
    for (const model of models) {
      const above = model.parent !== null && ids.has(model.parent) ? model.parent : null;
      if (above === parent) {
        row.push([model, depth]);
        add(model.id, depth + 1);
      }
    }
  };
  add(null, 0);
  return row;
}

/** @param {App} app @param {Model} model @param {number} depth */
function entry(app, model, depth) {
  const chosen = app.state?.current === model.id;
  const second = app.view.compare === model.id && !chosen;
  const radio = el("input", {
    type: "radio",
    name: "model",
    value: model.id,
    checked: chosen,
    disabled: Boolean(app.state?.job),
    "data-key": `model ${model.id}`,
    change: () => app.choose("/api/current", { model: model.id }),
  });
  const compare = el(
    "button",
    {
      type: "button",
      class: "compare",
      disabled: chosen,
      "aria-pressed": second ? "true" : "false",
      "aria-label": `Compare with ${model.label}, model ${model.id}`,
      title: "Draw this model beside the chosen one",
      "data-key": `compare ${model.id}`,
      click: () => app.look({ compare: second ? null : model.id }),
    },
    "compare",
  );
  const about = el(
    "div",
    { class: "entry" },
    el("label", {}, radio, " ", el("span", { class: "name" }, model.label)),
    compare,
    marks(model),
    errors(model, app.state?.models.find((other) => other.id === model.parent) ?? null),
  );
  return {
    key: String(model.id),
    attributes: {
      class: `model${chosen ? " chosen" : ""}${second ? " second" : ""}`,
      "data-id": model.id,
      style: `--depth: ${Math.min(depth, 6)}`,
    },
    children: [about, noteOf(app, { model: model.id }, `model ${model.id}`, model.note)],
  };
}

/** @param {Model} model */
function marks(model) {
  const supported =
    model.supported === null
      ? null
      : el(
          "span",
          { class: model.supported ? "good-text" : "bad-text" },
          model.supported ? "✓ supported" : "✗ not supported",
        );
  const verdict = model.verdict && el("span", {}, VERDICTS[model.verdict] ?? model.verdict);
  return el(
    "p",
    { class: "marks", title: `Fitted on ${model.fitted_on.join(", ")}; held out: ${model.judged_on.join(", ")}` },
    [el("span", { class: "quiet" }, `model ${model.id}`), supported, verdict],
  );
}

/** Held-out error of each axis, with its change from the parent. @param {Model} model @param {Model|null} parent */
function errors(model, parent) {
  if (!model.axes) return el("p", { class: "quiet" }, "no held-out flights");
  return el(
    "ul",
    { class: "errors", "aria-label": "Held-out root mean square errors" },
    AXES.map((axis) => {
      const now = model.axes?.[axis];
      const fall = rmsFall(parent?.axes?.[axis]?.sse, now?.sse);
      const moved = known(fall) && Math.abs(fall) >= 1;
      return el(
        "li",
        { title: `${axis}: held-out rms ${short(now?.rms)} ${unit(axisUnit(axis))}` },
        el("b", {}, axis),
        " ",
        short(now?.rms),
        moved &&
          el(
            "span",
            { class: fall > 0 ? "good-text" : "bad-text" },
            ` ${fall > 0 ? "↓" : "↑"}${percent(Math.abs(fall))}`,
          ),
      );
    }),
  );
}
