// Notes: what the user writes about a flight or a model. They are text, whatever they look like.

import { post } from "./api.js";
import { el } from "./dom.js";

/** @typedef {import("./main.js").App} App */
/** @typedef {{element: HTMLElement, take: (text: string, longest: number) => void}} Note */

/** Letters of a note that its heading shows. */
const SHOWN = 60;
const HOW = "Ctrl+Enter or leaving the field saves it.";

/**
 * The notes that are on the page. Each stays the same element while the rest of the page is drawn anew, so that what is being
 * written, and the caret in it, stay as they are.
 * @type {Map<string, Note>}
 */
const notes = new Map();

/**
 * The note of a flight or a model, with what is kept of it.
 * @param {App} app @param {{flight: string}|{model: number}} of @param {string} name @param {string} text
 */
export function noteOf(app, of, name, text) {
  const key = JSON.stringify(of);
  let note = notes.get(key);
  if (!note) {
    note = made(app, of, name);
    notes.set(key, note);
  }
  note.take(text, app.state?.longest_note ?? Infinity);
  return note.element;
}

/** @param {App} app @param {{flight: string}|{model: number}} of @param {string} name @returns {Note} */
function made(app, of, name) {
  /** What was kept when the user began to write. */
  let kept = "";
  let longest = Infinity;
  /** What is on its way to the server. @type {string|null} */
  let sent = null;
  /** What was kept elsewhere while the user wrote. */
  let elsewhere = "";
  const title = el("span", {});
  const heading = el("summary", { "data-key": `unfold note on ${name}` }, title, el("span", { class: "hidden" }, ` on ${name}`));
  const field = el("textarea", { rows: 4, "aria-label": `Note on ${name}`, input: written, blur: save, keydown: onKey });
  const told = el("p", { class: "quiet", role: "status" });
  const element = el("details", { class: "note-of", "data-key": `note on ${name}` }, heading, field, told);

  const isEdited = () => field.value !== kept;

  function written() {
    const { length } = [...field.value];
    const over = length > longest;
    field.setAttribute("aria-invalid", String(over));
    told.classList.toggle("bad-text", over);
    if (over) told.textContent = `A note has ${longest} characters at most, and this one has ${length}: shorten it.`;
    else told.textContent = isEdited() ? elsewhere || HOW : "";
    return !over;
  }

  /** @param {KeyboardEvent} event */
  function onKey(event) {
    if (event.key !== "Enter" || !(event.ctrlKey || event.metaKey)) return;
    event.preventDefault();
    save();
  }

  async function save() {
    if (!isEdited() || field.value === sent || !written()) return;
    const text = field.value;
    sent = text;
    try {
      const state = await post("/api/notes", { ...of, text });
      kept = text;
      elsewhere = "";
      told.textContent = isEdited() ? HOW : "Saved.";
      app.takeState(state);
    } catch (error) {
      told.classList.add("bad-text");
      told.textContent = error instanceof Error ? error.message : String(error);
    } finally {
      sent = null;
    }
  }

  /** What the server has now; what is being written stays. @param {string} text @param {number} most */
  function take(text, most) {
    longest = most;
    const line = text.trim().split("\n")[0];
    const brief = line.length > SHOWN ? `${line.slice(0, SHOWN)}…` : line;
    title.textContent = line ? `Note: ${brief}` : "Note";
    if (text === kept || text === sent) return;
    if (isEdited()) {
      elsewhere = `It was changed in another tab to “${text}”. What you write here overwrites that.`;
      told.textContent = elsewhere;
    } else {
      field.value = text;
      told.textContent = "";
    }
    kept = text;
  }

  return { element, take };
}
