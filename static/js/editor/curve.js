// The curve of the selected alarm: its limits are flags that are dragged, or moved by keys, and stay in their order.
import { updateInPlace } from "../in-place.js";
import { onSelect, selection } from "./selection.js";
import { edit, onState, part } from "./wire.js";

/** @typedef {import("./wire.js").Path} Path */

const AGAIN_MS = 1000;
const STEPPED_MS = 400; // after the last key, before the limit is written
const PAGE = 10; // steps of a page key
const COMPACT = 10; // digits of a value

const pane = /** @type {HTMLElement} */ (document.getElementById("curve"));
const closed = new Set(); // alarms whose curve is not wanted

/** @type {{ limit: string, pointer: number } | null} */
let drag = null;
/** @type {Record<string, string>} the limits that are not written yet */
let moved = {};
let axis = ""; // while a flag is moved
/** @type {ReturnType<typeof setTimeout> | undefined} */
let writing;
let turn = 0;

const path = () => JSON.stringify(selection() ?? []);
const isAlarm = () => selection()?.[0] === "alarm" && selection()?.length === 2;

async function refresh() {
  const number = ++turn;
  const html = isAlarm() && !closed.has(path()) ? await part("curve", { path: path(), axis, ...moved }) : "";
  if (number !== turn) return;
  const fresh = document.createElement("div");
  fresh.innerHTML = html ?? "";
  pane.hidden = !fresh.firstElementChild;
  updateInPlace(pane, fresh);
  for (const flag of flags()) flag.style.top = `${flag.dataset.place}%`;
}

/** @returns {HTMLElement[]} */
const flags = () => [...pane.querySelectorAll("[data-limit]")];
/** @param {string} limit */
const flagOf = (limit) => flags().find((flag) => flag.dataset.limit === limit);
/** @param {HTMLElement} flag @param {string} name */
const numberOf = (flag, name) => Number(flag.getAttribute(`aria-value${name}`));
const step = () => Number(pane.querySelector("[data-step]")?.getAttribute("data-step") ?? 1);
const ends = () => (pane.querySelector("[data-axis]")?.getAttribute("data-axis") ?? "0 1").split(" ").map(Number);

// A limit stands a step inside of its neighbours, at a whole number of steps.
/** @param {HTMLElement} flag @param {number} value */
function move(flag, value) {
  const by = step();
  const [low, high] = ends();
  const least = numberOf(flag, "min") + (numberOf(flag, "min") > low ? by : 0);
  const most = numberOf(flag, "max") - (numberOf(flag, "max") < high ? by : 0);
  const whole = Math.round(Math.min(most, Math.max(least, value)) / by) * by;
  const text = `${Number(whole.toPrecision(COMPACT))}`;
  const limit = flag.dataset.limit ?? "";
  if (Number(text) === numberOf(flag, "now")) return;
  axis = `${low} ${high}`;
  moved = { ...moved, [limit]: text };
  flag.setAttribute("aria-valuenow", text);
  flag.style.top = `${((high - Number(text)) / (high - low)) * 100}%`;
  refresh();
}

// As a form writes it: one line of the file, one step of undo.
async function write() {
  clearTimeout(writing);
  const edits = Object.entries(moved).flatMap(([limit, text]) => {
    const flag = flagOf(limit);
    const toml = /[.e]/.test(text) ? text : `${text}.0`;
    return flag ? [{ op: "set", path: JSON.parse(flag.dataset.path ?? "[]"), toml }] : [];
  });
  moved = {};
  if (edits.length) await edit(edits);
  axis = "";
  refresh();
}

/** @param {PointerEvent} event */
function onDown(event) {
  const flag = event.target instanceof Element ? event.target.closest("[data-limit]") : null;
  if (!flag?.dataset.limit || event.button !== 0) return;
  drag = { limit: flag.dataset.limit, pointer: event.pointerId };
  pane.setPointerCapture(event.pointerId);
  flag.focus();
  event.preventDefault();
}

/** @param {PointerEvent} event */
function onMove(event) {
  const flag = drag?.pointer === event.pointerId ? flagOf(drag.limit) : undefined;
  const box = pane.querySelector(".area")?.getBoundingClientRect();
  if (!flag || !box) return;
  const [low, high] = ends();
  move(flag, high - ((event.clientY - box.top) / box.height) * (high - low));
}

/** @param {PointerEvent} event */
function onUp(event) {
  if (drag?.pointer !== event.pointerId) return;
  drag = null;
  write();
}

/** @param {KeyboardEvent} event */
function onKey(event) {
  const flag = event.target instanceof Element ? event.target.closest("[data-limit]") : null;
  if (event.key === "Escape") {
    moved = {};
    axis = "";
    clearTimeout(writing);
    refresh();
    return;
  }
  /** @type {Record<string, number>} */
  const steps = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: PAGE, PageDown: -PAGE };
  const count = steps[event.key];
  if (!flag || !count || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  move(flag, numberOf(flag, "now") + count * step());
  clearTimeout(writing);
  writing = setTimeout(write, STEPPED_MS);
}

export function start() {
  onSelect(() => {
    closed.clear();
    refresh();
  });
  onState((now, before) => {
    if (now.revision !== before.revision) refresh();
  });
  pane.addEventListener("pointerdown", onDown);
  pane.addEventListener("pointermove", onMove);
  pane.addEventListener("pointerup", onUp);
  pane.addEventListener("pointercancel", () => {
    drag = null;
    moved = {};
    axis = "";
    refresh();
  });
  pane.addEventListener("keydown", onKey);
  pane.addEventListener("click", (event) => {
    if (!(event.target instanceof Element && event.target.closest("[data-close]"))) return;
    closed.add(path());
    refresh();
  });
  setInterval(() => {
    if (!pane.hidden && !drag && !document.hidden && !Object.keys(moved).length) refresh();
  }, AGAIN_MS);
}
