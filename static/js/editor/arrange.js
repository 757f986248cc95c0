// Arrange: the overlay on the preview takes pointer and keyboard, and selects what the page shows.
import { onDrawn, shownDocument, shownPage, shownScale, showPage } from "./preview.js";
import { isAround, isSame, onSelect, select, selection } from "./selection.js";
import { get, onState, state } from "./wire.js";

/** @typedef {import("./wire.js").Path} Path */
/** @typedef {{ span: number, rows: number, columns: number }} Size */
/** @typedef {{ path: Path, selector: string, tag: string, size: Size | null }} Place */
/** @typedef {{ left: number, top: number, width: number, height: number }} Box */

const TAG_ROOM = 34; // px that a name tag needs below a ring

const overlay = /** @type {HTMLElement} */ (document.getElementById("overlay"));
const spoken = /** @type {HTMLElement} */ (document.getElementById("selected"));

/** @type {Place[]} */
let places = [];
/** @type {{ path: Path, message: string }[]} */
let faulty = [];
let asked = 0;

export const shownPlaces = () => places;

// Where a part of the page is, in px of the overlay; null if the page does not show it.
/** @param {Place} place @returns {Box | null} */
export function boxOf(place) {
  const element = shownDocument()?.querySelector(place.selector);
  const box = element?.getBoundingClientRect();
  if (!box?.width || !box.height) return null;
  const scale = shownScale();
  return { left: box.left * scale, top: box.top * scale, width: box.width * scale, height: box.height * scale };
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
  ({ places, faulty } = answer);
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
  for (const ring of overlay.querySelectorAll(".ring:not(.hover)")) ring.remove();
  for (const { path, message } of faulty) addRing(placeOf(path), message, "faulty");
  for (const other of state.others) addRing(placeOf(other.path), other.tag, "other");
  const place = places.find(({ path, selector }) => selector === reached && isSame(path, selection()));
  const chosen = place ?? placeOf(selection());
  if (chosen) addRing(chosen, chosen.tag, "chosen");
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
  if (box.left + box.width > clientWidth || box.left < clientWidth / 4) ring.classList.add("start");
  if (kind === "chosen") for (let number = 0; number < 4; number += 1) ring.append(document.createElement("i"));
  overlay.append(ring);
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
  const outer = places.filter((place) => place.path.length < path.length && isAround(place.path, path));
  choose(outer.at(-1));
}

function enterForm() {
  const field = document.querySelector("#form input, #form select, #form textarea, #form .form button");
  if (field instanceof HTMLElement) field.focus();
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
    if (event.button !== 0) return;
    const { x, y } = pointOf(event);
    choose(placeAt(x, y));
  });
  overlay.addEventListener("dblclick", enterForm);
  onDrawn(() => {
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
