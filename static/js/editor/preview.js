// The preview: the panel's own page in a frame of a chosen size. After an edit it is drawn again at once from what the
// server renders; when the sessions of the edited panel run, the frame is replaced by a live one.
import { redraw } from "./redraw.js";
import { get, onState, part, state } from "./wire.js";

const ROOT = "/preview";
const COOKIE_S = 365 * 86_400;
// Pages are below the path of their robot, if the panel has several.
const PAGE = /^(\/preview(?:\/robots\/[^/]+)?)(?:\/pages\/([^/?]+))?/;

const view = /** @type {HTMLElement} */ (document.getElementById("view"));
const frames = /** @type {HTMLElement} */ (document.getElementById("frames"));
const overlay = /** @type {HTMLElement} */ (document.getElementById("overlay"));
const scaleText = /** @type {HTMLElement} */ (document.getElementById("scale"));

/** @type {HTMLIFrameElement | null} */
let frame = null;
/** @type {HTMLIFrameElement | null} */
let coming = null;
/** @type {Document | null} */
let markup = null; // what the page in the frame was made from
let page = "";
let base = ROOT;
let drawn = 0; // the number of the panel that the frame shows
let live = 0; // the number of the panel whose sessions the frame's scripts read
let size = { width: 1280, height: 800 };
let scale = 1;
/** @type {(() => void)[]} */
const listeners = [];

export const shownPage = () => page;
export const shownDocument = () => frame?.contentDocument ?? null;
export const shownScale = () => scale;

// Called when the page was drawn, or its size or place is another one.
/** @param {() => void} listener */
export function onDrawn(listener) {
  listeners.push(listener);
}

function tell() {
  for (const listener of listeners) listener();
}

/** @param {string} name */
export function showPage(name) {
  if (name === page) return;
  page = name;
  load();
}

// In the frame as a browser of the panel would have it: by its cookie.
/** @param {string} name @param {string} value */
export function setChoice(name, value) {
  // biome-ignore lint/suspicious/noDocumentCookie: the panel reads it from the next request
  document.cookie = `kiosk_${name}=${value}; path=${ROOT}; max-age=${COOKIE_S}; samesite=strict`;
  load();
}

/** @param {number} width @param {number} height */
export function setSize(width, height) {
  size = { width, height };
  fit();
}

function fit() {
  scale = Math.min(1, view.clientWidth / size.width, view.clientHeight / size.height);
  frames.style.width = `${size.width}px`;
  frames.style.height = `${size.height}px`;
  frames.style.transform = `scale(${scale})`;
  overlay.style.width = `${Math.round(size.width * scale)}px`;
  overlay.style.height = `${Math.round(size.height * scale)}px`;
  scaleText.textContent = `${Math.round(scale * 100)} %`;
  tell();
}

/** @param {string} [query] */
const address = (query = "") => `${base}/${page ? `pages/${page}` : ""}${query}`;

// Loads the page in a new frame, which takes the place of the old one when it is there.
function load() {
  coming?.remove();
  const made = document.createElement("iframe");
  const number = state.live;
  made.title = frames.dataset.title ?? "";
  made.className = "coming";
  made.tabIndex = -1;
  made.addEventListener("load", () => loaded(made, number));
  made.src = address();
  frames.append(made);
  coming = made;
}

/** @type {string[]} */
let names = []; // the ids of the pages in their order

// The panel has the page no longer, or by another id: then that is the only one which is new.
async function loadAnother() {
  const known = await pageNames();
  const renamed = known.length === names.length ? known.filter((name) => !names.includes(name)) : [];
  page = renamed.length === 1 && names.indexOf(page) === known.indexOf(renamed[0]) ? renamed[0] : "";
  names = known;
  if (!page) base = ROOT;
  load();
}

async function pageNames() {
  const made = document.createElement("div");
  made.innerHTML = (await part("pages", {})) ?? "";
  return [...made.querySelectorAll("[data-page]")].map((key) => key.getAttribute("data-page") ?? "");
}

/** @param {HTMLIFrameElement} made @param {number} number */
async function loaded(made, number) {
  const shown = made.contentDocument;
  const [, around = base, name] = PAGE.exec(made.contentWindow?.location.pathname ?? "") ?? [];
  if (!shown || (made !== coming && made !== frame)) return;
  base = around;
  if (name) page = name;
  if (!page) page = shown.querySelector('input[name="_page"]')?.getAttribute("value") ?? "";
  // What its scripts have changed since it came is not what an edit changes.
  const before = await rendered("");
  const now = state.drawn;
  const after = number < now ? await rendered(`?drawn=${now}`) : null;
  if (shown !== made.contentDocument || (made !== coming && made !== frame)) return;
  if (!before && !after && page && made === coming) {
    loadAnother();
    return;
  }
  if (before && after) redraw(shown, before, after);
  if (made === coming) {
    frame?.remove();
    frame = made;
    coming = null;
    made.classList.remove("coming");
    live = number;
    frames.dataset.live = String(live);
  }
  markup = after ?? before;
  pageNames().then((known) => {
    names = known;
  });
  showDrawn(after ? now : number);
  if (drawn < state.drawn) await draw();
  if (state.live > live && !coming) load();
}

/** @param {string} query */
async function rendered(query) {
  const response = await get(address(query));
  if (!response) return null;
  return new DOMParser().parseFromString(await response.text(), "text/html");
}

/** @param {number} number */
function showDrawn(number) {
  drawn = number;
  frames.dataset.drawn = String(number);
  tell();
}

// Draws the page from the newest panel.
async function draw() {
  const wanted = state.drawn;
  const shown = frame?.contentDocument;
  if (!frame || !shown || !page || !markup) return;
  const before = markup;
  const after = await rendered(`?drawn=${wanted}`);
  if (wanted < drawn || shown !== frame?.contentDocument || before !== markup) return;
  if (!after) {
    loadAnother();
    return;
  }
  redraw(shown, before, after);
  markup = after;
  showDrawn(wanted);
  if (drawn < state.drawn) await draw();
}

export function start() {
  new ResizeObserver(fit).observe(view);
  onState((now) => {
    if (!frame && !coming) {
      if (now.drawn) load();
      return;
    }
    if (now.drawn > drawn) draw();
    if (now.live > live && !coming) load();
  });
}
