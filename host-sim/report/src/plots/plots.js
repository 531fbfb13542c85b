// The plots of a page: values under the pointer or the keyboard's cursor, and a part of the horizontal axis looked at closely.

/** The smallest part of an axis that is shown. */
const LEAST = 1 / 1000;

/** Short line of the look of a line. @param {Line} line */
const swatch = ({ kind, colour, stroke, dash }) =>
  html(
    "span",
    {},
    svg(
      "svg",
      { width: 24, height: 8, viewBox: "0 0 240 80", "aria-hidden": "true" },
      kind === "points"
        ? svg("circle", { cx: 120, cy: 40, r: 30, fill: colour })
        : svg("line", { x1: 0, x2: 240, y1: 40, y2: 40, stroke: colour, "stroke-width": stroke + 6, "stroke-dasharray": dash }),
    ),
  );

/** Plots by their horizontal axis. @type {Map<string, Link>} */
const links = new Map();

/** Plots with the same horizontal axis move together. @param {Axis} x @param {boolean} zooms */
function linkOf(x, zooms) {
  const key = JSON.stringify([x.name, x.unit, x.log, x.low, x.high, zooms || links.size]);
  const link = links.get(key) ?? { range: /** @type {[number, number]} */ ([x.low, x.high]), at: null, plots: [] };
  links.set(key, link);
  return link;
}

/** Gives a figure its life. @param {HTMLElement} figure */
function enliven(figure) {
  const text = figure.querySelector("script[type='application/json']")?.textContent;
  const card = /** @type {HTMLElement|null} */ (figure.querySelector(".card"));
  const drawing = /** @type {SVGSVGElement|null} */ (card?.querySelector("svg") ?? null);
  if (!text || !card || !drawing) return;
  const data = read(text);
  if (data.panels.some((panel) => panel.lines.some((line) => line.xs.length))) wire(figure, card, drawing, data);
}

/** @param {HTMLElement} figure @param {HTMLElement} card @param {SVGSVGElement} drawing @param {Data} data */
function wire(figure, card, drawing, data) {
  const link = linkOf(data.x, data.zooms);
  /** The panel whose values are shown. */
  let shown = data.panels[0];
  /** Height of the pointer, px; nothing for the keyboard. @type {number|null} */
  let height = null;
  let isHere = false;
  /** Where a drag began, px. @type {number|null} */
  let began = null;

  const over = svg("g", { "pointer-events": "none" });
  const cross = svg("g", { "pointer-events": "none", stroke: "#222", "stroke-width": 7, class: "closer" });
  const chosen = svg("rect", { fill: "#0072b2", "fill-opacity": 0.15, visibility: "hidden", class: "closer" });
  drawing.append(over, cross, chosen);
  const reading = html("div", { class: "reading", hidden: "hidden" });
  const spoken = html("p", { class: "spoken", role: "status" });
  const note = html("span", { class: "thinned" });
  const hint = document.querySelector(".plot-tools") ? "" : "Drag over a plot to zoom; double click shows all.";
  figure.append(reading, spoken);

  const isWhole = () => link.range[0] === data.x.low && link.range[1] === data.x.high;

  /** Shows a part of the axis in all plots that have it. @param {number} low @param {number} high */
  function show(low, high) {
    const whole = data.x.high - data.x.low;
    const span = Math.min(whole, Math.max(LEAST * whole, high - low));
    const from = Math.min(Math.max(data.x.low, low), data.x.high - span);
    // To the last bit, so that the whole is known as such.
    link.range = span >= 0.999 * whole ? [data.x.low, data.x.high] : [from, from + span];
    for (const plot of link.plots) plot.draw();
  }

  const all = () => show(data.x.low, data.x.high);

  /** @param {number} factor */
  function zoom(factor) {
    const [low, high] = link.range;
    const about = link.at !== null && link.at >= low && link.at <= high ? link.at : (low + high) / 2;
    show(about - (about - low) * factor, about + (high - about) * factor);
  }

  /** @param {number} share of what is shown */
  function move(share) {
    const [low, high] = link.range;
    show(low + share * (high - low), high + share * (high - low));
  }

  const tool = (/** @type {string} */ sign, /** @type {string} */ label, /** @type {() => void} */ click) =>
    html("button", { type: "button", "aria-label": label, title: label, click }, sign);
  const back = tool("All", "Show all (Escape, or double click)", all);
  const tools = html(
    "div",
    { class: "plot-tools", role: "group", "aria-label": "Range of the plot" },
    tool("+", "Zoom in (plus key, or drag over the plot)", () => zoom(0.5)),
    tool("−", "Zoom out (minus key)", () => zoom(2)),
    tool("◀", "Back along the axis (shift and left arrow)", () => move(-0.5)),
    tool("▶", "On along the axis (shift and right arrow)", () => move(0.5)),
    back,
    note,
  );
  if (data.zooms) card.after(tools);

  function draw() {
    over.replaceChildren(...(isWhole() ? [] : [closer(data, link.range)]));
    back.disabled = isWhole();
    note.textContent = isWhole() ? hint : thinnedNote();
    point();
  }

  /** Says so where lines have fewer samples here than there were. */
  function thinnedNote() {
    const thin = data.panels.flatMap((panel) => panel.lines).filter((line) => line.xs.length < line.of && line.kind !== "points");
    const [one] = thin.sort((a, b) => b.of / b.xs.length - a.of / a.xs.length);
    return one ? `Thinned: the page has ${one.xs.length} of ${one.of} samples, with all peaks.` : "";
  }

  /** Draws the crosshair and the values at it. */
  function point() {
    const [low, high] = link.range;
    const inside = link.at !== null && link.at >= low && link.at <= high;
    reading.hidden = !isHere || !inside;
    cross.replaceChildren();
    if (!inside || link.at === null) return;
    const { at, rows } = readingOf(data, shown, link, link.at, height);
    const x = mapping(data, shown, link.range).x(Math.min(high, Math.max(low, at)));
    for (const { top, bottom } of data.panels) cross.append(svg("line", { x1: units(x), x2: units(x), y1: units(top), y2: units(bottom) }));
    if (!isHere) return;
    if (height !== null) cross.append(svg("line", { x1: units(data.left), x2: units(data.right), y1: units(height), y2: units(height), "stroke-dasharray": "20 20" }));
    write(at, rows, x);
  }

  /** @param {number} at @param {{line: Line, value: string}[]} rows @param {number} x px */
  function write(at, rows, x) {
    const named = (/** @type {Line} */ line) => line.name || shown.y.name;
    const limits = shown.marks.filter((mark) => mark.name && mark.along === "y" && !mark.band);
    reading.replaceChildren(
      html("div", {}, html("span", {}, data.x.name), html("b", {}, withUnit(data.x, at, 6))),
      ...rows.map(({ line, value }) => html("div", {}, swatch(line), html("span", {}, named(line)), html("b", {}, value))),
      ...limits.map((mark) => html("div", {}, html("span", {}, mark.name), html("b", {}, withUnit(shown.y, mark.from, 5)))),
    );
    if (height === null)
      spoken.textContent = `${data.x.name} ${withUnit(data.x, at, 6)}: ${rows.map(({ line, value }) => `${named(line)} ${value}`).join(", ")}`;
    // Beside the crosshair, on the side where there is room; the card may be scrolled.
    const scale = drawing.getBoundingClientRect().width / data.width;
    const [origin, own] = [drawing.getBoundingClientRect(), figure.getBoundingClientRect()];
    const place = origin.left - own.left + x * scale;
    const toLeft = x > (data.left + data.right) / 2;
    reading.style.left = `${Math.max(0, toLeft ? place - reading.offsetWidth - 10 : place + 10)}px`;
    reading.style.top = `${origin.top - own.top + shown.top * scale + 4}px`;
  }

  /** Place of the pointer in the drawing, px. @param {MouseEvent} event */
  function placeOf(event) {
    const { left, top, width } = drawing.getBoundingClientRect();
    const scale = data.width / width;
    return { x: (event.clientX - left) * scale, y: (event.clientY - top) * scale };
  }

  /** @param {number} x px */
  const valueOf = (x) => {
    const [low, high] = link.range;
    return low + ((Math.min(data.right, Math.max(data.left, x)) - data.left) / (data.right - data.left)) * (high - low);
  };

  /** @param {PointerEvent} event */
  function onMove(event) {
    const { x, y } = placeOf(event);
    if (began !== null) {
      const [from, to] = [Math.min(began, x), Math.max(began, x)].map((px) => Math.min(data.right, Math.max(data.left, px)));
      const [top, bottom] = [data.panels[0].top, data.panels[data.panels.length - 1].bottom];
      const size = { x: units(from), width: units(to - from), y: units(top), height: units(bottom - top), visibility: "visible" };
      for (const [name, value] of Object.entries(size)) chosen.setAttribute(name, value);
    }
    const panel = data.panels.find(({ top, bottom }) => y >= top && y <= bottom);
    isHere = Boolean(panel) && x >= data.left - 2 && x <= data.right + 2;
    if (panel && isHere) [shown, height, link.at] = [panel, y, valueOf(x)];
    else if (began === null) link.at = null;
    for (const plot of link.plots) plot.point();
  }

  /** @param {PointerEvent} event */
  function onPress(event) {
    const { x } = placeOf(event);
    // A finger scrolls the page.
    if (!data.zooms || event.button !== 0 || event.pointerType === "touch" || x < data.left - 2 || x > data.right + 2) return;
    drawing.setPointerCapture(event.pointerId);
    began = x;
  }

  /** @param {PointerEvent} event */
  function onRelease(event) {
    if (began === null) return;
    const { x } = placeOf(event);
    const [from, to] = [valueOf(Math.min(began, x)), valueOf(Math.max(began, x))];
    const far = Math.abs(x - began) > 5;
    endDrag();
    if (far) show(from, to);
    onMove(event);
  }

  function endDrag() {
    began = null;
    chosen.setAttribute("visibility", "hidden");
  }

  function onLeave() {
    if (began !== null) return;
    [isHere, link.at] = [false, null];
    for (const plot of link.plots) plot.point();
  }

  /** @param {number} by samples */
  function step(by) {
    const [low, high] = link.range;
    const densest = shown.lines.filter((line) => line.rises).sort((a, b) => b.xs.length - a.xs.length)[0];
    if (!densest) return;
    const inside = link.at !== null && link.at >= low && link.at <= high;
    const from = nearest(densest.xs, inside && link.at !== null ? link.at : (low + high) / 2);
    const count = firstFrom(densest.xs, high) - firstFrom(densest.xs, low);
    const to = Math.min(densest.xs.length - 1, Math.max(0, from + by * Math.max(1, Math.round(count / 300))));
    [link.at, height, isHere] = [densest.xs[to], null, true];
    for (const plot of link.plots) plot.point();
  }

  /** @param {number} by panels */
  function change(by) {
    const at = data.panels.indexOf(shown) + by;
    shown = data.panels[Math.min(data.panels.length - 1, Math.max(0, at))];
    step(0);
  }

  /** @param {KeyboardEvent} event */
  function onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { key } = event;
    const arrow = key === "ArrowLeft" ? -1 : key === "ArrowRight" ? 1 : 0;
    if (arrow && event.shiftKey && data.zooms) move(0.25 * arrow);
    else if (arrow) step(arrow);
    else if (data.panels.length > 1 && (key === "ArrowUp" || key === "ArrowDown")) change(key === "ArrowUp" ? -1 : 1);
    else if (data.zooms && (key === "+" || key === "=")) zoom(0.5);
    else if (data.zooms && key === "-") zoom(2);
    else if (key === "Escape" && began !== null) endDrag();
    else if (key === "Escape" || key === "Home") all();
    else return;
    event.preventDefault();
  }

  const keys = data.zooms ? ", with shift they move the range; plus and minus zoom; Escape shows all" : "";
  card.classList.add("live");
  card.setAttribute("role", "group");
  card.setAttribute("aria-label", `${drawing.getAttribute("aria-label") ?? "plot"}. The left and right arrows move the cursor${keys}.`);
  card.addEventListener("keydown", onKey);
  card.addEventListener("blur", onLeave);
  drawing.addEventListener("pointermove", onMove);
  drawing.addEventListener("pointerdown", onPress);
  drawing.addEventListener("pointerup", onRelease);
  drawing.addEventListener("pointercancel", endDrag);
  drawing.addEventListener("pointerleave", onLeave);
  if (data.zooms) drawing.addEventListener("dblclick", all);
  link.plots.push({ draw, point });
  draw();
}

for (const figure of document.querySelectorAll("figure")) enliven(figure);
