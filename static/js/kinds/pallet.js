// Moves what a plan of a pallet shows: the area of its boxes, and the place of the next one.
import { find } from "../show.js";

/** @type {Record<string, Show>} */
export const show = {
  filled: (root, path) => find(root, ".boxes").setAttribute("d", path),
  next: (root, place) => {
    const box = find(root, ".next");
    box.toggleAttribute("hidden", !place);
    if (place) box.setAttribute("transform", `translate(${place})`);
  },
};
