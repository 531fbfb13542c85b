// What has changed since the chosen model was good: the verdict on the flights that are marked flown later.

import { get } from "./api.js";
import { el, redraw } from "./dom.js";
import { VERDICTS } from "./models.js";
import { prose, short, unit, withError } from "./numbers.js";

/** @typedef {import("./api.js").Finding} Finding */
/** @typedef {import("./main.js").App} App */

/** Answers by model. @type {Map<number, Promise<any>>} */
const asked = new Map();

/** Asks anew: a job has ended. */
export function forgetChanges() {
  asked.clear();
}

/** @param {App} app @param {HTMLElement} root */
export async function drawChanges(app, root) {
  const model = app.current();
  if (!model?.changed) {
    redraw(root, []);
    return;
  }
  if (!asked.has(model.id)) asked.set(model.id, get("/api/changes", { model: model.id }));
  try {
    const changes = await asked.get(model.id);
    if (app.current()?.id === model.id) draw(root, changes);
  } catch (error) {
    asked.delete(model.id);
    throw error;
  }
}

/** @param {HTMLElement} root @param {any} changes */
function draw(root, changes) {
  /** @type {Finding[]} */
  const supported = changes.effects.filter((/** @type {Finding} */ finding) => finding.supported);
  redraw(root, [
    el("h2", {}, "What changed?"),
    el("p", { id: "changed-verdict", "data-verdict": changes.verdict }, inWords(changes.verdict)),
    el("p", { id: "changed-summary" }, prose(changes.summary)),
    el("p", { class: "quiet" }, `Flown later: ${changes.flights.join(", ")}.`),
    changes.since && el("p", {}, since(changes.since)),
    ...supported.map((finding) => card(changes, finding)),
    el("p", { class: "quiet" }, "In a terminal: ", el("code", {}, changes.command)),
  ]);
}

/** @param {string} verdict */
function inWords(verdict) {
  if (verdict === "missing-effect") return "Something has changed";
  return verdict === "adequate" ? "Nothing has changed" : (VERDICTS[verdict] ?? verdict);
}

/** @param {{flight: string, t_s: number, t_low_s: number, t_high_s: number}} begin */
function since(begin) {
  const span = `${short(begin.t_low_s)} to ${short(begin.t_high_s)} s, 95 %`;
  return `Since ${short(begin.t_s)} s in ${begin.flight} (${span}).`;
}

/** @param {any} changes @param {Finding} finding */
function card(changes, finding) {
  return el(
    "article",
    { class: "card supported", "data-change": finding.effect, "aria-label": finding.effect },
    el("h3", {}, finding.effect, typeof finding.motor === "number" && ` (motor ${finding.motor})`),
    el("p", {}, changes.sentences?.[finding.effect]),
    el(
      "dl",
      { class: "coefficients" },
      finding.coefficients.flatMap((one) => [
        el("dt", {}, one.name),
        el("dd", {}, `${withError(one.value, one.std_error)} ${unit(one.unit)}`),
      ]),
    ),
    finding.confounded_with.length > 0 &&
      el("p", { class: "note" }, `These flights cannot tell it apart from ${finding.confounded_with.join(", ")}.`),
  );
}
