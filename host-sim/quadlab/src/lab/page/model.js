// The chosen model in numbers, and how to take it along.

import { AXES, address, axisUnit } from "./api.js";
import { el, redraw, table } from "./dom.js";
import { titleOf } from "./models.js";
import { short, unit, withError, withUnit } from "./numbers.js";
import { timelineSection } from "./timeline.js";

/** @typedef {import("./main.js").App} App */
/** @typedef {import("./api.js").Coefficient} Coefficient */

/** @param {App} app @param {HTMLElement} root */
export function modelTab(app, root) {
  const content = el("div");
  const timeline = timelineSection(app);
  root.append(content, timeline.element);

  async function update() {
    const [model, second] = [app.current(), app.second()];
    if (!model) return;
    const all = second ? [model, second] : [model];
    const still = () => app.current()?.id === model.id && app.second()?.id === second?.id;
    const [details, other] = await Promise.all(all.map((one) => app.details(one.id)));
    if (still()) draw(model, second, [details, other], []);
    const comparisons = await Promise.all(all.map((one) => app.comparison(one.id)));
    if (!still()) return;
    draw(model, second, [details, other], comparisons);
    await timeline.update();
  }

  /** @param {import("./api.js").Model} model @param {import("./api.js").Model|null} second @param {any[]} documents @param {any[]} comparisons */
  function draw(model, second, [details, other], [comparison, others]) {
    redraw(content, [
      el("h3", {}, titleOf(model)),
      el(
        "p",
        { class: "quiet" },
        `Fitted on ${model.fitted_on.join(", ") || "nothing"}. Held out: ${model.judged_on.join(", ") || "nothing"}.`,
      ),
      downloads(app, model.id),
      command(app, model.command),
      errors(comparison, model, titleOf(model)),
      second && errors(others, second, `second: ${titleOf(second)}`),
      horizons(comparison, others ?? null),
      coefficients(details.coefficients, other?.coefficients ?? null),
      physical(details.physical ?? []),
      equations(details.equations ?? []),
      el(
        "details",
        { "data-key": "toml" },
        el("summary", { "data-key": "unfold toml" }, "Model file"),
        el("pre", { tabindex: "0" }, details.toml),
      ),
    ]);
  }
  return { update, picture: () => null, resize: timeline.draw, theme: timeline.draw };
}

/** @typedef {{symbol: string, name: string, value: number, std_error: number|null, unit: string, mathml: string|null, source: string}} Physical */

/** Mass, thrust and torque coefficients and moments of inertia. @param {Physical[]} all */
function physical(all) {
  if (!all.length) return null;
  const commands = all.some((one) => one.unit.includes("cmd"));
  return el(
    "section",
    { id: "physical", "aria-label": "Physical parameters" },
    table(
      "Physical parameters",
      ["parameter", "meaning", "value ± standard error", "unit", "from"],
      all.map((one) => [
        symbol(one.symbol),
        one.name,
        withError(one.value, one.std_error),
        unit(one.unit),
        one.source,
      ]),
    ),
    el(
      "p",
      { class: "quiet" },
      "Mass and geometry of the vehicle file count as exact; a rotor's lever is its arm over √2, as in an X frame. ",
      commands && "The motor map is not known: cmd is the unit of the motor commands, which stand in for rotor speeds.",
    ),
    el(
      "details",
      { "data-key": "relations" },
      el("summary", { "data-key": "unfold relations" }, "How they follow from the coefficients"),
      all
        .filter((one) => one.mathml && one.symbol !== "m")
        .map((one) => el("div", { class: "equation" }, drawn(/** @type {string} */ (one.mathml)))),
    ),
  );
}

/** @param {string} text such as `k_Q/I_zz` */
function symbol(text) {
  const one = (/** @type {string} */ part) => {
    const [base, below] = part.replace("omega", "ω").split("_");
    return [el("i", {}, base), below ? el("sub", {}, below) : ""];
  };
  return text.split("/").flatMap((part, n) => [n ? " / " : "", ...one(part)]);
}

/** What each effect does. @param {{effect: string, sentence: string, mathml: string|null, source: string|null}[]} all */
function equations(all) {
  if (!all.length) return null;
  return el(
    "section",
    { "aria-label": "Equations" },
    el("h3", {}, "Equations"),
    all.map((one) =>
      el(
        "div",
        { class: "equation", "data-effect": one.effect },
        el("b", {}, one.effect),
        one.mathml ? drawn(one.mathml) : null,
        el("p", { class: "quiet" }, one.sentence, one.source && ` (${one.source})`),
      ),
    ),
  );
}

/** The equation of an effect of the catalogue, from the server's own text. @param {string} mathml */
function drawn(mathml) {
  const parsed = new DOMParser().parseFromString(mathml, "application/xml");
  return document.importNode(parsed.documentElement, true);
}

/** @param {App} app @param {number} id */
function downloads(app, id) {
  const link = (/** @type {string} */ text, /** @type {string} */ path, /** @type {Record<string, any>} */ query) =>
    el("li", {}, el("a", { href: address(path, query), download: true, "data-key": path }, text));
  return el(
    "ul",
    { class: "downloads", "aria-label": "Downloads" },
    link("model.toml", "/api/download/model.toml", { id }),
    app.flight() &&
      link(`samples of ${app.view.flight} (CSV)`, "/api/download/series.csv", { model: id, flight: app.view.flight }),
    app.flight() &&
      link(`samples of ${app.view.flight} (Parquet)`, "/api/download/series.parquet", { model: id, flight: app.view.flight }),
    link("report (HTML)", "/api/download/report.html", { id }),
  );
}

/** @param {App} app @param {string} text */
function command(app, text) {
  const said = el("span", { role: "status" });
  const copy = async () => {
    await navigator.clipboard.writeText(text);
    said.textContent = "copied";
  };
  return el(
    "div",
    { class: "command" },
    el("p", {}, "The same in a terminal:"),
    el("pre", { tabindex: "0", id: "command" }, text),
    el("button", { type: "button", id: "copy", "data-key": "copy", click: () => app.act(copy()) }, "Copy"),
    " ",
    said,
  );
}

/** @param {any} comparison @param {import("./api.js").Model} model @param {string} of */
function errors(comparison, model, of) {
  if (!comparison) return null;
  const cell = (/** @type {any} */ one) => (one ? `${short(one.rms)} (${short(one.r2, 3)})` : "–");
  const use = (/** @type {string} */ name) =>
    model.fitted_on.includes(name) ? "training" : model.judged_on.includes(name) ? "held out" : "neither";
  const rows = comparison.flights.map((/** @type {any} */ flight) => [
    flight.name,
    use(flight.name),
    ...AXES.map((axis) => cell(flight.axes?.[axis])),
  ]);
  if (model.axes) rows.push(["all held out", "held out", ...AXES.map((axis) => cell(model.axes?.[axis]))]);
  return table(
    `Root mean square error (and R²) of each flight, ${of}`,
    ["flight", "set", ...AXES.map((axis) => withUnit(axis, axisUnit(axis)))],
    rows,
  );
}

/** @param {any} one @param {any} other */
function horizons(one, other) {
  if (!one?.horizons) return null;
  const fields = [
    ["position", "position_m", "m"],
    ["velocity", "velocity_m_s", "m/s"],
    ["attitude", "attitude_rad", "rad"],
    ["rates", "rate_rad_s", "rad/s"],
  ];
  const names = Object.keys(one.horizons);
  const name = (/** @type {string} */ key) =>
    /^\d+$/.test(key)
      ? `${key} ${key === "1" ? "sample" : "samples"} ahead`
      : key.replace(/^sum_(\d+)_(\d+)$/, "sum of $1 to $2 ahead");
  return table(
    `Mean error of open-loop prediction, all flights${other ? ": chosen, and second model" : ""}`,
    ["horizon", ...fields.map(([text, , of]) => withUnit(text, of))],
    names.map((key) => [
      name(key),
      ...fields.map(([, field]) => {
        const first = short(one.horizons[key]?.[field]);
        return other ? `${first}; ${short(other.horizons?.[key]?.[field])}` : first;
      }),
    ]),
  );
}

/** @param {Coefficient[]} all @param {Coefficient[]|null} others */
function coefficients(all, others) {
  const same = (/** @type {Coefficient} */ c) => others?.find((o) => o.effect === c.effect && o.name === c.name);
  const gone = (others ?? []).filter((o) => !all.some((c) => c.effect === o.effect && c.name === o.name));
  const head = ["effect", "coefficient", "value ± standard error", ...(others ? ["second model"] : []), "unit"];
  const value = (/** @type {Coefficient|undefined} */ c) => (c ? withError(c.value, c.std_error) : "–");
  const row = (
    /** @type {Coefficient} */ c,
    /** @type {Coefficient|undefined} */ mine,
    /** @type {Coefficient|undefined} */ theirs,
  ) => [c.effect ?? "", c.name, value(mine), ...(others ? [value(theirs)] : []), unit(c.unit)];
  return table("Coefficients", head, [...all.map((c) => row(c, c, same(c))), ...gone.map((c) => row(c, undefined, c))]);
}
