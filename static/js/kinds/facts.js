// Facts of the cell at one look: `pallet`, `sequence` and `conditions`.
import { find, setText } from "../show.js";

// Moves what a plan of a pallet shows: the area of its boxes, and the place of the next one.

/** @type {Record<string, Show>} */
const showPallet = {
  filled: (root, path) => find(root, ".boxes").setAttribute("d", path),
  next: (root, place) => {
    const box = find(root, ".next");
    box.toggleAttribute("hidden", !place);
    if (place) box.setAttribute("transform", `translate(${place})`);
  },
};

// A sequence of steps: each is shown in a place that is there already, and the picture beside them is exchanged.

/** @type {Record<string, Show>} */
const showSequence = {
  rows: (root, rows) => {
    for (const [place, item] of root.querySelectorAll("li").entries()) showStep(item, rows[place]);
  },
  picture: (root, name) => {
    const frame = root.querySelector("div.picture");
    if (!frame) return;
    const picture = find(frame, "img");
    const address = `${picture.dataset.folder}/${name}`;
    if (name && picture.getAttribute("src") !== address) picture.src = address;
    frame.hidden = !name;
  },
  mark: (root, mark) => {
    const place = root.querySelector("svg.place");
    if (!place) return;
    place.toggleAttribute("hidden", !mark.length);
    for (const [number, name] of ["x", "y"].entries()) place.setAttribute(name, `${mark[number] ?? 0}%`);
  },
  at: (root, number) => {
    const text = root.querySelector("svg.place > text");
    if (text) text.textContent = number;
  },
};

/** @param {HTMLElement} item @param {Data} step */
function showStep(item, step) {
  item.hidden = !step;
  if (!step) return;
  item.dataset.now = step.state;
  if (step.state === "now") item.setAttribute("aria-current", "step");
  else item.removeAttribute("aria-current");
  setText(find(item, "b"), step.number);
  setText(find(item, "span"), step.text);
  setText(find(item, "small"), step.note);
  setText(find(item, "i"), step.word);
}

// A check list: rows are updated in place, and change their order only when no finger is on them.

// The order that waits for the finger to leave, by the widget.
/** @type {WeakMap<HTMLElement, number[]>} */
const waiting = new WeakMap();
/** @type {WeakMap<HTMLElement, Set<number>>} */
const fingers = new WeakMap();

/** @param {HTMLElement} root */
function equipConditions(root) {
  const down = new Set();
  fingers.set(root, down);
  root.addEventListener("pointerdown", ({ pointerId }) => down.add(pointerId));
  /** @param {PointerEvent} event */
  const lift = ({ pointerId }) => {
    down.delete(pointerId);
    const order = waiting.get(root);
    if (order && !down.size) arrange(root, order);
  };
  document.addEventListener("pointerup", lift);
  document.addEventListener("pointercancel", lift);
}

/** @param {HTMLElement} root @param {number} number @returns {HTMLElement} */
const rowOf = (root, number) => find(root, `[data-row="${number}"]`);

/** @type {Record<string, Show>} */
const showConditions = {
  row_states: (root, states) => {
    for (const [number, met] of states.entries()) rowOf(root, number).dataset.met = met;
  },
  row_values: (root, texts) => {
    for (const [number, text] of texts.entries()) setText(rowOf(root, number).querySelector("b"), text);
  },
  row_needs: (root, texts) => {
    for (const [number, text] of texts.entries()) setText(rowOf(root, number).querySelector("small"), text);
  },
  order: (root, order) => {
    if (fingers.get(root)?.size) waiting.set(root, order);
    else arrange(root, order);
  },
};

/** @param {HTMLElement} root @param {number[]} order */
function arrange(root, order) {
  waiting.delete(root);
  for (const [place, number] of order.entries()) {
    const row = rowOf(root, number);
    row.hidden = place >= Number(root.dataset.most);
    find(root, "ul").append(row);
  }
}

/** @type {Hooks} */
export const pallet = { show: showPallet };
/** @type {Hooks} */
export const sequence = { show: showSequence };
/** @type {Hooks} */
export const conditions = { equip: equipConditions, show: showConditions };
