// Which effect is tried beside the chosen model: that of the card under the pointer, or of the one whose button is pressed.

import { byId, el } from "./dom.js";

/** @typedef {{model: number, effect: string}} Tried */
/** @typedef {{is: "asked"|"drawn"|"refused", why: string}} Outcome */
/** @typedef {import("./main.js").App} App */

/** How long the pointer rests on a card before its effect is tried, ms. */
const REST_MS = 250;

/** Tabs in which it is drawn. */
const TABS = ["time", "where"];

/** The card under the pointer. @type {Tried|null} */
let pointed = null;
/** The card whose button is pressed. @type {Tried|null} */
let held = null;
/** What came of the newest one. @type {Outcome & {of: string}} */
let came = { of: "", is: "asked", why: "" };

/** @param {Tried} one */
const nameOf = (one) => `${one.model} ${one.effect}`;

/** What is tried now. @param {App} app @returns {Tried|null} */
export function tried(app) {
  const model = app.current();
  const fits = (/** @type {Tried|null} */ one) =>
    one && one.model === model?.id && !model.effects.includes(one.effect) ? one : null;
  return fits(pointed) ?? fits(held);
}

/** What the shown tab says of it. @param {App} app @returns {(Tried & Outcome)|null} */
export function outcome(app) {
  const now = tried(app);
  if (!now || !TABS.includes(app.view.tab) || hidden(app)) return null;
  return came.of === nameOf(now) ? { ...now, ...came } : { ...now, is: "asked", why: "" };
}

/** Lines of two flights and two models could not be told apart. @param {App} app */
const hidden = (app) => app.view.tab === "time" && Boolean(app.view.beside);

/** Tells what came of an effect that is tried. @param {App} app @param {Tried} one @param {Outcome["is"]} is @param {string} [why] */
export function tell(app, one, is, why = "") {
  const words = { asked: `Trying ${one.effect}`, drawn: `With ${one.effect}: drawn`, refused: why };
  if (came.of !== nameOf(one) || came.is !== is) byId("announced").textContent = words[is];
  came = { of: nameOf(one), is, why };
  app.drawLegend();
}

/** Another effect is tried, or none. @param {App} app */
function drawAnew(app) {
  if (TABS.includes(app.view.tab)) app.drawTrial();
}

/** The button of a card that keeps its effect drawn. @param {App} app @param {number} model @param {string} effect @param {() => void} again */
export function previewButton(app, model, effect, again) {
  const isHeld = held?.model === model && held.effect === effect;
  const click = () => {
    held = isHeld ? null : { model, effect };
    // Who lets it go does not want to see it because the pointer is still there.
    pointed = null;
    if (held && !TABS.includes(app.view.tab)) app.look({ tab: "time" });
    else drawAnew(app);
    again();
  };
  return el(
    "button",
    {
      type: "button",
      class: "preview",
      disabled: Boolean(app.state?.job),
      "aria-pressed": String(isHeld),
      "aria-label": `Preview: draw the model with ${effect}`,
      title: "Draw what it would do to prediction and residual; resting the pointer on the card does so for a look",
      "data-key": `preview ${effect}`,
      click,
    },
    "Preview",
  );
}

/** Tries the effect of a card on which the pointer rests. A finger has the card's button. @param {App} app @param {HTMLElement} root of the cards */
export function wirePreview(app, root) {
  let under = "";
  let timer = 0;
  const rest = (/** @type {string} */ effect) => {
    if (effect === under) return;
    under = effect;
    clearTimeout(timer);
    if (pointed) {
      pointed = null;
      drawAnew(app);
    }
    if (effect) timer = window.setTimeout(() => begin(effect), REST_MS);
  };
  const begin = (/** @type {string} */ effect) => {
    const model = app.current();
    if (!model || app.state?.job) return;
    pointed = { model: model.id, effect };
    drawAnew(app);
  };
  root.addEventListener("pointerover", (event) => {
    if (event.pointerType === "touch" || !(event.target instanceof Element)) return;
    const card = event.target.closest(".card[data-effect]");
    rest(card instanceof HTMLElement ? (card.dataset.effect ?? "") : "");
  });
  root.addEventListener("pointerleave", () => rest(""));
}
