// A map: tiles of its picture in one transform, the robot over them. Fingers, the wheel and keys move and enlarge it.
import { closest, find } from "../show.js";
import { keepDrags } from "../touches.js";

/** @typedef {{ x: number, y: number, yaw: number, resolution: number }} Placed */
/** @typedef {Placed & { version: string, width: number, height: number }} Grid */
/** @typedef {{ x: number, y: number }} Point */
/** @typedef {(event: PointerEvent) => (() => void) | null} Taker */

const TILE = 512; // cells a side, as the server cuts them
const LEAST_ROBOT_PX = 12; // its radius, however small the map
const STEP = 1.5; // of the size, by a key
const PAN = 0.2; // of the view, by an arrow key
const MARGIN = 0.04; // of the view, around the whole map
const MOST_PX_PER_CELL = 24;
const SCALE_PX = 140; // at most, and a quarter of the map
const AGAIN_MS = 3000; // until tiles that did not come are asked for again
const MOST_LAYERS = 8;

/** @type {WeakMap<HTMLElement, MapView>} */
const views = new WeakMap();

// Called for each widget of this kind.
/** @param {HTMLElement} root */
export const equip = (root) => {
  const view = new MapView(root);
  views.set(root, view);
  if (root.querySelector(".map-list") || root.dataset.footprint) layers(root, view);
  if (root.querySelector(".map-plan")) placePlan(root, view);
};

/** @param {HTMLElement} root @param {MapView} view */
const layers = async (root, view) => (await import("./map-layers.js")).layersOf(root, view);

/** @param {HTMLElement} root @param {MapView} view */
const placePlan = async (root, view) => (await import("./map-plan.js")).placePlan(root, view);

// The view of a map, for other scripts; undefined until the widget is equipped.
/** @param {HTMLElement} root @returns {MapView | undefined} */
export const viewOf = (root) => views.get(root);

/** @type {Record<string, Show>} */
export const show = {
  grid: (root, grid) => views.get(root)?.showGrid(grid),
  pose: (root, pose) => views.get(root)?.showPose(pose),
  zones: async (root, zones) => {
    const view = views.get(root);
    if (!view) return;
    if (root.dataset.level !== undefined) (await import("./map-levels.js")).levelsOf(root, view).showZones(zones);
    else if (zones.length) (await import("./map-zones.js")).showZones(root, view, zones);
  },
  routes: async (root, routes) => {
    const view = views.get(root);
    if (view) (await import("./map-routes.js")).showRoutes(root, view, routes);
  },
  level: (root, level) => {
    root.dataset.level = level;
  },
  levels: async (root, levels) => {
    const view = views.get(root);
    if (view) (await import("./map-levels.js")).levelsOf(root, view).show(levels);
  },
  level_note: async (root, note) => {
    const view = views.get(root);
    if (view) (await import("./map-levels.js")).levelsOf(root, view).tell(note);
  },
  robots: async (root, robots) => {
    const view = views.get(root);
    if (view) (await import("./map-robots.js")).showRobots(root, view, robots);
  },
  ...Object.fromEntries(Array.from({ length: MOST_LAYERS }, (_, index) => [`layer_${index}`, showLayer(index)])),
};

/** @param {number} index @returns {Show} */
function showLayer(index) {
  return async (root, layer) => {
    const view = views.get(root);
    if (view) (await layers(root, view)).show(index, layer);
  };
}

export class MapView {
  /** @type {HTMLElement} */
  #root;
  /** @type {HTMLElement} */
  #view;
  /** @type {HTMLElement} */
  #tiles;
  /** @type {Grid | null} */
  #ofRobot = null; // the map that the robot is on
  /** @type {{ id: string, grid: Grid | null } | null} */
  #level = null; // another level, that the operator looks at
  /** @type {Grid | null} */
  #newest = null;
  /** @type {Grid | null} */
  #grid = null; // of the tiles that are shown: until those of the newest are there, all is drawn by these
  /** @type {HTMLElement | null} */
  #layer = null;
  #again = 0;
  /** @type {number[] | null} */
  #pose = null;
  #perMetre = 0; // pixels
  /** @type {Point} */
  #centre = { x: 0, y: 0 }; // of the view, in metres
  #isWhole = true; // the whole map is shown, whatever the size of the view
  #follows = false;
  /** @type {Map<number, Point>} */
  #fingers = new Map();
  #frame = 0;
  /** @type {(() => void)[]} */
  #drawn = [];
  /** @type {Taker[]} */
  #takers = [];
  /** @type {{ id: number, point: Point, end: () => void } | null} */
  #taken = null; // the finger that another script took

  /** @param {HTMLElement} root */
  constructor(root) {
    this.#root = root;
    this.#view = find(root, ".map-view");
    this.#tiles = find(root, ".map-tiles");
    const view = this.#view;
    new ResizeObserver(() => this.#draw()).observe(view);
    view.addEventListener("pointerdown", (event) => this.#down(event));
    view.addEventListener("pointermove", (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"])
      view.addEventListener(name, (event) => this.#up(/** @type {PointerEvent} */ (event).pointerId));
    keepDrags(view, "every");
    view.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    view.addEventListener("keydown", (event) => this.#key(event));
    find(root, ".map-keys").addEventListener("click", ({ target }) => this.#do(closest(target, "button")?.dataset.do));
    new MutationObserver(() => this.#load()).observe(document.documentElement, { attributeFilter: ["data-theme"] });
  }

  /** @param {Grid | null} grid */
  showGrid(grid) {
    this.#ofRobot = grid;
    this.#take();
  }

  // Another level than the robot's, where the robot is not drawn; null: that of the robot.
  /** @param {{ id: string, grid: Grid | null } | null} level */
  showLevel(level) {
    if (level?.id !== this.#level?.id) [this.#isWhole, this.#follows] = [true, false];
    this.#level = level;
    this.#root.toggleAttribute("data-elsewhere", level !== null);
    this.#take();
  }

  #take() {
    const before = this.#newest?.version;
    this.#newest = this.#level ? this.#level.grid : this.#ofRobot;
    if (this.#newest?.version !== before) this.#load();
    this.#draw();
  }

  // The level that is shown, "" on a map without levels, and while the robot's is not known.
  get level() {
    return this.#level?.id ?? this.#root.dataset.level ?? "";
  }

  /** @param {number[] | null} pose */
  showPose(pose) {
    this.#pose = pose;
    this.#draw();
  }

  // The version of the map that is shown, "" without one.
  get version() {
    return this.#grid?.version ?? "";
  }

  // Where the robot is on what is shown, or was last: x, y and yaw in metres and radians; null if that is not known.
  get pose() {
    return this.#level ? null : this.#pose;
  }

  // How many pixels a metre is.
  get perMetre() {
    return this.#perMetre;
  }

  // The middle of the view, in metres of the map's frame.
  get middle() {
    return { ...this.#centre };
  }

  // Moves the map so far that a point of it, in metres, is at least `margin` pixels within the view, and
  // below what covers `top` of it.
  /** @param {number} x @param {number} y @param {number} margin @param {number} top */
  bring(x, y, margin, top) {
    const { clientWidth, clientHeight } = this.#view;
    const at = this.at(x, y);
    const inside = (/** @type {number} */ part, /** @type {number} */ from, /** @type {number} */ size) =>
      Math.min(Math.max(part, from + margin), size - margin) - part;
    const [right, down] = [inside(at.x, 0, clientWidth), inside(at.y, Math.max(top, 0), clientHeight)];
    if (right || down) this.#pan(right, down);
  }

  // Of the view, in pixels.
  get width() {
    return this.#view.clientWidth;
  }

  // Draws soon.
  draw() {
    this.#draw();
  }

  // `call` is called after each draw: positions in the view may be others then.
  /** @param {() => void} call */
  onDraw(call) {
    this.#drawn.push(call);
    this.#draw();
  }

  // `take` gets the "pointerdown" of a first finger. If it returns a function, the finger does not move the map, and
  // its further events on `.map-view` are for the caller. The function is called if a second finger ends that:
  // two move and enlarge the map. `isFirst`: it is asked before the others.
  /** @param {Taker} take */
  onPointer(take, isFirst = false) {
    if (isFirst) this.#takers.unshift(take);
    else this.#takers.push(take);
  }

  // Where a point of the map's frame, in metres, is in the view, in pixels.
  /** @param {number} x @param {number} y @returns {Point} */
  at(x, y) {
    const { clientWidth, clientHeight } = this.#view;
    return {
      x: clientWidth / 2 + this.#perMetre * (x - this.#centre.x),
      y: clientHeight / 2 - this.#perMetre * (y - this.#centre.y),
    };
  }

  // Where an event is in the map's frame, in metres; null without a map.
  /** @param {MouseEvent} event @returns {Point | null} */
  pointAt(event) {
    if (!this.#grid || !this.#perMetre) return null;
    const { clientWidth, clientHeight } = this.#view;
    const { x, y } = this.#point(event);
    return {
      x: this.#centre.x + (x - clientWidth / 2) / this.#perMetre,
      y: this.#centre.y - (y - clientHeight / 2) / this.#perMetre,
    };
  }

  // The tiles of a grid, and whether all of them come.
  /** @param {Grid} grid @returns {{ layer: HTMLElement, isWhole: Promise<boolean> }} */
  tilesOf(grid) {
    const layer = document.createElement("div");
    const theme = document.documentElement.dataset.theme;
    const path = `${pageGuard.page.base}/widgets/${this.#root.dataset.widget}/map/${grid.version}`;
    for (let row = 0; row * TILE < grid.height; row++)
      for (let column = 0; column * TILE < grid.width; column++) {
        const image = Object.assign(new Image(), { src: `${path}/${column}-${row}.png?theme=${theme}`, alt: "" });
        image.style.left = `${column * TILE}px`;
        image.style.top = `${row * TILE - grid.height}px`;
        layer.append(image);
      }
    const decoded = Promise.allSettled([...layer.querySelectorAll("img")].map((image) => image.decode()));
    return { layer, isWhole: decoded.then((tiles) => tiles.every(({ status }) => status === "fulfilled")) };
  }

  // All tiles of a map are shown at once, in place of those before. A map with a tile missing is not shown.
  async #load() {
    clearTimeout(this.#again);
    const grid = this.#newest;
    if (!grid) return this.#show(null, null);
    const { layer, isWhole: arrival } = this.tilesOf(grid);
    const isWhole = await arrival;
    if (grid.version !== this.#newest?.version) return;
    this.#root.toggleAttribute("data-broken", !isWhole);
    if (isWhole) this.#show(grid, layer);
    else this.#again = setTimeout(() => this.#load(), AGAIN_MS);
  }

  /** @param {Grid | null} grid @param {HTMLElement | null} layer */
  #show(grid, layer) {
    [this.#grid, this.#layer] = [grid, layer];
    this.#tiles.replaceChildren(...(layer ? [layer] : []));
    for (const key of this.#root.querySelectorAll(".map-keys > button:not(.map-level)")) key.disabled = !grid;
    find(this.#root, ".map-scale").hidden = !grid;
    this.#root.dataset.version = grid?.version ?? "";
    this.#draw();
  }

  #draw() {
    cancelAnimationFrame(this.#frame);
    this.#frame = requestAnimationFrame(() => this.#drawNow());
  }

  #drawNow() {
    const grid = this.#grid;
    const robot = find(this.#root, ".map-robot");
    const unsure = find(this.#root, ".map-unsure");
    const pose = this.pose;
    for (const mark of [robot, unsure]) mark.toggleAttribute("hidden", !grid || !pose);
    if (!grid || !this.#view.clientWidth) return;
    if (this.#isWhole) this.#fit(grid);
    if (this.#follows && pose) this.#centre = { x: pose[0], y: pose[1] };
    if (this.#layer) this.placeTiles(this.#layer, grid);
    if (pose) {
      const place = this.at(pose[0], pose[1]);
      const radius = Math.max(Number(this.#root.dataset.radius) * this.#perMetre, LEAST_ROBOT_PX);
      const turn = (-pose[2] * 180) / Math.PI;
      robot.setAttribute("transform", `translate(${place.x} ${place.y}) rotate(${turn}) scale(${radius})`);
      unsure.setAttribute("transform", `translate(${place.x} ${place.y})`);
    }
    this.#drawScale();
    find(this.#root, '[data-do="follow"]').setAttribute("aria-pressed", String(this.#follows));
    for (const call of this.#drawn) call();
  }

  // Puts tiles, or a picture, where their lower left corner is.
  /** @param {HTMLElement} layer @param {Placed} grid */
  placeTiles(layer, grid) {
    const { x, y } = this.at(grid.x, grid.y);
    const perCell = this.#perMetre * grid.resolution;
    layer.style.transform = `translate(${x}px, ${y}px) rotate(${-grid.yaw}rad) scale(${perCell})`;
    layer.parentElement?.toggleAttribute("data-large", perCell > 1);
  }

  #drawScale() {
    const scale = find(this.#root, ".map-scale");
    const texts = [...scale.querySelectorAll("span")];
    const most = Math.min(SCALE_PX, this.#view.clientWidth / 4);
    const fitting = texts.filter(({ dataset }) => Number(dataset.metres) * this.#perMetre <= most);
    const shown = fitting[fitting.length - 1] ?? texts[0];
    for (const text of texts) text.hidden = text !== shown;
    scale.style.width = `${Number(shown.dataset.metres) * this.#perMetre}px`;
  }

  // The whole map, with a margin.
  /** @param {Grid} grid */
  #fit({ width, height, resolution, x, y, yaw }) {
    const [sin, cos] = [Math.sin(yaw), Math.cos(yaw)];
    const [w, h] = [width * resolution, height * resolution];
    this.#centre = { x: x + (cos * w - sin * h) / 2, y: y + (sin * w + cos * h) / 2 };
    const [across, up] = [Math.abs(cos) * w + Math.abs(sin) * h, Math.abs(sin) * w + Math.abs(cos) * h];
    const { clientWidth, clientHeight } = this.#view;
    this.#perMetre = Math.min(clientWidth / across, clientHeight / up) * (1 - MARGIN);
  }

  // Enlarges it around a point of the view.
  /** @param {number} factor @param {Point} [around] */
  #zoom(factor, around) {
    if (!this.#grid) return;
    const { clientWidth, clientHeight } = this.#view;
    const point = this.#follows || !around ? { x: clientWidth / 2, y: clientHeight / 2 } : around;
    const most = MOST_PX_PER_CELL / this.#grid.resolution;
    const least = 8 / (Math.max(this.#grid.width, this.#grid.height) * this.#grid.resolution);
    const next = Math.min(Math.max(this.#perMetre * factor, least), most);
    const change = 1 / this.#perMetre - 1 / next;
    this.#centre.x += (point.x - clientWidth / 2) * change;
    this.#centre.y -= (point.y - clientHeight / 2) * change;
    this.#perMetre = next;
    this.#isWhole = false;
    this.#draw();
  }

  /** @param {number} x @param {number} y */
  #pan(x, y) {
    this.#centre.x -= x / this.#perMetre;
    this.#centre.y += y / this.#perMetre;
    this.#isWhole = this.#follows = false;
    this.#draw();
  }

  /** @param {MouseEvent} event @returns {Point} */
  #point({ clientX, clientY }) {
    const { left, top } = this.#view.getBoundingClientRect();
    return { x: clientX - left, y: clientY - top };
  }

  /** @param {PointerEvent} event */
  #down(event) {
    this.#view.setPointerCapture(event.pointerId);
    const [id, point] = [event.pointerId, this.#point(event)];
    if (this.#taken) {
      this.#fingers.set(this.#taken.id, this.#taken.point);
      this.#taken.end();
      this.#taken = null;
    } else if (!this.#fingers.size) {
      for (const take of this.#takers) {
        const end = take(event);
        if (!end) continue;
        this.#taken = { id, point, end };
        return;
      }
    }
    this.#fingers.set(id, point);
  }

  /** @param {number} id */
  #up(id) {
    this.#fingers.delete(id);
    if (this.#taken?.id === id) this.#taken = null;
  }

  // One finger moves the map, two enlarge and move it.
  /** @param {PointerEvent} event */
  #move(event) {
    if (this.#taken?.id === event.pointerId) this.#taken.point = this.#point(event);
    const before = this.#fingers.get(event.pointerId);
    if (!before || !this.#grid) return;
    const now = this.#point(event);
    this.#fingers.set(event.pointerId, now);
    const other = [...this.#fingers].find(([id]) => id !== event.pointerId)?.[1];
    if (!other) return this.#pan(now.x - before.x, now.y - before.y);
    const [was, is] = [before, now].map((point) => Math.hypot(point.x - other.x, point.y - other.y));
    if (was > 1) this.#zoom(is / was, { x: (now.x + other.x) / 2, y: (now.y + other.y) / 2 });
    if (!this.#follows) this.#pan((now.x - before.x) / 2, (now.y - before.y) / 2);
  }

  /** @param {WheelEvent} event */
  #wheel(event) {
    event.preventDefault();
    const { left, top } = this.#view.getBoundingClientRect();
    this.#zoom(2 ** (-event.deltaY / 400), { x: event.clientX - left, y: event.clientY - top });
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const { clientWidth, clientHeight } = this.#view;
    const [x, y] = [PAN * clientWidth, PAN * clientHeight];
    /** @type {Record<string, () => void>} */
    const keys = {
      ArrowLeft: () => this.#pan(x, 0),
      ArrowRight: () => this.#pan(-x, 0),
      ArrowUp: () => this.#pan(0, y),
      ArrowDown: () => this.#pan(0, -y),
      "+": () => this.#zoom(STEP),
      "-": () => this.#zoom(1 / STEP),
    };
    if (!this.#grid || !keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  }

  /** @param {string | undefined} what */
  #do(what) {
    if (what === "layers" || what === "levels" || what === "robots") return;
    if (what === "in") this.#zoom(STEP);
    else if (what === "out") this.#zoom(1 / STEP);
    else if (what === "whole") [this.#isWhole, this.#follows] = [true, false];
    else if (what === "follow") {
      this.#follows = !this.#follows;
      this.#isWhole = false;
    }
    this.#draw();
  }
}
