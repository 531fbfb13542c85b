// The page: its state, what it hears from the server, and what is drawn when.

import { drawAdvice, forget } from "./advice.js";
import { ServerError, flightsOf, get, post } from "./api.js";
import { drawChanges, forgetChanges } from "./changed.js";
import { drawDiscovery, forgetDiscovery } from "./discovered.js";
import { byId, el, fill } from "./dom.js";
import { drawFlights } from "./flights.js";
import { drawLegend } from "./legend.js";
import { modelTab } from "./model.js";
import { drawModels } from "./models.js";
import { flightOverview } from "./overview.js";
import { prose } from "./numbers.js";
import { ownTab } from "./own.js";
import { pathTab } from "./path.js";
import { wirePreview } from "./preview.js";
import { plotly } from "./plots.js";
import { saveButtons } from "./save.js";
import { spectrumTab } from "./spectrum.js";
import { timeTab } from "./time.js";
import { wireUpload } from "./upload.js";
import { there } from "./used.js";
import { drawVehicleButton, wireVehicle } from "./vehicle.js";
import { TABS, readView, writeView } from "./view.js";
import { whereTab } from "./where.js";

/** @typedef {import("./api.js").State} State */
/** @typedef {import("./api.js").Job} Job */

/** The answers to /api/model. @type {Map<number, Promise<any>>} */
const details = new Map();
/** The answers to /api/comparison. @type {Map<number, Promise<any>>} */
const comparisons = new Map();
/** The answer to /api/quantities. @type {Promise<{name: string, unit: string}[]>|null} */
let quantities = null;
/** @type {(() => void)[]} */
const cursorListeners = [];

/** What every part of the page works with. */
export const app = {
  /** @type {State|null} */
  state: null,
  view: readView(),
  /** Time under the cursor, s. @type {number|null} */
  cursor: null,
  /** Whether the cursor stays where it is when the pointer moves. */
  held: false,

  current: () => app.state?.models.find((model) => model.id === app.state?.current) ?? null,
  second: () =>
    app.state?.models.find((model) => model.id === app.view.compare && model.id !== app.state?.current) ?? null,
  /** The file of the shown flight. */
  flight: () => app.state?.flights.find((file) => flightsOf(file).includes(app.view.flight)) ?? null,

  /** First and last time of the shown flight as far as its file tells, s. @returns {[number, number]} */
  span() {
    const used = app.used();
    const times = used ? there(used).flat() : [];
    return times.length ? [times[0], times[times.length - 1]] : [0, 1];
  },

  /** What of the shown flight is used. */
  used: () => app.flight()?.used.find((used) => used.flight === app.view.flight) ?? null,

  /** Coefficients, equations and file of a model. @param {number} id */
  details: (id) => kept(details, id, "/api/model"),

  /** What `quadlab compare` says of a model and all flights; it takes long where these are. @param {number} id */
  comparison: (id) => kept(comparisons, id, "/api/comparison"),

  /** What residuals can be drawn against. */
  async quantities() {
    quantities ??= get("/api/quantities");
    try {
      return await quantities;
    } catch (error) {
      quantities = null;
      throw error;
    }
  },

  /** Changes what is looked at. @param {Partial<import("./view.js").View>} change */
  look(change) {
    if (change.tab && change.tab !== app.view.tab) byId("middle").scrollTop = 0;
    // Who chooses the flight beside has both change places.
    const { flight, beside, shift } = app.view;
    const swap = Boolean(beside) && change.flight === beside;
    Object.assign(app.view, change, swap && { beside: flight, shift: -shift });
    writeView(app.view);
    drawState();
  },

  /** Shows the error of what was asked for, if there is one. @param {Promise<any>} work */
  async act(work) {
    try {
      await work;
    } catch (error) {
      if (!(error instanceof ServerError)) console.error(error);
      fail(error instanceof Error ? error.message : String(error));
    }
  },

  /** The same for what is to be drawn: says so where it takes a while. @param {Promise<any>} work */
  async wait(work) {
    waiting += 1;
    window.setTimeout(showWaiting, 400);
    await app.act(work);
    waiting -= 1;
    showWaiting();
  },

  /** Changes the state on the server. @param {string} path @param {object} body */
  choose: (path, body) => app.act(post(path, body).then(takeState)),

  /** Starts a job. @param {{do: string, model?: number, effect?: string}} job */
  run(job) {
    return app.act(
      post("/api/jobs", job).then(() => {
        drawJob(app.state?.job ?? { do: job.do, activity: job.do, done: null, all: null });
      }),
    );
  },

  takeState: (/** @type {State} */ state) => takeState(state),

  /** Draws anew what an effect that is tried has its place in. */
  drawTrial: () => drawTabs(),
  drawLegend: () => drawLegend(app, byId("legend")),

  /** Moves the cursor. @param {number|null} t @param {boolean} [held] whether it stays there */
  point(t, held = false) {
    app.cursor = t;
    app.held = held;
    for (const listener of cursorListeners) listener();
  },

  /** @param {() => void} listener */
  onCursor(listener) {
    cursorListeners.push(listener);
  },
};

/** An answer by model, asked for once. @param {Map<number, Promise<any>>} answers @param {number} id @param {string} path */
async function kept(answers, id, path) {
  if (!answers.has(id)) answers.set(id, get(path, { id }));
  try {
    return await answers.get(id);
  } catch (error) {
    answers.delete(id);
    throw error;
  }
}

/** How many answers are awaited. */
let waiting = 0;

function showWaiting() {
  byId("loading").hidden = waiting === 0;
}

/** @typedef {typeof app} App */
/** @typedef {{update: () => any, picture: () => import("./save.js").Picture|null, resize: () => any, theme: () => any}} Tab */

/** @type {Record<string, Tab>} */
const tabs = {
  time: timeTab(app, byId("panel-time")),
  where: whereTab(app, byId("panel-where")),
  spectrum: spectrumTab(app, byId("panel-spectrum")),
  path: pathTab(app, byId("panel-path")),
  model: modelTab(app, byId("panel-model")),
  own: ownTab(app, byId("panel-own")),
};

const overview = flightOverview(app, byId("overview"));

/** The model that another was made from in the first place. @param {number|null} id @returns {number|null} */
function rootOf(id) {
  const model = app.state?.models.find((one) => one.id === id);
  return model?.parent != null ? rootOf(model.parent) : id;
}

/** Takes a new state. @param {State} state */
function takeState(state) {
  const before = app.state;
  app.state = state;
  if (before && before.readings !== state.readings) {
    comparisons.clear();
    forget();
  }
  const { view } = app;
  const had = (/** @type {number|null} */ id) => before?.models.some((model) => model.id === id);
  if (before && state.current !== before.current) {
    // A model that was just made is compared with the one before it, or with the first of all that were just made.
    const root = rootOf(state.current);
    if (!had(state.current)) view.compare = had(root) || root === state.current ? before.current : root;
    else if (view.compare === state.current) view.compare = before.current;
  }
  if (!app.second()) view.compare = null;
  if (!app.flight() && !(state.reading && view.flight)) {
    view.flight = state.first ?? "";
    view.from = view.to = null;
  }
  const isThere = (/** @type {string} */ name) => state.flights.some((file) => !file.problem && flightsOf(file).includes(name));
  if (view.beside === view.flight || (!state.reading && !isThere(view.beside))) view.beside = "";
  if (!state.reading) writeView(view);
  drawState();
  document.body.dataset.ready = "true";
  // It comes while the first series are computed.
  app.act(plotly());
}

let refreshing = false;
let again = false;

/** Fetches the state; several wishes at once become one. */
async function refresh() {
  if (refreshing) {
    again = true;
    return;
  }
  refreshing = true;
  try {
    do {
      again = false;
      takeState(await get("/api/state"));
    } while (again);
  } finally {
    refreshing = false;
  }
}

function drawState() {
  const { state, view } = app;
  if (!state) return;
  byId("folder").textContent = [state.vehicle?.name, state.folder].filter(Boolean).join(" · ");
  byId("reading").hidden = !state.reading;
  drawFlights(app, byId("flights"));
  drawModels(app, byId("models"));
  drawVehicleButton(app);
  fill(
    byId("flight"),
    state.flights
      .filter((file) => !file.problem)
      .flatMap(flightsOf)
      .map((name) => [name, name]),
    view.flight,
  );
  byId("flight-choice").hidden =
    !app.flight() || (Boolean(app.current()) && !["time", "spectrum", "path", "own"].includes(view.tab));
  const problem = byId("problem");
  problem.hidden = !state.problem;
  if (problem.textContent !== (state.problem ?? "")) problem.textContent = state.problem ?? "";
  drawJob(state.job);
  app.act(drawAdvice(app, byId("advice")));
  app.act(drawChanges(app, byId("changes")));
  app.act(drawDiscovery(app, byId("discovery")));
  drawTabs();
}

/** Whether the chosen tab has something to show: an effect can be written before there is a model. */
const hasTab = () => Boolean(app.current()) || app.view.tab === "own";

/** What fills the middle column. */
const shown = () => (hasTab() ? tabs[app.view.tab] : overview);

function drawTabs() {
  const { view } = app;
  for (const name of TABS) {
    const chosen = name === view.tab;
    const button = byId(`tab-${name}`);
    button.setAttribute("aria-selected", String(chosen));
    button.tabIndex = chosen ? 0 : -1;
    byId(`panel-${name}`).hidden = !chosen || !hasTab();
  }
  byId("overview").hidden = hasTab();
  byId("save").hidden = !app.current() || ["model", "own"].includes(view.tab);
  app.drawLegend();
  app.wait((async () => shown().update())());
}

/** @param {Job|null} job */
function drawJob(job) {
  const state = app.state;
  if (state) state.job = job;
  const busy = job !== null;
  const focused = document.activeElement;
  if (document.body.dataset.busy !== String(busy))
    byId("announced").textContent = job ? `${job.do} is running` : "done";
  document.body.dataset.busy = String(busy);
  const blocked = busy || !state || Boolean(state.problem) || state.reading;
  const model = app.current();
  byId("identify").disabled = blocked;
  byId("explain").disabled = blocked;
  byId("diagnose").disabled = blocked || !model;
  byId("discover").disabled = blocked || !model;
  byId("changed").hidden = !state?.flights.some((flight) => flight.set === "later");
  byId("changed").disabled = blocked || !model;
  byId("cancel").disabled = !busy;
  byId("identify").classList.toggle("primary", !model);
  byId("diagnose").classList.toggle("primary", Boolean(model) && model?.verdict === null);
  for (const button of document.querySelectorAll("button.add, button.keep, button.preview"))
    /** @type {HTMLButtonElement} */ (button).disabled = busy;
  byId("job").hidden = !busy;
  keepFocus(focused, busy);
  if (!job) return;
  const progress = byId("progress");
  if (job.done !== null && job.all) {
    progress.max = job.all;
    progress.value = job.done;
  } else {
    progress.removeAttribute("value");
  }
  const share = job.done !== null && job.all ? ` (${job.done} of ${job.all})` : "";
  byId("activity").textContent = `${job.do}: ${job.activity}${share}`;
}

/** The focus does not stay on a button that can no longer be pressed. @param {Element|null} focused @param {boolean} busy */
function keepFocus(focused, busy) {
  if (!(focused instanceof HTMLButtonElement) || !focused.disabled || !byId("right").contains(focused)) return;
  byId(busy ? "cancel" : "advice").focus();
}

/** A sentence that can be put away. @param {string} id @param {string[]} sentences */
function say(id, sentences) {
  const box = byId(id);
  const away = () => {
    box.hidden = true;
    box.replaceChildren();
  };
  box.replaceChildren(
    el(
      "div",
      {},
      sentences.map((text) =>
        el(
          "p",
          {},
          prose(text).replace(/^[a-z](?=[a-z]* )/, (letter) => letter.toUpperCase()),
        ),
      ),
    ),
    el("button", { type: "button", class: "dismiss", "aria-label": "Dismiss this message", click: away }, "Dismiss"),
  );
  box.hidden = false;
}

/** @param {string} sentence */
const fail = (sentence) => say("error", [sentence]);

/** @type {string[]} */
let warnings = [];

/** @param {string} sentence */
function warn(sentence) {
  if (byId("warning").hidden) warnings = [];
  warnings = [...warnings.filter((text) => text !== sentence), sentence].slice(-4);
  say("warning", warnings);
}

const LOST =
  "The connection to quadlab is lost. The page goes on by itself when quadlab answers again. If quadlab has ended, start it again and open the address that it prints.";

/** What is shown as running; looking for evidence and reading are not. */
const JOBS = ["identify", "diagnose", "add", "explain", "changed", "discover"];

function listen() {
  const events = new EventSource("/api/events");
  const data = (/** @type {any} */ event) => JSON.parse(event.data || "{}");
  let lost = 0;
  events.addEventListener("progress", (event) => {
    const told = data(event);
    if (JOBS.includes(told.do)) drawJob(told);
    else if (told.do === "reading") byId("reading").textContent = `Reading flights: ${told.activity}`;
  });
  events.addEventListener("warning", (event) => warn(data(event).sentence));
  events.addEventListener("state", () => app.act(refresh()));
  events.addEventListener("finished", (event) => {
    const { error } = data(event);
    drawJob(null);
    forget();
    forgetChanges();
    forgetDiscovery();
    details.clear();
    comparisons.clear();
    if (error === "cancelled") byId("announced").textContent = "cancelled";
    else if (error) fail(error);
    app.act(refresh());
  });
  events.addEventListener("open", () => {
    clearTimeout(lost);
    if (byId("error").textContent.startsWith(LOST)) byId("error").hidden = true;
    app.act(refresh());
  });
  events.addEventListener("error", () => {
    clearTimeout(lost);
    lost = window.setTimeout(() => fail(LOST), 1500);
    // A browser gives up after some errors for good; then the page begins anew.
    if (events.readyState === EventSource.CLOSED) window.setTimeout(listen, 3000);
  });
}

function wireTabs() {
  const list = byId("tabs");
  list.addEventListener("click", (/** @type {any} */ event) => {
    const tab = event.target.closest("[role=tab]")?.dataset.tab;
    if (tab) app.look({ tab });
  });
  list.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const at = TABS.indexOf(app.view.tab);
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: TABS.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    const tab = TABS[(to + TABS.length) % TABS.length];
    app.look({ tab });
    byId(`tab-${tab}`).focus();
  });
}

function wireButtons() {
  byId("save").append(...saveButtons(app, () => tabs[app.view.tab].picture(), "save"));
  byId("identify").addEventListener("click", () => app.run({ do: "identify" }));
  byId("diagnose").addEventListener("click", () => app.run({ do: "diagnose", model: app.current()?.id }));
  byId("discover").addEventListener("click", () => app.run({ do: "discover", model: app.current()?.id }));
  byId("changed").addEventListener("click", () => app.run({ do: "changed", model: app.current()?.id }));
  byId("explain").addEventListener("click", () => app.run({ do: "explain" }));
  byId("cancel").addEventListener("click", () => app.act(post("/api/cancel", {})));
  byId("flight").addEventListener("change", (/** @type {any} */ event) =>
    app.look({ flight: event.target.value, from: null, to: null }),
  );
  window.addEventListener("hashchange", () => {
    app.view = readView();
    if (app.state) takeState(app.state);
  });
}

function wireSize() {
  let timer = 0;
  const later = (/** @type {() => any} */ work) => {
    clearTimeout(timer);
    timer = window.setTimeout(() => app.state && app.act((async () => work())()), 100);
  };
  let width = 0;
  let height = 0;
  new ResizeObserver(() => {
    const middle = byId("middle");
    if (middle.clientWidth === width && middle.clientHeight === height) return;
    [width, height] = [middle.clientWidth, middle.clientHeight];
    later(() => shown().resize());
  }).observe(byId("middle"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => later(() => shown().theme()));
}

const HINTS = [
  "On the left, choose which flights the model is fitted to and which are held out to test it; then press Identify.",
  "Press Diagnose: it tries every known effect and says which one the model lacks.",
  "Press Add on a card, and see the error fall beside the model before it. Going back is one click.",
];

function drawHints() {
  const box = byId("hints");
  try {
    if (localStorage.getItem("quadlab-hints") === "seen") return;
  } catch {
    return;
  }
  const away = () => {
    localStorage.setItem("quadlab-hints", "seen");
    box.hidden = true;
  };
  box.replaceChildren(
    el(
      "ol",
      {},
      HINTS.map((text) => el("li", {}, text)),
    ),
    el("button", { type: "button", class: "dismiss", id: "hints-away", click: away }, "Got it"),
  );
  box.hidden = false;
}

wireTabs();
wireButtons();
wireVehicle(app);
wireUpload(app);
wirePreview(app, byId("advice"));
wireSize();
drawHints();
app.act(refresh());
listen();
