// A list over a map, that a button of the map opens. A finger on the map, or Escape, closes it.
import { find } from "../show.js";

// Returns what closes it.
/** @param {HTMLElement} root @param {string} name of the button @param {HTMLElement} list */
export function openList(root, name, list) {
  const key = find(root, `button[data-do="${name}"]`);
  /** @param {boolean} isOpen */
  const open = (isOpen) => {
    list.hidden = !isOpen;
    key.setAttribute("aria-expanded", String(isOpen));
    if (!isOpen) key.focus();
  };
  key.addEventListener("click", () => open(Boolean(list.hidden)));
  find(root, ".map-view").addEventListener("pointerdown", () => {
    if (!list.hidden) open(false);
  });
  list.addEventListener("keydown", ({ key: pressed }) => {
    if (pressed === "Escape") open(false);
  });
  return () => open(false);
}
