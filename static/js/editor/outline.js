// The outline as a tree: by arrow keys, first letters, search, and drag to another place.
import { onPane } from "./panes.js";
import { isAround, isSame, onSelect, select, selection } from "./selection.js";
import { edit } from "./wire.js";

/** @typedef {import("./wire.js").Path} Path */

const TYPED_MS = 700; // letters that come faster are one word

const left = /** @type {HTMLElement} */ (document.getElementById("left"));
const open = new Map([['["page"]', true]]); // what was opened or closed, by its path
let sought = "";
let typed = "";
let typedAt = 0;

const lines = () => [...left.querySelectorAll(".tr")];
/** @param {HTMLElement} line @returns {Path} */
const pathOf = (line) => JSON.parse(line.dataset.path ?? "[]");
/** @param {HTMLElement} line */
const levelOf = (line) => Number(line.getAttribute("aria-level"));

// Lines inside of closed ones are hidden; a search shows what it finds, and what is around that.
function show() {
  let closed = Infinity;
  for (const line of lines()) {
    const level = levelOf(line);
    if (line.hasAttribute("aria-expanded")) {
      const isOpen = open.get(line.dataset.path ?? "") ?? false;
      line.setAttribute("aria-expanded", String(isOpen || Boolean(sought)));
    }
    if (level <= closed) closed = Infinity;
    line.hidden = !sought && level > closed;
    if (!sought && closed === Infinity && line.getAttribute("aria-expanded") === "false") closed = level;
  }
  if (sought) showFound();
  const shown = lines().filter((line) => !line.hidden);
  const current = shown.find((line) => isSame(pathOf(line), selection())) ?? shown[0];
  for (const line of lines()) {
    line.tabIndex = line === current ? 0 : -1;
    line.setAttribute("aria-selected", String(isSame(pathOf(line), selection())));
  }
}

function showFound() {
  const all = lines();
  const wanted = all.filter((line) => line.textContent?.toLowerCase().includes(sought) || false);
  for (const line of all) {
    const own = pathOf(line); // that of the panel is around everything
    line.hidden = !wanted.some((found) => found === line || (own.length && isAround(own, pathOf(found))));
  }
}

/** @param {HTMLElement} line @param {boolean} isOpen */
function toggle(line, isOpen) {
  open.set(line.dataset.path ?? "", isOpen);
  show();
}

/** @param {Path} path */
function reveal(path) {
  for (const line of lines()) {
    const own = pathOf(line);
    if (own.length < path.length && isAround(own, path)) open.set(line.dataset.path ?? "", true);
  }
  show();
  lines()
    .find((line) => isSame(pathOf(line), path))
    ?.scrollIntoView({ block: "nearest" });
}

/** @param {HTMLElement | undefined} line */
function go(line) {
  if (!line) return;
  for (const other of lines()) other.tabIndex = other === line ? 0 : -1;
  line.focus();
}

/** @param {KeyboardEvent} event */
function onKey(event) {
  const line = event.target instanceof Element ? event.target.closest(".tr") : null;
  if (!line || event.ctrlKey || event.metaKey || event.altKey) return;
  const shown = lines().filter((other) => !other.hidden);
  const number = shown.indexOf(line);
  const isOpen = line.getAttribute("aria-expanded");
  /** @type {Record<string, () => void>} */
  const keys = {
    ArrowDown: () => go(shown[number + 1]),
    ArrowUp: () => go(shown[number - 1]),
    Home: () => go(shown[0]),
    End: () => go(shown.at(-1)),
    ArrowRight: () => (isOpen === "false" ? toggle(line, true) : isOpen && go(shown[number + 1])),
    ArrowLeft: () => (isOpen === "true" ? toggle(line, false) : go(around(shown, number))),
    Enter: () => choose(line),
    " ": () => choose(line),
  };
  const act = keys[event.key];
  if (act) act();
  else if (event.key.length === 1) typeAhead(shown, number, event.key);
  else return;
  event.preventDefault();
}

/** @param {HTMLElement[]} shown @param {number} number */
function around(shown, number) {
  const level = levelOf(shown[number]);
  return shown.slice(0, number).findLast((line) => levelOf(line) < level);
}

/** @param {HTMLElement[]} shown @param {number} number @param {string} letter */
function typeAhead(shown, number, letter) {
  const now = performance.now();
  typed = now - typedAt < TYPED_MS ? typed + letter.toLowerCase() : letter.toLowerCase();
  typedAt = now;
  const from = typed.length > 1 ? number : number + 1;
  const next = [...shown.slice(from), ...shown.slice(0, from)];
  go(next.find((line) => line.querySelector("b")?.textContent?.toLowerCase().startsWith(typed)));
}

/** @param {HTMLElement} line */
function choose(line) {
  if (pathOf(line).length > 1 || !line.hasAttribute("aria-expanded")) select(pathOf(line), "outline");
  else toggle(line, line.getAttribute("aria-expanded") !== "true");
}

/** @param {MouseEvent} event */
function onClick(event) {
  const target = event.target instanceof Element ? event.target : null;
  const line = target?.closest(".tr");
  if (!line) return;
  go(line);
  if (target?.closest(".icon") === line.firstElementChild && line.hasAttribute("aria-expanded"))
    toggle(line, line.getAttribute("aria-expanded") !== "true");
  else choose(line);
}

// A table is dragged to the place of another of its kind.
/** @type {{ line: HTMLElement, id: number, y: number, isMoved: boolean } | null} */
let drag = null;
const DRAGGED_PX = 6;

/** @param {PointerEvent} event */
function onDown(event) {
  const line = event.target instanceof Element ? event.target.closest(".tr") : null;
  if (line && event.button === 0 && typeof pathOf(line).at(-1) === "number")
    drag = { line, id: event.pointerId, y: event.clientY, isMoved: false };
}

/** @param {PointerEvent} event */
function onMove(event) {
  if (!drag || event.pointerId !== drag.id) return;
  if (!drag.isMoved && Math.abs(event.clientY - drag.y) < DRAGGED_PX) return;
  drag.isMoved = true;
  left.setPointerCapture(event.pointerId);
  mark(targetAt(event));
}

/** @param {PointerEvent} event */
function onUp(event) {
  if (!drag || event.pointerId !== drag.id) return;
  const { line, isMoved } = drag;
  drag = null;
  mark(null);
  if (!isMoved) return;
  const target = targetAt(event, line);
  if (!target) return;
  const path = pathOf(line);
  const to = target.path;
  edit([{ op: "move", path, to }]).then((answer) => answer?.select && select(answer.select, "edit"));
  left.addEventListener("click", (click) => click.stopPropagation(), { capture: true, once: true });
}

// The line under the pointer before which the dragged table would stand, with its path.
/** @param {PointerEvent} event @param {HTMLElement | undefined} [moved] */
function targetAt(event, moved = drag?.line) {
  const line = lines().find((other) => {
    const box = other.getBoundingClientRect();
    return !other.hidden && event.clientY >= box.top && event.clientY < box.bottom;
  });
  if (!line || !moved || line === moved) return null;
  const [path, own] = [pathOf(line), pathOf(moved)];
  const kind = own.at(-2);
  if (isAround(own, path)) return null;
  if (path.at(-2) === kind) return { line, path };
  const inside = { widget: ["group", "page"], group: ["page"] }[String(kind)];
  if (!inside?.includes(String(path.at(-2)))) return null;
  return { line, path: [...path, String(kind), countOf(path, String(kind))] };
}

/** @param {Path} path @param {string} kind */
function countOf(path, kind) {
  return lines().filter((line) => {
    const own = pathOf(line);
    return own.length === path.length + 2 && own.at(-2) === kind && isAround(path, own);
  }).length;
}

/** @param {{ line: HTMLElement } | null} target */
function mark(target) {
  for (const line of lines()) line.classList.toggle("over-before", line === target?.line);
}

export function start() {
  onPane((pane) => {
    if (pane !== left || left.dataset.part !== "outline") return;
    const input = left.querySelector('input[type="search"]');
    if (input instanceof HTMLInputElement) {
      input.value = sought;
      input.addEventListener("input", () => {
        sought = input.value.trim().toLowerCase();
        show();
      });
    }
    show();
  });
  onSelect((path, from) => {
    if (left.dataset.part !== "outline") return;
    if (path && from !== "outline") reveal(path);
    else show();
  });
  left.addEventListener("keydown", onKey);
  left.addEventListener("click", onClick);
  left.addEventListener("pointerdown", onDown);
  left.addEventListener("pointermove", onMove);
  left.addEventListener("pointerup", onUp);
  left.addEventListener("pointercancel", () => {
    drag = null;
    mark(null);
  });
}
