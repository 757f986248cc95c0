import { find } from "../show.js";

// The keys of a step have the values that they publish; one without a value is at the end of the limits.
/** @type {Record<string, Show>} */
export const show = {
  step_up: (root, value) => setKey(root, "up", value),
  step_down: (root, value) => setKey(root, "down", value),
};

/** @param {HTMLElement} root @param {string} way @param {string} value */
function setKey(root, way, value) {
  const key = find(root, `button[data-way="${way}"]`);
  key.value = value;
  key.toggleAttribute("data-end", !value);
  key.disabled = !value || root.dataset.enabled === "false";
}

// A permission leaves a key at the end of the limits as it is.
/** @param {HTMLElement} root @param {boolean} locked */
export function lock(root, locked) {
  root.dataset.enabled = String(!locked);
  for (const key of root.querySelectorAll("button[data-end]")) key.disabled = true;
}

// What a key sends: its value when the finger went down.
/** @param {HTMLButtonElement} key @param {string} value */
export const values = (key, value) => ({ [key.name]: Number(value) });
