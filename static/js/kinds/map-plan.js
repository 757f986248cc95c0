// A plan of the panel's pictures on a map: its lower left corner is at its origin, as that of a map's picture is.
import { find } from "../show.js";
import { layersOf } from "./map-layers.js";

/** @param {HTMLElement} root @param {import("./map.js").MapView} view */
export function placePlan(root, view) {
  const plan = find(root, "div.map-plan");
  const image = find(plan, "img");
  const row = find(root, "button[data-fixed='plan']");
  const note = find(row, "small");
  const [x, y, yaw] = JSON.parse(plan.dataset.origin ?? "[]");
  const place = { x, y, yaw, resolution: Number(plan.dataset.resolution) };
  const show = () => {
    if (!image.complete) return;
    const isBroken = !image.naturalWidth;
    note.toggleAttribute("hidden", !isBroken);
    layersOf(root, view).warn(row, isBroken ? (note.textContent ?? "") : "");
    image.style.top = `${-image.naturalHeight}px`;
  };
  for (const name of ["load", "error"]) image.addEventListener(name, show);
  show();
  view.onDraw(() => view.placeTiles(find(plan, "div"), place));
}
