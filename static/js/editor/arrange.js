// Arrange: the overlay on the preview takes pointer and keyboard, and selects what the page shows.
import { enterForm } from "./panes.js";
import { onDrawn, shownDocument, shownPage, shownScale, showPage } from "./preview.js";
import { isAround, isSame, onSelect, select, selection } from "./selection.js";
import { get, onState, state } from "./wire.js";

/** @typedef {import("./wire.js").Path} Path */
/** @typedef {{ span: number, rows: number, columns: number }} Size */
/** @typedef {{ left: number, top: number, width: number, height: number }} Box */
/**
 * @typedef {object} Place
 * @property {Path} path
 * @property {string} selector
 * @property {string} tag
 * @property {Size | null} size
 * @property {string[] | null} [beside] Of an empty place: the parts of the element that leave room.
 * @property {Box} [room] Of an empty place.
 * @property {number} [span] Of an empty place: the columns that it has, 0 for the whole width.
 */

const TAG_ROOM = 39; // px that a name tag needs below a ring

const overlay = /** @type {HTMLElement} */ (document.getElementById("overlay"));
const spoken = /** @type {HTMLElement} */ (document.getElementById("selected"));

const LEAST_ROOM = 24; // px of an empty place that can be selected

/** @type {Place[]} */
let places = [];
/** @type {Place[]} */
let known = []; // as the server has them: empty places are not measured yet
/** @type {{ path: Path, message: string }[]} */
let faulty = [];
let asked = 0;

export const shownPlaces = () => places;

// Where a part of the page is, in px of the overlay; null if the page does not show it.
/** @param {Place} place @returns {Box | null} */
export const boxOf = (place) => place.room ?? boxAt(place.selector);

/** @param {string} selector @returns {Box | null} */
function boxAt(selector) {
  const element = shownDocument()?.querySelector(selector);
  const box = element?.getBoundingClientRect();
  if (!box?.width || !box.height) return null;
  const scale = shownScale();
  return { left: box.left * scale, top: box.top * scale, width: box.width * scale, height: box.height * scale };
}

// The room that parts leave in the element around them: to the right of each row, and below the last.
/** @param {Place} place @returns {Place[]} */
function roomsIn(place) {
  const outer = boxAt(place.selector);
  const boxes = (place.beside ?? []).map(boxAt);
  if (!outer || boxes.some((box) => !box)) return [];
  const step = Number(place.path.at(-2)) - boxes.length;
  /** @param {number} number @param {Box} room */
  const made = (number, room) => ({
    ...place,
    span: columnsOf(place, room),
    path: [...place.path.slice(0, -2), Math.max(0, step + number), "+"],
    selector: `${place.selector} +${number}`,
    tag: overlay.dataset.empty ?? "",
    room,
  });
  if (!boxes.length) return [made(0, outer)];
  const rooms = [];
  const inset = Math.max(0, (boxes[0]?.left ?? 0) - outer.left);
  const right = outer.left + outer.width - inset;
  let row = { left: outer.left + inset, top: 0, bottom: 0 };
  for (const [number, box] of boxes.entries()) {
    if (!box) continue;
    row = {
      left: Math.max(box.top >= row.bottom - 1 ? 0 : row.left, box.left + box.width + inset / 2),
      top: box.top >= row.bottom - 1 ? box.top : row.top,
      bottom: Math.max(row.bottom, box.top + box.height),
    };
    const next = boxes[number + 1];
    if (!next || next.top >= row.bottom - 1)
      rooms.push(
        made(number + 1, { left: row.left, top: row.top, width: right - row.left, height: row.bottom - row.top }),
      );
  }
  for (const box of boxes) {
    if (!box) continue;
    const room = roomBelow(box, boxes, inset / 2);
    rooms.push(made(boxes.findLastIndex((other) => other && isBefore(other, room, inset)) + 1, room));
  }
  const below = row.bottom + inset / 2;
  const left = outer.left + inset;
  rooms.push(
    made(boxes.length, { left, top: below, width: right - left, height: outer.top + outer.height - below - inset / 2 }),
  );
  return rooms.filter(({ room }) => room.width >= LEAST_ROOM && room.height >= LEAST_ROOM);
}

// Whether a part comes before a room, row by row.
/** @param {Box} box @param {Box} room @param {number} near */
const isBefore = (box, room, near) => box.top < room.top - near || (box.top <= room.top + near && box.left < room.left);

// The columns of a room, by those of a part beside it; 0 where it has all of them.
/** @param {Place} place @param {Box} room */
function columnsOf(place, room) {
  const [selector = ""] = place.beside ?? [];
  const size = known.find((other) => other.selector === selector)?.size;
  const box = size && boxAt(selector);
  if (!box || place.path.at(-3) !== "widget") return 0;
  const columns = Math.max(1, Math.round((room.width * size.span) / box.width));
  return columns < size.columns ? columns : 0;
}

// The room between a part and the end of its row, beside a higher part.
/** @param {Box} box @param {(Box | null)[]} boxes @param {number} gap @returns {Box} */
function roomBelow(box, boxes, gap) {
  const bottom = box.top + box.height;
  let end = bottom;
  let next = Infinity; // the top of what is below it
  for (const other of boxes) {
    if (!other || other === box) continue;
    const isBelow = other.left < box.left + box.width - 1 && other.left + other.width > box.left + 1;
    if (isBelow && other.top >= bottom - 1) next = Math.min(next, other.top - gap);
    else if (other.top < bottom - 1) end = Math.max(end, other.top + other.height);
  }
  const top = bottom + gap;
  return { left: box.left, top, width: box.width, height: Math.min(end, next) - top };
}

// Where a new table comes if an empty place is selected, and its width.
export function emptyPlace() {
  const path = selection();
  return path?.at(-1) === "+" ? { at: path.slice(0, -1), span: placeOf(path)?.span ?? 0 } : {};
}

function measure() {
  places = known.flatMap((place) => (place.beside ? roomsIn(place) : [place]));
}

/** @param {Path | null} path */
export const placeOf = (path) => (path ? places.findLast((place) => isSame(place.path, path)) : undefined);

// The innermost part at a point of the overlay.
/** @param {number} x @param {number} y */
export function placeAt(x, y) {
  return places.findLast((place) => {
    const box = boxOf(place);
    return box && x >= box.left && x <= box.left + box.width && y >= box.top && y <= box.top + box.height;
  });
}

// The point of a pointer event, in px of the overlay.
/** @param {MouseEvent} event */
export function pointOf(event) {
  const box = overlay.getBoundingClientRect();
  return { x: event.clientX - box.left, y: event.clientY - box.top };
}

async function askPlaces() {
  const turn = ++asked;
  const response = await get(`/places?page=${encodeURIComponent(shownPage())}`);
  if (!response || turn !== asked) return;
  const answer = await response.json();
  ({ places: known, faulty } = answer);
  measure();
  markSizes(answer.fits);
  drawRings();
}

// Which screens the page fits, and why not the others; of those that are none of the panel's nothing is known.
/** @param {Record<string, string>} fits */
function markSizes(fits) {
  for (const button of document.querySelectorAll("[data-size]")) {
    const why = fits[button.dataset.size ?? ""];
    button.dataset.fits = why === undefined ? "" : why ? "no" : "yes";
    button.title = why ?? "";
    const mark = button.querySelector("small");
    if (mark) mark.textContent = why ?? "";
  }
}

export function drawRings() {
  for (const ring of overlay.querySelectorAll(".ring:not(.hover), .room")) ring.remove();
  for (const { room, beside } of places) if (room && !beside?.length) addRoom(room);
  for (const { path, message } of faulty) addRing(placeOf(path), message, "faulty");
  for (const { path, person, tag } of state.others) addRing(placeOf(path), person ? `${person}: ${tag}` : tag, "other");
  const place = places.find(({ path, selector }) => selector === reached && isSame(path, selection()));
  const chosen = place ?? placeOf(selection());
  if (chosen) addRing(chosen, chosen.tag, "chosen");
}

// A page or a group without anything says what to do.
/** @param {Box} box */
function addRoom(box) {
  const room = document.createElement("div");
  room.className = "room";
  room.textContent = overlay.dataset.fill ?? "";
  putAt(room, box);
  overlay.prepend(room);
}

/** @param {Place | undefined} place @param {string} tag @param {string} kind */
function addRing(place, tag, kind) {
  const box = place && boxOf(place);
  if (!box) return;
  const ring = document.createElement("div");
  ring.className = `ring ${kind}`;
  putAt(ring, box);
  const label = document.createElement("span");
  label.className = "tag";
  label.textContent = tag;
  ring.append(label);
  const { clientHeight, clientWidth } = overlay;
  if (box.top + box.height + TAG_ROOM > clientHeight) ring.classList.add(box.top > TAG_ROOM ? "above" : "inside");
  if (kind === "chosen") for (let number = 0; number < 4; number += 1) ring.append(document.createElement("i"));
  overlay.append(ring);
  const right = box.left + box.width;
  if (right > clientWidth || right < label.offsetWidth) ring.classList.add("start");
}

/** @param {HTMLElement} element @param {Box} box */
export function putAt(element, box) {
  for (const side of /** @type {const} */ (["left", "top", "width", "height"])) element.style[side] = `${box[side]}px`;
}

/** @param {Place | undefined} place */
function hover(place) {
  overlay.querySelector(".ring.hover")?.remove();
  const box = place && !isSame(place.path, selection()) ? boxOf(place) : null;
  if (!box) return;
  const ring = document.createElement("div");
  ring.className = "ring hover";
  putAt(ring, box);
  overlay.append(ring);
}

/** @param {KeyboardEvent} event */
function onKey(event) {
  if (event.altKey || event.ctrlKey || event.metaKey || event.shiftKey) return;
  const shown = places.filter(boxOf);
  const isKept = shown.some((place) => place.selector === reached) && isSame(reachedPath, selection());
  const number = shown.findLastIndex(({ selector, path }) =>
    isKept ? selector === reached : isSame(path, selection()),
  );
  const steps = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };
  const step = steps[/** @type {keyof typeof steps} */ (event.key)];
  if (step)
    choose(shown[(number < 0 ? (step > 0 ? 0 : -1) : number + step + shown.length) % shown.length] ?? shown.at(-1));
  else if (event.key === "Home") choose(shown[0]);
  else if (event.key === "End") choose(shown.at(-1));
  else if (event.key === "Escape") chooseAround();
  else if (event.key === "Enter") enterForm();
  else return;
  event.preventDefault();
}

// The part that was reached by keys or pointer: several may be of one table, such as a page and its tab.
let reached = "";
/** @type {Path | null} */
let reachedPath = null;

/** @param {Place | undefined} place */
function choose(place) {
  if (!place) return;
  reached = place.selector;
  reachedPath = place.path;
  if (isSame(place.path, selection())) drawRings();
  select(place.path, "preview");
}

function chooseAround() {
  const path = selection();
  if (!path) return;
  const inner = path.at(-1) === "+" ? path.slice(0, -3) : path.slice(0, -1);
  const outer = places.filter((place) => isAround(place.path, inner));
  choose(outer.at(-1));
}

// A selected table that is on another page brings that page.
/** @param {Path | null} path */
function showPageOf(path) {
  if (path?.[0] !== "page" || placeOf(path.slice(0, 2))?.selector === "main") return;
  const tab = places.find((place) => isSame(place.path, path.slice(0, 2)));
  const name = /pages\/([^"]+)"/.exec(tab?.selector ?? "")?.[1];
  const isShown = places.some((place) => place.selector === "main" && isSame(place.path, path.slice(0, 2)));
  if (name && !isShown) showPage(name);
}

export function start() {
  overlay.addEventListener("keydown", onKey);
  overlay.addEventListener("pointermove", (event) => {
    const { x, y } = pointOf(event);
    if (!event.buttons) hover(placeAt(x, y));
  });
  overlay.addEventListener("pointerleave", () => hover(undefined));
  overlay.addEventListener("pointerdown", (event) => {
    const isHandle = event.target instanceof Element && event.target.matches(".ring.chosen i");
    if (event.button !== 0 || isHandle) return;
    const { x, y } = pointOf(event);
    choose(placeAt(x, y));
  });
  overlay.addEventListener("dblclick", enterForm);
  onDrawn(() => {
    measure();
    drawRings();
    askPlaces();
  });
  onState((now, before) => {
    const isDrawn = now.drawn !== before.drawn; // then they are asked for when the page is there
    if (!isDrawn && (now.revision !== before.revision || now.faults !== before.faults)) askPlaces();
    else drawRings();
  });
  onSelect((path, from) => {
    hover(undefined);
    if (from !== "preview") showPageOf(path);
    drawRings();
    spoken.textContent = placeOf(path)?.tag ?? "";
  });
}
