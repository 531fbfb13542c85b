// A range of time that is chosen by dragging over the linked plots.

/** @typedef {import("./panels.js").Panels} Panels */
/** @typedef {[number, number]} Range first and last time, s */

/** A press that moves by less is a click, px. */
const LEAST_PX = 3;

/**
 * @param {import("./main.js").App} app @param {HTMLElement} overlay holds a band for each column of panels
 * @param {() => Range} range that is shown @param {() => void} done
 */
export function rangeChoice(app, overlay, range, done) {
  /** @type {Range|null} */
  let chosen = null;
  let flight = "";
  /** @type {Panels|null} */
  let panels = null;

  /** What is chosen of the shown flight. */
  const get = () => (flight === app.view.flight ? chosen : null);

  function clear() {
    chosen = null;
  }

  /** Chooses what the pointer is dragged over from now on. @param {PointerEvent} pressed @param {number} start s */
  function begin(pressed, start) {
    const perPixel = (range()[1] - range()[0]) / (panels?.plotWidth ?? 1);
    const moved = (/** @type {PointerEvent} */ event) => {
      const far = event.clientX - pressed.clientX;
      const [first, last] = range();
      const end = Math.min(Math.max(start + far * perPixel, first), last);
      if (chosen || Math.abs(far) > LEAST_PX) chosen = start < end ? [start, end] : [end, start];
      draw(panels);
    };
    const ended = () => {
      window.removeEventListener("pointermove", moved);
      window.removeEventListener("pointerup", ended);
      window.removeEventListener("pointercancel", ended);
      draw(panels);
      done();
    };
    [chosen, flight] = [null, app.view.flight];
    window.addEventListener("pointermove", moved);
    window.addEventListener("pointerup", ended);
    window.addEventListener("pointercancel", ended);
  }

  /** A band over the range in each column. @param {Panels|null} lay */
  function draw(lay) {
    panels = lay;
    const over = get();
    const [from, to] = range();
    for (const element of overlay.querySelectorAll(".choosing")) {
      const band = /** @type {HTMLElement} */ (element);
      band.hidden = !lay || !over || over[1] < from || over[0] > to;
      if (!lay || !over || band.hidden) continue;
      const px = (/** @type {number} */ t) => ((Math.min(Math.max(t, from), to) - from) / (to - from)) * lay.plotWidth;
      band.style.left = `${lay.x(Number(band.dataset.column)) + px(over[0])}px`;
      band.style.width = `${px(over[1]) - px(over[0])}px`;
      band.style.height = `${lay.height - 24}px`;
    }
  }

  return { get, clear, begin, draw };
}
