// The traces and axes of the linked plots.

import { known } from "./numbers.js";
import { axis, line } from "./plots.js";

/** @typedef {import("./api.js").Series} Series */
/** @typedef {import("./api.js").Channel} Channel */
/** @typedef {{first: Series, second: Series|null, beside: Series|null}} Shown of the chosen model, of the second, and of a second flight */

/**
 * Traces and axes of the linked plots.
 * @param {Shown} shown @param {Channel[]} channels @param {import("./panels.js").Panels} panels
 * @param {[number, number]} range @param {boolean} difference
 * @param {Shown} framed what the vertical axes are to hold: they stay where a line is only looked at
 */
export function figure(shown, channels, panels, range, difference, framed) {
  /** @type {any[]} */
  const traces = [];
  /** @type {Record<string, any>} */
  const axes = {};
  const { width, height } = panels;
  channels.forEach((channel, n) => {
    const place = panels.places[n];
    const left = panels.x(place.column);
    const across = [left / width, (left + panels.plotWidth) / width];
    const lowest = n === channels.length - 1 || panels.places[n + 1].column !== place.column;
    const [main, rest] = [2 * n + 1, 2 * n + 2];
    const drawn = lines(shown, channel, difference, main, rest);
    const held = framed === shown ? drawn : lines(framed, channel, difference, main, rest);
    const up = (/** @type {[number, number]} */ [top, bottom]) => [1 - bottom / height, 1 - top / height];
    // Plotly writes into the range.
    const x = { domain: across, range: [...range], matches: n ? "x" : undefined, zeroline: false };
    axes[nth("xaxis", main)] = axis({
      ...x,
      anchor: nth("y", main),
      showticklabels: false,
      matches: n ? "x" : undefined,
    });
    axes[nth("xaxis", rest)] = axis({
      ...x,
      anchor: nth("y", rest),
      showticklabels: lowest,
      ticksuffix: " s",
      matches: "x",
    });
    axes[nth("yaxis", main)] = axis({
      domain: up(panels.main(place)),
      range: extent(held, nth("y", main)),
      anchor: nth("x", main),
      fixedrange: true,
      nticks: 5,
      zeroline: false,
    });
    axes[nth("yaxis", rest)] = axis({
      domain: up(panels.rest(place)),
      range: extent(held, nth("y", rest)),
      anchor: nth("x", rest),
      fixedrange: true,
      nticks: 3,
    });
    traces.push(...drawn);
  });
  return { traces, axes };
}

/** Range of what is drawn on an axis, with some room; nothing where there is nothing. @param {any[]} traces @param {string} yaxis */
function extent(traces, yaxis) {
  let [low, high] = [Infinity, -Infinity];
  for (const { y } of traces.filter((trace) => trace.yaxis === yaxis)) {
    for (const value of y) {
      if (!known(value)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (low > high) return undefined;
  const space = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [low - space, high + space];
}

/** Plotly's name of an axis. @param {string} kind @param {number} n from 1 */
const nth = (kind, n) => (n === 1 ? kind : `${kind}${n}`);

/**
 * @param {Shown} shown @param {Channel} channel @param {boolean} difference
 * @param {number} main @param {number} rest numbers of the axes
 */
function lines(shown, channel, difference, main, rest) {
  const trace = (
    /** @type {Parameters<typeof line>[0]} */ role,
    /** @type {number} */ n,
    /** @type {number[]} */ x,
    /** @type {(number|null)[]} */ y,
  ) => ({
    type: "scatter",
    mode: "lines",
    x,
    y,
    xaxis: nth("x", n),
    yaxis: nth("y", n),
    line: line(role),
    hoverinfo: "skip",
    connectgaps: false,
  });
  const { first, second, beside } = shown;
  const other = sameIn(second, channel);
  const there = sameIn(beside, channel);
  const all = [trace("measured", main, first.t, channel.measured)];
  if (there && beside)
    all.unshift(
      trace("beside-measured", main, beside.t, there.measured),
      trace("second", main, beside.t, there.predicted),
      trace("second-residual", rest, beside.t, there.residual),
    );
  if (other && second)
    all.push(
      trace("second", main, second.t, other.predicted),
      trace("second-residual", rest, second.t, other.residual),
    );
  all.push(trace("predicted", main, first.t, channel.predicted), trace("residual", rest, first.t, channel.residual));
  if (!difference) return all;
  if (other && second) all.push(trace("difference", rest, first.t, apart(first, channel, second, other)));
  if (there && beside) all.push(trace("difference", rest, beside.t, there.residual_apart ?? []));
  return all;
}

/** The same channel of other series. @param {Series|null} series @param {Channel} channel */
export const sameIn = (series, channel) => series?.channels.find((c) => c.id === channel.id);

/** Second prediction minus the first, where both have a value at the same time. @param {Series} first @param {Channel} channel @param {Series} second @param {Channel} other */
function apart(first, channel, second, other) {
  let at = 0;
  return first.t.map((t, n) => {
    while (at < second.t.length - 1 && second.t[at] < t) at++;
    const [a, b] = [channel.predicted[n], other.predicted[at]];
    return second.t[at] === t && known(a) && known(b) ? b - a : null;
  });
}
