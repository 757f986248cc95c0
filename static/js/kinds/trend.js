// A trend: draws what the server keeps, follows it while the widget can be seen, and looks back.
import { merged } from "../trend/columns.js";
import { Cursor } from "../trend/cursor.js";
import { duration, Plot } from "../trend/plot.js";
import { closest, find } from "../show.js";

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
