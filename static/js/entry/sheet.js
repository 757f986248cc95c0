// A sheet over the page in which something is entered: one at a time, and hold-to-run keys are locked.
import { lockLocally, unlockLocally } from "../show.js";
import { place } from "./place.js";
import { TAP_AGAIN_MS } from "../press.js";

const HOLDS = '[data-kind="hold"]';

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

export class Sheet {
  /** @type {HTMLElement} */
  root;
  /** @type {HTMLElement | null} */
  #input = null;
  /** @type {string[]} */
  #shapes;
  /** @type {() => void} */
  #gone; // called when the input is not there any more
  #watch = new ResizeObserver(() => (this.#input.getClientRects().length ? this.#place() : this.#gone()));
  #placed = () => this.#place();

  // `shapes`: how it may look, the best one first.
  /** @param {string} id @param {string[]} shapes @param {() => void} gone */
  constructor(id, shapes, gone) {
    this.root = document.getElementById(id).content.firstElementChild.cloneNode(true);
    this.#shapes = shapes;
    this.#gone = gone;
    // The input keeps the focus, and so its caret.
    this.root.addEventListener("mousedown", (event) => event.preventDefault());
  }

  /** @param {HTMLElement} input @param {string | null} label */
  open(input, label) {
    this.#input = input;
    this.root.setAttribute("aria-label", label);
    document.body.append(this.root);
    input.closest("[data-widget]").dataset.entering = "";
    for (const hold of document.querySelectorAll(HOLDS)) lockLocally(hold, this.root.dataset.locks);
    if (this.#place()) settle();
    addEventListener("resize", this.#placed);
    this.#watch.observe(input);
  }

  close() {
    settle();
    removeEventListener("resize", this.#placed);
    this.#watch.disconnect();
    this.root.remove();
    document.querySelector("main").toggleAttribute("data-lifted", false);
    delete this.#input.closest("[data-widget]").dataset.entering;
    for (const hold of document.querySelectorAll(HOLDS)) unlockLocally(hold);
  }

  #place() {
    return place(this.root, this.#input, this.#shapes);
  }
}
