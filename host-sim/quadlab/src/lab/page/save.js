// Figures as files: what a tab shows, with what the page writes beside it.

import { el } from "./dom.js";
import { legendOf } from "./legend.js";
import { titleOf } from "./models.js";
import { colour, line, plain, plotly, small } from "./plots.js";

/** @typedef {import("./main.js").App} App */
/** @typedef {{sign: string, colour: string, text: string}} Mark what a mark stands for */
/** @typedef {{plot: any, of: string, data?: any[], names?: {text: string, x: number, y: number}[], marks?: Mark[]}} Picture a plot, the
 *   flights in it, its data where they are other than on the screen, names of its panels at places of the whole, px from the top left, and
 *   its legend where the page's is another */

/** Buttons that save a figure. @param {App} app @param {() => Picture|null} shown @param {string} id begins those of the buttons */
export function saveButtons(app, shown, id) {
  const button = (/** @type {"svg"|"png"} */ format) =>
    el(
      "button",
      {
        type: "button",
        id: `${id}-${format}`,
        "aria-label": `Save the figure as ${format.toUpperCase()}`,
        title: `Save the figure as ${format.toUpperCase()}`,
        click: () => app.act(save(app, shown(), format)),
      },
      format.toUpperCase(),
    );
  return ["Figure: ", button("svg"), " ", button("png")];
}

/** @param {App} app @param {Picture|null} picture @param {"svg"|"png"} format */
async function save(app, picture, format) {
  const model = app.current();
  if (!picture?.plot.data || !model) return;
  const Plotly = await plotly();
  const { layout } = picture.plot;
  const legend = linesOf(picture.marks ?? legendOf(app).map(markOf), layout.width);
  const top = Math.round((2.4 + 1.5 * legend.length) * small());
  const [width, height] = [layout.width, layout.height + top];
  const figure = {
    data: picture.data ?? picture.plot.data,
    layout: {
      ...layout,
      height,
      paper_bgcolor: colour("bg"),
      margin: { ...layout.margin, t: layout.margin.t + top },
      annotations: [...(layout.annotations ?? []), ...head(model, picture, legend, layout, top)],
    },
  };
  await Plotly.downloadImage(figure, { format, width, height, filename: nameOf(app, model.id, picture.of) });
}

/** @param {import("./legend.js").Entry} entry @returns {Mark} */
const markOf = ([role, text]) => ({ sign: "▬", colour: line(role).color, text });

/** Lines of marks that are no wider than the figure. @param {Mark[]} marks @param {number} width */
function linesOf(marks, width) {
  const most = width / (0.62 * small());
  /** @type {Mark[][]} */
  const lines = [];
  let taken = Infinity;
  for (const mark of marks) {
    taken += mark.text.length + 6;
    if (taken > most) {
      lines.push([]);
      taken = mark.text.length + 6;
    }
    lines[lines.length - 1].push(mark);
  }
  return lines.map((row) =>
    row.map(({ sign, colour, text }) => `<span style="color:${colour}">${sign}</span> ${plain(text)}`).join("   "),
  );
}

/** Title, legend and names of panels. @param {import("./api.js").Model} model @param {Picture} picture @param {string[]} legend @param {any} layout @param {number} top */
function head(model, picture, legend, layout, top) {
  const { l, r, t, b } = layout.margin;
  const [across, upwards] = [layout.width - l - r, layout.height - t - b];
  // Places are parts of what lies within the margins, from below.
  const text = (/** @type {string} */ of, /** @type {number} */ x, /** @type {number} */ y, more = {}) => ({
    text: of,
    x: (x - l) / across,
    y: 1 - (y - t) / upwards,
    xref: "paper",
    yref: "paper",
    xanchor: "left",
    yanchor: "top",
    showarrow: false,
    ...more,
  });
  return [
    text(`<b>${plain(`${titleOf(model)}, ${picture.of}`)}</b>`, 8, 4 - top, { font: { size: 1.15 * small() } }),
    ...legend.map((row, n) => text(row, 8, 4 - top + (1.7 + 1.5 * n) * small())),
    ...(picture.names ?? []).map((name) => text(plain(name.text), name.x, name.y)),
  ];
}

/** @param {App} app @param {number} model @param {string} of flights */
function nameOf(app, model, of) {
  const words = `model-${model}-${of.replace(/\.\w+(?= |$)/g, "")}-${app.view.tab}`;
  return words.replace(/[^\w.-]+/g, "-");
}
