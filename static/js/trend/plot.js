// The plot of a trend, with the axis of its values.
import { numberText } from "../number-text.js";
import { find } from "../show.js";

// The axis of a trend's values: its ends and the lines of its grid, the same as `axis_range` and `value_ticks` in
// app/cell/view/trend.py. Total: for all doubles but NaN the ends are finite and the ticks few.

const LARGEST = 1e300; // of an axis: sums and differences of such values are finite
const LEAST_WIDTH = 1e-300;
const NARROWEST = 1e-9; // relative: a narrower axis has ticks that doubles can't tell apart
const MARGIN = 0.05;
const MOST_DIGITS = 12; // after the point

/** @param {number} value */
const drawable = (value) => Math.min(Math.max(value, -LARGEST), LARGEST);

// [low, high] for values from `low` to `high`, with a margin where an end is not fixed (undefined).
/** @param {number} lowest @param {number} highest @param {number | undefined} fixedLow @param {number | undefined} fixedHigh @returns {[number, number]} */
export function axisRange(lowest, highest, fixedLow, fixedHigh) {
  let low = drawable(fixedLow ?? lowest);
  let high = drawable(fixedHigh ?? highest);
  const largest = Math.max(Math.abs(low), Math.abs(high));
  if (high - low < Math.max(largest * NARROWEST, LEAST_WIDTH)) {
    const margin = largest * MARGIN >= LEAST_WIDTH ? largest * MARGIN : 1;
    if (fixedLow !== undefined) high = low + margin;
    else if (fixedHigh !== undefined) low = high - margin;
    else [low, high] = [high - margin, high + margin];
  }
  const margin = (high - low) * MARGIN;
  return [fixedLow === undefined ? low - margin : low, fixedHigh === undefined ? high + margin : high];
}

// [value, text] of the lines of the grid, about `most`; the text has a hyphen and a point.
/** @param {number} low @param {number} high @param {number} most @returns {Generator<[number, string]>} */
export function* valueTicks(low, high, most) {
  const least = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(least));
  const factor = [1, 2, 2.5, 5].find((by) => power * by >= least * 0.999) ?? 10;
  const step = power * factor;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9) + (factor === 2.5 ? 1 : 0));
  const isFixedPoint = Math.max(Math.abs(low), Math.abs(high)) < 1e6 && digits <= MOST_DIGITS;
  const last = Math.floor(high / step + 1e-9);
  for (let count = Math.ceil(low / step - 1e-9); count <= last; count++) {
    const value = count * step;
    yield [value, isFixedPoint ? value.toFixed(digits) : Number(value.toPrecision(4)).toString()];
  }
}

// Draws a trend's columns into the elements that the server has rendered (templates/widgets/trend.html); the same as
// app/cell/view/trend.py.

const SIZE = 1000;
const PER_COLUMN_PX = 1.5;
const VALUE_TICK_PX = 45;
const NAME_ROOM = 12; // percent of the height that the name of a limit takes
const TIME_TICK_PX = 90;
const STEPS = [
  1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400, 172800, 604800,
];

const LONGEST_STEP = STEPS[STEPS.length - 1];

// The name of a limit stands outside of what the limits enclose, if that is drawn.
/** @type {(letter: string, place: number) => boolean} */
const isNamedAbove = (letter, place) => (letter === "H" ? place >= NAME_ROOM : place > 100 - NAME_ROOM);
/** @type {(text: string | undefined) => number | undefined} */
const numberOr = (text) => (text === undefined ? undefined : Number(text));

export class Plot {
  /** @type {HTMLElement} */
  #root;
  /** @type {HTMLElement} */
  #area;
  /** @type {View} */
  #view = { begin: 0, end: 0, width: 0, zone: 0, offset: "", shift: "", span: 0, live: false }; // what is drawn

  /** @param {HTMLElement} root */
  constructor(root) {
    this.#root = root;
    this.#area = find(root, ".area");
    /** @type {Pen[]} */
    this.pens = [...root.querySelectorAll(".legend .pen")].map((pen, i) => ({
      name: find(pen, '[role="rowheader"]').textContent,
      unit: pen.dataset.unit ?? "",
      digits: numberOr(/\.(\d+)f$/.exec(pen.dataset.format ?? "")?.[1]),
      low: numberOr(pen.dataset.low),
      high: numberOr(pen.dataset.high),
      normal: pen.dataset.normal?.split(" ").map(Number),
      axis: pen.dataset.axis ?? "left",
      line: root.querySelectorAll(".pens > path.line")[i],
      mark: root.querySelectorAll("use.end")[i],
    }));
  }

  // How many columns the server is asked for.
  get mostColumns() {
    return Math.min(1000, Math.max(50, Math.round(this.#area.clientWidth / PER_COLUMN_PX)));
  }

  // `columns` of each pen are [number, lowest, highest, last, whether it begins a line].
  /** @param {View} view @param {Column[][]} columns */
  draw(view, columns) {
    this.#view = view;
    const { begin, end } = view;
    /** @type {Record<string, [number, number]>} */
    const ends = { left: this.#range(columns, "left"), right: this.#range(columns, "right") };
    /** @param {number} time */
    const x = (time) => ((time - begin) / (end - begin)) * SIZE;
    /** @param {string} axis @returns {(value: number) => number} */
    const on = (axis) => {
      const [low, high] = ends[axis];
      return (value) => Math.min(Math.max((high - value) / (high - low), -0.5), 1.5) * SIZE;
    };
    const y = on("left");
    /** @param {string} name */
    const part = (name) => find(this.#root, name);
    const most = Math.max(2, Math.floor(this.#area.clientHeight / VALUE_TICK_PX));
    const values = [...valueTicks(...ends.left, most)];
    const times = [...this.#timeTicks()];
    part(".grid-lines").innerHTML =
      values.map(([value]) => `<path d="M0 ${y(value)}h${SIZE}"/>`).join("") +
      times.map(([time]) => `<path d="M${x(time)} 0v${SIZE}"/>`).join("");
    /** @param {string} at @param {string} axis @param {[number, string][]} ticks */
    const ticksAt = (at, axis, ticks) =>
      ticks
        .map(([value, text]) => `<text ${at} dy="5" y="${on(axis)(value) / 10}%">${numberText(text)}</text>`)
        .join("");
    part(".values").innerHTML = ticksAt('x="0" dx="-6"', "left", values);
    const right = this.#root.dataset.right === undefined ? [] : [...valueTicks(...ends.right, most)];
    part(".right-values").innerHTML = ticksAt('x="100%" dx="6"', "right", right);
    part(".times").innerHTML = times
      .map(([time, text]) => `<text x="${x(time) / 10}%" y="100%" dy="18">${text}</text>`)
      .join("");
    const limits = this.pens.flatMap(({ high, low, axis }, i) => [
      ...(high === undefined ? [] : [{ letter: "H", at: high, axis, i }]),
      ...(low === undefined ? [] : [{ letter: "L", at: low, axis, i }]),
    ]);
    part(".limits").innerHTML = limits
      .map(({ at, axis, i }) => `<path class="pen-${i}" d="M0 ${on(axis)(at)}h${SIZE}"/>`)
      .join("");
    const named = limits
      .map((limit) => ({ ...limit, place: on(limit.axis)(limit.at) / 10 }))
      .filter(({ place }) => place >= 0 && place <= 100);
    part(".limit-names").innerHTML = named
      .map(
        ({ letter, at, place }) =>
          `<text x="6" y="${place}%" dy="${isNamedAbove(letter, place) ? -5 : 15}">${letter} ${numberText(String(at))}</text>`,
      )
      .join("");
    part(".bands").innerHTML = this.pens
      .flatMap(({ normal, axis }) => (normal ? [normal.map(on(axis))] : []))
      .map(([from, to]) => `<rect class="band" x="0" width="${SIZE}" y="${to}" height="${from - to}"/>`)
      .join("");
    for (const [i, pen] of this.pens.entries()) this.#drawPen(pen, columns[i], x, on(pen.axis));
  }

  // Through the lowest and the highest value of each column: no peak is lost.
  /** @param {Pen} pen @param {Column[]} columns @param {(time: number) => number} x @param {(value: number) => number} y */
  #drawPen(pen, columns, x, y) {
    /** @type {string[]} */
    const path = [];
    let before = 0;
    for (const [number, low, high, last, starts] of columns) {
      const values = Math.abs(before - low) <= Math.abs(before - high) ? [low, high] : [high, low];
      if (low === high) values.pop();
      else if (values[1] !== last) values.push(last);
      const at = Math.min(x(this.timeOf(number)), SIZE).toFixed(1);
      for (const [i, value] of values.entries()) {
        const isFirst = i === 0 && (starts || !path.length);
        path.push(`${isFirst ? "M" : "L"}${at} ${y(value).toFixed(1)}${isFirst ? "h0" : ""}`);
      }
      before = last;
    }
    pen.line.setAttribute("d", path.join(""));
    const newest = columns.at(-1);
    pen.mark.setAttribute("visibility", newest && x(this.timeOf(newest[0])) >= 0 ? "visible" : "hidden");
    if (!newest) return;
    pen.mark.setAttribute("x", `${Math.min(x(this.timeOf(newest[0])), SIZE) / 10}%`);
    pen.mark.setAttribute("y", `${y(newest[3]) / 10}%`);
  }

  // The time in the middle of a column.
  /** @param {number} number */
  timeOf(number) {
    return (number + 0.5) * this.#view.width;
  }

  /** @param {Column[][]} columns @param {string} axis @returns {[number, number]} */
  #range(columns, axis) {
    const own = this.pens.map((pen) => pen.axis === axis);
    const fixed = this.pens
      .filter((_, i) => own[i])
      .flatMap((pen) => [pen.low, pen.high, ...(pen.normal ?? [])])
      .filter((value) => value !== undefined);
    const { min, max, rightMin, rightMax } = this.#root.dataset;
    const drawn = columns.filter((_, i) => own[i]).flat();
    /** @param {1 | 2} index @param {(a: number, b: number) => number} pick @param {number} none */
    const ends = (index, pick, none) => [...drawn.map((column) => column[index]), ...fixed].reduce(pick, none);
    const low = ends(1, (a, b) => Math.min(a, b), Infinity);
    const high = ends(2, (a, b) => Math.max(a, b), -Infinity);
    const [lowest, highest] = low <= high ? [low, high] : [0, 1]; // nothing is drawn
    const [from, to] = axis === "left" ? [min, max] : [rightMin, rightMax];
    return axisRange(lowest, highest, numberOr(from), numberOr(to));
  }

  /** @returns {Generator<[number, string]>} */
  *#timeTicks() {
    const { begin, end, zone } = this.#view;
    const step =
      STEPS.find((one) => one >= (end - begin) / Math.max(2, this.#area.clientWidth / TIME_TICK_PX)) ?? LONGEST_STEP;
    for (let number = Math.ceil((begin + zone) / step); number * step - zone <= end; number++) {
      const time = number * step - zone;
      const [from, to] = step < 60 ? [11, 19] : step < 86400 ? [11, 16] : [5, 10];
      yield [time, this.#local(time).slice(from, to) + (step < 86400 ? this.#zoneText : "")];
    }
  }

  /** @param {number} time */
  #local(time) {
    return new Date((time + this.#view.zone) * 1000).toISOString();
  }

  // After a time of day: the clock was changed within the time that is drawn.
  get #zoneText() {
    return this.#view.offset ? ` ${this.#view.offset}` : "";
  }

  /** @param {number} time */
  clockOf(time) {
    return this.#local(time).slice(11, 19) + this.#zoneText;
  }
}

// Seconds as "2 d 03:04:05".
/** @param {number} s */
export function duration(s) {
  /** @param {number} number */
  const two = (number) => String(Math.floor(number)).padStart(2, "0");
  const days = s >= 86400 ? `${Math.floor(s / 86400)} d ` : "";
  return `${days}${two((s % 86400) / 3600)}:${two((s % 3600) / 60)}:${two(s % 60)}`;
}
