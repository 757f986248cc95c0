// The screen is locked so that it can be cleaned, also when the page is loaded again: only Stop stays bare and works. It
// unlocks by itself, or when its button is held.
import { shield } from "./cover.js";
import { lockHolds, unlockHolds } from "../show.js";
import { find } from "../show.js";
import { leaveStopsBare } from "./cover.js";

const UNTIL = "cleaning-until"; // in this tab: when it unlocks, by Date.now()
const COUNT_MS = 100;
const HOLD_TO_END_MS = 2000; // a cloth does not rest for so long on one place

const over = find(document, "#cleaning");
const totalMs = () => 1000 * Number(over.dataset.seconds);

export class Cleaning {
  #endsAt = 0; // by performance.now(): a clock that is set changes nothing

  constructor() {
    let holding = 0;
    const end = find(over, ".end-cleaning");
    end.addEventListener("pointerdown", () => {
      clearTimeout(holding); // of another finger: only the last one counts
      holding = setTimeout(() => this.#end(), HOLD_TO_END_MS);
    });
    for (const name of ["pointerup", "pointercancel", "pointerleave"])
      end.addEventListener(name, () => clearTimeout(holding));
    const left = Number(pageGuard.recall(UNTIL)) - Date.now();
    if (left > 0 && left <= totalMs()) this.#begin(left);
  }

  start() {
    if (over.matches(":popover-open")) return;
    pageGuard.keep(UNTIL, Date.now() + totalMs());
    this.#begin(totalMs());
  }

  /** @param {number} ms */
  #begin(ms) {
    this.#endsAt = performance.now() + ms;
    shield.raise();
    // A hold that goes on ends with its lock.
    lockHolds(find(over, "p").textContent.trim());
    if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
    find(document, "#menu").hidePopover();
    over.showPopover();
    leaveStopsBare(over);
    this.#count();
  }

  #count() {
    if (!over.matches(":popover-open")) return;
    const left = this.#endsAt - performance.now();
    if (left <= 0) return this.#end();
    find(over, "[role=timer]").textContent = String(Math.ceil(left / 1000));
    setTimeout(() => this.#count(), COUNT_MS);
  }

  #end() {
    pageGuard.keep(UNTIL, null);
    over.hidePopover();
    unlockHolds();
    shield.lower();
  }
}
