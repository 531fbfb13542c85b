// The mean residual in cells of the room: from above and from two sides.

import { known, short, unit, withUnit } from "./numbers.js";
import { axis, colour, cursorMark } from "./plots.js";

/** @typedef {{across: string, upwards: string, x: number[], y: number[], mean: (number|null)[][], count: number[][]}} Plane */
/** @typedef {{cell_m: number, fewest: number, samples: number, planes: Plane[], unit: string, flights: string[], without_position: string[]}} Room */

/** The largest mean there is. @param {Room} room */
export function largestMean(room) {
  const all = room.planes.flatMap((plane) => plane.mean.flat()).filter(known);
  return Math.max(...all.map(Math.abs), 0) || 1;
}

/**
 * Cells seen from above, and from two sides beside it. Where the cursor is, is drawn later.
 * @param {Room} room @param {number} limit of the colours
 */
export function roomFigure(room, limit) {
  const traces = room.planes.flatMap((plane, n) => [cells(plane, axesOf(n), room, limit), cursorMark(axesOf(n))]);
  const [above, east, north] = room.planes;
  const title = (/** @type {string} */ name) => ({ title: { text: withUnit(name, "m"), standoff: 4 } });
  /** Cells are square on the screen, and ticks many enough to be read. @param {any} more */
  const metres = (more) => axis({ nticks: 8, constrain: "domain", zeroline: false, ...more });
  const shape = {
    hovermode: "closest",
    xaxis: metres({ domain: [0, 0.47], anchor: "y", ...title(above.across) }),
    yaxis: metres({ domain: [0, 1], anchor: "x", scaleanchor: "x", ...title(above.upwards) }),
    xaxis2: metres({ domain: [0.56, 1], anchor: "y2", ...title(east.across) }),
    yaxis2: metres({ domain: [0.57, 1], anchor: "x2", scaleanchor: "x2", ...title(east.upwards) }),
    xaxis3: metres({ domain: [0.56, 1], anchor: "y3", ...title(north.across) }),
    yaxis3: metres({ domain: [0, 0.43], anchor: "x3", scaleanchor: "x3", ...title(north.upwards) }),
  };
  return { traces, shape };
}

/** What plotly adds to the names of the axes of a plot. @param {number} n */
const axesOf = (n) => (n ? String(n + 1) : "");

/** @param {Plane} plane @param {string} id @param {Room} room @param {number} limit */
function cells(plane, id, room, limit) {
  return {
    type: "heatmap",
    name: "cells",
    x: plane.x,
    y: plane.y,
    z: plane.mean,
    customdata: plane.count,
    zmin: -limit,
    zmax: limit,
    colorscale: [
      [0, colour("predicted")],
      [0.5, colour("middle")],
      [1, colour("residual")],
    ],
    showscale: false,
    hoverongaps: false,
    xaxis: `x${id}`,
    yaxis: `y${id}`,
    hovertemplate: `${plane.across} %{x:.2f} m, ${plane.upwards} %{y:.2f} m:<br>mean %{z:.3g} ${unit(room.unit)}, %{customdata} samples<extra></extra>`,
  };
}

/** What the map shows, as a sentence. @param {Room} room @param {string} of name of the axis */
export function roomSaid(room, of) {
  const without = room.without_position.length ? ` No position was logged in ${room.without_position.join(", ")}.` : "";
  const top = topCell(room.planes[0]);
  if (!top) return `No cell has ${room.fewest} samples.${without}`;
  return (
    `Mean residual of ${of} in cells of ${short(room.cell_m, 1)} m with ${room.fewest} samples or more, of ${room.samples} in all. ` +
    `From above it is largest at north ${short(top.y)} m, east ${short(top.x)} m: ${short(top.mean)} ${unit(room.unit)} (${top.count} samples).${without}`
  );
}

/** @param {Plane} plane */
function topCell(plane) {
  /** @type {{x: number, y: number, mean: number, count: number}|null} */
  let top = null;
  plane.mean.forEach((row, j) =>
    row.forEach((mean, i) => {
      if (!known(mean) || (top && Math.abs(top.mean) >= Math.abs(mean))) return;
      const middle = (/** @type {number[]} */ edges, /** @type {number} */ n) => (edges[n] + edges[n + 1]) / 2;
      top = { x: middle(plane.x, i), y: middle(plane.y, j), mean, count: plane.count[j][i] };
    }),
  );
  return /** @type {{x: number, y: number, mean: number, count: number}|null} */ (top);
}
