// Measured against predicted over time: linked plots with one time axis and one cursor.

import { flightsOf, get, givenUp } from "./api.js";
import { rangeChoice } from "./choosing.js";
import { choice, el, redraw } from "./dom.js";
import { withTried } from "./legend.js";
import { known, nearest, seconds, short, withUnit } from "./numbers.js";
import { layPanels } from "./panels.js";
import { CONFIG, layout, plotly, room } from "./plots.js";
import { besideOf, chipsOf, modeOf, tool } from "./time-controls.js";
import { figure, sameIn } from "./time-figure.js";
import { trialOf } from "./trial.js";
import { saidOf, shades, unused, usedButtons } from "./used.js";

/** @typedef {import("./api.js").Series} Series */
/** @typedef {import("./api.js").Channel} Channel */
/** @typedef {import("./main.js").App} App */

/** What dragging does. @type {[string, string][]} */
const DRAGS = [
  ["zoom", "zooms"],
  ["pan", "moves the range"],
  ["use", "chooses what is used"],
];
const LEAST_SPAN_S = 0.1;
const FIRST_AHEAD = ["position", "attitude"];
/** How long a zoom may rest before the server is asked, ms. */
const REST_MS = 120;

/** @param {App} app @param {HTMLElement} root */
export function timeTab(app, root) {
  /** @type {import("./time-figure.js").Shown|null} */
  let shown = null;
  /** First and last time of what was asked for whole. @type {Map<string, [number, number]>} */
  const wholes = new Map();
  /** @type {import("./panels.js").Panels|null} */
  let panels = null;
  /** @type {AbortController|null} */
  let asked = null;
  let timer = 0;
  /** What dragging does, one of DRAGS. */
  let drag = "zoom";
  let key = "";
  let drawn = "";
  const trial = trialOf(app, "/api/series", () => draw());
  /** Where the panels lie without an effect that is tried, so that they stay. @type {{of: string, panels: import("./panels.js").Panels}|null} */
  let bare = null;

  const controls = el("div", { class: "controls" });
  const chips = el("div", { class: "chips", role: "group", "aria-label": "Channels" });
  const tools = el("div", { class: "tools", role: "group", "aria-label": "Range of time" });
  const usedSaid = el("span", { role: "status" });
  const usedRow = el("div", { class: "controls" });
  const used = el("div", { class: "controls", id: "used", role: "group", "aria-label": "What is used" }, usedSaid, usedRow);
  const plots = el("div", { id: "plots-drawing", "aria-hidden": "true" });
  const overlay = el("div", { class: "overlay", "aria-hidden": "true" });
  const spoken = el("p", { class: "hidden", role: "status" });
  const box = el(
    "div",
    {
      id: "plots",
      tabindex: "0",
      role: "group",
      "aria-label":
        "Linked plots. The left and right arrows move the cursor, with shift they move the range; plus and minus zoom; Home shows all.",
      keydown: onKey,
      mousemove: onMove,
      pointerdown: onPress,
      wheel: onWheel,
    },
    plots,
    overlay,
  );
  root.append(controls, el("div", { class: "bar-of-two" }, chips, tools), used, box, spoken);
  const choosing = rangeChoice(app, overlay, range, drawUsed);
  app.onCursor(drawCursor);

  function drawControls() {
    const { view } = app;
    redraw(controls, [
      modeOf(view, (ahead, other) => app.look(other ? { ahead, channels: null } : { ahead })),
      besideOf(others(), view, (change) => app.look(change)),
      (view.beside || app.second()) &&
        el(
          "label",
          {},
          el("input", {
            type: "checkbox",
            id: "difference",
            checked: view.difference,
            "data-key": "difference",
            change: () => app.look({ difference: !view.difference }),
          }),
          view.beside ? " difference of the residuals" : " difference of the models",
        ),
    ]);
    redraw(tools, [
      tool("zoom-in", "+", "Zoom in (plus key)", () => zoom(0.5)),
      tool("zoom-out", "−", "Zoom out (minus key)", () => zoom(2)),
      tool("earlier", "◀", "Earlier (shift and left arrow)", () => move(-0.5)),
      tool("later", "▶", "Later (shift and right arrow)", () => move(0.5)),
      tool("all", "All", "Show the whole flight (Home key, or double click)", all),
      choice("dragging", "drag", DRAGS, drag, (wanted) => {
        drag = wanted;
        choosing.clear();
        drawControls();
        draw();
      }),
    ]);
    drawUsed();
  }

  /** What is used of the flight, and how to change it. */
  function drawUsed() {
    const of = app.used();
    used.hidden = !of || !(drag === "use" || of.chosen);
    if (!of || used.hidden) return;
    const text = saidOf(of);
    if (usedSaid.textContent !== text) usedSaid.textContent = text;
    const busy = Boolean(app.state?.job) || Boolean(app.state?.reading);
    const dragged = choosing.get();
    redraw(
      usedRow,
      usedButtons(of, dragged ?? range(), dragged !== null, whole(), busy, (parts) => {
        choosing.clear();
        app.choose("/api/use", { name: of.flight, parts });
      }),
    );
  }

  /** Names of the flights that another can be chosen of. */
  function others() {
    const usable = (app.state?.flights ?? []).filter((file) => !file.problem);
    return usable.flatMap(flightsOf).filter((name) => name !== app.view.flight);
  }

  /** What the benchmark reads. */
  const measureDrawing = () => performance.measure("time drawn", "time asked");

  /** @param {Channel[]} channels */
  function chosen(channels) {
    const wanted = app.view.channels;
    const row = channels.filter((c) =>
      wanted ? wanted.includes(c.id) : app.view.ahead === 0 || FIRST_AHEAD.includes(c.group),
    );
    return row.length ? row : channels;
  }

  function drawChips() {
    const channels = shown?.first.channels ?? [];
    const on = chosen(channels).map((c) => c.id);
    redraw(
      chips,
      chipsOf(channels, on, (ids) => app.look({ channels: ids.length ? ids : null })),
    );
  }

  /** What is drawn along the axis of time. */
  const flights = () => JSON.stringify([app.view.flight, app.view.beside, app.view.beside && app.view.shift]);

  /** @returns {[number, number]} */
  const whole = () => wholes.get(flights()) ?? app.span();

  /** The range that is shown, s. @returns {[number, number]} */
  function range() {
    const { from, to } = app.view;
    return from === null || to === null ? whole() : [from, to];
  }

  /** @param {number} from @param {number} to */
  function show(from, to) {
    const [first, last] = whole();
    const span = Math.min(Math.max(to - from, LEAST_SPAN_S), last - first);
    const begin = Math.min(Math.max(from, first), last - span);
    if (span >= (last - first) * 0.999) return all();
    app.look({ from: begin, to: begin + span });
  }

  function all() {
    app.look({ from: null, to: null });
  }

  /** Zooms about the cursor, or the middle. @param {number} factor @param {number} [about] */
  function zoom(factor, about) {
    const [from, to] = range();
    const centre =
      about ?? (app.cursor !== null && app.cursor >= from && app.cursor <= to ? app.cursor : (from + to) / 2);
    show(centre - (centre - from) * factor, centre + (to - centre) * factor);
  }

  /** @param {number} share of what is shown */
  function move(share) {
    const [from, to] = range();
    show(from + share * (to - from), to + share * (to - from));
  }

  /** @param {KeyboardEvent} event */
  function onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = event.key === "ArrowLeft" ? -1 : event.key === "ArrowRight" ? 1 : 0;
    if (arrow && event.shiftKey) move(0.25 * arrow);
    else if (arrow) stepCursor(arrow);
    else if (event.key === "+" || event.key === "=") zoom(0.5);
    else if (event.key === "-") zoom(2);
    else if (event.key === "Home") all();
    else return;
    event.preventDefault();
  }

  /** @param {number} by samples that are drawn */
  function stepCursor(by) {
    const t = shown?.first.t ?? [];
    const [from, to] = range();
    const step = Math.max(1, Math.round(t.length / 400));
    const inside = app.cursor !== null && app.cursor >= from && app.cursor <= to ? app.cursor : (from + to) / 2;
    const at = nearest(t, inside) + by * step;
    app.point(t[Math.max(0, Math.min(t.length - 1, at))] ?? null, app.held);
    spoken.textContent = said();
  }

  /** The values at the cursor as a sentence. */
  function said() {
    if (!shown || app.cursor === null) return "";
    const at = nearest(shown.first.t, app.cursor);
    const parts = chosen(shown.first.channels).map(
      (c) => `${c.id.replace(/_/g, " ")} measured ${short(c.measured[at])}, predicted ${short(c.predicted[at])}`,
    );
    return `${seconds(app.cursor)}: ${parts.join("; ")}`;
  }

  /** Time under the pointer. @param {MouseEvent} event */
  function timeAt(event) {
    if (!panels) return null;
    const x = event.clientX - box.getBoundingClientRect().left;
    for (let column = 0; column < panels.columns; column++) {
      const share = (x - panels.x(column)) / panels.plotWidth;
      const [from, to] = range();
      if (share >= 0 && share <= 1) return from + share * (to - from);
    }
    return null;
  }

  /** @param {MouseEvent} event */
  function onMove(event) {
    const t = timeAt(event);
    if (t !== null && !app.held) app.point(t);
  }

  /** A click holds the cursor, the next one lets it go. Plotly covers the page while a button is down. @param {PointerEvent} pressed */
  function onPress(pressed) {
    const start = timeAt(pressed);
    if (drag === "use" && start !== null && pressed.button === 0) choosing.begin(pressed, start);
    const release = (/** @type {PointerEvent} */ released) => {
      const t = timeAt(released);
      if (t === null || Math.abs(released.clientX - pressed.clientX) > 3) return;
      app.point(t, !app.held);
    };
    window.addEventListener("pointerup", release, { once: true });
  }

  /** The wheel scrolls the page; with control or shift it zooms. @param {WheelEvent} event */
  function onWheel(event) {
    if (!event.ctrlKey && !event.shiftKey) return;
    event.preventDefault();
    zoom(event.deltaY + event.deltaX > 0 ? 1.25 : 0.8, timeAt(event) ?? undefined);
  }

  /** Draws what is there, and asks for what is not. */
  async function update() {
    drawControls();
    const { beside, shift } = app.view;
    // Lines of two flights and two models could not be told apart.
    const [model, flight, second] = [app.current(), app.flight(), beside ? null : app.second()];
    if (!model || !flight) return;
    const width = Math.max(
      200,
      Math.round((layPanels(6, root.clientWidth, 0).plotWidth || 600) * Math.min(2, devicePixelRatio)),
    );
    const query = { flight: app.view.flight, from: app.view.from, to: app.view.to, width, ahead: app.view.ahead || null };
    trial.update(beside ? null : query, inTrial());
    const wanted = JSON.stringify([
      model.id,
      second?.id,
      app.view.flight,
      app.view.from,
      app.view.to,
      width,
      app.view.ahead,
      beside,
      shift,
      app.state?.readings,
    ]);
    if (wanted === key && shown) {
      drawChips();
      await draw();
      return;
    }
    const first = !shown || drawn !== `${app.view.flight} ${app.view.ahead}`;
    key = wanted;
    performance.mark("time asked");
    clearTimeout(timer);
    asked?.abort();
    asked = new AbortController();
    const { signal } = asked;
    box.setAttribute("aria-busy", "true");
    if (shown && !first) slide();
    timer = window.setTimeout(
      () =>
        app.wait(
          ask(
            signal,
            query,
            model.id,
            second?.id ?? null,
            beside ? { flight: beside, beside: app.view.flight, shift } : null,
          ),
        ),
      first ? 0 : REST_MS,
    );
  }

  /**
   * @param {AbortSignal} signal @param {Record<string, any>} query @param {number} model @param {number|null} second
   * @param {Record<string, any>|null} other what the question for a second flight has besides
   */
  async function ask(signal, query, model, second, other) {
    const wanted = key;
    const along = flights();
    try {
      const [one, two, beside] = await Promise.all([
        get("/api/series", { model, ...query }, signal),
        second === null ? null : get("/api/series", { model: second, ...query }, signal),
        other && get("/api/series", { model, ...query, ...other }, signal),
      ]);
      if (signal.aborted) return;
      const ends = [one, beside].filter((series) => series && series.to > series.from);
      if (query.from === null && ends.length)
        wholes.set(along, [Math.min(...ends.map((s) => s.from)), Math.max(...ends.map((s) => s.to))]);
      shown = { first: one, second: two, beside };
      drawn = `${query.flight} ${query.ahead ?? 0}`;
      drawChips();
      await draw();
    } catch (error) {
      if (givenUp(error)) return;
      if (key === wanted) key = "";
      throw error;
    } finally {
      if (!signal.aborted) box.removeAttribute("aria-busy");
    }
  }

  /** Without which an effect that is tried is not drawn. */
  const inTrial = () => [app.view.flight, app.view.ahead];

  /** What is drawn: an effect that is tried takes the place of a second model. */
  function lines() {
    const tried = shown && !shown.beside ? trial.answer(inTrial()) : null;
    return shown && tried ? { ...shown, second: tried } : shown;
  }

  async function draw() {
    const Plotly = await plotly();
    const drawing = lines();
    if (!drawing || root.hidden || !root.clientWidth) return;
    const channels = chosen(drawing.first.channels);
    const same = JSON.stringify([channels.map((c) => c.id), root.clientWidth, range(), inTrial()]);
    const isBare = drawing === shown;
    panels = !isBare && bare?.of === same ? bare.panels : layPanels(channels.length, root.clientWidth, room(box));
    const { traces, axes } = figure(drawing, channels, panels, range(), app.view.difference, shown ?? drawing);
    const parts = app.used();
    const fresh = !plots.data;
    await Plotly.react(
      plots,
      traces,
      {
        ...layout(),
        ...axes,
        width: panels.width,
        height: panels.height,
        margin: { l: 0, r: 0, t: 0, b: 0 },
        hovermode: false,
        dragmode: drag === "use" ? false : drag,
        shapes: parts ? shades(unused(parts, whole()), channels.length) : [],
      },
      CONFIG,
    );
    if (fresh) {
      plots.on("plotly_relayout", onRelayout);
      plots.on("plotly_doubleclick", () => all());
    }
    if (isBare) bare = { of: same, panels };
    drawOverlay(channels);
    measureDrawing();
  }

  /** Shows another range of the lines that are there: much less has to be drawn than of new ones. */
  async function slide() {
    if (!plots.data || !panels) return draw();
    const Plotly = await plotly();
    await Plotly.relayout(plots, { "xaxis.range": [...range()] });
    drawCursor();
    choosing.draw(panels);
    measureDrawing();
  }

  /** @param {Record<string, any>} change */
  function onRelayout(change) {
    for (const [name, value] of Object.entries(change)) {
      const axisName = /^(xaxis\d*)\.range\[0\]$/.exec(name)?.[1];
      if (axisName) return show(value, change[`${axisName}.range[1]`]);
      if (/^xaxis\d*\.range$/.test(name) && value.join() !== range().join()) return show(value[0], value[1]);
    }
  }

  /** Names of the panels and values at the cursor. @param {Channel[]} channels */
  function drawOverlay(channels) {
    if (!panels) return;
    const lay = panels;
    overlay.replaceChildren(
      ...channels.map((channel, n) => {
        const place = lay.places[n];
        return el(
          "div",
          {
            id: `plot-${channel.id}`,
            class: "panel-name",
            "data-channel": channel.id,
            style: `left: ${lay.x(place.column)}px; width: ${lay.plotWidth}px; top: ${lay.main(place)[0] - 22}px`,
          },
          el("b", {}, nameOf(channel)),
          channel.predicted.some(known) ? null : el("span", { class: "quiet" }, "not modelled"),
          el("span", { class: "values" }),
        );
      }),
      ...Array.from({ length: lay.columns }, (_, column) =>
        el("div", { class: "cursor", "data-column": column, hidden: true }),
      ),
      ...Array.from({ length: lay.columns }, (_, column) =>
        el("div", { class: "choosing", "data-column": column, hidden: true }),
      ),
      el("div", { class: "cursor-time", hidden: true }),
    );
    drawCursor();
    choosing.draw(panels);
  }

  function drawCursor() {
    if (!panels || !shown || root.hidden) return;
    const lay = panels;
    const [from, to] = range();
    const t = app.cursor;
    const inside = t !== null && t >= from && t <= to;
    const px = inside ? ((t - from) / (to - from)) * lay.plotWidth : 0;
    for (const bar of overlay.querySelectorAll(".cursor")) {
      bar.hidden = !inside;
      bar.classList.toggle("pinned", app.held);
      bar.style.left = `${lay.x(Number(bar.dataset.column)) + px}px`;
      bar.style.height = `${lay.height - 24}px`;
    }
    const clock = overlay.querySelector(".cursor-time");
    if (clock) {
      clock.hidden = !inside;
      clock.textContent = inside ? seconds(t) : "";
      clock.style.left = `${lay.x(0) + px}px`;
    }
    const at = inside ? nearest(shown.first.t, t) : -1;
    const about = isThinned(shown.first.t, app.flight()?.rate_hz ?? 0) ? "≈  " : "";
    const otherSeries = lines()?.second ?? shown.beside;
    const word = shown.beside ? "there" : (withTried(app) ?? "second");
    const otherAt = inside && otherSeries ? nearest(otherSeries.t, t) : -1;
    for (const channel of chosen(shown.first.channels)) {
      const values = overlay.querySelector(`#plot-${CSS.escape(channel.id)} .values`);
      const other = sameIn(otherSeries, channel);
      const text = reading(channel, at, other, otherAt, word);
      if (values) values.textContent = inside ? `${about}${text}` : "";
    }
  }

  /** @returns {import("./save.js").Picture|null} */
  function picture() {
    if (!panels || !shown) return null;
    const lay = panels;
    const names = chosen(shown.first.channels).map((channel, n) => ({
      text: nameOf(channel),
      x: lay.x(lay.places[n].column),
      y: lay.main(lay.places[n])[0] - 20,
    }));
    const { flight, beside } = app.view;
    return { plot: plots, of: beside ? `${flight} and ${beside}` : flight, names };
  }

  return { update, picture, resize: () => update(), theme: () => draw() };
}

/** @param {Channel} channel */
function nameOf({ id, name, unit }) {
  return withUnit(id.length === 1 && !name.startsWith(`${id} `) ? `${id}, ${name}` : name, unit);
}

/** Whether several samples share a column of pixels: then values are those near the cursor, not at it. @param {number[]} t @param {number} rateHz */
const isThinned = (t, rateHz) => t.length > 1 && (t[t.length - 1] - t[0]) * rateHz > 1.8 * t.length;

/**
 * Values of a channel at a sample.
 * @param {Channel} channel @param {number} at @param {Channel|undefined} other @param {number} otherAt
 * @param {string} word what the other is called: "there" of a second flight
 */
function reading(channel, at, other, otherAt, word) {
  const parts = [`measured ${short(channel.measured[at])}`];
  if (other && word === "there") parts.push(`there ${short(other.measured[otherAt])}`);
  parts.push(`predicted ${short(channel.predicted[at])}`);
  if (other) parts.push(`${word} ${short(other.predicted[otherAt])}`);
  parts.push(`residual ${short(channel.residual[at])}`);
  if (other) parts.push(`${word === "second" ? "second's" : word} ${short(other.residual[otherAt])}`);
  return parts.join("  ");
}
