// A trend, with the columns of its pens and its cursor. `trend/plot.js` draws it.
import { numberText } from "../number-text.js";
import { closest, find } from "../show.js";
import { keepDrags } from "../touches.js";
import { duration, Plot } from "../trend/plot.js";

// The columns of a trend's pen: [number, lowest, highest, last, whether it begins a line].

// The old ones, and the server's in place of those from `since` on (0: of all): it says [number, value], [number,
// lowest, highest, last], or null where a line ends. One before the plot stays: a line comes in from there.
/** @param {Column[]} old @param {ColumnItem[]} items @param {number} since @param {(number: number) => boolean} isBefore @returns {Column[]} */
function merged(old, items, since, isBefore) {
  const columns = since ? old.filter(([number]) => number < since) : [];
  let starts = false;
  for (const item of items) {
    if (item && item[0] >= since)
      columns.push(item.length === 2 ? [item[0], item[1], item[1], item[1], starts] : [...item, starts]);
    starts = item === null;
  }
  const first = columns.findIndex(([number]) => !isBefore(number));
  if (first < 0) return columns.slice(-1);
  return first > 0 ? columns.slice(first - 1) : columns;
}

// The cursor of a trend: a line that a finger or a keyboard sets, and the values there.

const NEAR = 0.02; // of the plot's width: how far from the cursor a value may be
const STEP = 0.02; // of the plot's width, by a key
const NOTHING = "—";

class Cursor {
  /** @type {HTMLElement} */
  #root;
  /** @type {import("../trend/plot.js").Plot} */
  #plot;
  /** @type {View | null} */
  #drawn = null; // {begin, end, width, span} of what the plot shows
  /** @type {Column[][]} */
  #columns = [];
  /** @type {number | null} */
  #time = null; // in seconds since the epoch

  /** @param {HTMLElement} root @param {import("../trend/plot.js").Plot} plot */
  constructor(root, plot) {
    this.#root = root;
    this.#plot = plot;
    const area = find(root, ".area");
    /** @param {PointerEvent} event */
    const point = (event) => this.#point((event.clientX - area.getBoundingClientRect().left) / area.clientWidth);
    area.addEventListener("pointerdown", point);
    area.addEventListener("pointermove", (event) => event.buttons && point(event));
    keepDrags(area, "sideways");
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

// A trend: draws what the server keeps, follows it while the widget can be seen, and looks back.

const LEAST_MS = 500; // between two requests
const AGAIN_MS = 2000; // after one that failed
const LATE_S = 1; // a sample is in the history by then
const SETTLED_S = 0.5;

/** @param {HTMLElement} root */
export const equip = (root) => new Trend(root);

class Trend {
  /** @type {HTMLElement} */
  #root;
  /** @type {HTMLElement} */
  #area;
  #plot;
  #cursor;
  /** @type {Column[][]} */
  #columns; // of each pen
  /** @type {number[]} */
  #windows;
  #keep;
  #span;
  /** @type {number | null} */
  #end = null; // in seconds since the epoch, by the server's clock; null: live
  /** @type {View | null} */
  #drawn = null; // {begin, end, width, zone, shift} of the columns
  #clock = 0; // what to add to performance.now() for the server's clock, in seconds
  #visible = false;
  #timer = 0;
  /** @type {AbortController | null} */
  #request = null; // the request under way

  /** @param {HTMLElement} root */
  constructor(root) {
    this.#root = root;
    this.#area = find(root, ".area");
    this.#windows = (root.dataset.windows ?? "").split(" ").map(Number);
    this.#keep = Number(root.dataset.keep);
    this.#span = Number(root.dataset.window);
    this.#plot = new Plot(root);
    this.#cursor = new Cursor(root, this.#plot);
    this.#columns = this.#plot.pens.map(() => []);
    this.#listen();
    this.#showState();
  }

  #listen() {
    new IntersectionObserver((seen) => this.#setVisible(seen[seen.length - 1].isIntersecting)).observe(this.#area);
    document.addEventListener("visibilitychange", () => this.#update());
    const keys = this.#root.querySelector(".trend-keys");
    keys?.addEventListener("click", ({ target }) => this.#act(closest(target, "button")?.dataset.do));
    setInterval(() => this.#showBehind(), 1000);
  }

  get #now() {
    return performance.now() / 1000 + this.#clock;
  }

  /** @param {boolean} visible */
  #setVisible(visible) {
    this.#visible = visible;
    this.#update();
  }

  // Asks while the trend can be seen; a pause asks for nothing.
  #update() {
    clearTimeout(this.#timer);
    if (!this.#visible || document.hidden) return;
    const isOver = this.#end !== null && this.#drawn?.end === this.#end && this.#drawn.span === this.#span;
    if (!isOver) this.#query();
  }

  async #query() {
    this.#request?.abort();
    const request = new AbortController();
    this.#request = request;
    const points = this.#plot.mostColumns;
    const query = new URLSearchParams({ span_s: String(this.#span), points: String(points) });
    const width = this.#span / points;
    const drawn = this.#drawn;
    const goesOn = this.#end === null && drawn?.live && drawn.width === width;
    const since = goesOn ? Math.max(0, Math.floor((drawn.end - LATE_S) / width) - 1) : 0;
    if (this.#end !== null) query.set("end", String(this.#end));
    if (goesOn) query.set("since", String(since));
    const path = `${pageGuard.page.base}/widgets/${this.#root.dataset.widget}/trend?${query}`;
    let wait = AGAIN_MS;
    try {
      const response = await fetch(path, { signal: request.signal });
      if (response.ok) {
        /** @type {TrendAnswer} */
        const answer = await response.json();
        wait = Math.max(LEAST_MS, width * 1000);
        this.#clock = answer.now - performance.now() / 1000;
        if (goesOn && answer.shift !== drawn.shift) wait = 0;
        this.#receive(answer, since, wait > 0);
      }
    } catch {
      if (request.signal.aborted) return; // another one is under way
    }
    if (request !== this.#request) return;
    clearTimeout(this.#timer);
    if (this.#end === null || wait === AGAIN_MS) this.#timer = setTimeout(() => this.#update(), wait);
  }

  // Columns from `since` on take the place of those that are there.
  /** @param {TrendAnswer} answer @param {number} since @param {boolean} live */
  #receive(answer, since, live) {
    const { end, shift, width_s: width, zone_s: zone, offset } = answer;
    const begin = end - this.#span;
    /** @param {number} number */
    const isBefore = (number) => (number + 1) * width < begin;
    this.#columns = answer.pens.map((items, i) => merged(this.#columns[i], items, since, isBefore));
    this.#drawn = {
      begin,
      end: this.#end ?? end,
      width,
      zone,
      offset,
      shift,
      span: this.#span,
      live: live && this.#end === null,
    };
    this.#plot.draw(this.#drawn, this.#columns);
    this.#cursor.show(this.#drawn, this.#columns);
    this.#showState();
  }

  // The keys.
  /** @param {string | undefined} what */
  #act(what) {
    const end = this.#end ?? this.#now;
    const window = this.#windows.indexOf(this.#span);
    if (what === "pause") this.#end = this.#drawn?.end ?? end;
    else if (what === "live") this.#end = null;
    else if (what === "back") this.#end = Math.max(end - this.#span / 2, this.#oldest);
    else if (what === "forward")
      this.#end = end + this.#span / 2 >= this.#now - SETTLED_S ? null : end + this.#span / 2;
    else if (what === "longer") this.#span = this.#windows[window + 1] ?? this.#span;
    else if (what === "shorter") this.#span = this.#windows[window - 1] ?? this.#span;
    else return;
    if (what === "live") this.#cursor.remove();
    this.#showState();
    this.#update();
  }

  get #oldest() {
    return this.#now - this.#keep + this.#span;
  }

  #showState() {
    const window = this.#windows.indexOf(this.#span);
    const live = this.#end === null;
    this.#root.toggleAttribute("data-paused", !live);
    const keys = {
      back: (this.#end ?? this.#now) <= this.#oldest,
      forward: live,
      longer: window >= this.#windows.length - 1,
      shorter: window <= 0,
      pause: false,
    };
    for (const [name, off] of Object.entries(keys)) {
      const key = this.#root.querySelector(`button[data-do="${name}"]`);
      if (key) key.disabled = off;
    }
    const pause = this.#root.querySelector("[data-do=pause]");
    const resume = this.#root.querySelector("[data-do=live]");
    if (pause && resume) {
      const had = document.activeElement === pause || document.activeElement === resume;
      [pause.hidden, resume.hidden] = [!live, live];
      if (had) (live ? pause : resume).focus();
    }
    find(this.#root, ".paused").hidden = live;
    this.#showBehind();
  }

  #showBehind() {
    if (this.#end === null) return;
    const behindS = Math.max(0, Math.round(this.#now - this.#end));
    find(this.#root, ".paused span").textContent = `−${duration(behindS)}`;
  }
}
