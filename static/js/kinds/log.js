// A log: asks for its lines while it is seen, when more have come, and when other lines are wanted.
import { copyOf, find, setText } from "../show.js";

const APART_MS = 250;
const SETTLE_MS = 300; // from the last letter typed

/** @type {WeakMap<HTMLElement, Log>} */
const logs = new WeakMap();

// Called for each widget of this kind.
/** @param {HTMLElement} root */
export const equip = (root) => logs.set(root, new Log(root));

/** @type {Record<string, Show>} */
export const show = {
  count(root, value) {
    root.dataset.count = value;
    logs.get(root)?.update();
  },
};

class Log {
  /** @type {HTMLElement} */
  #root;
  /** @type {HTMLElement} */
  #lines;
  #last = 0; // the number of the newest line at the last response
  #queriedAt = -Infinity;
  #timer = 0;
  /** @type {AbortController | null} */
  #request = null; // the request under way
  #onScreen = false;
  #paused = false;

  /** @param {HTMLElement} root */
  constructor(root) {
    this.#root = root;
    this.#lines = find(root, ".lines");
    const wanted = find(root, ".wanted");
    wanted.inert = false;
    find(wanted, ".level").addEventListener("change", () => this.#restart());
    for (const input of wanted.querySelectorAll("input")) {
      input.addEventListener("input", () => this.#restart(SETTLE_MS));
      input.addEventListener("keydown", (event) => event.key === "Enter" && event.preventDefault()); // no press
    }
    const pause = find(wanted, ".pause");
    pause.addEventListener("click", () => {
      this.#paused = !this.#paused;
      pause.setAttribute("aria-pressed", String(this.#paused));
      this.update();
    });
    new IntersectionObserver((entries) => {
      this.#onScreen = entries[entries.length - 1].isIntersecting;
      this.update();
    }).observe(root);
    document.addEventListener("visibilitychange", () => this.update());
    this.#restart();
  }

  // Asks when there is more than what was asked for, not too often, and one request at a time.
  update() {
    const more = Number(this.#root.dataset.count) !== this.#last;
    if (!more || this.#paused || this.#request || this.#timer || !this.#onScreen || document.hidden) return;
    const wait = Math.max(0, this.#queriedAt + APART_MS - performance.now());
    this.#timer = setTimeout(() => this.#query(), wait);
  }

  // From the first line on, as other lines are wanted.
  #restart(wait = 0) {
    this.#request?.abort();
    this.#request = null;
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#query(true), wait);
  }

  async #query(whole = false) {
    this.#timer = 0;
    this.#queriedAt = performance.now();
    const request = new AbortController();
    this.#request = request;
    const query = new URLSearchParams({
      level: find(this.#root, ".wanted select.level").value,
      node: find(this.#root, ".wanted input.node").value,
      search: find(this.#root, ".wanted input.search").value,
      after: String(whole ? 0 : this.#last),
    });
    try {
      const path = `${pageGuard.page.base}/widgets/${this.#root.dataset.widget}/lines?${query}`;
      const answer = await fetch(path, { signal: request.signal });
      if (answer.ok && request === this.#request) this.#show(await answer.json(), whole);
    } catch {
      // The connection is lost: the page shows that.
    }
    if (request !== this.#request) return;
    this.#request = null;
    this.update();
  }

  /** @param {{ lines: Record<string, string>[], note: string, last: number }} answer @param {boolean} whole */
  #show({ lines, note, last }, whole) {
    const template = find(this.#root, "template");
    const top = this.#lines.scrollTop;
    const before = this.#lines.scrollHeight;
    const rows = lines.reverse().map((line) => {
      const row = copyOf(template);
      row.dataset.level = line.level;
      find(row, "time").dateTime = line.at;
      for (const name of ["time", "word", "node", "text"]) find(row, `.${name}`).textContent = line[name];
      return row;
    });
    if (whole) this.#lines.replaceChildren(...rows);
    else this.#lines.prepend(...rows);
    while (this.#lines.children.length > Number(this.#root.dataset.lines)) this.#lines.lastElementChild?.remove();
    // Who reads further down stays there.
    if (top > 0 && !whole) this.#lines.scrollTop = top + this.#lines.scrollHeight - before;
    setText(this.#root.querySelector(".left-out"), note);
    this.#last = last;
  }
}
