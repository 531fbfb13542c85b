// A part of a plot, drawn over the whole: the drawing itself stays, for print and for readers without scripts.

const SVG = "http://www.w3.org/2000/svg";
/** Units of the drawing in a pixel. */
const UNITS = 10;

/** @param {string} tag @param {Record<string, any>} attributes @param {...(Node|string)} children @returns {any} */
function html(tag, attributes, ...children) {
  return filled(document.createElement(tag), attributes, children);
}

/** @param {string} tag @param {Record<string, any>} attributes @param {...(Node|string)} children @returns {any} */
function svg(tag, attributes, ...children) {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

/** @param {Element} element @param {Record<string, any>} attributes @param {(Node|string)[]} children */
function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value !== "") element.setAttribute(name, String(value));
  }
  element.append(...children);
  return element;
}

/** @param {number} px */
const units = (px) => (UNITS * px).toFixed(1);

let clips = 0;

/** A part of a figure, drawn over the whole. @param {Data} data @param {[number, number]} range */
function closer(data, range) {
  const [first, last] = [data.panels[0], data.panels[data.panels.length - 1]];
  const { left, right } = data;
  const marked = ticks(data.x, range, Math.max(2, Math.min(10, Math.floor((right - left) / 90))));
  const box = (/** @type {number} */ x, /** @type {number} */ y, /** @type {number} */ to, /** @type {number} */ down, /** @type {Record<string, any>} */ more) =>
    svg("rect", { x: units(x), y: units(y), width: units(to - x), height: units(down - y), ...more });
  // The numbers of the axis are written anew; those of the vertical one reach a little below it.
  const content = [
    box(left - 1, last.bottom, right + 24, last.bottom + 24, { fill: "#fff" }),
    box(left - 45, last.bottom + 6.5, left, last.bottom + 24, { fill: "#fff" }),
    ...data.panels.flatMap((panel) => closerPanel(data, panel, range, marked)),
  ];
  for (const [value, label] of marked) {
    const x = units(mapping(data, first, range).x(value));
    content.push(
      svg("line", { x1: x, x2: x, y1: units(last.bottom), y2: units(last.bottom + 4), stroke: "#222", "stroke-width": UNITS }),
      svg("text", { x, y: units(last.bottom + 18), "text-anchor": "middle", "font-family": "sans-serif", "font-size": 130, fill: "#222", class: "tick" }, label),
    );
  }
  return svg("g", { class: "closer" }, ...content);
}

/** @param {Data} data @param {Panel} panel @param {[number, number]} range @param {[number, string][]} marked */
function closerPanel(data, panel, range, marked) {
  const { left, right } = data;
  const { top, bottom } = panel;
  const at = mapping(data, panel, range);
  const id = `part-${(clips += 1)}`;
  const area = { x: units(left), y: units(top), width: units(right - left), height: units(bottom - top) };
  const line = (/** @type {number[]} */ [x1, y1, x2, y2], /** @type {Record<string, any>} */ more) =>
    svg("line", { x1: units(x1), y1: units(y1), x2: units(x2), y2: units(y2), ...more });
  const grid = { stroke: "#ddd", "stroke-width": UNITS };
  const count = Math.max(2, Math.min(8, Math.floor((bottom - top) / 42)));
  const drawn = svg("g", { "clip-path": `url(#${id})` });
  for (const [x] of marked) drawn.append(line([at.x(x), top, at.x(x), bottom], grid));
  for (const [y] of ticks(panel.y, [panel.y.low, panel.y.high], count)) drawn.append(line([left, at.y(y), right, at.y(y)], grid));
  for (const mark of panel.marks) drawn.append(markOf(data, panel, mark, at));
  for (const one of panel.lines) drawn.append(...shapesOf(one, at, range));
  return [
    svg("clipPath", { id }, svg("rect", area)),
    // Ends of lines reach a little over the edge.
    svg("rect", { ...area, width: units(right - left + 2), fill: "#fff" }),
    drawn,
    line([left, top, left, bottom], { stroke: "#222", "stroke-width": UNITS }),
    line([left, bottom, right, bottom], { stroke: "#222", "stroke-width": UNITS }),
  ];
}

/** @param {Data} data @param {Panel} panel @param {Mark} mark @param {ReturnType<typeof mapping>} at */
function markOf(data, panel, { along, band, from, to, colour, stroke, dash }, at) {
  const ends = along === "x" ? [at.x(from), at.x(to)] : [at.y(from), at.y(to)];
  const [low, high] = [Math.min(...ends), Math.max(...ends)];
  const [x1, x2] = along === "x" ? [low, high] : [data.left, data.right];
  const [y1, y2] = along === "x" ? [panel.top, panel.bottom] : [low, high];
  return band
    ? svg("rect", { x: units(x1), y: units(y1), width: units(x2 - x1), height: units(y2 - y1), fill: colour, "fill-opacity": 0.2 })
    : svg("line", { x1: units(x1), x2: units(x2), y1: units(y1), y2: units(y2), stroke: colour, "stroke-width": stroke, "stroke-dasharray": dash });
}

/** What is drawn of a line. @param {Line} line @param {ReturnType<typeof mapping>} at @param {[number, number]} range */
function shapesOf(line, at, range) {
  const { xs, ys, kind, colour, stroke, dash } = line;
  const [from, to] = line.rises ? [Math.max(0, firstFrom(xs, range[0]) - 1), Math.min(xs.length, firstFrom(xs, range[1]) + 1)] : [0, xs.length];
  const dots = [];
  let path = "";
  let before = NaN;
  for (let n = from; n < to; n++) {
    const known = Number.isFinite(ys[n]);
    const [x, y] = [units(at.x(xs[n])), units(at.y(ys[n]))];
    const lonely = known && !Number.isFinite(before) && !Number.isFinite(ys[n + 1] ?? NaN);
    if (known && (kind === "points" || lonely)) dots.push(marker(line, Number(x), Number(y)));
    else if (known) path += Number.isFinite(before) ? `${kind === "step" ? `H${x}V${y}` : `L${x} ${y}`}` : `M${x} ${y}`;
    before = kind === "points" ? NaN : ys[n];
  }
  const drawn = svg("path", { d: path || "M0 0", fill: "none", stroke: colour, "stroke-width": stroke, "stroke-dasharray": dash });
  return path ? [drawn, ...dots] : dots;
}

/** A sample as the drawing marks it: series of points differ by their shapes too. @param {Line} line @param {number} x @param {number} y */
function marker({ kind, xs, colour, marker }, x, y) {
  const radius = kind === "points" && xs.length <= 300 ? 30 : 15;
  if (marker === "triangle") {
    const [side, foot] = [1.3 * radius, 0.75 * radius];
    return svg("path", { d: `M${x} ${y - 1.5 * radius}L${x - side} ${y + foot}H${x + side}Z`, fill: colour });
  }
  if (marker === "cross") {
    const [low, high] = [x - radius, x + radius];
    return svg("path", { d: `M${low} ${y - radius}L${high} ${y + radius}M${low} ${y + radius}L${high} ${y - radius}`, stroke: colour, "stroke-width": 13 });
  }
  return svg("circle", { cx: x, cy: y, r: radius, fill: colour });
}
