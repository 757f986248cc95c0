// Touches of buttons: felt at once. A stop button is pressed by its own pointer, whatever else touches the glass.
import { closest } from "./show.js";

export const STOPS = '[data-role="stop"] > button[type="submit"]';

/** @param {EventTarget | null} target */
export function isStop(target) {
  return closest(target, STOPS) !== null;
}

/** @param {HTMLElement} button @param {{ clientX: number, clientY: number }} event */
const isOver = (button, { clientX: x, clientY: y }) => {
  const { left, right, top, bottom } = button.getBoundingClientRect();
  return x >= left && x <= right && y >= top && y <= bottom;
};

// Chromium gives a click to the first finger only, but each finger has its own pointer.
export class StopKeys {
  /** @type {Map<number, HTMLButtonElement>} */
  #down = new Map(); // pointer → the stop button that it went down on
  /** @type {(button: HTMLButtonElement, event: PointerEvent) => void} */
  #press;
  /** @type {WeakMap<HTMLButtonElement, number>} */
  #pressedAt = new WeakMap(); // when a pointer pressed it: the click that follows is the same press

  /** @param {(button: HTMLButtonElement, event: PointerEvent) => void} press */
  constructor(press) {
    this.#press = press;
    addEventListener("pointerdown", (event) => this.#began(event), true);
    addEventListener("pointermove", (event) => this.#moved(event), true);
    // Where another finger scrolls the page, the browser takes the pointers of all fingers away.
    for (const name of /** @type {const} */ (["pointerup", "pointercancel"]))
      addEventListener(name, (event) => this.#ended(event), true);
  }

  // Whether a click is that of a press by a pointer.
  /** @param {Event} click @param {HTMLButtonElement} button */
  isPressed(click, button) {
    return click.timeStamp - (this.#pressedAt.get(button) ?? Number.NEGATIVE_INFINITY) < CLICK_AFTER_MS;
  }

  /** @param {PointerEvent} event */
  #began(event) {
    const button = closest(event.target, STOPS);
    if (button && event.button === 0 && !button.disabled) this.#down.set(event.pointerId, button);
  }

  // A finger that slides off takes its press back.
  /** @param {PointerEvent} event */
  #moved(event) {
    const button = this.#down.get(event.pointerId);
    if (button && !isOver(button, event)) this.#down.delete(event.pointerId);
  }

  /** @param {PointerEvent} event */
  #ended(event) {
    const button = this.#down.get(event.pointerId);
    this.#down.delete(event.pointerId);
    if (!button || (event.type === "pointerup" && !isOver(button, event))) return;
    this.#pressedAt.set(button, event.timeStamp);
    this.#press(button, event);
  }
}

const CLICK_AFTER_MS = 500;

// A button looks pressed while a pointer is down on it: from the first moment on, and not once it has slid off.
export function feelTouches() {
  /** @type {Map<number, HTMLElement>} */
  const touched = new Map();
  addEventListener("pointerdown", ({ target, pointerId }) => {
    const button = closest(target, "form.page button:enabled");
    if (!button) return;
    touched.set(pointerId, button);
    button.toggleAttribute("data-down", true);
  });
  /** @param {PointerEvent} event */
  const released = (event) => {
    const button = touched.get(event.pointerId);
    if (!button || (event.type === "pointermove" && isOver(button, event))) return;
    touched.delete(event.pointerId);
    if (![...touched.values()].includes(button)) button.toggleAttribute("data-down", false);
  };
  for (const name of /** @type {const} */ (["pointermove", "pointerup", "pointercancel"]))
    addEventListener(name, released, true);
}
