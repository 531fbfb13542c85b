// What the unknown effect looks like that the chosen model lacks: each proposal as a formula, to be kept as an effect of the user's own.

import { get } from "./api.js";
import { el, redraw } from "./dom.js";
import { VERDICTS } from "./models.js";
import { prose, short, unit, withError } from "./numbers.js";

/** @typedef {import("./main.js").App} App */
/** @typedef {{own: string, text: string, formula: string, sentence: string, physics?: string, quantities: string[], rivals: string[],
 *   excite: string, drop_percent: Record<string, number>, flights_improved: [number, number],
 *   flights?: {flight: string, drop_percent: number}[],
 *   coefficients: FormNumber[], constants?: FormNumber[]}} Proposal */
/** @typedef {{name: string, value: number, std_error: number, unit: string}} FormNumber */

/** Answers by model. @type {Map<number, Promise<any>>} */
const asked = new Map();

/** Asks anew: a job has ended. */
export function forgetDiscovery() {
  asked.clear();
}

/** @param {App} app @param {HTMLElement} root */
export async function drawDiscovery(app, root) {
  const model = app.current();
  if (!model?.discovered) {
    redraw(root, []);
    return;
  }
  if (!asked.has(model.id)) asked.set(model.id, get("/api/discovery", { model: model.id }));
  try {
    const discovery = await asked.get(model.id);
    if (app.current()?.id === model.id) draw(app, root, discovery);
  } catch (error) {
    asked.delete(model.id);
    throw error;
  }
}

/** @param {App} app @param {HTMLElement} root @param {any} discovery */
function draw(app, root, discovery) {
  redraw(root, [
    el("h2", {}, "What does it look like?"),
    el("p", { id: "discovered-verdict", "data-verdict": discovery.verdict }, inWords(discovery.verdict)),
    el("p", { id: "discovered-conclusion" }, prose(discovery.conclusion)),
    ...discovery.proposals.map((/** @type {Proposal} */ proposal) => card(app, proposal)),
    el("p", { class: "quiet" }, "In a terminal: ", el("code", {}, discovery.command)),
  ]);
}

/** @param {string} verdict */
function inWords(verdict) {
  const words = { proposed: "A formula fits", nothing: "Nothing is left to explain", "not-a-formula": "Something is left, and no formula fits" };
  return words[/** @type {keyof typeof words} */ (verdict)] ?? VERDICTS[verdict] ?? verdict;
}

/** @param {App} app @param {Proposal} proposal */
function card(app, proposal) {
  const isKept = Boolean(app.state?.own.some((own) => own.id === proposal.own));
  const falls = Object.entries(proposal.drop_percent).map(([axis, drop]) => `${axis} ${short(drop)} %`);
  const [better, all] = proposal.flights_improved;
  const byFlight = (proposal.flights ?? []).map((own) => `${own.flight} ${short(own.drop_percent)} %`);
  const rivals = proposal.rivals.length
    ? `These flights cannot distinguish it from: ${proposal.rivals.join("; ")}.`
    : "No form in other quantities explains these flights about as well.";
  return el(
    "article",
    { class: "card supported", "data-discovered": proposal.own, "aria-label": proposal.own },
    el("h3", {}, proposal.own),
    el("p", {}, prose(proposal.sentence)),
    ...proposal.formula.split("; ").map((row) => el("p", {}, el("code", {}, row))),
    el(
      "dl",
      { class: "coefficients" },
      [...proposal.coefficients, ...(proposal.constants ?? [])].flatMap((one) => [
        el("dt", {}, one.name),
        el("dd", {}, `${withError(one.value, one.std_error)} ${unit(one.unit)}`),
      ]),
    ),
    el("p", {}, `The held-out squared error falls: ${falls.join(", ")}; on ${better} of ${all} flights${byFlight.length ? `: ${byFlight.join(", ")}` : ""}.`),
    proposal.physics && el("p", {}, prose(`Consistent with: ${proposal.physics}.`)),
    el("p", { class: "note" }, prose(rivals)),
    el("p", { class: "quiet" }, prose(`To confirm: ${proposal.excite}.`)),
    isKept
      ? el("p", { class: "quiet" }, "It is among your own effects: press Diagnose, then Add.")
      : el(
          "button",
          { type: "button", class: "keep-discovered", click: () => app.choose("/api/effects/keep", { text: proposal.text }) },
          "Keep as my own effect",
        ),
  );
}
