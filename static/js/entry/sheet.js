// A sheet over the page in which something is entered: one at a time, and hold-to-run keys are locked.
import { lockHolds, unlockHolds } from "../hold-locks.js";
import { copyOf, find } from "../show.js";
import { place, widgetOf } from "./place.js";
import { TAP_AGAIN_MS } from "../press.js";

// The styles of sheets come with the first one.
await new Promise((resolve, reject) => {
  const link = Object.assign(document.createElement("link"), { rel: "stylesheet", onload: resolve, onerror: reject });
  link.href = new URL("../keypad.css", import.meta.url).href;
  document.head.append(link);
});

// What lies below a sheet that moves or closes is not pressed by a second tap.
let settling = 0;
function settle() {
  clearTimeout(settling);
  document.body.dataset.settling = "";
  settling = setTimeout(() => delete document.body.dataset.settling, TAP_AGAIN_MS);
}

// What an input is called on the page.
/** @param {HTMLInputElement} input */
export function nameOf(input) {
  const named = input.labels?.[0] ?? document.getElementById(input.getAttribute("aria-labelledby") ?? "");
  return named?.textContent ?? "";
}

export class Sheet {
  /** @type {HTMLElement} */
  root;
  /** @type {HTMLElement} */
  #input;
  /** @type {string[]} */
  #shapes;
  /** @type {() => void} */
  #gone; // called when the input is not there any more
  #watch = new ResizeObserver(() => (this.#input.getClientRects().length ? this.#place() : this.#gone()));
  #placed = () => this.#place();

  // `shapes`: how it may look, the best one first.
  /** @param {string} id @param {string[]} shapes @param {HTMLElement} input @param {() => void} gone */
  constructor(id, shapes, input, gone) {
    this.root = copyOf(find(document, `template#${id}`));
    this.#input = input;
    this.#shapes = shapes;
    this.#gone = gone;
    // The input keeps the focus, and so its caret.
    this.root.addEventListener("mousedown", (event) => event.preventDefault());
  }

  /** @param {string} label */
  open(label) {
    this.root.setAttribute("aria-label", label);
    document.body.append(this.root);
    widgetOf(this.#input).dataset.entering = "";
    lockHolds(this.root.dataset.locks);
    if (this.#place()) settle();
    addEventListener("resize", this.#placed);
    this.#watch.observe(this.#input);
  }

  close() {
    settle();
    removeEventListener("resize", this.#placed);
    this.#watch.disconnect();
    this.root.remove();
    find(document, "main").toggleAttribute("data-lifted", false);
    delete widgetOf(this.#input).dataset.entering;
    unlockHolds();
  }

  #place() {
    return place(this.root, this.#input, this.#shapes);
  }
}
