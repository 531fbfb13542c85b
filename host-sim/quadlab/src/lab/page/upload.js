// Flights that are dropped on the page, or chosen by a button: they go into the folder.

import { ServerError, post, put } from "./api.js";
import { byId } from "./dom.js";

/** @typedef {import("./main.js").App} App */

/** @param {App} app */
export function wireUpload(app) {
  const choose = byId("add-files");
  const input = /** @type {HTMLInputElement} */ (byId("files"));
  choose.addEventListener("click", () => input.click());
  input.addEventListener("change", () => {
    const files = [...(input.files ?? [])];
    input.value = "";
    app.act(take(app, files));
  });
  const over = (/** @type {DragEvent} */ event) => Boolean(event.dataTransfer?.types.includes("Files"));
  document.addEventListener("dragover", (event) => {
    if (!over(event)) return;
    event.preventDefault();
    document.body.classList.add("dropping");
  });
  document.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) document.body.classList.remove("dropping");
  });
  document.addEventListener("drop", (event) => {
    document.body.classList.remove("dropping");
    if (!over(event) || !event.dataTransfer) return;
    event.preventDefault();
    // What was dropped is gone after this event: it is asked for at once.
    const files = [...event.dataTransfer.items].map((item) => {
      const entry = item.webkitGetAsEntry();
      return entry ? filesOf(entry) : [item.getAsFile()].filter((file) => file !== null);
    });
    app.act(Promise.all(files).then((all) => take(app, all.flat())));
  });
}

/** The files of a folder that was dropped; hidden ones and folders within it are left. @param {FileSystemEntry} entry @returns {Promise<File[]>} */
async function filesOf(entry) {
  if (entry.isFile) return [await fileOf(entry)];
  const reader = /** @type {FileSystemDirectoryEntry} */ (entry).createReader();
  /** @type {FileSystemEntry[]} */
  const all = [];
  for (;;) {
    // A browser gives a hundred at a time.
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!some.length) break;
    all.push(...some);
  }
  return Promise.all(all.filter((one) => one.isFile && !one.name.startsWith(".")).map(fileOf));
}

/** @param {FileSystemEntry} entry @returns {Promise<File>} */
const fileOf = (entry) =>
  new Promise((resolve, reject) => /** @type {FileSystemFileEntry} */ (entry).file(resolve, reject));

/** Puts files into the folder, one after the other, and reads them. @param {App} app @param {File[]} files */
async function take(app, files) {
  if (!files.length) return;
  /** @type {string[]} */
  const refused = [];
  const reading = byId("reading");
  for (const [n, file] of files.entries()) {
    reading.hidden = false;
    reading.textContent = `Taking ${file.name}: ${n + 1} of ${files.length}`;
    try {
      await put("/api/upload", { name: file.name }, file);
    } catch (error) {
      if (!(error instanceof ServerError)) throw error;
      refused.push(error.message);
    }
  }
  reading.textContent = "Reading flights …";
  reading.hidden = true;
  if (refused.length < files.length) app.takeState(await post("/api/read", {}));
  if (refused.length) throw new ServerError(400, refused.join("; "));
}
