// The page gets dark when it is not touched for long. The touch that wakes it presses nothing.
import { leaveStopsBare } from "./cover.js";
import { shield } from "./cover.js";
import { find } from "../show.js";

const MOVES = ["pointerdown", "pointermove", "pointerup", "pointercancel", "keydown", "wheel"];

const dark = find(document, "#dark");

export class Dimming {
  /** @type {number} */
  #afterMs;
  #timer = 0;
  /** @type {Set<number>} */
  #pressed = new Set(); // pointers that are down: a page that is held is touched

  /** @param {number} afterMs */
  constructor(afterMs) {
    this.#afterMs = afterMs;
    for (const name of MOVES) addEventListener(name, (event) => this.#touched(event), true);
    shield.touched = (event) => MOVES.includes(event.type) && this.#touched(event);
    // What the operator must see: the state of the machine and of the robot, and what is wrong with the panel.
    const seen = new MutationObserver(() => this.wake());
    const machine = document.querySelector(".machine-state");
    if (machine) seen.observe(machine, { attributeFilter: ["data-state", "data-shape", "data-colour"] });
    seen.observe(find(document, "#state"), { attributeFilter: ["data-state"] });
    seen.observe(find(document, "#fault"), { attributeFilter: ["hidden"] });
    this.#wait();
  }

  wake() {
    if (dark.matches(":popover-open")) {
      dark.hidePopover();
      shield.lower();
    }
    this.#wait();
  }

  /** @param {Event} event */
  #touched(event) {
    if (event instanceof PointerEvent) {
      const { type, pointerId, movementX, movementY } = event;
      if (type === "pointermove" && !movementX && !movementY) return; // the page moved, not the mouse
      if (type === "pointerdown") this.#pressed.add(pointerId);
      if (type === "pointerup" || type === "pointercancel") this.#pressed.delete(pointerId);
    }
    this.wake();
  }

  #wait() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#dim(), this.#afterMs);
  }

  #dim() {
    if (this.#pressed.size || document.querySelector("#cleaning:popover-open")) return this.#wait();
    shield.raise();
    dark.showPopover();
    leaveStopsBare(dark);
  }
}
