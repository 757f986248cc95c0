// The places of a tour, or the poses of the goal that runs: a list, and the same numbers on the map, joined by a line.
import { copyOf, find, setText, svgElement } from "../show.js";
import { viewOf } from "./map.js";

/** @typedef {import("./map.js").MapView} MapView */
/** @typedef {{ number: number, label: string, state: string, word: string, note: string, pose: number[] | null }} Row */

const RADIUS_PX = 12;
const CURRENT_PX = 15;

/** @type {WeakMap<HTMLElement, Tour>} */
const tours = new WeakMap();

/** @param {HTMLElement} root */
export const equip = (root) => tours.set(root, new Tour(root));

/** @type {Record<string, Show>} */
export const show = {
  rows: (root, rows) => tours.get(root)?.showRows(rows),
  level: (root, level) => tours.get(root)?.showLevel(level),
};

class Tour {
  #root;
  #list;
  /** @type {Row[]} */
  #rows = [];
  #level = "";
  /** @type {MapView | null} */
  #view = null;
  #line = svgElement("polyline");
  #marks = svgElement("g");
  #layer = svgElement("g", { class: "map-tour" }, this.#line, this.#marks);

  /** @param {HTMLElement} root */
  constructor(root) {
    this.#root = root;
    this.#list = find(root, "ol");
  }

  /** @param {Row[]} rows */
  showRows(rows) {
    const before = this.#rows.find(({ state }) => state === "current")?.number;
    this.#rows = rows;
    const list = this.#list;
    while (list.children.length > rows.length) list.lastElementChild?.remove();
    while (list.children.length < rows.length)
      list.append(copyOf(/** @type {HTMLTemplateElement} */ (find(this.#root, "template.row-template"))));
    rows.forEach(({ number, label, state, word, note }, index) => {
      const row = /** @type {HTMLElement} */ (list.children[index]);
      row.dataset.state = state;
      if (state === "current") row.setAttribute("aria-current", "step");
      else row.removeAttribute("aria-current");
      setText(find(row, ".number"), String(number));
      setText(find(row, "b"), label);
      setText(find(row, ".word"), word);
      setText(find(row, "small"), note);
    });
    const current = rows.find(({ state }) => state === "current")?.number;
    if (current && current !== before) this.#reveal(current - 1);
    this.#show();
  }

  // The row of the current pose is seen in a long list; the page itself stays where it is.
  /** @param {number} index */
  #reveal(index) {
    const [list, row] = [this.#list, /** @type {HTMLElement} */ (this.#list.children[index])];
    const top = row.offsetTop - list.offsetTop;
    if (top < list.scrollTop || top + row.offsetHeight > list.scrollTop + list.clientHeight)
      list.scrollTop = top - list.clientHeight / 3;
  }

  /** @param {string} level */
  showLevel(level) {
    this.#level = level;
    this.#show();
  }

  // The map is equipped before the first event: its script is loaded with this one.
  #show() {
    if (!this.#view) {
      const map = document.querySelector(`[data-kind="map"][data-widget="${this.#root.dataset.map}"]`);
      this.#view = (map && viewOf(map)) ?? null;
      if (!map || !this.#view) return;
      const marks = find(map, "svg.map-marks");
      marks.insertBefore(this.#layer, find(marks, ".map-robot"));
      this.#view.onDraw(() => this.#draw());
    }
    this.#view.draw();
  }

  #draw() {
    const view = this.#view;
    if (!view) return;
    const isShown = view.version !== "" && this.#level === view.level;
    this.#layer.toggleAttribute("hidden", !isShown);
    if (!isShown) return;
    const placed = this.#rows.flatMap((row) => (row.pose ? [{ ...row, ...view.at(row.pose[0], row.pose[1]) }] : []));
    this.#line.setAttribute("points", placed.map(({ x, y }) => `${x},${y}`).join(" "));
    while (this.#marks.children.length > placed.length) this.#marks.lastChild?.remove();
    while (this.#marks.children.length < placed.length)
      this.#marks.append(
        svgElement(
          "g",
          {},
          svgElement("circle"),
          svgElement("text", { "text-anchor": "middle", dy: ".36em" }),
          svgElement("path", { d: "M-9-9 9 9M9-9-9 9" }),
        ),
      );
    placed.forEach(({ x, y, number, state }, index) => {
      const mark = this.#marks.children[index];
      mark.setAttribute("transform", `translate(${x} ${y})`);
      mark.setAttribute("data-state", state);
      mark.children[0].setAttribute("r", String(state === "current" ? CURRENT_PX : RADIUS_PX));
      const text = mark.children[1];
      if (text.textContent !== String(number)) text.textContent = String(number);
    });
  }
}
