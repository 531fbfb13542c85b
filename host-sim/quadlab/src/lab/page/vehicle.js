// The vehicle file as a form, with a picture of where to measure.

import { get, post } from "./api.js";
import { byId, el, svg } from "./dom.js";

/** @typedef {import("./main.js").App} App */
/** @typedef {{name: string, mass: number, arm_length: number, rotor_radius: number, air_density: number, gravity: number,
 *   tracked_point: number[], spin: ("cw"|"ccw")[], command_range: number[], unmeasured: string[]}} Fields */
/** @typedef {{written: boolean, fields: Fields, command_unit: string, has_rotor_map: boolean, how: Record<string, string>}} Vehicle */

/** Rotors from above, forward is up: front left, front right, rear right, rear left. @type {[number, number][]} */
const ROTORS = [
  [-70, -70],
  [70, -70],
  [70, 70],
  [-70, 70],
];
const ROTOR_NAMES = ["1 front left", "2 front right", "3 rear right", "4 rear left"];

/** @param {App} app */
export function wireVehicle(app) {
  const dialog = /** @type {HTMLDialogElement} */ (byId("vehicle"));
  byId("vehicle-open").addEventListener("click", () => app.act(open(app, dialog)));
}

/** @param {App} app */
export function drawVehicleButton(app) {
  const vehicle = app.state?.vehicle;
  const count = vehicle?.unmeasured.length ?? 0;
  const button = byId("vehicle-open");
  button.hidden = !vehicle;
  button.disabled = Boolean(app.state?.job) || Boolean(app.state?.reading);
  button.textContent = count ? `Vehicle: ${count} value${count > 1 ? "s" : ""} not measured` : "Vehicle";
  button.classList.toggle("primary", Boolean(vehicle) && !vehicle?.written);
}

/** @param {App} app @param {HTMLDialogElement} dialog */
async function open(app, dialog) {
  const vehicle = /** @type {Vehicle} */ (await get("/api/vehicle"));
  const problem = el("p", { class: "bad-text", role: "alert" });
  const form = el(
    "form",
    { method: "dialog" },
    el("h2", { id: "vehicle-title" }, "Vehicle"),
    el(
      "p",
      { class: "quiet" },
      vehicle.written
        ? "What the vehicle file says of the craft. Models that were made before keep what they were made with."
        : "Guessed from the flights. Measure what is marked, and save: the file vehicle.toml is written beside the flights.",
    ),
    el("div", { class: "vehicle" }, fieldsOf(vehicle), picture(vehicle.fields)),
    problem,
    el(
      "div",
      { class: "buttons" },
      el("button", { type: "submit", class: "primary", id: "vehicle-save" }, "Save"),
      el("button", { type: "button", click: () => dialog.close() }, "Cancel"),
    ),
  );
  form.addEventListener("submit", async (/** @type {Event} */ event) => {
    event.preventDefault();
    try {
      app.takeState(await post("/api/vehicle", read(form, vehicle)));
      dialog.close();
    } catch (error) {
      problem.textContent = error instanceof Error ? error.message : String(error);
    }
  });
  dialog.replaceChildren(form);
  dialog.showModal();
}

/** @param {Vehicle} vehicle */
function fieldsOf(vehicle) {
  const { fields } = vehicle;
  const number = (/** @type {string} */ name, /** @type {number} */ value, /** @type {string} */ label) =>
    el("input", { type: "number", step: "any", required: true, name, value: String(value), "aria-label": label });
  const one = (/** @type {string} */ field, /** @type {string} */ label, /** @type {string} */ unit, /** @type {number} */ value) =>
    row(vehicle, field, `${label} (${unit})`, number(field, value, `${label} in ${unit}`));
  const [forward, right, down] = fields.tracked_point;
  const [low, high] = fields.command_range;
  return el(
    "div",
    { class: "fields" },
    row(vehicle, "name", "Name", el("input", { name: "name", value: fields.name, required: true, "aria-label": "Name" })),
    one("mass", "Mass", "kg", fields.mass),
    one("arm_length", "Arm length a", "m", fields.arm_length),
    one("rotor_radius", "Rotor radius R", "m", fields.rotor_radius),
    row(
      vehicle,
      "tracked_point",
      "Tracked point: forward, right, down (m)",
      number("forward", forward, "Tracked point forward in m"),
      number("right", right, "Tracked point right in m"),
      number("down", down, "Tracked point down in m"),
    ),
    row(
      vehicle,
      "motors.spin",
      "Each propeller turns, seen from above",
      ...fields.spin.map((spin, n) =>
        el(
          "select",
          { name: `spin${n}`, "aria-label": `Motor ${ROTOR_NAMES[n]} turns` },
          el("option", { value: "cw", selected: spin === "cw" }, `${n + 1}: clockwise`),
          el("option", { value: "ccw", selected: spin === "ccw" }, `${n + 1}: anticlockwise`),
        ),
      ),
    ),
    row(
      vehicle,
      "motors.command_range",
      `Motor commands at idle and full throttle (${vehicle.command_unit})`,
      number("low", low, "Motor command at idle"),
      number("high", high, "Motor command at full throttle"),
    ),
    one("air_density", "Air density", "kg/m³", fields.air_density),
    one("gravity", "Gravity", "m/s²", fields.gravity),
    !vehicle.has_rotor_map &&
      el(
        "p",
        { class: "quiet" },
        "The file has no motor map (rotor speed over command), so models use commands instead. Measure it on a test stand: quadlab motor-map.",
      ),
  );
}

/** A field, how it is measured, and whether it has been. @param {Vehicle} vehicle @param {string} field @param {string} label @param {...HTMLElement} inputs */
function row(vehicle, field, label, ...inputs) {
  const isGuess = vehicle.fields.unmeasured.includes(field);
  const box = el("input", { type: "checkbox", name: `measured ${field}`, checked: !isGuess });
  for (const input of inputs) input.addEventListener("input", () => (box.checked = true));
  return el(
    "fieldset",
    { class: isGuess ? "guess" : "" },
    el("legend", {}, label),
    ...inputs,
    isGuess && el("label", { class: "inline" }, box, " measured"),
    isGuess && vehicle.how[field] && el("p", { class: "quiet" }, sentence(vehicle.how[field])),
  );
}

/** @param {string} how */
const sentence = (how) => `${how[0].toUpperCase()}${how.slice(1)}.`;

/** @param {HTMLFormElement} form @param {Vehicle} vehicle @returns {Fields} */
function read(form, vehicle) {
  const data = new FormData(form);
  const text = (/** @type {string} */ name) => String(data.get(name) ?? "");
  const number = (/** @type {string} */ name) => Number(text(name));
  return {
    name: text("name"),
    mass: number("mass"),
    arm_length: number("arm_length"),
    rotor_radius: number("rotor_radius"),
    air_density: number("air_density"),
    gravity: number("gravity"),
    tracked_point: ["forward", "right", "down"].map(number),
    spin: [0, 1, 2, 3].map((n) => (text(`spin${n}`) === "cw" ? "cw" : "ccw")),
    command_range: ["low", "high"].map(number),
    unmeasured: vehicle.fields.unmeasured.filter((field) => !data.has(`measured ${field}`)),
  };
}

/** The craft from above with its lengths. @param {Fields} fields */
function picture(fields) {
  const label = (/** @type {number} */ x, /** @type {number} */ y, /** @type {string} */ text, anchor = "middle") =>
    svg("text", { x, y, "text-anchor": anchor }, text);
  const rotors = ROTORS.flatMap(([x, y], n) => [
    svg("line", { x1: 0, y1: 0, x2: x, y2: y, class: "arm" }),
    svg("circle", { cx: x, cy: y, r: 36, class: "rotor" }),
    label(x, y + 5, String(n + 1)),
    label(x, y + (y < 0 ? -42 : 54), fields.spin[n] === "cw" ? "↻" : "↺"),
  ]);
  return svg(
    "svg",
    { viewBox: "-130 -150 260 300", role: "img", class: "craft", "aria-label": "The craft from above: motors 1 front left, 2 front right, 3 rear right, 4 rear left; arm length a from the middle to a motor, rotor radius R" },
    label(0, -128, "forward ↑"),
    ...rotors,
    svg("line", { x1: 0, y1: 0, x2: 70, y2: 70, class: "length" }),
    label(26, 48, "a", "end"),
    svg("line", { x1: 70, y1: -70, x2: 106, y2: -70, class: "length" }),
    label(92, -75, "R"),
    svg("circle", { cx: 0, cy: 0, r: 5, class: "centre" }),
    label(0, 138, "from above"),
  );
}
