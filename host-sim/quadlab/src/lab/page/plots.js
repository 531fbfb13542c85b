// Plotly with the page's colours and type.

/** @type {Promise<any>|null} */
let loading = null;

/** Plotly. It is large, so it starts when the first plot is drawn, and the rest of the page is there before. @returns {Promise<any>} */
export function plotly() {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "/page/plotly.min.js";
    script.addEventListener("load", () => resolve(/** @type {any} */ (window).Plotly));
    script.addEventListener("error", () => reject(new Error("The plots cannot be loaded. Load the page again.")));
    document.head.append(script);
  });
  return loading;
}

/** A colour of the style sheet. @param {string} name without the dashes */
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** The same colour, let through. @param {string} name @param {number} alpha */
export function faint(name, alpha) {
  const [r, g, b] = [1, 3, 5].map((at) => parseInt(colour(name).slice(at, at + 2), 16));
  return `rgba(${r},${g},${b},${alpha})`;
}

/** Text for Plotly, which reads tags. @param {string} text */
export const plain = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

/** Size of small type, px. */
export const small = () => 0.8 * parseFloat(getComputedStyle(document.documentElement).fontSize);

/** Height that is left below the top of an element in the middle column, px. @param {HTMLElement} element */
export function room(element) {
  const scrolled = document.getElementById("middle")?.scrollTop ?? 0;
  return window.innerHeight - element.getBoundingClientRect().top - scrolled - 12;
}

/** What all layouts have in common. @returns {any} */
export function layout() {
  return {
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: "system-ui, sans-serif", size: small(), color: colour("text") },
    margin: { l: 64, r: 12, t: 28, b: 44 },
    showlegend: false,
    hoverlabel: { bgcolor: colour("panel"), bordercolor: colour("control"), font: { color: colour("text") } },
  };
}

/** An axis of a plot. @param {object} [more] @returns {any} */
export function axis(more = {}) {
  return {
    gridcolor: colour("grid"),
    linecolor: colour("control"),
    zerolinecolor: colour("control"),
    tickcolor: colour("control"),
    automargin: false,
    ...more,
  };
}

/** What all plots have in common. */
export const CONFIG = { displayModeBar: false, responsive: false, doubleClick: false, showTips: false };

/** How the lines of one role look. @param {"measured"|"predicted"|"second"|"residual"|"second-residual"|"beside-measured"|"difference"} role */
export function line(role) {
  switch (role) {
    case "measured":
      return { color: colour("measured"), width: 2.6 };
    case "predicted":
      return { color: colour("predicted"), width: 1.2 };
    case "beside-measured":
      return { color: faint("second", 0.55), width: 2.6 };
    case "second":
      return { color: colour("second"), width: 1.4, dash: "6px,3px" };
    case "residual":
      return { color: colour("residual"), width: 1.1 };
    case "second-residual":
      return { color: colour("second"), width: 1.1, dash: "6px,3px" };
    default:
      return { color: colour("difference"), width: 1.3, dash: "2px,2px" };
  }
}

/** Where the craft is at the cursor's time: the place comes later. @param {string} id what the names of its axes end with */
export const cursorMark = (id) => ({
  type: "scatter",
  name: "cursor",
  mode: "markers",
  x: [null],
  y: [null],
  xaxis: `x${id}`,
  yaxis: `y${id}`,
  marker: { size: 11, color: colour("text"), symbol: "diamond", line: { color: colour("bg"), width: 1.5 } },
  hoverinfo: "skip",
});
