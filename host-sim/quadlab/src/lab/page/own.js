// An effect of the user's own: written as formulas, checked while typing, drawn, tried on the held-out flights, kept.

import { evidence, falls } from "./advice.js";
import { ServerError, get, givenUp, newest, post } from "./api.js";
import { el, redraw, table } from "./dom.js";
import { swatch } from "./legend.js";
import { titleOf } from "./models.js";
import { given, prose, unit, withUnit } from "./numbers.js";
import { drawColumns, lookOf } from "./own-figure.js";

/** @typedef {import("./main.js").App} App */
/** @typedef {{id: string, forces: string[], moments: string[], rows: {row: string, formula: string, unit: string}[],
 *   coefficients: {name: string, unit: string, possible: [number, number], typical: number}[], linear: boolean}} Described */
/** @typedef {{problem: string|null, effect: Described|null}} Checked */
/** @typedef {{quantities: {name: string, unit: string, meaning: string}[], functions: string[], example: string}} Names */

/** How long the keys may rest before the text is checked, ms. */
const REST_MS = 300;
/** Where a reload finds what is being written. */
const DRAFT = "quadlab-own-effect";

/** @param {App} app @param {HTMLElement} root */
export function ownTab(app, root) {
  /** What is wrong with the text, or what it says; null until that is known. @type {Checked|null} */
  let checked = null;
  /** What is being tried or was, and on what. @type {{key: string, title: string, why: any}|null} */
  let tried = null;
  let trying = new AbortController();
  /** What was being written when another effect was opened. @type {string|null} */
  let left = null;
  /** @type {Names|null} */
  let names = null;
  /** Whether the text has its first content. */
  let begun = false;
  /** @type {import("./own-figure.js").Preview|null} */
  let preview = null;
  /** Why there is no preview. @type {string|null} */
  let nothingDrawn = null;
  let timer = 0;
  /** @type {ReturnType<typeof newest<Checked>>} */
  const newestCheck = newest();
  /** @type {ReturnType<typeof newest<import("./own-figure.js").Preview>>} */
  const newestPreview = newest();

  const kept = el("div", { id: "own-kept" });
  const area = el("textarea", {
    id: "own-text",
    rows: 11,
    spellcheck: "false",
    autocapitalize: "off",
    autocomplete: "off",
    "aria-describedby": "own-status",
    input: onInput,
  });
  const status = el("div", { id: "own-status", role: "status" });
  const buttons = el("div", { class: "buttons", id: "own-buttons" });
  const help = el("div", { id: "own-help" });
  const result = el("div", { id: "own-result" });
  const legend = el("div", { class: "legend", id: "own-legend" });
  const plot = el("div", { id: "own-plot", class: "plot", "aria-hidden": "true" });
  const picture = el("div", { role: "img", "aria-label": "What the effect would do, beside what the model leaves" }, plot);
  root.append(
    kept,
    el(
      "div",
      { class: "own-editor" },
      el("div", {}, el("label", { for: "own-text" }, "Formulas, coefficients and units of one effect (TOML)"), area),
      status,
    ),
    buttons,
    help,
    result,
    legend,
    picture,
  );

  const text = () => area.value;
  const ownOf = (/** @type {string|undefined} */ id) => app.state?.own.find((own) => own.id === id) ?? null;
  /** The kept effect that is shown as it is kept. */
  const shownOwn = () => {
    const own = ownOf(checked?.effect?.id);
    return own && own.text === text() ? own : null;
  };

  /** What a trial depends on. */
  const trialKey = () =>
    JSON.stringify([text(), app.current()?.id, (app.state?.flights ?? []).map((file) => [file.name, file.set])]);

  /** @param {string} value */
  function write(value) {
    area.value = value;
    onInput();
  }

  function onInput() {
    try {
      sessionStorage.setItem(DRAFT, text());
    } catch {
      // Then a reload begins anew.
    }
    checked = null;
    drawButtons();
    drawResult();
    clearTimeout(timer);
    timer = window.setTimeout(() => app.act(check()), REST_MS);
  }

  async function check() {
    const answer = await newestCheck([text(), app.state?.models.length], (signal) =>
      post("/api/effects/check", { text: text() }, signal),
    );
    if (!answer) return;
    checked = answer;
    area.setAttribute("aria-invalid", String(Boolean(answer.problem)));
    redraw(status, answer.effect ? described(answer.effect) : [el("p", { id: "own-problem", class: "bad-text" }, prose(answer.problem ?? ""))]);
    drawKept();
    drawButtons();
    drawResult();
    await look();
  }

  /** Asks for what the effect would do in the shown flight. */
  async function look() {
    const [model, flight] = [app.current(), app.flight()];
    if (!checked?.effect || !model || !flight || !root.clientWidth) {
      preview = null;
      nothingDrawn = checked?.effect && !model ? "Press Identify: an effect is drawn and tried beside a model." : null;
      return draw();
    }
    const asked = {
      text: text(),
      model: model.id,
      flight: app.view.flight,
      from: app.view.from,
      to: app.view.to,
      width: Math.round(root.clientWidth * Math.min(2, devicePixelRatio)),
    };
    try {
      const answer = await newestPreview([asked, app.state?.readings], (signal) => post("/api/effects/preview", asked, signal));
      if (!answer) return;
      [preview, nothingDrawn] = [answer, null];
    } catch (error) {
      if (!(error instanceof ServerError)) throw error;
      [preview, nothingDrawn] = [null, error.message];
    }
    await draw();
  }

  async function draw() {
    const shown = preview;
    picture.hidden = !shown;
    redraw(legend, [
      nothingDrawn && el("p", { id: "own-nothing", class: "quiet" }, prose(nothingDrawn)),
      ...(shown ? legendOf(shown) : []),
    ]);
    if (shown && !root.hidden) await drawColumns(app, plot, shown, root.clientWidth);
  }

  function drawKept() {
    const all = app.state?.own ?? [];
    redraw(kept, [
      all.length > 0 && el("h3", {}, "Kept: candidates of Diagnose and Explain"),
      all.length > 0 && el("ul", { class: "kept" }, all.map(entry)),
    ]);
  }

  /** @param {import("./api.js").OwnEffect} own */
  function entry(own) {
    const models = own.models.length ? `in model${own.models.length > 1 ? "s" : ""} ${own.models.join(", ")}` : "";
    return el(
      "li",
      { "data-own": own.id },
      el(
        "button",
        {
          type: "button",
          class: "name",
          "aria-pressed": String(own.text === text()),
          "aria-label": `Edit ${own.id}`,
          "data-key": `own ${own.id}`,
          click: () => open(ownOf(own.id)?.text ?? ""),
        },
        own.id,
      ),
      el("span", { class: "quiet" }, models),
      own.problem && el("span", { class: "bad-text" }, prose(own.problem)),
      !own.models.length &&
        el(
          "button",
          {
            type: "button",
            class: "keep",
            disabled: Boolean(app.state?.job),
            "aria-label": `Remove ${own.id}`,
            "data-key": `remove ${own.id}`,
            click: () => app.choose("/api/effects/remove", { id: own.id }),
          },
          "Remove",
        ),
    );
  }

  /** Opens another text; what was written and not kept can be had back. @param {string} value */
  function open(value) {
    const isKept = app.state?.own.some((own) => own.text === text()) || text() === names?.example;
    if (!isKept) left = text();
    write(value);
    drawKept();
  }

  function drawButtons() {
    const [effect, model, own] = [checked?.effect, app.current(), shownOwn()];
    const busy = Boolean(app.state?.job);
    const isTrying = tried?.key === trialKey() && tried.why === null;
    const button = (/** @type {string} */ name, /** @type {string} */ kind, /** @type {boolean} */ off, /** @type {() => any} */ click) =>
      el("button", { type: "button", id: `own-${kind}`, class: kind, disabled: off, "data-key": `own-${kind}`, click }, name);
    const had = buttons.contains(document.activeElement);
    redraw(buttons, [
      button("Try it", "try", !effect || !model || isTrying, () => app.act(tryIt())),
      button(own ? "Kept" : "Keep", "keep", !effect || busy || Boolean(own), () => app.choose("/api/effects/keep", { text: text() })),
      own &&
        model &&
        !model.effects.includes(own.id) &&
        button("Add to the model", "add", busy, () => app.run({ do: "add", model: app.current()?.id, effect: checked?.effect?.id })),
      button("Example", "example", text() === names?.example, () => open(names?.example ?? "")),
      left !== null &&
        button("Back to what I wrote", "back", false, () => {
          const value = left ?? "";
          left = null;
          write(value);
        }),
    ]);
    // The focus does not stay on a button that can no longer be pressed.
    if (had && document.activeElement?.matches(":disabled, body")) {
      const next = checked?.effect ? buttons.querySelector("button:not(:disabled)") : area;
      next?.focus();
    }
  }

  /** Fits the chosen model with the effect, and judges it on the held-out flights. */
  async function tryIt() {
    const model = app.current();
    if (!model) return;
    trying.abort();
    trying = new AbortController();
    const { signal } = trying;
    const mine = { key: trialKey(), title: titleOf(model), why: /** @type {any} */ (null) };
    tried = mine;
    drawButtons();
    drawResult();
    try {
      mine.why = await post("/api/effects/try", { text: text(), model: model.id }, signal);
    } catch (error) {
      if (tried === mine) tried = null;
      if (!givenUp(error)) throw error;
    } finally {
      drawButtons();
      drawResult();
    }
  }

  function drawResult() {
    const shown = tried && tried.key === trialKey() ? tried : null;
    redraw(result, [shown && (shown.why ? judged(shown) : el("p", { role: "status" }, "Trying it on the held-out flights …"))]);
  }

  /** @param {{title: string, why: any}} shown */
  function judged({ title, why }) {
    return el(
      "section",
      { class: `card${why.supported ? " supported" : ""}`, "data-tried": why.effect, "aria-label": "Evidence on the held-out flights" },
      el(
        "div",
        { class: "heading" },
        el("h3", {}, `${why.effect} on ${title}`),
        el("span", { class: why.supported ? "good-text" : "quiet" }, why.supported ? "✓ supported" : "not supported"),
      ),
      falls(overFlights(why.flights, [...(checked?.effect?.forces ?? []), ...(checked?.effect?.moments ?? [])])),
      el(
        "details",
        { "data-key": "own evidence", open: true },
        el("summary", { "data-key": "own evidence summary" }, "The evidence"),
        el("div", { class: "evidence" }, evidence(why)),
      ),
    );
  }

  async function drawHelp() {
    if (!names) {
      names = await get("/api/effects/names");
      redraw(help, [helpOf(/** @type {Names} */ (names))]);
    }
    if (begun) return;
    begun = true;
    let draft = null;
    try {
      draft = sessionStorage.getItem(DRAFT);
    } catch {
      // The example, then.
    }
    area.value = draft || names?.example || "";
  }

  async function update() {
    await drawHelp();
    drawKept();
    drawButtons();
    drawResult();
    await check();
  }

  return { update, picture: () => null, resize: look, theme: draw };
}

/** What a text says. @param {Described} effect */
function described(effect) {
  const acts = [
    effect.forces.length ? `forces along ${effect.forces.join(", ")}` : "",
    effect.moments.length ? `moments about ${effect.moments.join(", ")}` : "",
  ].filter(Boolean);
  const how = effect.linear ? "It is linear in its coefficients." : "It is fitted step by step, from several starts.";
  return [
    el("p", { id: "own-described" }, el("b", {}, effect.id), `: ${acts.join("; ")}. ${how}`),
    el(
      "ul",
      { class: "rows" },
      effect.rows.map(({ row, formula, unit: of }) =>
        el("li", {}, el("b", {}, withUnit(row, of)), " += ", el("code", {}, formula)),
      ),
    ),
    table(
      "Coefficients",
      ["name", "unit", "possible", "typical"],
      effect.coefficients.map((c) => [
        c.name,
        unit(c.unit) || "1",
        `${given(c.possible[0])} to ${given(c.possible[1])}`,
        given(c.typical),
      ]),
    ),
  ];
}

/** What formulas can name. @param {Names} names */
function helpOf(names) {
  return el(
    "details",
    { "data-key": "own help" },
    el("summary", { "data-key": "own help summary" }, "What can a formula name?"),
    el("p", {}, "Rows: u v w in m/s² and p q r in rad/s² along and about the body's axes, north east down in m/s². Each formula has its row's unit; a number with a unit is a coefficient or a constant."),
    el("p", {}, "Functions: ", el("code", {}, names.functions.join(" ")), "."),
    el(
      "ul",
      { class: "names" },
      names.quantities.map((q) => el("li", {}, el("code", {}, q.name), ` ${withUnit(q.meaning, q.unit)}`)),
    ),
  );
}

/** @param {import("./own-figure.js").Preview} shown */
function legendOf(shown) {
  const names = [...new Set(shown.axes.flatMap((axis) => axis.columns.map((column) => column.coefficient)))];
  if (!names.length) return [el("p", { class: "quiet" }, "In this flight the effect does nothing.")];
  return [
    el("span", {}, swatch("residual"), "residual of the model"),
    ...names.map((name) => el("span", {}, swatch(lookOf(shown, name)), `${name}, at its typical size`)),
  ];
}

/** Errors of all flights together, on some axes. @param {{axes: Record<string, any>}[]} flights @param {string[]} axes */
function overFlights(flights, axes) {
  const sum = (/** @type {string} */ axis, /** @type {string} */ when) =>
    flights.reduce((all, flight) => all + (flight.axes[axis]?.[when] ?? 0), 0);
  const drop = (/** @type {string} */ axis) => {
    const [before, after] = [sum(axis, "sse_before"), sum(axis, "sse_after")];
    return { sse_before: before, sse_after: after, drop_percent: before > 0 ? 100 * (1 - after / before) : 0 };
  };
  return flights.length ? Object.fromEntries(axes.map((axis) => [axis, drop(axis)])) : {};
}
