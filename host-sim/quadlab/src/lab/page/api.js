// The server's interface: what it sends, and how to ask for it.

/** @typedef {"u"|"v"|"w"|"p"|"q"|"r"} Axis */
/** @typedef {{rms: number|null, sse: number|null, r2: number|null}} Errors */
/** @typedef {{flight: string, parts: [number, number][], flown: [number, number][], chosen: boolean}} Used which parts of a flight are
 *   used, which fly, and whether the user has chosen */
/** @typedef {{flight: string, severity: "note"|"warning"|"refused", sentence: string, places: [number, number][]}} Fault with first and
 *   last time of each place, s; without places it is about the whole flight */
/** @typedef {{name: string, set: "train"|"validate"|"later"|"none", duration_s: number, rate_hz: number, rows: number, columns: string[],
 *   used: Used[], faults: Fault[], problem: string|null, note: string, height: [number, number][], battery: [number, number][],
 *   flights?: string[]}} Flight a file with a flight, or a log with some */
/** @typedef {{id: number, parent: number|null, effect: string|null, label: string, fitted_on: string[], judged_on: string[],
 *   effects: string[], axes: Record<Axis, Errors>|null, verdict: string|null, changed: string|null, discovered: string|null, supported: boolean|null, command: string,
 *   note: string}} Model */
/** @typedef {{do: string, activity: string, done: number|null, all: number|null}} Job */
/** @typedef {{id: string, text: string, problem: string|null, models: number[]}} OwnEffect a kept effect, and the models that have it */
/** @typedef {{folder: string, vehicle: {name: string, written: boolean, unmeasured: string[]}|null, problem: string|null, reading: boolean, readings: number, longest_note: number, first: string|null, flights: Flight[],
 *   models: Model[], own: OwnEffect[], current: number|null, job: Job|null}} State */
/** @typedef {{id: string, name: string, unit: string, group: string, measured: (number|null)[], predicted: (number|null)[],
 *   residual: (number|null)[], residual_apart?: (number|null)[]}} Channel with the difference of the residuals where it is of a
 *   flight beside another */
/** @typedef {{from: number, to: number, t: number[], channels: Channel[]}} Series */
/** @typedef {{effect?: string, name: string, value: number, std_error: number|null, unit: string}} Coefficient */
/** @typedef {{sse_before: number, sse_after: number, drop_percent: number}} Drop */
/** @typedef {{effect: string, supported: boolean, axes: Record<string, Drop>, p_value: number|null, held_out_p_value: number|null,
 *   flights_improved: [number, number], coefficients: Coefficient[], confounded_with: string[], reason: string, motor?: number}} Finding */
/** @typedef {{verdict: string, verdicts: {translation: string, rotation: string}, summary: string, effects: Finding[],
 *   unexplained: {axis: string, depends_on: string, share_percent: number, p_value: number|null}[],
 *   not_identified: {group?: string, axis?: string|null, reason?: string, why?: string, fly: string}[],
 *   sentences?: Record<string, string>}} Diagnosis */

/** The six axes, in their order. @type {Axis[]} */
export const AXES = ["u", "v", "w", "p", "q", "r"];

/** Unit of an axis, as the server writes units. @param {string} axis */
export const axisUnit = (axis) => ("uvw".includes(axis) ? "m/s^2" : "rad/s^2");

/** What an axis is. @type {Record<string, string>} */
export const AXIS_NAMES = { u: "forward", v: "to the right", w: "down", p: "roll", q: "pitch", r: "yaw" };

/** The flights of a file: a log may hold several. @param {Flight} file */
export const flightsOf = (file) => (file.flights?.length ? file.flights : [file.name]);

/** An answer other than 2xx; its message is a sentence for the user. */
export class ServerError extends Error {
  /** @param {number} status @param {string} sentence */
  constructor(status, sentence) {
    super(sentence);
    this.status = status;
  }
}

/** @param {string} path @param {RequestInit} [options] */
async function ask(path, options) {
  let response;
  try {
    response = await fetch(path, { credentials: "same-origin", ...options });
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new ServerError(0, "quadlab does not answer. Is it still running in its terminal?");
  }
  const text = await response.text();
  /** @type {any} */
  let body;
  try {
    body = text ? JSON.parse(text) : {};
  } catch {
    body = { error: text };
  }
  if (!response.ok) {
    throw new ServerError(response.status, body.error || `quadlab answered ${path} with status ${response.status}.`);
  }
  return body;
}

/**
 * Asks for a document.
 * @param {string} path
 * @param {Record<string, string|number|null|undefined>} [query] fields that are null are left out
 * @param {AbortSignal} [signal]
 */
export function get(path, query = {}, signal) {
  return ask(address(path, query), { signal });
}

/** Address of a document. @param {string} path @param {Record<string, string|number|null|undefined>} query */
export function address(path, query) {
  const fields = new URLSearchParams();
  for (const [name, value] of Object.entries(query)) {
    if (value !== null && value !== undefined && value !== "") fields.set(name, String(value));
  }
  const text = fields.toString();
  return text ? `${path}?${text}` : path;
}

/** Asks for something to be done. @param {string} path @param {object} body @param {AbortSignal} [signal] */
export function post(path, body, signal) {
  const headers = { "Content-Type": "application/json" };
  return ask(path, { method: "POST", headers, body: JSON.stringify(body), signal });
}

/** Sends a file. @param {string} path @param {Record<string, string>} query @param {File} file */
export function put(path, query, file) {
  const headers = { "Content-Type": "application/octet-stream" };
  return ask(address(path, query), { method: "POST", headers, body: file });
}

/** Whether a request was given up by the page itself. @param {unknown} error */
export const givenUp = (error) => error instanceof DOMException && error.name === "AbortError";

/**
 * Asks the newest question: the same one once, and an older one is given up for it.
 * @template T
 * @returns {(wanted: unknown, ask: (signal: AbortSignal) => Promise<T>) => Promise<T|null>} takes what the answer depends on, and
 *   gives nothing where a newer question came before the answer
 */
export function newest() {
  let key = "";
  let asked = new AbortController();
  /** @type {Promise<T>|null} */
  let answer = null;
  return async (wanted, ask) => {
    const now = JSON.stringify(wanted);
    if (now !== key) {
      asked.abort();
      asked = new AbortController();
      key = now;
      answer = ask(asked.signal);
    }
    const { signal } = asked;
    try {
      const given = await answer;
      return signal.aborted ? null : given;
    } catch (error) {
      if (signal.aborted || givenUp(error)) return null;
      key = "";
      throw error;
    }
  };
}
