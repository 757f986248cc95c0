// A check list: rows are updated in place, and change their order only when no finger is on them.
import { find, setText } from "../show.js";

// The order that waits for the finger to leave, by the widget.
/** @type {WeakMap<HTMLElement, number[]>} */
const waiting = new WeakMap();
/** @type {WeakMap<HTMLElement, Set<number>>} */
const fingers = new WeakMap();

/** @param {HTMLElement} root */
export function equip(root) {
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
export const show = {
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
