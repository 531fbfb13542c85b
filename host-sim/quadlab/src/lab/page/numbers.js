// Numbers and units as people write them.

const SUPERSCRIPTS = /** @type {Record<string, string>} */ ({
  "-": "⁻",
  0: "⁰",
  1: "¹",
  2: "²",
  3: "³",
  4: "⁴",
  5: "⁵",
  6: "⁶",
  7: "⁷",
  8: "⁸",
  9: "⁹",
});

/** @param {string|number} text */
const raised = (text) => [...String(text)].map((c) => SUPERSCRIPTS[c] ?? c).join("");

/** A true minus before each number of a text, and not in names. @param {string} text */
export const minus = (text) => text.replace(/(^|[\s(=])-(?=[\d.])/g, "$1−");

/** A sentence of the server with powers and minus signs as people write them. @param {string} text */
export const prose = (text) => minus(text).replace(/\^(-?\d+)/g, (_, power) => raised(power));

/** A unit: `m/s^2` becomes m/s², `1` nothing. @param {string|null|undefined} unit */
export function unit(unit) {
  if (!unit || unit === "1") return "";
  if (/\. /.test(unit)) return unit;
  return unit.replace(/\^(-?\d+)/g, (_, power) => raised(power)).replace(/ /g, "·");
}

/** A name with its unit in brackets. @param {string} name @param {string} of */
export const withUnit = (name, of) => (unit(of) ? `${name} [${unit(of)}]` : name);

/** Whether a number is there. @param {unknown} x @returns {x is number} */
export const known = (x) => typeof x === "number" && Number.isFinite(x);

/** A number with so many significant digits. @param {number|null|undefined} x @param {number} [digits] */
export function short(x, digits = 3) {
  if (!known(x)) return "–";
  if (x === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(x)));
  if (size < -4 || size >= 6) {
    return minus(`${(x / 10 ** size).toPrecision(digits)}×10${raised(size)}`);
  }
  const decimals = Math.max(0, digits - 1 - size);
  return minus(x.toFixed(Math.min(decimals, 12)));
}

/** A value with its standard error, both to the error's second digit. @param {number} value @param {number|null|undefined} error */
export function withError(value, error) {
  if (!known(value)) return "–";
  if (!known(error) || error <= 0) return short(value, 4);
  const largest = Math.max(Math.abs(value), error);
  const size = Math.floor(Math.log10(largest));
  const power = size < -3 || size >= 5 ? size : 0;
  const scale = 10 ** power;
  const decimals = Math.max(0, Math.min(12, 1 - Math.floor(Math.log10(error / scale))));
  const pair = `${minus((value / scale).toFixed(decimals))} ± ${(error / scale).toFixed(decimals)}`;
  return power ? `(${pair})×10${raised(power)}` : pair;
}

/** A number that was chosen, such as a threshold: without the zeros at its end. @param {number} x */
export const given = (x) => minus(String(Number(x.toPrecision(4))));

/** A p-value. @param {number|null|undefined} p */
export const pValue = (p) => (!known(p) ? "p unknown" : p < 1e-6 ? `p < 10${raised(-6)}` : `p = ${short(p, 2)}`);

/** Percent, without digits that mean nothing. @param {number|null|undefined} x */
export function percent(x) {
  if (!known(x)) return "–";
  if (Math.abs(x) < 0.05) return "0 %";
  return `${minus(Math.abs(x) < 10 ? x.toFixed(1) : x.toFixed(0))} %`;
}

/** By how much the root mean square falls from one sum of squares to another, percent. @param {number|null|undefined} before @param {number|null|undefined} after */
export function rmsFall(before, after) {
  return known(before) && known(after) && before > 0 ? 100 * (1 - Math.sqrt(after / before)) : null;
}

/** A time in a flight. @param {number} s */
export const seconds = (s) => `${s.toFixed(2)} s`;

/** Index of the nearest time. @param {number[]} times rising @param {number} t */
export function nearest(times, t) {
  let low = 0;
  let high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle;
    else high = middle;
  }
  return high >= 0 && Math.abs(times[high] - t) < Math.abs(times[low] - t) ? high : low;
}
