// What covers the page has a hole over each stop button.
import { STOPS } from "../stop-keys.js";

// Leaves the stop buttons bare under what covers the page, also when the page changes its size.
/** @param {HTMLElement} cover */
export function leaveStopsBare(cover) {
  cutHoles(cover);
  const resized = () => cutHoles(cover);
  addEventListener("resize", resized);
  cover.addEventListener("beforetoggle", () => removeEventListener("resize", resized), { once: true });
}

/** @param {HTMLElement} cover */
function cutHoles(cover) {
  const { left, top, width, height } = cover.getBoundingClientRect();
  const holes = [...document.querySelectorAll(STOPS)]
    .map((button) => button.getBoundingClientRect())
    .filter((hole) => hole.width && hole.height)
    .map((hole) => `M${hole.left - left} ${hole.top - top}v${hole.height}h${hole.width}v${-hole.height}z`);
  cover.style.clipPath = holes.length ? `path(evenodd, "M0 0H${width}V${height}H0z${holes.join("")}")` : "";
}
