// Where the linked plots lie: columns of panels, each a plot of the channel and one of its residual below.

/** @typedef {{column: number, row: number}} Place */
/** @typedef {{width: number, height: number, columns: number, left: number, plotWidth: number, places: Place[],
 *   main: (place: Place) => [number, number], rest: (place: Place) => [number, number], x: (column: number) => number}} Panels */

const LEFT = 58;
const RIGHT = 10;
const TITLE = 24;
const BETWEEN = 6;
const TIMES = 24;
const LEAST_ROW = 150;
const TWO_COLUMNS = 1150;

/**
 * Lays out so many panels. All lengths are px; a range is top and bottom.
 * @param {number} count @param {number} width @param {number} height what there is; more is taken where it is too little
 * @returns {Panels}
 */
export function layPanels(count, width, height) {
  const columns = width >= TWO_COLUMNS && count > 1 ? 2 : 1;
  const rows = Math.max(1, Math.ceil(count / columns));
  const all = Math.max(height, rows * LEAST_ROW + TIMES);
  const rowHeight = (all - TIMES) / rows;
  const plotWidth = width / columns - LEFT - RIGHT;
  const drawn = rowHeight - TITLE - BETWEEN;
  const places = Array.from({ length: count }, (_, n) => ({ column: Math.floor(n / rows), row: n % rows }));
  return {
    width,
    height: all,
    columns,
    left: LEFT,
    plotWidth,
    places,
    main: ({ row }) => [row * rowHeight + TITLE, row * rowHeight + TITLE + 0.66 * drawn],
    rest: ({ row }) => [row * rowHeight + TITLE + 0.66 * drawn + BETWEEN, (row + 1) * rowHeight],
    x: (column) => (column * width) / columns + LEFT,
  };
}
