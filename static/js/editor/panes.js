// The panes beside and below the preview: fragments of the server, put into the page as they come.
import { isSame, onSelect, select, selection } from "./selection.js";
import { Form } from "./form.js";
import { onDrawn } from "./preview.js";
import { onState, part, state, tryEdit, upload } from "./wire.js";

/** @typedef {import("./wire.js").Path} Path */

const left = /** @type {HTMLElement} */ (document.getElementById("left"));
const form = /** @type {HTMLElement} */ (document.getElementById("form"));
const faults = /** @type {HTMLElement} */ (document.getElementById("faults"));
const diff = /** @type {HTMLElement} */ (document.getElementById("diff"));

const shown = new Form(form, {
  post: tryEdit,
  load: (query) => part("form", query),
  select: (path) => select(path, "form"),
  upload,
});

// On a narrow screen the panes beside the preview share one place; on a small one those below come when they are asked
// for. Wide screens show all of them.
const NARROW = "(max-width: 1200px)"; // as in editor.css

/** @param {string} name "left", "form", or "" for none */
function showSide(name) {
  document.body.dataset.side = name;
  markSides();
}

/** @param {string} name */
function toggleSide(name) {
  if (name === "foot") document.body.toggleAttribute("data-foot");
  else showSide(document.body.dataset.side === name ? "" : name);
  markSides();
}

function markSides() {
  const { side, foot } = document.body.dataset;
  for (const button of document.querySelectorAll("[data-side-of]")) {
    const name = button.getAttribute("data-side-of");
    button.setAttribute("aria-pressed", String(name === "foot" ? foot !== undefined : name === side));
  }
}

// Shows the form, with the focus in the field that is filled in first.
export function fillIn() {
  showSide("form");
  return shown.focusNeeded();
}

// Shows the form, with the focus in its first field.
export function enterForm() {
  showSide("form");
  const field = document.querySelector("#form input, #form select, #form textarea, #form .form button");
  if (field instanceof HTMLElement) field.focus();
}

// The form takes the place of the lists, unless they have the focus. One that was closed stays closed.
/** @param {string} from */
function showSelected(from) {
  const isInLists = left.contains(document.activeElement);
  if (document.body.dataset.side === "left" && (from === "preview" || (from === "edit" && !isInLists)))
    showSide("form");
  if (from === "outline" && matchMedia(NARROW).matches) fillIn();
}

// What is being typed in the form counts as entered.
export const entered = () => shown.enter();

// The page itself is drawn first after an edit; without it the panes wait no longer than this.
const AFTER_MS = 300;
let isFilled = false;
let isOutdated = false;
let timer = 0;

async function fillAll() {
  if (!isOutdated) return;
  isOutdated = false;
  clearTimeout(timer);
  await Promise.all([shown.refresh(), fill(faults, "faults"), fill(diff, "diff")]);
  // The robot's list asks by itself whether it has other rows; the kinds are always the same.
  const name = left.dataset.part ?? "outline";
  if (name === "outline" || !left.childElementCount) await fill(left, name);
}

/** @type {Map<HTMLElement, number>} */
const asked = new Map();
/** @type {((pane: HTMLElement) => void)[]} */
const listeners = [];

// Called when a pane has another content.
/** @param {(pane: HTMLElement) => void} listener */
export function onPane(listener) {
  listeners.push(listener);
}

/** @param {HTMLElement} pane @param {string} name @param {Record<string, string>} [query] */
export async function fill(pane, name, query = {}) {
  const turn = (asked.get(pane) ?? 0) + 1;
  asked.set(pane, turn);
  const html = await part(name, { path: JSON.stringify(selection() ?? []), ...query });
  if (html === null || asked.get(pane) !== turn) return;
  const kept = keepPlace(pane);
  pane.innerHTML = html;
  kept();
  for (const listener of listeners) listener(pane);
}

// The focus and what is scrolled are as they were, where the same element is there again.
/** @param {HTMLElement} pane @returns {() => void} */
function keepPlace(pane) {
  const active = pane.contains(document.activeElement) ? document.activeElement : null;
  const named = active && nameOf(active);
  const scrolled = pane.querySelector(".scroll, .fault-list, pre, .form")?.scrollTop ?? 0;
  return () => {
    const area = pane.querySelector(".scroll, .fault-list, pre, .form");
    if (area) area.scrollTop = scrolled;
    if (named) focusNamed(pane, named);
  };
}

/** @param {HTMLElement} pane @param {{ tag: string, name: string }} named */
function focusNamed(pane, named) {
  if (!named.name) return;
  const same = [...pane.querySelectorAll(named.tag)].find((element) => nameOf(element).name === named.name);
  if (same instanceof HTMLElement) same.focus({ preventScroll: true });
}

// The focus goes back to what opened a question, or to what took its place when the pane was filled again.
/** @param {HTMLElement} pane @param {HTMLElement} opener */
export function focusAgain(pane, opener) {
  if (opener.isConnected) opener.focus();
  else focusNamed(pane, nameOf(opener));
}

/** @param {Element} element */
function nameOf(element) {
  const data = element instanceof HTMLElement ? element.dataset : {};
  return {
    tag: element.localName,
    name: element.id || element.getAttribute("name") || data.path || data.select || data.item || data.kindOf || "",
  };
}

/** @param {string} name */
export function showTab(name) {
  for (const tab of document.querySelectorAll("[data-tab]")) {
    const isChosen = tab instanceof HTMLElement && tab.dataset.tab === name;
    tab.setAttribute("aria-selected", String(isChosen));
    if (tab instanceof HTMLElement) tab.tabIndex = isChosen ? 0 : -1;
  }
  if (left.dataset.part !== name) left.replaceChildren();
  left.dataset.part = name;
  left.setAttribute("aria-labelledby", `tab-${name}`);
  fill(left, name);
}

/** @param {KeyboardEvent} event */
function onTabKey(event) {
  const tabs = [...document.querySelectorAll(".left [data-tab]")];
  const number = tabs.indexOf(/** @type {HTMLElement} */ (event.target));
  const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (number < 0 || !step) return;
  event.preventDefault();
  const next = tabs[(number + step + tabs.length) % tabs.length];
  next.focus();
  next.click();
}

/** @param {Event} event */
function onClick(event) {
  const target = event.target instanceof Element ? event.target : null;
  const tab = target?.closest("[data-tab]");
  if (tab?.dataset.tab) showTab(tab.dataset.tab);
  const chosen = target?.closest("[data-select]");
  if (chosen?.dataset.select) {
    select(JSON.parse(chosen.dataset.select), "list");
    showSide("form");
  }
  if (chosen?.dataset.field) shown.focus(chosen.dataset.field);
  const side = target?.closest("[data-side-of]")?.getAttribute("data-side-of");
  if (side) toggleSide(side);
}

export function start() {
  document.addEventListener("click", onClick);
  document.querySelector(".left .tabs")?.addEventListener("keydown", (event) => {
    if (event instanceof KeyboardEvent) onTabKey(event);
  });
  onState((now, before) => {
    const isKnown = now.revision === before.revision && now.drawn === before.drawn && now.saved === before.saved;
    if (isFilled && isKnown) return;
    isFilled = true;
    isOutdated = true;
    clearTimeout(timer);
    timer = setTimeout(fillAll, now.drawn === before.drawn ? 0 : AFTER_MS);
  });
  onDrawn(fillAll);
  onSelect((_path, from) => {
    shown.show(selection() ?? []);
    showSelected(from);
  });
  onPane((pane) => pane === faults && markFault());
  onSelect(markFault);
  if (state.revision) showTab(left.dataset.part ?? "outline");
}

function markFault() {
  for (const fault of faults.querySelectorAll("[data-select]")) {
    const isHere = isSame(JSON.parse(fault.dataset.select ?? "null"), selection());
    fault.toggleAttribute("aria-current", isHere);
    if (isHere) fault.setAttribute("aria-current", "true");
  }
}
