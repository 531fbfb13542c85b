// The path in space, coloured by the residual of an axis, or the residual's mean over the room. The cursor is that of the
// time plots.

import { get, newest } from "./api.js";
import { axisChoice } from "./controls.js";
import { choice, el, redraw } from "./dom.js";
import { hasPosition } from "./flights.js";
import { known, nearest, seconds, short, unit, withUnit } from "./numbers.js";
import { CONFIG, axis, colour, cursorMark, layout, plotly, room } from "./plots.js";
import { largestMean, roomFigure, roomSaid } from "./room.js";

/** @typedef {import("./main.js").App} App */
/** @typedef {{t: number[], north_m: number[], east_m: number[], up_m: number[], residual: (number|null)[], unit: string}} Path */

/** @param {App} app @param {HTMLElement} root */
export function pathTab(app, root) {
  const controls = el("div", { class: "controls" });
  const slider = el("input", {
    type: "range",
    id: "cursor-time",
    step: "any",
    "aria-label": "Time of the cursor",
    input: () => app.point(Number(slider.value)),
    keydown: (/** @type {KeyboardEvent} */ event) => onKey(event),
  });
  const values = el("output", { id: "path-values", for: "cursor-time" });
  const summary = el("p", { class: "quiet", id: "room-summary" });
  const plot = el("div", { id: "path-plot", class: "plot", "aria-hidden": "true" });
  const time = el("div", { class: "controls" }, el("label", { class: "wide" }, "Time ", slider));
  const frame = el("div", { role: "img" }, plot);
  root.append(controls, time, values, summary, frame);
  app.onCursor(drawCursor);
  /** @type {ReturnType<typeof newest<{path: Path|null, map: import("./room.js").Room|null}>>} */
  const ask = newest();
  /** @type {Path|null} */
  let path = null;
  /** @type {import("./room.js").Room|null} */
  let map = null;
  let cursorDrawn = 0;
  let smooth = "0.2";

  /** How the flight is drawn: `path` in space, `flat` from above and from the side, `map` or `map-all` in cells. */
  function kind() {
    const wanted = app.view.space;
    return wanted === "path" && !hasWebGl() ? "flat" : wanted;
  }

  const isMap = () => kind().startsWith("map");

  async function update() {
    const [model, flight] = [app.current(), app.flight()];
    if (!model || !flight) return;
    const placed = hasPosition(flight);
    redraw(controls, controlsOf());
    time.hidden = !placed;
    summary.hidden = !isMap();
    plot.hidden = !placed && kind() !== "map-all";
    frame.setAttribute(
      "aria-label",
      isMap() ? "Mean residual over the room" : "Path of the flight, coloured by the residual",
    );
    if (!placed) {
      path = null;
      summary.textContent = "";
      values.textContent = `No position was logged in ${app.view.flight}, so there is no path to draw.`;
    }
    if (plot.hidden) return;
    const query = { model: model.id, flight: app.view.flight, axis: app.view.axis };
    const given = await ask([query, kind(), placed, app.state?.readings], async (signal) => {
      const [of, cells] = await Promise.all([
        placed ? get("/api/path", query, signal) : null,
        isMap() ? get("/api/room", kind() === "map-all" ? { ...query, flight: null } : query, signal) : null,
      ]);
      return { path: of, map: cells };
    });
    if (!given) return;
    ({ path, map } = given);
    await draw();
  }

  function controlsOf() {
    return [
      axisChoice(app, "Colour: residual of", "path-axis"),
      choice(
        "as",
        "path-kind",
        [
          ...(hasWebGl() ? [/** @type {[string, string]} */ (["path", "path in space"])] : []),
          ["flat", "path from above and side"],
          ["map", "map of means, this flight"],
          ["map-all", "map of means, all flights"],
        ],
        kind(),
        (value) => app.look({ space: value }),
      ),
      !isMap() &&
        choice(
          "mean over",
          "path-mean",
          [
            ["0", "one sample"],
            ["0.2", "0.2 s"],
            ["1", "1 s"],
          ],
          smooth,
          (value) => setSmooth(value),
        ),
      el(
        "span",
        { class: "scale", "aria-hidden": "true" },
        el("span", { id: "scale-low" }),
        el("i", {}),
        el("span", { id: "scale-high" }),
      ),
    ];
  }

  /** @param {string} value s */
  function setSmooth(value) {
    smooth = value;
    app.act(draw());
  }

  /** What is drawn, and what its darkest colours stand for. */
  function drawing() {
    if (isMap()) {
      if (!map) return null;
      const limit = largestMean(map);
      summary.textContent = roomSaid(map, app.view.axis);
      return { limit, unit: map.unit, ...roomFigure(map, limit) };
    }
    if (!path) return null;
    const drawn = { ...path, residual: running(path, Number(smooth)) };
    const limit = largest(drawn.residual);
    return { limit, unit: path.unit, ...(kind() === "flat" ? flatFigure(drawn, limit) : figure(drawn, limit)) };
  }

  async function draw() {
    const Plotly = await plotly();
    const drawn = root.hidden || !root.clientWidth ? null : drawing();
    if (!drawn) return;
    for (const [id, text] of [
      ["scale-low", `−${short(drawn.limit, 2)}`],
      ["scale-high", `+${short(drawn.limit, 2)} ${unit(drawn.unit)}`],
    ]) {
      const label = root.querySelector(`#${id}`);
      if (label) label.textContent = text;
    }
    if (path) {
      slider.min = String(path.t[0] ?? 0);
      slider.max = String(path.t[path.t.length - 1] ?? 0);
    }
    const { traces, shape } = drawn;
    await Plotly.react(
      plot,
      traces,
      {
        ...layout(),
        ...shape,
        uirevision: `${app.view.flight} ${kind()}`,
        width: root.clientWidth,
        height: Math.max(360, room(plot)),
      },
      CONFIG,
    );
    plot.removeAllListeners?.("plotly_hover");
    plot.on("plotly_hover", (/** @type {any} */ event) => {
      const point = event.points[0];
      if (path && point && point.data.name === "path") app.point(path.t[point.pointNumber] ?? null);
    });
    drawCursor();
  }

  /** @param {KeyboardEvent} event */
  function onKey(event) {
    const by =
      event.key === "ArrowRight" || event.key === "ArrowUp"
        ? 1
        : event.key === "ArrowLeft" || event.key === "ArrowDown"
          ? -1
          : 0;
    if (!by || !path) return;
    event.preventDefault();
    const at = nearest(path.t, Number(slider.value)) + by;
    app.point(path.t[Math.max(0, Math.min(path.t.length - 1, at))]);
  }

  function drawCursor() {
    if (root.hidden || plot.hidden || !path || !plot.data) return;
    const at = nearest(path.t, app.cursor ?? path.t[0]);
    slider.value = String(path.t[at]);
    slider.setAttribute("aria-valuetext", seconds(path.t[at]));
    values.textContent =
      `${seconds(path.t[at])}: north ${short(path.north_m[at])} m, east ${short(path.east_m[at])} m, up ${short(path.up_m[at])} m, ` +
      `residual of ${app.view.axis} ${short(path.residual[at])} ${unit(path.unit)}`;
    cancelAnimationFrame(cursorDrawn);
    cursorDrawn = requestAnimationFrame(() => moveMark(at));
  }

  /** @param {number} at */
  async function moveMark(at) {
    if (!path) return;
    const Plotly = await plotly();
    const [n, e, u] = [[path.north_m[at]], [path.east_m[at]], [path.up_m[at]]];
    const marks = plot.data.flatMap((/** @type {any} */ trace, /** @type {number} */ i) =>
      trace.name === "cursor" ? [i] : [],
    );
    const places = isMap()
      ? { x: [e, e, n], y: [n, u, u] }
      : kind() === "flat"
        ? { x: [e, n], y: [n, u] }
        : { x: [e], y: [n], z: [u] };
    await Plotly.restyle(plot, places, marks);
  }

  /** With the scale of its colours, which the page has beside the plot. */
  function picture() {
    if (plot.hidden || !plot.data) return null;
    const scale = { showscale: true, colorbar: { title: { text: `residual of ${app.view.axis} [${unit((map ?? path)?.unit)}]`, side: "right" } } };
    const [first, ...rest] = plot.data;
    const scaled = first.line ? { line: { ...first.line, ...scale } } : first.marker ? { marker: { ...first.marker, ...scale } } : scale;
    return {
      plot,
      of: kind() === "map-all" ? "all flights" : app.view.flight,
      data: [{ ...first, ...scaled }, ...rest],
    };
  }

  return { update, picture, resize: draw, theme: draw };
}

/** Asked of the browser once. @type {boolean|null} */
let webGl = null;

function hasWebGl() {
  try {
    webGl ??= Boolean(document.createElement("canvas").getContext("webgl"));
  } catch {
    webGl = false;
  }
  return webGl;
}

/** Mean over so long around each sample. @param {Path} path @param {number} window s */
function running(path, window) {
  let [first, last, sum, count] = [0, 0, 0, 0];
  const add = (/** @type {number|null} */ r, /** @type {number} */ sign) => {
    if (!known(r)) return;
    sum += sign * r;
    count += sign;
  };
  return path.t.map((t, n) => {
    if (window <= 0 || !known(path.residual[n])) return path.residual[n];
    while (last < path.t.length && path.t[last] <= t + window / 2) add(path.residual[last++], 1);
    while (path.t[first] < t - window / 2) add(path.residual[first++], -1);
    return sum / count;
  });
}

/** The residual that 98 in 100 are below. @param {(number|null)[]} residual */
function largest(residual) {
  const sorted = residual
    .filter(known)
    .map(Math.abs)
    .sort((a, b) => a - b);
  return sorted[Math.floor(0.98 * (sorted.length - 1))] || 1;
}

/** Blue for what is predicted too large, vermillion for too small. @param {Path} path @param {number} limit */
function paint(path, limit) {
  return {
    color: path.residual.map((r) => (known(r) ? r : 0)),
    cmin: -limit,
    cmax: limit,
    colorscale: [
      [0, colour("predicted")],
      [0.5, colour("middle")],
      [1, colour("residual")],
    ],
  };
}

/** @param {Path} path @param {number} limit */
function figure(path, limit) {
  const text = path.t.map((t, n) => `${seconds(t)}, residual ${short(path.residual[n])} ${unit(path.unit)}`);
  const place = { x: path.east_m, y: path.north_m, z: path.up_m };
  const side = (/** @type {string} */ name) => ({
    title: { text: withUnit(name, "m") },
    gridcolor: colour("grid"),
    zerolinecolor: colour("control"),
    color: colour("text"),
    showspikes: false,
  });
  return {
    traces: [
      {
        type: "scatter3d",
        name: "path",
        mode: "lines",
        ...place,
        line: { width: 8, ...paint(path, limit) },
        text,
        hovertemplate: "%{text}<extra></extra>",
      },
      {
        type: "scatter3d",
        name: "cursor",
        mode: "markers",
        x: [null],
        y: [null],
        z: [null],
        marker: { size: 7, color: colour("text"), symbol: "diamond" },
        hoverinfo: "skip",
      },
    ],
    shape: {
      margin: { l: 0, r: 0, t: 0, b: 0 },
      scene: {
        aspectmode: "data",
        camera: { eye: { x: 1.5, y: 1.5, z: 1 } },
        xaxis: side("east"),
        yaxis: side("north"),
        zaxis: side("up"),
      },
    },
  };
}

/** Two views, for browsers without WebGL and for who prefers them. @param {Path} path @param {number} limit */
function flatFigure(path, limit) {
  const text = path.t.map((t, n) => `${seconds(t)}, residual ${short(path.residual[n])} ${unit(path.unit)}`);
  const dots = (/** @type {number[]} */ x, /** @type {number[]} */ y, /** @type {string} */ id) => [
    {
      type: "scatter",
      name: "path",
      mode: "markers",
      x,
      y,
      xaxis: `x${id}`,
      yaxis: `y${id}`,
      marker: { size: 4, ...paint(path, limit) },
      text,
      hovertemplate: "%{text}<extra></extra>",
    },
    cursorMark(id),
  ];
  const title = (/** @type {string} */ name) => ({ title: { text: withUnit(name, "m") } });
  return {
    traces: [...dots(path.east_m, path.north_m, ""), ...dots(path.north_m, path.up_m, "2")],
    shape: {
      hovermode: "closest",
      xaxis: axis({ domain: [0, 0.47], ...title("east") }),
      yaxis: axis({ scaleanchor: "x", ...title("north") }),
      xaxis2: axis({ domain: [0.55, 1], anchor: "y2", ...title("north") }),
      yaxis2: axis({ anchor: "x2", scaleanchor: "x2", ...title("up") }),
    },
  };
}
