// The panes "Robot" and "Parts": live values, search, and adding by a drag to the page or by Enter.
import { emptyPlace, placeAt, pointOf } from "./arrange.js";
import { dropOfNew, showMark } from "./change.js";
import { fill, fillIn, focusAgain, onPane } from "./panes.js";
import { shownPage } from "./preview.js";
import { select, selection } from "./selection.js";
import { add, get, part } from "./wire.js";

/** @typedef {import("./wire.js").Path} Path */
/** @typedef {{ at?: Path, on?: Path, span?: number }} Target */

const VALUES_MS = 1000;
const DRAGGED_PX = 5;

const left = /** @type {HTMLElement} */ (document.getElementById("left"));
const form = /** @type {HTMLElement} */ (document.getElementById("form"));
const overlay = /** @type {HTMLElement} */ (document.getElementById("overlay"));
const ask = /** @type {HTMLDialogElement} */ (document.getElementById("ask"));

let sought = "";
let soughtIn = ""; // the pane where that was typed
let rows = 0; // the version of the rows that the pane shows

const items = () => [...left.querySelectorAll(".offer")];

// Lines without the words that are sought are hidden, and headings without lines.
function filter() {
  const words = sought.toLowerCase().split(/\s+/);
  for (const item of items()) {
    const text = item.textContent?.toLowerCase() ?? "";
    item.closest("li")?.toggleAttribute("hidden", !words.every((word) => text.includes(word)));
  }
  for (const head of left.querySelectorAll(".offers-head"))
    head.toggleAttribute("hidden", !head.nextElementSibling?.querySelector("li:not([hidden])"));
}

async function refresh() {
  if (left.dataset.part !== "robot" || document.hidden) return;
  const response = await get("/robot");
  if (!response) return;
  const { values, rows: version } = await response.json();
  if (left.dataset.part !== "robot") return; // another pane was chosen in the meantime
  if (version !== rows) {
    rows = version;
    await fill(left, "robot");
    return;
  }
  for (const cell of left.querySelectorAll("[data-value]")) {
    const text = values[cell.getAttribute("data-value") ?? ""];
    if (text !== undefined && text !== cell.textContent) cell.textContent = text;
  }
}

// Adds a line of a pane; an item of the robot is asked about first, at the point where it is.
/** @param {HTMLElement} item @param {Target} target @param {{ x: number, y: number }} point */
async function addItem(item, target, point) {
  const pane = left.contains(item) ? left : form;
  const near = selection();
  const place = { ...emptyPlace(), ...target, near, page: shownPage() };
  if (item.dataset.kindOf) {
    chosen(await add({ ...place, kind: item.dataset.kindOf }));
    return;
  }
  const [section, key] = JSON.parse(item.dataset.item ?? "[]");
  const html = await part("pick", { section, key, path: JSON.stringify(target.on ?? []) });
  if (html === null) return;
  ask.innerHTML = html;
  ask.className = "at-point";
  ask.returnValue = "";
  ask.onclose = async () => {
    ask.className = "";
    if (ask.returnValue) chosen(await add({ ...place, section, key, choice: Number(ask.returnValue) }));
    else focusAgain(pane, item);
  };
  ask.showModal();
  const { width, height } = ask.getBoundingClientRect();
  ask.style.left = `${Math.max(8, Math.min(point.x, innerWidth - width - 8))}px`;
  ask.style.top = `${Math.max(8, Math.min(point.y, innerHeight - height - 8))}px`;
}

/** @param {import("./wire.js").Answer | null} answer */
function chosen(answer) {
  if (!answer?.select) return;
  select(answer.select, "edit");
  fillIn();
}

/** @param {KeyboardEvent} event */
function onPickKey(event) {
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  const picks = [...ask.querySelectorAll(".ways button")];
  if (!step || !picks.length) return;
  const number = picks.findIndex((pick) => pick.matches(":focus"));
  picks[(number + step + picks.length) % picks.length].focus();
  event.preventDefault();
}

/** @param {KeyboardEvent} event */
function onKey(event) {
  const item = event.target instanceof Element ? event.target.closest(".offer") : null;
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (!item || !step) return;
  const pane = left.contains(item) ? left : form;
  const shown = [...pane.querySelectorAll(".offer")].filter((other) => !other.closest("li")?.hidden);
  shown[shown.indexOf(item) + step]?.focus();
  event.preventDefault();
}

// Drag from a pane to the page.

/** @type {{ item: HTMLElement, id: number, x: number, y: number, ghost: HTMLElement | null } | null} */
let drag = null;

/** @param {PointerEvent} event */
function onDown(event) {
  const item = event.target instanceof Element ? event.target.closest(".offer") : null;
  if (item && event.button === 0) drag = { item, id: event.pointerId, x: event.clientX, y: event.clientY, ghost: null };
}

/** @param {PointerEvent} event */
function onMove(event) {
  if (!drag || event.pointerId !== drag.id) return;
  if (!drag.ghost) {
    if (Math.hypot(event.clientX - drag.x, event.clientY - drag.y) < DRAGGED_PX) return;
    left.setPointerCapture(event.pointerId);
    drag.ghost = document.createElement("div");
    drag.ghost.className = "ghost";
    drag.ghost.textContent = drag.item.querySelector("b")?.textContent ?? "";
    document.body.append(drag.ghost);
  }
  drag.ghost.style.left = `${event.clientX + 12}px`;
  drag.ghost.style.top = `${event.clientY + 12}px`;
  const { x, y } = pointOf(event);
  showMark(isOverPage(event) ? dropOf(drag.item, x, y) : null);
}

// Where an item would come; null for what has no place on a page.
/** @param {HTMLElement} item @param {number} x @param {number} y */
function dropOf(item, x, y) {
  if (item.hasAttribute("data-placeless")) return null;
  return dropOfNew(x, y, item.dataset.kindOf === "group" ? "group" : "widget");
}

/** @param {PointerEvent} event */
function isOverPage(event) {
  const box = overlay.getBoundingClientRect();
  return (
    event.clientX >= box.left && event.clientX <= box.right && event.clientY >= box.top && event.clientY <= box.bottom
  );
}

/** @param {PointerEvent} event */
function onUp(event) {
  if (!drag || event.pointerId !== drag.id) return;
  const { item, ghost } = drag;
  end();
  if (!ghost) return;
  left.addEventListener("click", (click) => click.stopPropagation(), { capture: true, once: true });
  if (!isOverPage(event)) return;
  const { x, y } = pointOf(event);
  const place = placeAt(x, y);
  const room = place?.room ? place.path.slice(0, -1) : null;
  const isRoom = room?.at(-2) === (item.dataset.kindOf === "group" ? "group" : "widget");
  const on = place && !place.room ? place.path : [];
  const target = room && isRoom ? { at: room, span: place?.span ?? 0 } : { at: dropOf(item, x, y)?.to, span: 0 };
  addItem(item, { ...target, on }, { x: event.clientX, y: event.clientY });
}

function end() {
  drag?.ghost?.remove();
  drag = null;
  showMark(null);
}

export function start() {
  left.addEventListener("input", (event) => {
    const field = event.target;
    if (!(field instanceof HTMLInputElement) || field.name !== "find") return;
    sought = field.value;
    filter();
  });
  for (const pane of [left, form]) {
    pane.addEventListener("click", (event) => {
      const item = event.target instanceof Element ? event.target.closest(".offer") : null;
      const box = item?.getBoundingClientRect();
      if (item && box) addItem(item, {}, { x: box.left + 24, y: box.bottom });
    });
  }
  for (const pane of [left, form]) pane.addEventListener("keydown", onKey);
  left.addEventListener("pointerdown", onDown);
  left.addEventListener("pointermove", onMove);
  left.addEventListener("pointerup", onUp);
  left.addEventListener("pointercancel", end);
  ask.addEventListener("keydown", onPickKey);
  onPane((pane) => {
    if (pane !== left) return;
    if (left.dataset.part !== soughtIn) sought = "";
    soughtIn = left.dataset.part ?? "";
    const field = left.querySelector('input[name="find"]');
    if (field instanceof HTMLInputElement) field.value = sought;
    filter();
  });
  setInterval(refresh, VALUES_MS);
}
