// What a page knows of its plots: axes, numbers behind lines, where they lie, and how they are written.
//
// The scripts of this folder stand one after the other in one script of the page. Places are CSS pixels of the drawing. Along a
// logarithmic axis all numbers are logarithms, of data and of ranges.

/** @typedef {{name: string, unit: string, log: boolean, low: number, high: number, power: number}} Axis */
/** @typedef {{name: string, kind: "line"|"step"|"points"|"bars", colour: string, stroke: number, dash: string, x: number, y: number,
 *   of: number, half: number, marker?: "disc"|"triangle"|"cross"}} Told a line as the page has it: numbers of its columns, and how many samples there were */
/** @typedef {Told & {xs: Float64Array, ys: Float64Array, rises: boolean}} Line */
/** @typedef {{along: "x"|"y", band: boolean, name: string, colour: string, stroke: number, dash: string, from: number, to: number}} Mark */
/** @typedef {{name: string, top: number, bottom: number, y: Axis, lines: Line[], marks: Mark[]}} Panel */
/** @typedef {{width: number, left: number, right: number, zooms: boolean, x: Axis, columns: string[], panels: Panel[]}} Data */
/** @typedef {{range: [number, number], at: number|null, plots: Plot[]}} Link plots that have one horizontal axis: what they show of it,
 *   and where the cursor is */
/** @typedef {{draw: () => void, point: () => void}} Plot */

/** How near the pointer has to be to a point, px. */
const NEAR = 14;
const FEWEST_TICKS = 3;

/** Numbers of a column. @param {string} text */
function numbersOf(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Float64Array.from({ length: bytes.length / 4 }, (_, n) => view.getFloat32(4 * n, true));
}

/** What is known of a figure. @param {string} text @returns {Data} */
function read(text) {
  const data = JSON.parse(text);
  const columns = data.columns.map(numbersOf);
  const drawn = (/** @type {Axis} */ axis, /** @type {number} */ value) => (axis.log ? Math.log10(value) : value);
  const across = columns.map((/** @type {Float64Array} */ column) =>
    column.map((value) => (data.x.log ? Math.log10(value) : data.x.low + value)),
  );
  for (const panel of data.panels) {
    for (const line of panel.lines) {
      line.xs = across[line.x];
      line.ys = columns[line.y].map((/** @type {number} */ value) => drawn(panel.y, value));
      line.rises = line.xs.every((/** @type {number} */ x, /** @type {number} */ n) => n === 0 || x >= line.xs[n - 1]);
    }
    for (const mark of panel.marks) {
      const axis = mark.along === "x" ? data.x : panel.y;
      [mark.from, mark.to] = [drawn(axis, mark.from), drawn(axis, mark.to)];
    }
  }
  return data;
}

/** Place of the first number that is not below another. @param {Float64Array} xs rising @param {number} x */
function firstFrom(xs, x) {
  let [low, high] = [0, xs.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (xs[middle] < x) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Place of the nearest number. @param {Float64Array} xs rising @param {number} x */
function nearest(xs, x) {
  const after = firstFrom(xs, x);
  if (after === 0) return 0;
  return after === xs.length || x - xs[after - 1] <= xs[after] - x ? after - 1 : after;
}

/** What a line is at a place of the horizontal axis: as it is drawn, both ends where it is upright, and nothing in a gap.
 * @param {Line} line @param {number} x @param {Axis} axis @returns {number[]} */
function valuesAt({ xs, ys, kind, half }, x, axis) {
  if (!xs.length) return [];
  const near = nearest(xs, x);
  const tiny = 1e-9 * (axis.high - axis.low);
  const known = (/** @type {number} */ y) => (Number.isFinite(y) ? [y] : []);
  if (Math.abs(xs[near] - x) <= tiny) {
    const there = [...ys.slice(firstFrom(xs, x - tiny), firstFrom(xs, x + tiny))].flatMap(known);
    return there.length > 1 ? [Math.min(...there), Math.max(...there)] : there;
  }
  if (kind === "bars") return Math.abs(xs[near] - x) <= half ? known(ys[near]) : [];
  const after = firstFrom(xs, x);
  if (after === 0 || (after === xs.length && kind !== "step")) return [];
  if (kind === "step") return known(ys[after - 1]);
  const share = (x - xs[after - 1]) / (xs[after] - xs[after - 1]);
  return known(ys[after - 1] + share * (ys[after] - ys[after - 1]));
}

/** @param {Axis} axis @param {number} value as it is drawn */
const inData = (axis, value) => (axis.log ? 10 ** value : value);

/** A number for people. @param {number} value @param {number} digits */
function short(value, digits) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-4 || size >= 1e6) ? value.toExponential(digits - 1) : String(Number(value.toPrecision(digits)));
  return text.replaceAll("-", "−");
}

/** @param {Axis} axis @param {number} value as it is drawn @param {number} digits */
const withUnit = (axis, value, digits) => `${short(inData(axis, value), digits)}${axis.unit ? ` ${axis.unit}` : ""}`;

/** Ticks of a part of an axis, with their labels. @param {Axis} axis @param {[number, number]} range @param {number} most @returns {[number, string][]} */
function ticks(axis, [low, high], most) {
  if (axis.log && high - low >= FEWEST_TICKS) {
    const step = Math.ceil((high - low) / most);
    return multiples(step, low, high).map((power) => [power, power >= -3 && power < 5 ? String(10 ** power) : `1e${power}`]);
  }
  if (axis.log) {
    const [from, to] = [10 ** low, 10 ** high];
    return linear({ ...axis, power: 0 }, from, to, most).map(([value, label]) => [Math.log10(value), label]);
  }
  return linear(axis, low, high, most);
}

/** @param {Axis} axis @param {number} low @param {number} high @param {number} most @returns {[number, string][]} */
function linear(axis, low, high, most) {
  let step = rounded((high - low) / most);
  while (multiples(step, low, high).length < FEWEST_TICKS) step = rounded(0.4 * step);
  const decimals = Math.min(12, Math.max(0, axis.power - Math.floor(Math.log10(step) + 1e-9)));
  return multiples(step, low, high).map((value) => {
    const text = (value / 10 ** axis.power).toFixed(decimals);
    return [value, Number(text) === 0 ? text.replace("-", "") : text];
  });
}

/** @param {number} step @param {number} low @param {number} high */
function multiples(step, low, high) {
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: Math.max(0, count) }, (_, n) => (first + n) * step);
}

/** The next step up that is 1, 2 or 5 times a power of ten. @param {number} step */
function rounded(step) {
  const decade = 10 ** Math.floor(Math.log10(step));
  return ([1, 2, 5].find((times) => times * decade >= step * (1 - 1e-9)) ?? 10) * decade;
}

/** Where numbers of a panel lie, px. @param {Data} data @param {Panel} panel @param {[number, number]} range shown of the horizontal axis */
function mapping(data, panel, [low, high]) {
  const { left, right } = data;
  const { top, bottom, y } = panel;
  return {
    x: (/** @type {number} */ value) => left + ((value - low) / (high - low)) * (right - left),
    y: (/** @type {number} */ value) => bottom - ((value - y.low) / (y.high - y.low)) * (bottom - top),
  };
}

/** What a panel has at a place: the place, moved to a sample, and each line's value. @param {Data} data @param {Panel} panel @param {Link} link
 * @param {number} x along the axis @param {number|null} py px down, of the pointer */
function readingOf(data, panel, link, x, py) {
  const joined = panel.lines.filter((line) => line.kind !== "points" && line.rises && line.xs.length);
  const densest = joined.reduce((/** @type {Line|null} */ most, line) => (most && most.xs.length >= line.xs.length ? most : line), null);
  const sample = densest ? densest.xs[nearest(densest.xs, x)] : x;
  const { x: px } = mapping(data, panel, link.range);
  const at = Math.abs(px(sample) - px(x)) <= NEAR ? sample : x;
  /** @type {{line: Line, value: string}[]} */
  const rows = [];
  for (const line of panel.lines.filter((one) => one.name || panel.lines.length === 1)) {
    if (joined.includes(line)) {
      const about = line.xs.length < line.of && line.kind !== "bars" ? "≈ " : "";
      const ends = valuesAt(line, at, data.x).map((value) => withUnit(panel.y, value, 5));
      if (ends.length) rows.push({ line, value: about + ends.join(" to ") });
    } else {
      const point = nearestPoint(data, panel, link, line, x, py);
      if (point !== null) rows.push({ line, value: `${withUnit(panel.y, line.ys[point], 5)} at ${withUnit(data.x, line.xs[point], 6)}` });
    }
  }
  return { at, rows };
}

/** The point of a cloud or a curve that lies near the pointer. @param {Data} data @param {Panel} panel @param {Link} link @param {Line} line
 * @param {number} x @param {number|null} py */
function nearestPoint(data, panel, link, { xs, ys }, x, py) {
  if (py === null) return null;
  const at = mapping(data, panel, link.range);
  let found = null;
  let least = NEAR;
  for (let n = 0; n < xs.length; n++) {
    const apart = Math.hypot(at.x(xs[n]) - at.x(x), at.y(ys[n]) - py);
    if (apart < least) [found, least] = [n, apart];
  }
  return found;
}
