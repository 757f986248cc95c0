// The cursor of a trend: a line that a finger or a keyboard sets, and the values there.
import { numberText } from "../number-text.js";
import { find } from "../show.js";

const NEAR = 0.02; // of the plot's width: how far from the cursor a value may be
const STEP = 0.02; // of the plot's width, by a key
const NOTHING = "—";

export class Cursor {
  /** @type {HTMLElement} */
  #root;
  /** @type {import("./plot.js").Plot} */
  #plot;
  /** @type {View | null} */
  #drawn = null; // {begin, end, width, span} of what the plot shows
  /** @type {Column[][]} */
  #columns = [];
  /** @type {number | null} */
  #time = null; // in seconds since the epoch

  /** @param {HTMLElement} root @param {import("./plot.js").Plot} plot */
  constructor(root, plot) {
    this.#root = root;
    this.#plot = plot;
    const area = find(root, ".area");
    /** @param {PointerEvent} event */
    const point = (event) => this.#point((event.clientX - area.getBoundingClientRect().left) / area.clientWidth);
    area.addEventListener("pointerdown", point);
    area.addEventListener("pointermove", (event) => event.buttons && point(event));
    area.addEventListener("keydown", (event) => this.#key(event));
  }

  // It goes when its time has left the plot.
  remove() {
    this.#time = null;
  }

  /** @param {View} drawn @param {Column[][]} columns */
  show(drawn, columns) {
    [this.#drawn, this.#columns] = [drawn, columns];
    this.#show(drawn);
  }

  /** @param {number} place */
  #point(place) {
    if (!this.#drawn) return;
    const { begin, end } = this.#drawn;
    this.#time = begin + Math.min(Math.max(place, 0), 1) * (end - begin);
    this.#show(this.#drawn);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const by = { ArrowLeft: -STEP, ArrowRight: STEP }[event.key];
    if (!this.#drawn || (!by && event.key !== "Escape")) return;
    event.preventDefault();
    const { begin, end } = this.#drawn;
    if (by) return this.#point(((this.#time ?? end) - begin) / (end - begin) + by);
    this.remove();
    this.#show(this.#drawn);
  }

  /** @param {View} drawn */
  #show(drawn) {
    const { begin, end } = drawn;
    if (this.#time !== null && this.#time < begin) this.remove();
    const time = this.#time !== null && this.#time <= end ? this.#time : null;
    const line = find(this.#root, "line.cursor");
    line.setAttribute("visibility", time === null ? "hidden" : "visible");
    const box = find(this.#root, ".cursor-values");
    box.hidden = time === null;
    if (time === null) return;
    const place = (time - begin) / (end - begin);
    for (const name of ["x1", "x2"]) line.setAttribute(name, `${place * 100}%`);
    box.dataset.side = place < 0.5 ? "right" : "left";
    const values = this.#plot.pens.flatMap((pen, i) => [
      ["span", pen.name],
      ["span", this.#valueAt(pen, this.#columns[i], time, drawn)],
    ]);
    const texts = [["b", this.#plot.clockOf(time)], ...values];
    box.replaceChildren(
      ...texts.map(([tag, text]) => Object.assign(document.createElement(tag), { textContent: text })),
    );
  }

  /** @param {Pen} pen @param {Column[]} columns @param {number} time @param {View} drawn */
  #valueAt(pen, columns, time, { width, span }) {
    if (!columns.length) return NOTHING;
    /** @param {Column} column */
    const distance = ([number]) => Math.abs(this.#plot.timeOf(number) - time);
    const nearest = columns.reduce((best, column) => (distance(column) < distance(best) ? column : best));
    if (distance(nearest) > width + NEAR * span) return NOTHING;
    const [, low, high] = nearest;
    /** @param {number} value */
    const text = (value) =>
      numberText(pen.digits === undefined ? Number(value.toPrecision(5)).toString() : value.toFixed(pen.digits));
    return `${low === high ? text(low) : `${text(low)} … ${text(high)}`} ${pen.unit}`.trim();
  }
}
