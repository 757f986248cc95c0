// A parameter: its input shows the robot's value, with the limits that its node describes.
import { showBounds, showEntry } from "../entries.js";

// The robot's value is read again: the response arrives as an event.
/** @param {HTMLElement} root */
export function equip(root) {
  root.querySelector(".read")?.addEventListener("click", (event) => {
    if (event.defaultPrevented) return;
    event.preventDefault();
    fetch(event.currentTarget.getAttribute("formaction"), { method: "POST" }).catch(() => {});
  });
}

/** @type {Record<string, Show>} */
export const show = {
  askable: (root, value) => (root.querySelector(".read").disabled = !value),
  entry: showEntry,
  bounds: showBounds,
  settable: (root, value) => (root.querySelector(".setting").inert = !value),
};
