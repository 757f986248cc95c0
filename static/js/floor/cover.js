// What covers the page while it is cleaned or dark: stop buttons stay bare under it, and nothing else is touched.
import { TAP_AGAIN_MS } from "../press.js";
import { isStop, STOPS } from "../show.js";

// What covers the page has a hole over each stop button.

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

// Takes every touch and key away from the page: while it is cleaned, and where a touch only wakes it.

const POINTERS = ["pointerdown", "pointerup", "pointercancel", "pointermove"];
const OTHERS = [
  "touchstart",
  "touchmove",
  "touchend",
  "mousedown",
  "mouseup",
  "click",
  "dblclick",
  "auxclick",
  "contextmenu",
  "wheel",
  "keydown",
  "keyup",
  "beforeinput",
  "dragstart",
  "submit",
];

/** @param {EventTarget | null} target */
const isEnd = (target) => target instanceof Element && target.closest(".end-cleaning") !== null;

class Shield {
  // Called with each event that is swallowed.
  /** @type {(event: Event) => void} */
  touched = () => {};
  #up = false;
  /** @type {Set<number | string>} */
  #down = new Set(); // the pointers and keys that went down under it
  #timer = 0;

  constructor() {
    // Listeners that the window has already still get what is swallowed.
    for (const name of [...POINTERS, ...OTHERS])
      addEventListener(name, (event) => this.#swallow(event), { capture: true, passive: false });
  }

  get up() {
    return this.#up;
  }

  raise() {
    clearTimeout(this.#timer);
    this.#up = true;
  }

  // When what went down has gone up, and a second tap would have come.
  lower() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => {
      if (this.#down.size) this.lower();
      else this.#up = false;
    }, TAP_AGAIN_MS);
  }

  /** @param {Event} event */
  #swallow(event) {
    if (!this.#up || isStop(event.target) || isEnd(event.target)) return;
    const { type } = event;
    if (event instanceof PointerEvent || event instanceof KeyboardEvent) {
      const pressed = "pointerId" in event ? event.pointerId : event.code;
      if (type === "pointerdown" || type === "keydown") this.#down.add(pressed);
      if (["pointerup", "pointercancel", "keyup"].includes(type)) this.#down.delete(pressed);
    }
    this.touched(event);
    event.stopImmediatePropagation();
    if (event.cancelable) event.preventDefault();
  }
}

// One for the page: events are swallowed from its loading on.
export const shield = new Shield();
