// A joystick: a hold whose heartbeats have the deflection. It follows one finger, wherever that goes, and shows the
// values that the server has sent to the robot.
import { Holding } from "../holding.js";
import { find } from "../show.js";

const APART_MS = 40; // between two heartbeats of a finger that moves
/** @type {Record<string, [number, number]>} */
const ARROWS = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };

// Called for each widget of this kind.
/** @param {HTMLElement} root @param {import("../source.js").Source} source */
export const equip = (root, source) => new Joystick(root, source);

class Joystick extends Holding {
  /** @type {HTMLElement} */
  #knob;
  #x = 0;
  #y = 0;
  /** @type {Set<string>} */
  #arrows = new Set(); // those that are held
  #beatAt = 0;

  /** @param {HTMLElement} root @param {import("../source.js").Source} source */
  constructor(root, source) {
    super(root, source);
    this.#knob = find(root, ".knob");
    this.button.addEventListener("pointerdown", (event) => this.#down(event));
    this.button.addEventListener("pointermove", (event) => event.pointerId === this.pointer && this.#moveTo(event));
    this.button.addEventListener("keydown", (event) => this.#keyDown(event));
    window.addEventListener("keyup", (event) => this.#keyUp(event), { capture: true });
  }

  heartbeatData() {
    return { x: this.#x, y: this.#y };
  }

  /** @param {Record<string, string>} moves */
  onResponse(moves) {
    for (const [axis, text] of Object.entries(moves)) find(this.root, `[data-axis="${axis}"]`).textContent = text;
  }

  onEnd() {
    this.#arrows.clear();
    this.#deflect(0, 0);
    for (const value of this.root.querySelectorAll("[data-axis]")) value.textContent = "";
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (!event.isPrimary || event.button !== 0 || this.busy) return;
    this.button.setPointerCapture(event.pointerId);
    this.pointer = event.pointerId;
    this.begin();
    this.#moveTo(event);
  }

  // From the middle of the pad, as far as the knob goes.
  /** @param {PointerEvent} event */
  #moveTo({ clientX, clientY }) {
    const { left, top, width, height } = find(this.root, ".pad").getBoundingClientRect();
    const reach = (Math.min(width, height) - this.#knob.offsetWidth) / 2;
    this.#deflect((clientX - left - width / 2) / reach, (top + height / 2 - clientY) / reach);
    if (performance.now() - this.#beatAt < APART_MS) return;
    this.#beatAt = performance.now();
    this.beat();
  }

  /** @param {number} x @param {number} y */
  #deflect(x, y) {
    /** @param {number} value */
    const inside = (value) => Math.max(-1, Math.min(1, value));
    const far = this.root.dataset.shape === "circle" ? Math.max(1, Math.hypot(x, y)) : 1;
    this.#x = inside(x / far);
    this.#y = inside(y / far);
    this.#knob.style.setProperty("--x", String(this.#x));
    this.#knob.style.setProperty("--y", String(this.#y));
  }

  /** @param {KeyboardEvent} event */
  #keyDown(event) {
    if (!(event.key in ARROWS)) return;
    event.preventDefault();
    if (event.repeat || this.pointer !== null) return;
    if (!this.isHeld) {
      if (this.busy) return;
      this.begin();
    }
    this.#arrows.add(event.key);
    this.#deflectByArrows();
  }

  /** @param {KeyboardEvent} event */
  #keyUp(event) {
    if (!this.#arrows.delete(event.key)) return;
    if (this.#arrows.size) this.#deflectByArrows();
    else this.end("released");
  }

  #deflectByArrows() {
    const held = [...this.#arrows].map((key) => ARROWS[key]);
    /** @param {0 | 1} axis */
    const sum = (axis) => held.reduce((all, arrow) => all + arrow[axis], 0);
    this.#deflect(sum(0), sum(1));
    this.beat();
  }
}
