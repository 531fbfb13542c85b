// What the server says of the chosen model with the effect that is tried: asked for while it is, and drawn only then.

import { ServerError, get, givenUp } from "./api.js";
import { tell, tried } from "./preview.js";

/** @typedef {import("./main.js").App} App */
/** @typedef {import("./preview.js").Tried} Tried */

/**
 * @param {App} app
 * @param {string} path what is asked
 * @param {() => any} draw draws the tab anew
 */
export function trialOf(app, path, draw) {
  let key = "";
  let asking = new AbortController();
  /** @type {{of: string, answer: any}|null} */
  let kept = null;

  /** What an answer stands for. @param {Tried} one @param {unknown} of what else has to be the same for it to be drawn */
  const nameOf = (one, of) =>
    JSON.stringify([
      one,
      of,
      app.state?.readings,
      app.state?.flights.map((file) => [file.name, file.set]),
      app.state?.own.map((own) => own.text),
    ]);

  /** The answer, while it is tried. @param {unknown} of */
  function answer(of) {
    const now = tried(app);
    return now && kept?.of === nameOf(now, of) ? kept.answer : null;
  }

  /**
   * Asks for what is tried now, and gives up what no longer is.
   * @param {Record<string, any>|null} query nothing where it is not drawn
   * @param {unknown} of the part of it without which an answer is not drawn
   */
  function update(query, of) {
    const now = query ? tried(app) : null;
    const wanted = now ? JSON.stringify([nameOf(now, of), query]) : "";
    if (wanted === key) return;
    key = wanted;
    asking.abort();
    asking = new AbortController();
    if (now && query) app.act(ask(asking.signal, now, query, of));
  }

  /** @param {AbortSignal} signal @param {Tried} now @param {Record<string, any>} query @param {unknown} of */
  async function ask(signal, now, query, of) {
    const name = nameOf(now, of);
    tell(app, now, answer(of) ? "drawn" : "asked");
    try {
      const given = await get(path, { ...query, ...now }, signal);
      if (signal.aborted) return;
      kept = { of: name, answer: given };
      tell(app, now, "drawn");
      await draw();
    } catch (error) {
      if (signal.aborted || givenUp(error)) return;
      if (!(error instanceof ServerError)) throw error;
      tell(app, now, "refused", error.message);
    }
  }

  return { update, answer };
}
