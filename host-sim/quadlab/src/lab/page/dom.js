// Elements from plain data. Text always goes in as text, never as markup.

/** @typedef {Node|string|number|null|undefined|false} Child */

/**
 * An element. Attributes that are null, undefined or false are left out; functions become event listeners.
 * @param {string} tag
 * @param {Record<string, any>} [attributes]
 * @param {...(Child|Child[])} children
 * @returns {any}
 */
export function el(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  put(element, attributes, children);
  return element;
}

/** The same for drawings. @param {string} tag @param {Record<string, any>} [attributes] @param {...(Child|Child[])} children */
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  put(element, attributes, children);
  return element;
}

/** @param {Element} element @param {Record<string, any>} attributes @param {(Child|Child[])[]} children */
function put(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "function") element.addEventListener(name, value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  for (const child of children.flat()) {
    if (child === null || child === undefined || child === false) continue;
    element.append(typeof child === "number" ? String(child) : child);
  }
}

/** The element with this id. @param {string} id @returns {any} */
export function byId(id) {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no element #${id}`);
  return element;
}

/**
 * Draws the content of an element anew, with the focus and the unfolded parts where they were. Both are known by `data-key`.
 * Children that say the same as before stay, so that a choice that is open stays open; what their listeners work with must
 * therefore stand in them.
 * @param {HTMLElement} root
 * @param {Child[]} children
 */
export function redraw(root, children) {
  const scroll = root.scrollTop;
  drawAnew(root, children);
  root.scrollTop = scroll;
}

/** The same of an element that does not scroll: nothing is laid out for it. @param {HTMLElement} root @param {Child[]} children */
function drawAnew(root, children) {
  const active = document.activeElement;
  const key = active instanceof HTMLElement && root.contains(active) ? active.dataset.key : undefined;
  const open = [...root.querySelectorAll("details[open]")].map((d) => /** @type {HTMLElement} */ (d).dataset.key);
  const shut = [...root.querySelectorAll("details:not([open])")].map((d) => /** @type {HTMLElement} */ (d).dataset.key);
  const drawn = children
    .filter((child) => child !== null && child !== undefined && child !== false)
    .map((child) => (child instanceof Node ? child : document.createTextNode(String(child))));
  for (const parent of drawn) {
    for (const details of parent instanceof Element ? parent.querySelectorAll("details") : []) {
      if (open.includes(details.dataset.key)) details.open = true;
      if (shut.includes(details.dataset.key)) details.open = false;
    }
  }
  replace(root, drawn);
  const focused = key && root.querySelector(`[data-key="${CSS.escape(key)}"]`);
  if (focused instanceof HTMLElement && focused !== document.activeElement) focused.focus();
}

/** The items of lists that are drawn by `redrawItems`. @type {WeakMap<HTMLElement, Map<string, HTMLElement>>} */
const lists = new WeakMap();

/**
 * Draws a list anew. Its items stay the same elements, so that one of their children can stay too.
 * @param {HTMLElement} root
 * @param {{key: string, attributes: Record<string, any>, children: Child[]}[]} items
 */
export function redrawItems(root, items) {
  const known = lists.get(root);
  const scroll = root.scrollTop;
  const drawn = items.map(({ key, attributes, children }) => {
    const item = known?.get(key) ?? el("li");
    for (const [name, value] of Object.entries(attributes)) item.setAttribute(name, value);
    drawAnew(item, children);
    return item;
  });
  lists.set(root, new Map(items.map(({ key }, n) => [key, drawn[n]])));
  drawAnew(root, drawn);
  root.scrollTop = scroll;
}

/** Puts nodes into an element, without touching those that are there already. @param {HTMLElement} root @param {Node[]} drawn */
function replace(root, drawn) {
  const old = new Set(root.childNodes);
  const content = drawn.map((node) => {
    for (const there of old) {
      if (!there.isEqualNode(node)) continue;
      old.delete(there);
      const made = node instanceof Element ? node.querySelectorAll("select") : [];
      const kept = there instanceof Element ? there.querySelectorAll("select") : [];
      kept.forEach((select, n) => (select.value = made[n].value));
      return there;
    }
    return node;
  });
  for (const node of old) root.removeChild(node);
  let next = root.firstChild;
  for (const node of content) {
    if (node === next) next = node.nextSibling;
    else root.insertBefore(node, next);
  }
}

/**
 * A table.
 * @param {string} caption
 * @param {Child[]} head
 * @param {(Child|Child[])[][]} rows
 */
export function table(caption, head, rows) {
  return el(
    "table",
    {},
    el("caption", {}, caption),
    el(
      "thead",
      {},
      el(
        "tr",
        {},
        head.map((cell) => el("th", { scope: "col" }, cell)),
      ),
    ),
    el(
      "tbody",
      {},
      rows.map((cells) =>
        el(
          "tr",
          {},
          cells.map((cell, n) => (n ? el("td", {}, cell) : el("th", { scope: "row" }, cell))),
        ),
      ),
    ),
  );
}

/** A choice with its label. @param {string} label @param {string} id @param {[string, string][]} options value and text
 * @param {string} chosen @param {(value: string) => void} change */
export function choice(label, id, options, chosen, change) {
  const select = el("select", { id, "data-key": id, change: (/** @type {any} */ event) => change(event.target.value) });
  fill(select, options, chosen);
  return el("label", {}, label, " ", select);
}

/** Options of a select. @param {HTMLSelectElement} select @param {[string, string][]} options @param {string} chosen */
export function fill(select, options, chosen) {
  const same =
    select.options.length === options.length && options.every(([value], n) => select.options[n].value === value);
  if (same) {
    select.value = chosen;
    return;
  }
  select.replaceChildren(...options.map(([value, text]) => el("option", { value, selected: value === chosen }, text)));
}
