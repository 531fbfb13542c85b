// Controls that several tabs have.

import { AXES, AXIS_NAMES } from "./api.js";
import { choice } from "./dom.js";

/** The axis that is looked at. @param {import("./main.js").App} app @param {string} label @param {string} id */
export function axisChoice(app, label, id) {
  /** @type {[string, string][]} */
  const axes = AXES.map((axis) => [axis, `${axis}, ${AXIS_NAMES[axis]}`]);
  return choice(label, id, axes, app.view.axis, (axis) => app.look({ axis }));
}
