// A parameter: its input shows the robot's value, with the limits that its node describes.
import { showBounds, showEntry } from "../entries.js";
import { find } from "../show.js";

// The robot's value is read again: the response arrives as an event.
/** @param {HTMLElement} root */
export function equip(root) {
  const button = find(root, "button.read");
  button.addEventListener("click", (event) => {
    if (event.defaultPrevented) return;
    event.preventDefault();
    fetch(button.formAction, { method: "POST" }).catch(() => {});
  });
}

/** @type {Record<string, Show>} */
export const show = {
  askable: (root, value) => (find(root, "button.read").disabled = !value),
  entry: showEntry,
  bounds: showBounds,
  settable: (root, value) => (find(root, ".setting").inert = !value),
};
