// What is selected is changed where it stands: moved, made wider or higher, copied, deleted, by keys and by drag.
import { boxOf, drawRings, placeAt, placeOf, pointOf, putAt, shownPlaces } from "./arrange.js";
import { isAround, isSame, select, selection } from "./selection.js";
import { edit, get, part, pasteText } from "./wire.js";

/** @typedef {import("./wire.js").Path} Path */
/** @typedef {import("./arrange.js").Place} Place */
/** @typedef {import("./arrange.js").Box} Box */
/** @typedef {{ to: Path, mark: Box, isUpright: boolean }} Drop */

const DRAGGED_PX = 5;
const MARK_PX = 4;
const WIDE = 0.6; // of its group: such a widget is alone in its row

const overlay = /** @type {HTMLElement} */ (document.getElementById("overlay"));
const left = /** @type {HTMLElement} */ (document.getElementById("left"));
const ask = /** @type {HTMLDialogElement} */ (document.getElementById("ask"));

/** @param {Path} path */
const numberOf = (path) => Number(path.at(-1));
/** @param {Path} path @param {number} number @returns {Path} */
const beside = (path, number) => [...path.slice(0, -1), number];
/** @param {Path | null} path @returns {path is Path} */
const isListed = (path) => typeof path?.at(-1) === "number";

/** @param {Path} path */
const siblings = (path) =>
  shownPlaces().filter((place) => place.path.length === path.length && isAround(path.slice(0, -1), place.path));

/** @param {Parameters<typeof edit>[0]} edits */
async function change(edits) {
  const answer = await edit(edits);
  if (answer?.select) select(tableOf(answer.select), "edit");
}

// The table that a path is in, if it is that of a key.
/** @param {Path} path @returns {Path} */
function tableOf(path) {
  const last = path.findLastIndex((step) => typeof step === "number");
  return last < 0 ? path : path.slice(0, last + 1);
}

// One place further, or into the list beside at its end.
/** @param {Path} path @param {number} step */
function move(path, step) {
  const number = numberOf(path) + step;
  const last = siblings(path).length - 1;
  if (path.at(-2) === "widget" && path.includes("group") && (number < 0 || number > last)) {
    const group = path.slice(0, -2);
    const next = placeOf(beside(group, numberOf(group) + step));
    if (!next) return;
    const end = shownPlaces().filter((place) => place.path.length === path.length && isAround(next.path, place.path));
    change([{ op: "move", path, to: [...next.path, "widget", step > 0 ? 0 : end.length] }]);
  } else if (number >= 0 && number <= last) change([{ op: "move", path, to: beside(path, number) }]);
}

/** @param {Place} place @param {number} columns @param {number} rows */
function resize(place, columns, rows) {
  if (!place.size) return;
  const span = Math.max(1, Math.min(place.size.columns, place.size.span + columns));
  const high = Math.max(1, place.size.rows + rows);
  setSize(place, span, high);
}

/** @param {Place} place @param {number} span @param {number} rows */
function setSize({ path, size }, span, rows) {
  const edits = [];
  if (span !== size?.span) edits.push({ op: "set", path: [...path, "span"], value: span });
  if (rows !== size?.rows && path.at(-2) === "widget") edits.push({ op: "set", path: [...path, "rows"], value: rows });
  if (edits.length) change(edits);
}

// Asks first if other tables name what is deleted.
/** @param {Path} path */
async function remove(path) {
  const html = await part("delete", { path: JSON.stringify(path) });
  if (html === null) return;
  if (!html.trim()) {
    doRemove(path);
    return;
  }
  ask.innerHTML = html;
  ask.returnValue = "";
  ask.showModal();
  ask.onclose = () => {
    if (ask.returnValue === "yes") doRemove(path);
    overlay.focus();
  };
}

/** @param {Path} path */
async function doRemove(path) {
  const next = siblings(path).find((place) => numberOf(place.path) === numberOf(path) + 1);
  const answer = await edit([{ op: "delete", path }]);
  if (!answer) return;
  const place = next ? path : path.slice(0, -2);
  select(place.length ? place : null, "edit");
}

/** @param {Path} path */
async function copy(path) {
  const response = await get(`/text?path=${encodeURIComponent(JSON.stringify(path))}`);
  if (response) await navigator.clipboard.writeText(await response.text());
}

// What is pasted comes after what is selected, or at the end of it.
/** @param {string} text */
async function paste(text) {
  const shown = shownPlaces().find((place) => place.selector === "main");
  const answer = await pasteText(selection() ?? shown?.path ?? [], text);
  if (answer?.select) select(tableOf(answer.select), "edit");
}

/** @param {KeyboardEvent} event @param {Path | null} path */
function onKey(event, path) {
  const place = placeOf(path);
  if (!path || !isListed(path)) return;
  const isCommand = event.ctrlKey || event.metaKey;
  const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
  if (event.altKey && step) move(path, step);
  else if (event.shiftKey && step && place) {
    if (event.key === "ArrowLeft" || event.key === "ArrowRight") resize(place, step, 0);
    else resize(place, 0, step);
  } else if (event.key === "Delete" || event.key === "Backspace") remove(path);
  else if (isCommand && event.key.toLowerCase() === "d")
    change([{ op: "duplicate", path, to: beside(path, numberOf(path) + 1) }]);
  else if (isCommand && event.key.toLowerCase() === "c" && !String(getSelection())) copy(path);
  else if (isCommand && event.key.toLowerCase() === "x") copy(path).then(() => remove(path));
  else return;
  event.preventDefault();
}

// Drag.

/** @type {{ place: Place, x: number, y: number, id: number, isResizing: boolean, isMoved: boolean } | null} */
let drag = null;
/** @type {Drop | null} */
let drop = null;
/** @type {{ span: number, rows: number } | null} */
let size = null;

/** @param {PointerEvent} event */
function onDown(event) {
  const { x, y } = pointOf(event);
  const isHandle = event.target instanceof Element && event.target.matches(".ring.chosen i");
  const place = isHandle ? placeOf(selection()) : placeAt(x, y);
  if (event.button === 0 && place?.size && isListed(place.path))
    drag = { place, x, y, id: event.pointerId, isResizing: isHandle, isMoved: false };
}

/** @param {PointerEvent} event */
function onMove(event) {
  if (!drag || event.pointerId !== drag.id) return;
  const { x, y } = pointOf(event);
  if (!drag.isMoved && Math.hypot(x - drag.x, y - drag.y) < DRAGGED_PX) return;
  if (!drag.isMoved) overlay.setPointerCapture(event.pointerId);
  drag.isMoved = true;
  if (drag.isResizing) showSize(drag.place, x, y);
  else showDrop(drag.place, x, y);
}

/** @param {Place} place @param {number} x @param {number} y */
function showSize(place, x, y) {
  const box = boxOf(place);
  if (!box || !place.size) return;
  const column = box.width / place.size.span;
  const row = box.height / place.size.rows;
  size = {
    span: Math.max(1, Math.min(place.size.columns, Math.round((x - box.left) / column))),
    rows: place.path.at(-2) === "widget" ? Math.max(1, Math.round((y - box.top) / row)) : 1,
  };
  const ring = overlay.querySelector(".ring.chosen");
  if (ring instanceof HTMLElement) putAt(ring, { ...box, width: column * size.span, height: row * size.rows });
}

/** @param {Place} moved @param {number} x @param {number} y */
function showDrop(moved, x, y) {
  drop = dropAt(moved, x, y);
  showMark(drop);
}

// Shows where something would come; nothing with null.
/** @param {Drop | null} drop */
export function showMark(drop) {
  overlay.querySelector(".drop")?.remove();
  if (!drop) return;
  const mark = document.createElement("div");
  mark.className = `drop${drop.isUpright ? " upright" : ""}`;
  putAt(mark, drop.mark);
  overlay.append(mark);
}

// Where a new widget or group would come if it was let go at a point; null where the page has no widget or group.
/** @param {number} x @param {number} y @param {"group" | "widget"} kind */
export function dropOfNew(x, y, kind) {
  const page = shownPlaces().find(({ selector }) => selector === "main")?.path ?? [];
  return dropAt({ path: [...page, kind, Infinity], selector: "", tag: "", size: null }, x, y);
}

// Where a table would come if it was let go at a point.
/** @param {Place} moved @param {number} x @param {number} y @returns {Drop | null} */
function dropAt(moved, x, y) {
  const kind = moved.path.at(-2);
  const around = shownPlaces().findLast((place) => {
    const box = boxOf(place);
    return box && kind !== "group" && place.path.at(-2) === "group" && isInside(box, x, y);
  });
  const list = kind === "group" ? siblings(moved.path) : inList(around, moved);
  const outer = around && boxOf(around);
  const nearest = closest(list, x, y);
  const path = around ? [...around.path, "widget"] : moved.path.slice(0, -1);
  if (kind === "widget" && !around && moved.path.includes("group")) return null;
  if (!nearest) {
    if (!outer) return null;
    return { to: [...path, 0], mark: { ...outer, top: outer.top + 40, height: MARK_PX }, isUpright: false };
  }
  const { place, box } = nearest;
  const isUpright = kind === "group" || (outer ? box.width < outer.width * WIDE : false);
  const isAfter = isUpright ? x > box.left + box.width / 2 : y > box.top + box.height / 2;
  let number = numberOf(place.path) + (isAfter ? 1 : 0);
  const isSameList = isSame(place.path.slice(0, -1), moved.path.slice(0, -1));
  if (isSameList && number > numberOf(moved.path)) number -= 1;
  const mark = isUpright
    ? { left: box.left + (isAfter ? box.width : -MARK_PX), top: box.top, width: MARK_PX, height: box.height }
    : { left: box.left, top: box.top + (isAfter ? box.height : -MARK_PX), width: box.width, height: MARK_PX };
  return { to: [...place.path.slice(0, -1), number], mark, isUpright };
}

/** @param {Place | undefined} around @param {Place} moved */
function inList(around, moved) {
  if (!around) return siblings(moved.path);
  return shownPlaces().filter(
    ({ path }) => path.length === around.path.length + 2 && isAround(around.path, path) && path.at(-2) === "widget",
  );
}

/** @param {Place[]} list @param {number} x @param {number} y */
function closest(list, x, y) {
  const boxes = list.flatMap((place) => {
    const box = boxOf(place);
    return box ? [{ place, box, far: distance(box, x, y) }] : [];
  });
  return boxes.sort((nearer, other) => nearer.far - other.far)[0];
}

/** @param {Box} box @param {number} x @param {number} y */
function distance(box, x, y) {
  const across = Math.max(box.left - x, 0, x - box.left - box.width);
  const down = Math.max(box.top - y, 0, y - box.top - box.height);
  return Math.hypot(across, down);
}

/** @param {Box} box @param {number} x @param {number} y */
function isInside(box, x, y) {
  return distance(box, x, y) === 0;
}

/** @param {PointerEvent} event */
function onUp(event) {
  if (!drag || event.pointerId !== drag.id) return;
  const { place, isMoved, isResizing } = drag;
  if (isMoved && isResizing && size) setSize(place, size.span, size.rows);
  else if (isMoved && drop && !isSame(drop.to, place.path)) change([{ op: "move", path: place.path, to: drop.to }]);
  end();
}

function end() {
  drag = null;
  drop = null;
  size = null;
  overlay.querySelector(".drop")?.remove();
  drawRings();
}

export function start() {
  overlay.addEventListener("keydown", (event) => onKey(event, selection()));
  left.addEventListener("keydown", (event) => {
    const line = event.target instanceof Element ? event.target.closest(".tr") : null;
    if (line?.dataset.path) onKey(event, JSON.parse(line.dataset.path));
  });
  overlay.addEventListener("pointerdown", onDown);
  overlay.addEventListener("pointermove", onMove);
  overlay.addEventListener("pointerup", onUp);
  overlay.addEventListener("pointercancel", end);
  document.addEventListener("paste", (event) => {
    const text = event.clipboardData?.getData("text/plain");
    const inText = event.target instanceof HTMLInputElement || event.target instanceof HTMLTextAreaElement;
    if (inText || !text) return;
    event.preventDefault();
    paste(text);
  });
}
