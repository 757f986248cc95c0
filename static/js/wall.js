// A wall of cells: puts in place what the server has drawn again of the cells in view, once a second.
import { updateInPlace } from "./in-place.js";
import { find } from "./show.js";

const SETTLED_MS = 250; // after scrolling
const REDRAWN_MS = 2000; // between two drawings of the whole page, when cells come or go

/** @typedef {{ tiles?: Record<string, string>, parts?: Record<string, string>, ages?: Record<string, string>, order?: number }} Cells */

const main = find(document, "main[data-events]");
/** @type {Set<Element>} */
const seen = new Set();
/** @type {EventSource | null} */
let stream = null;
let range = "";
let timer = 0;
let redrawing = 0;

const observer = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    if (isIntersecting) seen.add(target);
    else seen.delete(target);
  }
  clearTimeout(timer);
  timer = setTimeout(follow, stream ? SETTLED_MS : 0);
});

function observe() {
  observer.disconnect();
  seen.clear();
  const tiles = main.querySelectorAll(".wall-tiles > a");
  for (const tile of tiles) observer.observe(tile);
  if (!tiles.length) follow();
}

// The events of the cells that are seen now.
function follow() {
  if (document.hidden) return close();
  const tiles = [...seen].sort((one, other) => (one.compareDocumentPosition(other) & 2 ? 1 : -1));
  const [first, last] = [tiles[0], tiles.at(-1)].map((tile) => tile?.getAttribute("data-row") ?? "");
  const wanted = `&first=${first}&last=${last}`;
  if (stream && stream.readyState !== EventSource.CLOSED && wanted === range) return;
  close();
  range = wanted;
  stream = new EventSource(main.dataset.events + wanted);
  stream.addEventListener("cells", ({ data }) => show(JSON.parse(data)));
  stream.onerror = () => {
    if (stream?.readyState === EventSource.CLOSED) timer = setTimeout(follow, REDRAWN_MS);
  };
}

function close() {
  stream?.close();
  stream = null;
}

/** @param {Cells} cells */
function show({ tiles = {}, parts = {}, ages = {}, order }) {
  for (const [id, html] of Object.entries(tiles)) put(main.querySelector(`a[data-row="${id}"]`), html);
  for (const [id, html] of Object.entries(parts)) put(document.getElementById(id), html);
  // What was drawn again has no age, or an old one.
  for (const [id, age] of Object.entries(ages)) known.set(id, age);
  for (const row of main.querySelectorAll("[data-row]")) {
    const age = known.get(row.getAttribute("data-row") ?? "");
    const element = age === undefined ? null : row.querySelector(":scope > i, .age");
    if (element && element.textContent !== age) element.textContent = age ?? "";
  }
  if (order !== undefined && String(order) !== main.dataset.order) redrawLater();
}
/** @type {Map<string, string>} */
const known = new Map();

/** @param {Element | null} old @param {string} html */
function put(old, html) {
  const fresh = drawn(html).body.firstElementChild;
  if (!old || !fresh) return;
  for (const { name, value } of fresh.attributes) if (old.getAttribute(name) !== value) old.setAttribute(name, value);
  for (const { name } of [...old.attributes]) if (!fresh.hasAttribute(name)) old.removeAttribute(name);
  updateInPlace(old, fresh);
}

/** @param {string} html */
const drawn = (html) => new DOMParser().parseFromString(html, "text/html");

// Cells have come or gone: the page is fetched again, and put in place.
function redrawLater() {
  if (redrawing) return;
  redrawing = setTimeout(async () => {
    try {
      const answer = await fetch(location.href, { headers: { accept: "text/html" } });
      const fresh = answer.ok && drawn(await answer.text()).querySelector("main[data-events]");
      if (fresh) {
        main.dataset.order = fresh.dataset.order;
        updateInPlace(find(main, ".wall-sites"), find(fresh, ".wall-sites"));
        observe();
      }
    } catch {
      // the page itself shows that the server is lost; the next event says it again
    }
    redrawing = 0;
  }, REDRAWN_MS);
}

document.addEventListener("visibilitychange", follow);
addEventListener("pagehide", close);
observe();
