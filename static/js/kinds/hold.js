// A hold: a button, by a finger, a mouse button, Space or Enter.
import { Holding } from "../holding.js";
import { find, setText } from "../show.js";

const KEYS = [" ", "Enter"];

// Called for each widget of this kind.
/** @param {HTMLElement} root @param {import("../source.js").Source} source */
export const equip = (root, source) => new Hold(root, source);

class Hold extends Holding {
  #seconds = new Intl.NumberFormat(document.documentElement.lang, { minimumFractionDigits: 1 });
  #since = 0; // of this page's own hold, by performance.now(); 0 without one

  /** @param {HTMLElement} root @param {import("../source.js").Source} source */
  constructor(root, source) {
    super(root, source);
    this.button.addEventListener("pointerdown", (event) => this.#down(event));
    this.button.addEventListener("keydown", (event) => this.#keyDown(event));
  }

  // For how long it is held, in half seconds.
  /** @param {WebSocket | null} [socket] */
  beat(socket) {
    super.beat(socket);
    if (this.root.dataset.hold !== "held") return;
    this.#since ||= performance.now();
    const halves = Math.floor((performance.now() - this.#since) / 500);
    setText(find(this.root, ".held-for"), `${this.#seconds.format(halves / 2)} s`);
  }

  onEnd() {
    this.#since = 0;
    setText(find(this.root, ".held-for"), "");
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (!event.isPrimary || event.button !== 0 || this.busy) return;
    // A finger's pointer stays with the button by itself: it must be seen to slide off.
    if (this.button.hasPointerCapture(event.pointerId)) this.button.releasePointerCapture(event.pointerId);
    this.pointer = event.pointerId;
    this.begin();
  }

  /** @param {KeyboardEvent} event */
  #keyDown(event) {
    if (!KEYS.includes(event.key)) return;
    event.preventDefault();
    if (event.repeat || this.busy) return;
    this.key = event.key;
    this.begin();
  }
}
