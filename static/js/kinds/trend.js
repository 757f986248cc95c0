// A trend: draws what the server keeps, follows it while the widget can be seen, and looks back.
import { Plot, written } from "../trend-plot.js";

const LEAST_MS = 500; // between two requests
const AGAIN_MS = 2000; // after one that failed
const LATE_S = 1; // a sample is in the history by then
const PER_COLUMN_PX = 1.5;
const SETTLED_S = 0.5;
const NEAR = 0.02; // of the plot's width: how far from the cursor a value may be

export const equip = (root) => new Trend(root);

class Trend {
  #root;
  #area;
  #plot;
  #columns; // of each pen: [number, lowest, highest, last, whether it begins a line]
  #windows;
  #keep;
  #span;
  #end = null; // in seconds since the epoch, by the server's clock; null: live
  #drawn = null; // {begin, end, width, zone, shift} of the columns
  #clock = 0; // what to add to performance.now() for the server's clock, in seconds
  #cursor = null; // in seconds since the epoch
  #visible = false;
  #timer = 0;
  #asked = null; // the request under way

  constructor(root) {
    this.#root = root;
    this.#area = root.querySelector(".area");
    this.#windows = root.dataset.windows.split(" ").map(Number);
    this.#keep = Number(root.dataset.keep);
    this.#span = Number(root.dataset.window);
    this.#plot = new Plot(root);
    this.#columns = this.#plot.pens.map(() => []);
    this.#listen();
  }

  #listen() {
    new IntersectionObserver((seen) => this.#see(seen.at(-1).isIntersecting)).observe(this.#area);
    document.addEventListener("visibilitychange", () => this.#follow());
    const keys = this.#root.querySelector(".trend-keys");
    if (keys) keys.hidden = false;
    keys?.addEventListener("click", (event) => this.#do(event.target.closest("button")?.dataset.do));
    const point = (event) => this.#point((event.clientX - this.#area.getBoundingClientRect().left) / this.#area.clientWidth);
    this.#area.addEventListener("pointerdown", point);
    this.#area.addEventListener("pointermove", (event) => event.buttons && point(event));
    this.#area.addEventListener("keydown", (event) => this.#key(event));
    setInterval(() => this.#showBehind(), 1000);
  }

  get #now() {
    return performance.now() / 1000 + this.#clock;
  }

  #see(visible) {
    this.#visible = visible;
    this.#follow();
  }

  // Asks while the trend can be seen; a pause asks for nothing.
  #follow() {
    clearTimeout(this.#timer);
    if (!this.#visible || document.hidden) return;
    const isOver = this.#end !== null && this.#drawn?.end === this.#end && this.#drawn.span === this.#span;
    if (!isOver) this.#ask();
  }

  async #ask() {
    this.#asked?.abort();
    const asked = (this.#asked = new AbortController());
    const points = Math.min(1000, Math.max(50, Math.round(this.#plot.width / PER_COLUMN_PX)));
    const query = { span_s: this.#span, points };
    const width = this.#span / points;
    const drawn = this.#drawn;
    const goesOn = this.#end === null && drawn?.live && drawn.width === width;
    if (this.#end !== null) query.end = this.#end;
    if (goesOn) query.since = Math.max(0, Math.floor((drawn.end - LATE_S) / width) - 1);
    const path = `${document.body.dataset.base}/widgets/${this.#root.dataset.widget}/trend?${new URLSearchParams(query)}`;
    let wait = AGAIN_MS;
    try {
      const response = await fetch(path, { signal: asked.signal });
      if (response.ok) {
        const answer = await response.json();
        wait = Math.max(LEAST_MS, width * 1000);
        this.#clock = answer.now - performance.now() / 1000;
        if (goesOn && answer.shift !== drawn.shift) wait = 0;
        this.#take(answer, goesOn ? query.since : 0, wait > 0);
      }
    } catch {
      if (asked.signal.aborted) return; // another one is under way
    }
    if (asked !== this.#asked) return;
    clearTimeout(this.#timer);
    if (this.#end === null || wait === AGAIN_MS) this.#timer = setTimeout(() => this.#follow(), wait);
  }

  // Columns from `since` on take the place of those that are there.
  #take(answer, since, live) {
    const begin = answer.end - this.#span;
    this.#columns = answer.pens.map((items, i) => {
      const kept = since ? this.#columns[i].filter(([number]) => number < since) : [];
      let starts = false;
      for (const item of items) {
        if (item && item[0] >= since) kept.push(item.length === 2 ? [item[0], item[1], item[1], item[1], starts] : [...item, starts]);
        starts = item === null;
      }
      // One before the plot stays: a line comes in from there.
      const first = kept.findIndex(([number]) => (number + 1) * answer.width_s >= begin);
      return first > 0 ? kept.slice(first - 1) : first < 0 ? kept.slice(-1) : kept;
    });
    const { end, shift, width_s: width, zone_s: zone } = answer;
    const isLive = live && this.#end === null;
    this.#drawn = { begin, end: this.#end ?? end, width, zone, shift, span: this.#span, live: isLive };
    this.#plot.draw(this.#drawn, this.#columns);
    this.#showCursor();
    this.#showState();
  }

  // The keys.
  #do(what) {
    const end = this.#end ?? this.#now;
    const window = this.#windows.indexOf(this.#span);
    if (what === "pause") this.#end = this.#drawn?.end ?? end;
    else if (what === "live") this.#end = this.#cursor = null;
    else if (what === "back") this.#end = Math.max(end - this.#span / 2, this.#oldest);
    else if (what === "forward") this.#end = end + this.#span / 2 >= this.#now - SETTLED_S ? null : end + this.#span / 2;
    else if (what === "longer") this.#span = this.#windows[window + 1] ?? this.#span;
    else if (what === "shorter") this.#span = this.#windows[window - 1] ?? this.#span;
    else return;
    this.#showState();
    this.#follow();
  }

  get #oldest() {
    return this.#now - this.#keep + this.#span;
  }

  #showState() {
    const window = this.#windows.indexOf(this.#span);
    const live = this.#end === null;
    this.#root.toggleAttribute("data-paused", !live);
    const keys = { back: (this.#end ?? this.#now) <= this.#oldest, forward: live, longer: window >= this.#windows.length - 1, shorter: window <= 0 };
    for (const [name, off] of Object.entries(keys)) {
      const key = this.#root.querySelector(`[data-do="${name}"]`);
      if (key) key.disabled = off;
    }
    const [pause, resume] = ["pause", "live"].map((name) => this.#root.querySelector(`[data-do="${name}"]`));
    const had = [pause, resume].includes(document.activeElement);
    if (pause) [pause.hidden, resume.hidden] = [!live, live];
    if (had) (live ? pause : resume).focus();
    this.#root.querySelector(".paused").hidden = live;
    this.#showBehind();
  }

  #showBehind() {
    if (this.#end === null) return;
    const s = Math.max(0, Math.round(this.#now - this.#end));
    const two = (number) => String(Math.floor(number)).padStart(2, "0");
    const days = s >= 86400 ? `${Math.floor(s / 86400)} d ` : "";
    this.#root.querySelector(".paused span").textContent = `−${days}${two((s % 86400) / 3600)}:${two((s % 3600) / 60)}:${two(s % 60)}`;
  }

  // The cursor.
  #point(place) {
    if (!this.#drawn) return;
    const { begin, end } = this.#drawn;
    this.#cursor = begin + Math.min(Math.max(place, 0), 1) * (end - begin);
    this.#showCursor();
  }

  #key(event) {
    const by = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
    if (!this.#drawn || (!by && event.key !== "Escape")) return;
    event.preventDefault();
    if (by) this.#point(((this.#cursor ?? this.#drawn.end) - this.#drawn.begin) / (this.#drawn.end - this.#drawn.begin) + by);
    else this.#cursor = null;
    this.#showCursor();
  }

  #showCursor() {
    const { begin, end } = this.#drawn;
    const line = this.#root.querySelector(".cursor");
    const box = this.#root.querySelector(".cursor-values");
    if (this.#cursor !== null && this.#cursor < begin) this.#cursor = null;
    const shown = this.#cursor !== null && this.#cursor <= end;
    line.setAttribute("visibility", shown ? "visible" : "hidden");
    box.hidden = !shown;
    if (!shown) return;
    const place = (this.#cursor - begin) / (end - begin);
    for (const name of ["x1", "x2"]) line.setAttribute(name, `${place * 100}%`);
    box.dataset.side = place < 0.5 ? "right" : "left";
    const texts = [["b", this.#plot.clockOf(this.#cursor)], ...this.#plot.pens.flatMap((pen, i) => [["span", pen.name], ["span", this.#valueAt(pen, this.#columns[i])]])];
    box.replaceChildren(...texts.map(([tag, text]) => Object.assign(document.createElement(tag), { textContent: text })));
  }

  #valueAt(pen, columns) {
    const distance = (one) => Math.abs(this.#plot.timeOf(one[0]) - this.#cursor);
    const nearest = columns.reduce((best, one) => (best === null || distance(one) < distance(best) ? one : best), null);
    if (!nearest || distance(nearest) > this.#drawn.width + NEAR * this.#span) return "—";
    const [, low, high] = nearest;
    const text = (value) => written(pen.digits === undefined ? Number(value.toPrecision(5)).toString() : value.toFixed(pen.digits));
    return `${low === high ? text(low) : `${text(low)} … ${text(high)}`} ${pen.unit}`.trim();
  }
}
