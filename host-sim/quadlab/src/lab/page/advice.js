// What to do next: the last step's worth, the verdict, and a card for each effect that was tried.

import { AXES, ServerError, axisUnit, flightsOf, get } from "./api.js";
import { el, redraw, table } from "./dom.js";
import { VERDICTS } from "./models.js";
import { given, known, pValue, percent, prose, rmsFall, short, unit, withError } from "./numbers.js";
import { previewButton } from "./preview.js";

/** @typedef {import("./api.js").Diagnosis} Diagnosis */
/** @typedef {import("./api.js").Finding} Finding */
/** @typedef {import("./api.js").Model} Model */
/** @typedef {import("./main.js").App} App */

/** The evidence that was unfolded, by model and effect: an answer, or null while it is on its way. @type {Map<string, any>} */
const unfolded = new Map();

/** Diagnoses by model. @type {Map<number, Promise<Diagnosis|null>>} */
const made = new Map();

/** Asks for diagnoses and evidence anew: a job has ended. */
export function forget() {
  made.clear();
  unfolded.clear();
}

/** @param {App} app @param {HTMLElement} root */
export async function drawAdvice(app, root) {
  const model = app.current();
  if (!model) {
    redraw(root, [start(app)]);
    return;
  }
  // A state from before the diagnosis may still be drawn after its end: that there was none yet is not kept.
  if (model.verdict === null) {
    draw(app, root, model, null);
    return;
  }
  if (!made.has(model.id)) made.set(model.id, diagnosisOf(model));
  try {
    const diagnosis = (await made.get(model.id)) ?? null;
    if (app.current()?.id === model.id) draw(app, root, model, diagnosis);
  } catch (error) {
    made.delete(model.id);
    throw error;
  }
}

/** @param {Model} model @returns {Promise<Diagnosis|null>} */
async function diagnosisOf(model) {
  try {
    return await get("/api/diagnosis", { model: model.id });
  } catch (error) {
    if (error instanceof ServerError && error.status === 404) return null;
    throw error;
  }
}

/** @param {App} app */
function start(app) {
  const training = app.state?.flights.filter((flight) => flight.set === "train").length ?? 0;
  const heldOut = app.state?.flights.filter((flight) => flight.set === "validate").length ?? 0;
  if (app.state?.problem) return null;
  return el(
    "p",
    {},
    `${training} training flights, ${heldOut} held out. Press Identify to fit the basic model, or Explain to let quadlab take all steps by itself.`,
  );
}

/** @param {App} app @param {HTMLElement} root @param {Model} model @param {Diagnosis|null} diagnosis */
function draw(app, root, model, diagnosis) {
  const again = () => draw(app, root, model, diagnosis);
  redraw(root, [
    outcome(app, model),
    stale(app, model),
    ...(diagnosis ? report(app, model, diagnosis, again) : [undiagnosed()]),
  ]);
}

function undiagnosed() {
  return el("p", { id: "summary" }, "This model has not been diagnosed. Press Diagnose to try every effect on it.");
}

/** What the effect that made the model was worth. @param {App} app @param {Model} model */
function outcome(app, model) {
  const parent = app.state?.models.find((other) => other.id === model.parent);
  if (!parent?.axes || !model.axes) return null;
  const rows = AXES.map((axis) => ({ axis, before: parent.axes?.[axis], after: model.axes?.[axis] }))
    .map((row) => ({ ...row, fall: rmsFall(row.before?.sse, row.after?.sse) }))
    .filter((row) => known(row.fall) && Math.abs(row.fall) >= 1);
  const support = model.supported === false ? " The flights do not support it." : "";
  return el(
    "section",
    { id: "outcome", "aria-label": "What the last step was worth" },
    el("h3", {}, `With ${model.effect ?? model.label}`),
    el(
      "p",
      {},
      rows.length
        ? `Held-out error of the chosen model and of its parent.${support}`
        : `No held-out error changes by 1 % or more.${support}`,
    ),
    rows.map(({ axis, before, after, fall }) => {
      const largest = Math.max(before?.rms ?? 0, after?.rms ?? 0) || 1;
      return el(
        "div",
        { class: "before-after" },
        el("b", {}, axis),
        el(
          "span",
          { class: "twin", "aria-hidden": "true" },
          el("i", { class: "before", style: `width: ${(100 * (before?.rms ?? 0)) / largest}%` }),
          el("i", { class: "after", style: `width: ${(100 * (after?.rms ?? 0)) / largest}%` }),
        ),
        el(
          "span",
          {},
          `${short(before?.rms)} → ${short(after?.rms)} ${unit(axisUnit(axis))} (${(fall ?? 0) > 0 ? "−" : "+"}${percent(Math.abs(fall ?? 0))})`,
        ),
      );
    }),
  );
}

/** Says so when the model was fitted on other flights than are chosen now. @param {App} app @param {Model} model */
function stale(app, model) {
  const names = (/** @type {string} */ set) =>
    (app.state?.flights ?? []).filter((file) => file.set === set).flatMap(flightsOf);
  const same = (/** @type {string[]} */ a, /** @type {string[]} */ b) =>
    [...a].sort().join("\n") === [...b].sort().join("\n");
  // A single flight is split by blocks of time, which have names of their own.
  if (names("train").length + names("validate").length < 2) return null;
  if (same(names("train"), model.fitted_on) && same(names("validate"), model.judged_on)) return null;
  return el(
    "p",
    { class: "note" },
    "This model has other training and held-out flights than you have chosen now. Press Identify to fit it on these.",
  );
}

/** @param {App} app @param {Model} model @param {Diagnosis} diagnosis @param {() => void} again */
function report(app, model, diagnosis, again) {
  const supported = diagnosis.effects.filter((finding) => finding.supported);
  const others = diagnosis.effects.filter((finding) => !finding.supported);
  const cards = (/** @type {Finding[]} */ findings) =>
    findings.map((finding) => card(app, model, diagnosis, finding, again));
  return [
    el("p", { id: "verdict", class: diagnosis.verdict, "data-verdict": diagnosis.verdict }, inWords(diagnosis.verdict)),
    el(
      "p",
      { class: "quiet" },
      `Translation: ${inWords(diagnosis.verdicts?.translation)}. `,
      `Rotation: ${inWords(diagnosis.verdicts?.rotation)}.`,
    ),
    el("p", { id: "summary", tabindex: diagnosis.summary.length > 400 ? 0 : null }, prose(diagnosis.summary)),
    unexplained(app, diagnosis),
    notIdentified(diagnosis),
    ...cards(supported),
    others.length
      ? el(
          "details",
          { class: "others", "data-key": "others", open: !supported.length && diagnosis.verdict === "unexplained" },
          el("summary", { "data-key": "unfold others" }, `${others.length} effects that the flights do not support`),
          cards(others),
        )
      : null,
  ];
}

/** A verdict in words. @param {string|undefined} verdict */
const inWords = (verdict) => VERDICTS[verdict ?? ""] ?? verdict ?? "unknown";

/** What no effect accounts for; a click shows it. @param {App} app @param {Diagnosis} diagnosis */
function unexplained(app, diagnosis) {
  if (!diagnosis.unexplained.length) return null;
  return el(
    "section",
    {},
    el("h3", {}, "What is left in the residual"),
    el(
      "ul",
      { class: "left-over" },
      diagnosis.unexplained.map((one) =>
        el(
          "li",
          {},
          el("b", {}, one.axis),
          `: ${one.depends_on}, ${percent(one.share_percent)} of its squared error, ${pValue(one.p_value)} `,
          el(
            "button",
            {
              type: "button",
              "data-key": `left ${one.axis} ${one.depends_on}`,
              "aria-label": `Show ${one.depends_on} in the residual of ${one.axis}`,
              click: () => app.act(showLeft(app, one)),
            },
            "Show",
          ),
        ),
      ),
    ),
    el(
      "p",
      {},
      "Do you know what it could be? ",
      el(
        "button",
        { type: "button", "data-key": "write own", click: () => app.look({ tab: "own" }) },
        "Write an effect of your own",
      ),
    ),
  );
}

/** Draws the residual against what it depends on, or its spectrum where that is nothing measured. @param {App} app @param {{axis: string, depends_on: string}} one */
async function showLeft(app, one) {
  const wanted = one.depends_on.includes("changes in time") ? "time" : one.depends_on;
  const measured = (await app.quantities()).some((quantity) => quantity.name === wanted);
  app.look(
    measured ? { tab: "where", axis: one.axis, quantity: wanted, over: "" } : { tab: "spectrum", axis: one.axis },
  );
}

/** @param {Diagnosis} diagnosis */
function notIdentified(diagnosis) {
  if (!diagnosis.not_identified.length) return null;
  return el(
    "section",
    {},
    el("h3", {}, "Not identified"),
    el(
      "ul",
      {},
      diagnosis.not_identified.map((one) =>
        el(
          "li",
          {},
          el("b", {}, one.axis ?? one.group ?? ""),
          prose(`: ${one.reason ?? one.why ?? "these flights do not determine it"}. To determine it: ${one.fly}.`),
        ),
      ),
    ),
  );
}

/** @param {App} app @param {Model} model @param {Diagnosis} diagnosis @param {Finding} finding @param {() => void} again */
function card(app, model, diagnosis, finding, again) {
  const key = `${model.id} ${finding.effect}`;
  const open = unfolded.has(key);
  const id = `why-${finding.effect}`;
  return el(
    "article",
    {
      class: `card${finding.supported ? " supported" : ""}`,
      "data-effect": finding.effect,
      "aria-label": finding.effect,
    },
    el(
      "div",
      { class: "heading" },
      el("h3", {}, finding.effect, known(finding.motor) && ` (motor ${finding.motor})`),
      el(
        "span",
        { class: finding.supported ? "good-text" : "quiet" },
        finding.supported ? "✓ supported" : "not supported",
      ),
    ),
    el("p", {}, diagnosis.sentences?.[finding.effect]),
    el("p", { class: finding.supported ? "" : "quiet" }, sentence(finding.reason)),
    falls(finding.axes),
    coefficients(finding),
    finding.confounded_with.length > 0 && confounded(app, model, finding, again),
    el(
      "div",
      { class: "buttons" },
      el(
        "button",
        {
          type: "button",
          class: `add${finding.supported ? " primary" : ""}`,
          disabled: Boolean(app.state?.job),
          "data-key": `add ${finding.effect}`,
          "aria-label": `${finding.supported ? "Add" : "Add anyway"}: ${finding.effect}`,
          click: () => app.run({ do: "add", model: model.id, effect: finding.effect }),
        },
        finding.supported ? "Add" : "Add anyway",
      ),
      previewButton(app, model.id, finding.effect, again),
      el(
        "button",
        {
          type: "button",
          class: "why",
          "aria-expanded": String(open),
          "aria-controls": id,
          "aria-label": `Why? Evidence for and against ${finding.effect}`,
          "data-key": `why ${finding.effect}`,
          click: () => app.act(toggle(model, finding, again)),
        },
        "Why?",
      ),
    ),
    el(
      "div",
      {
        id,
        class: "evidence",
        hidden: !open,
        role: "region",
        tabindex: "0",
        "aria-label": `Evidence for and against ${finding.effect}`,
      },
      open && evidence(unfolded.get(key)),
    ),
  );
}

/** What it cannot be told apart from, and the flight that tells. @param {App} app @param {Model} model @param {Finding} finding @param {() => void} again */
function confounded(app, model, finding, again) {
  return el(
    "div",
    { class: "note" },
    el("p", {}, `These flights cannot tell it apart from ${finding.confounded_with.join(", ")}.`),
    finding.confounded_with.map((other) => toFly(app, model, finding.effect, other, again)),
  );
}

/** Flights that were planned, by model and effects; null while one is on its way. @type {Map<string, {words: string, deviations: number, file: string, url: string}|null>} */
const planned = new Map();

/** @param {App} app @param {Model} model @param {string} effect @param {string} other @param {() => void} again */
function toFly(app, model, effect, other, again) {
  const key = `${model.id} ${effect} ${other}`;
  const plan = planned.get(key);
  const work = async () => {
    planned.set(key, null);
    again();
    try {
      const { csv, ...flight } = await get("/api/next", { model: model.id, effect, other });
      planned.set(key, { ...flight, url: URL.createObjectURL(new Blob([csv], { type: "text/csv" })) });
    } catch (error) {
      planned.delete(key);
      throw error;
    } finally {
      again();
    }
  };
  return el(
    "div",
    { class: "to-fly" },
    plan
      ? el(
          "p",
          {},
          `To tell it from ${other}: ${plan.words}; the one that is there stands out by ${short(plan.deviations, 2)} standard errors. `,
          el("a", { href: plan.url, download: plan.file, "data-key": `pattern ${key}` }, `Pattern file ${plan.file}`),
        )
      : el(
          "button",
          {
            type: "button",
            class: "plan",
            disabled: plan === null,
            "data-key": `plan ${key}`,
            click: () => app.act(work()),
          },
          plan === null ? `Planning a flight …` : `What to fly to tell it from ${other}`,
        ),
    el("p", { class: "quiet" }, "In a terminal: ", el("code", {}, planCommand(model.id, effect, other))),
  );
}

/** @param {number} model @param {string} effect @param {string} other */
const planCommand = (model, effect, other) =>
  `quadlab plan --model lab/model-${model}.toml --separate ${effect} ${other} --out ${effect}-or-${other}.csv`;

/** @param {string} text */
const sentence = (text) =>
  text ? prose(text[0].toUpperCase() + text.slice(1) + (/[.!?]$/.test(text) ? "" : ".")) : "";

/** @param {Model} model @param {Finding} finding @param {() => void} again */
async function toggle(model, finding, again) {
  const key = `${model.id} ${finding.effect}`;
  if (unfolded.has(key)) {
    unfolded.delete(key);
    again();
    return;
  }
  unfolded.set(key, null);
  again();
  try {
    unfolded.set(key, await get("/api/why", { model: model.id, effect: finding.effect }));
  } catch (error) {
    unfolded.delete(key);
    throw error;
  } finally {
    again();
  }
}

/** By how much the held-out rms falls, axis by axis. @param {Finding["axes"]} axes */
export function falls(axes) {
  const rows = Object.entries(axes);
  if (!rows.length) return null;
  return el(
    "ul",
    { class: "falls", "aria-label": "Fall of the held-out rms error" },
    rows.map(([axis, drop]) => {
      const fall = rmsFall(drop.sse_before, drop.sse_after);
      const width = known(fall) ? Math.min(100, Math.abs(fall)) : 0;
      return el(
        "li",
        {},
        el("b", {}, axis),
        el(
          "span",
          { class: "track", "aria-hidden": "true" },
          el("i", { class: (fall ?? 0) < 0 ? "worse" : "", style: `width: ${width}%` }),
        ),
        el("span", {}, known(fall) ? `${fall < 0 ? "rises" : "falls"} by ${percent(Math.abs(fall))}` : "–"),
      );
    }),
  );
}

/** @param {Finding} finding */
function coefficients(finding) {
  if (!finding.coefficients.length) return null;
  return el(
    "dl",
    { class: "coefficients" },
    finding.coefficients.flatMap((c) => [
      el("dt", {}, c.name),
      el("dd", {}, `${withError(c.value, c.std_error)} ${unit(c.unit)}`),
    ]),
  );
}

/** All that speaks for and against an effect. @param {any} why the server's answer; null while it is on its way */
export function evidence(why) {
  if (!why) return [el("p", { role: "status" }, "Weighing the evidence …")];
  const number = (/** @type {any} */ x, /** @type {string} */ of) => `${short(x)}${of ? ` ${unit(of)}` : ""}`;
  return [
    el("p", {}, prose(why.summary)),
    el(
      "ul",
      { class: "criteria", "aria-label": "Criteria" },
      why.criteria.map((/** @type {any} */ c) =>
        el(
          "li",
          { class: c.met ? "met" : "missed" },
          el("b", { class: c.met ? "good-text" : "bad-text" }, c.met ? "✓ met" : "✗ not met"),
          ` ${c.question}: `,
          el("b", {}, known(c.value) ? number(c.value, c.unit) : "unknown"),
          `; needed: at ${c.at_most ? "most" : "least"} ${given(c.threshold)}${c.unit ? ` ${unit(c.unit)}` : ""}`,
        ),
      ),
    ),
    why.flights?.length > 0 &&
      table(
        "Fall of the rms error, flight by flight [%]",
        ["flight", ...AXES],
        why.flights.map((/** @type {any} */ flight) => [
          flight.flight,
          ...AXES.map((axis) =>
            percent(rmsFall(flight.axes[axis]?.sse_before, flight.axes[axis]?.sse_after)).replace(" %", ""),
          ),
        ]),
      ),
    why.coefficients?.length > 0 &&
      table(
        "Coefficients, and the range that is physically possible",
        ["coefficient", "value ± standard error", "possible"],
        why.coefficients.map((/** @type {any} */ c) => [
          c.name,
          `${withError(c.value, c.std_error)} ${unit(c.unit)}`,
          c.possible ? `${given(c.possible[0])} to ${given(c.possible[1])}` : "–",
        ]),
      ),
    why.alike?.length > 0 &&
      el(
        "div",
        {},
        el("p", {}, "Looks like:"),
        el(
          "ul",
          {},
          why.alike.map((/** @type {any} */ a) =>
            el(
              "li",
              {},
              el("b", {}, a.effect),
              typeof a.separate === "string" ? `: to tell them apart, ${a.separate}` : "",
            ),
          ),
        ),
      ),
    why.to_see_it && el("p", {}, el("b", {}, "To see it: "), why.to_see_it, "."),
  ];
}
