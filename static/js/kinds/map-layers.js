// The layers of a map: paths and outlines as SVG, a scan on a canvas, costmaps as tiles. The operator hides any of
// them: that choice is the browser's. What the server says is old or has no place is not drawn.
import { find, setText, svgElement } from "../show.js";
import { clearedCanvas } from "./map-canvas.js";
import { openList } from "./map-list.js";

/** @typedef {import("./map.js").Grid} Grid */
/** @typedef {{ points?: number[], ellipse?: number[], grid?: Grid }} Drawn */
/** @typedef {Drawn & { label: string, state: string, note: string, warning: string }} Layer */

const POINT_PX = 3; // of a scan
const LEAST_BODY_PX = 16; // a smaller robot is drawn as its round sign

/** @type {WeakMap<HTMLElement, Layers>} */
const known = new WeakMap();

/** @param {HTMLElement} root @param {import("./map.js").MapView} view */
export function layersOf(root, view) {
  const layers = known.get(root) ?? new Layers(root, view);
  known.set(root, layers);
  return layers;
}

class Layers {
  /** @type {HTMLElement} */
  #root;
  /** @type {import("./map.js").MapView} */
  #view;
  /** @type {HTMLButtonElement[]} */
  #rows;
  /** @type {HTMLButtonElement[]} */
  #fixed; // those of the panel's files: routes, a plan
  /** @type {(Layer | undefined)[]} */
  #layers = [];
  /** @type {Map<number, SVGPolylineElement | SVGPolygonElement>} */
  #shapes = new Map();
  /** @type {Map<number, { grid: Grid, tiles: HTMLElement }>} */
  #costs = new Map();
  /** @type {number[][]} */
  #body;

  /** @param {HTMLElement} root @param {import("./map.js").MapView} view */
  constructor(root, view) {
    this.#root = root;
    this.#view = view;
    this.#rows = [...root.querySelectorAll("button[data-layer]")];
    this.#body = JSON.parse(root.dataset.footprint ?? "[]");
    this.#fixed = [...root.querySelectorAll("button[data-fixed]")];
    for (const row of [...this.#rows, ...this.#fixed]) {
      this.#check(row, !hidden(this.#name(row)));
      row.addEventListener("click", () => this.#toggle(row));
    }
    const list = /** @type {HTMLElement | null} */ (root.querySelector(".map-list"));
    if (list) openList(root, "layers", list);
    new MutationObserver(() => this.#reload()).observe(document.documentElement, { attributeFilter: ["data-theme"] });
    view.onDraw(() => this.#draw());
  }

  /** @param {number} index @param {Layer} layer */
  show(index, layer) {
    this.#layers[index] = layer;
    const row = this.#rows[index];
    setText(row.querySelector("b"), layer.label);
    setText(row.querySelector("small"), layer.note);
    row.dataset.state = layer.state;
    if (layer.grid) this.#load(index, layer.grid);
    else this.#drop(index);
    this.#note();
    this.#view.draw();
  }

  /** @param {HTMLElement} row */
  #name(row) {
    return `map-layer-hidden:${pageGuard.page.base}/${this.#root.dataset.widget}${row.dataset.topic}`;
  }

  /** @param {HTMLButtonElement} row @param {boolean} isShown */
  #check(row, isShown) {
    row.setAttribute("aria-pressed", String(isShown));
  }

  /** @param {HTMLButtonElement} row */
  #toggle(row) {
    const isShown = row.getAttribute("aria-pressed") !== "true";
    this.#check(row, isShown);
    hide(this.#name(row), !isShown);
    this.#note();
    this.#view.draw();
  }

  // What is wrong with the first layer that the operator has not hidden.
  #note() {
    const wrong = this.#layers.find((layer, index) => layer?.warning && this.#isWanted(index));
    const row = this.#fixed.find(({ dataset, ariaPressed }) => dataset.warning && ariaPressed === "true");
    setText(find(this.#root, ".map-note"), wrong?.warning ?? row?.dataset.warning ?? "");
  }

  // What is wrong with a layer of the panel's files, "" if nothing is.
  /** @param {HTMLElement} row @param {string} warning */
  warn(row, warning) {
    row.dataset.warning = warning;
    this.#note();
  }

  /** @param {number} index */
  #isWanted(index) {
    return this.#rows[index]?.getAttribute("aria-pressed") === "true";
  }

  // A costmap's tiles take the place of those before when all of them are there.
  /** @param {number} index @param {Grid} grid */
  async #load(index, grid) {
    const before = this.#costs.get(index);
    if (before?.grid.version === grid.version) {
      before.grid = grid;
      return;
    }
    const { layer: tiles, isWhole } = this.#view.tilesOf(grid);
    if (!(await isWhole) || this.#layers[index]?.grid?.version !== grid.version) return;
    this.#drop(index);
    this.#costs.set(index, { grid, tiles });
    find(this.#root, ".map-costs").append(tiles);
    this.#view.draw();
  }

  #reload() {
    for (const [index, { grid }] of [...this.#costs]) {
      this.#drop(index);
      this.#load(index, grid);
    }
    this.#view.draw();
  }

  /** @param {number} index */
  #drop(index) {
    this.#costs.get(index)?.tiles.remove();
    this.#costs.delete(index);
  }

  #draw() {
    this.#drawBody();
    for (const row of this.#fixed) {
      const drawn = find(this.#root, `.map-${row.dataset.fixed}`);
      const isThere = Boolean(this.#view.version) && drawn.dataset.level === this.#view.level;
      drawn.toggleAttribute("hidden", row.getAttribute("aria-pressed") !== "true" || !isThere);
    }
    if (!this.#rows.length) return;
    for (const [index, { grid, tiles }] of this.#costs) {
      tiles.hidden = !this.#isWanted(index);
      this.#view.placeTiles(tiles, grid);
    }
    const context = clearedCanvas(find(this.#root, "canvas.map-points"));
    const origin = this.#view.at(0, 0);
    const perCentimetre = (this.#view.at(1, 0).x - origin.x) / 100;
    const group = find(this.#root, ".map-shapes");
    const place = `translate(${origin.x} ${origin.y}) scale(${perCentimetre} ${-perCentimetre})`;
    if (Number.isFinite(perCentimetre)) group.setAttribute("transform", place);
    this.#drawWithin(perCentimetre * 100);
    for (const [index, row] of this.#rows.entries()) {
      const points = this.#isWanted(index) && this.#view.version ? (this.#layers[index]?.points ?? []) : [];
      if (row.dataset.shape === "scan") {
        for (let at = 0; context && at < points.length; at += 2)
          context.fillRect(
            origin.x + perCentimetre * points[at] - POINT_PX / 2,
            origin.y - perCentimetre * points[at + 1] - POINT_PX / 2,
            POINT_PX,
            POINT_PX,
          );
      } else this.#drawShape(index, row, points);
    }
  }

  /** @param {number} index @param {HTMLElement} row @param {number[]} points */
  #drawShape(index, row, points) {
    let shape = this.#shapes.get(index);
    if (!shape && points.length) {
      const isPath = row.dataset.shape === "path";
      shape = svgElement(isPath ? "polyline" : "polygon");
      if (isPath) shape.dataset.line = row.dataset.line;
      this.#shapes.set(index, shape);
      find(this.#root, ".map-shapes").append(shape);
    }
    const text = points.join(" ");
    if (shape && shape.getAttribute("points") !== text) shape.setAttribute("points", text);
  }

  // Where the robot is with 95 % of probability, with its radius: else its sign would hide it.
  /** @param {number} perMetre */
  #drawWithin(perMetre) {
    const mark = find(this.#root, ".map-within");
    const index = this.#layers.findIndex((layer, at) => layer?.ellipse && this.#isWanted(at));
    const [pose, ellipse] = [this.#view.pose, this.#layers[index]?.ellipse];
    mark.toggleAttribute("hidden", !pose || !ellipse || !this.#view.version);
    if (!pose || !ellipse) return;
    const { x, y } = this.#view.at(pose[0], pose[1]);
    const radius = Math.max(Number(this.#root.dataset.radius) * perMetre, LEAST_BODY_PX);
    mark.setAttribute("rx", String(ellipse[0] * perMetre + radius));
    mark.setAttribute("ry", String(ellipse[1] * perMetre + radius));
    mark.setAttribute("transform", `translate(${x} ${y}) rotate(${(-ellipse[2] * 180) / Math.PI})`);
  }

  // The robot's footprint of the panel file, in place of its round sign where that is large enough to be seen.
  #drawBody() {
    const pose = this.#view.pose;
    if (!this.#body.length) return;
    const body = find(this.#root, ".map-body");
    const perMetre = this.#view.at(1, 0).x - this.#view.at(0, 0).x;
    const most = Math.max(...this.#body.flat().map(Math.abs));
    const isShown = Boolean(pose && this.#view.version) && 2 * most * perMetre >= LEAST_BODY_PX;
    body.toggleAttribute("hidden", !isShown);
    this.#root.toggleAttribute("data-body", isShown);
    if (!pose || !isShown) return;
    const { x, y } = this.#view.at(pose[0], pose[1]);
    body.setAttribute("points", this.#body.map(([ahead, left]) => `${ahead * perMetre},${-left * perMetre}`).join(" "));
    body.setAttribute("transform", `translate(${x} ${y}) rotate(${(-pose[2] * 180) / Math.PI})`);
  }
}

// Storage may be refused: then a hidden layer is shown again after a reload.
/** @param {string} name */
function hidden(name) {
  try {
    return localStorage.getItem(name) !== null;
  } catch {
    return false;
  }
}

/** @param {string} name @param {boolean} isHidden */
function hide(name, isHidden) {
  try {
    if (isHidden) localStorage.setItem(name, "1");
    else localStorage.removeItem(name);
  } catch {}
}
