// What is drawn on a map for goals: the places with their names, and what is chosen, a ring with an arrow. A finger that
// presses and drags sets a pose with its direction.
import { svgElement } from "../show.js";

/** @typedef {import("./map.js").MapView} MapView */
/** @typedef {{ x: number, y: number }} Point */
/** @typedef {import("./place.js").Place} Place */

const NEAR_PX = 26; // around a symbol that a finger meets
const TURN_PX = 22; // a drag that is shorter does not turn
const RING_PX = 17;
const ARROW_PX = 46;
const PHONE = matchMedia("(max-width: 599px)"); // it only shows

// Over what the map has, or under the mark `above`.
/** @param {HTMLElement} map @param {string} name @param {string} [above] */
function layer(map, name, above) {
  const made = svgElement("g", { class: name });
  const marks = map.querySelector("svg.map-marks");
  marks?.insertBefore(made, above ? marks.querySelector(above) : null);
  return made;
}

export class Places {
  /** @type {MapView} */
  #view;
  #layer;
  /** @type {Place[]} */
  #places = [];
  #chosen = "";

  // `choose` gets the id of a place whose symbol is touched.
  /** @param {HTMLElement} map @param {MapView} view @param {(id: string) => void} choose */
  constructor(map, view, choose) {
    this.#view = view;
    this.#layer = layer(map, "map-places", ".map-robot"); // a robot that is at a place is seen
    view.onDraw(() => this.#draw());
    view.onPointer((event) => {
      const id = this.#met(event);
      if (!id) return null;
      follow(map, event, { end: () => choose(id) });
      return () => follow(map, event, null);
    });
  }

  /** @param {Place[]} places @param {string} chosen */
  show(places, chosen) {
    const isSame =
      places.length === this.#places.length && places.every((place, at) => place.label === this.#places[at].label);
    [this.#places, this.#chosen] = [places, chosen];
    if (isSame) return this.#draw(); // the robot drives: only distances differ
    this.#layer.replaceChildren(
      ...places.map(({ label }) => {
        const text = svgElement("text", { x: RING_PX - 2, dy: ".36em" });
        text.textContent = label;
        return svgElement("g", {}, svgElement("circle", { r: 9 }), text);
      }),
    );
    this.#draw();
  }

  #draw() {
    this.#places.forEach(({ id, pose, level, reason }, number) => {
      const mark = this.#layer.children[number];
      const { x, y } = this.#view.at(pose[0], pose[1]);
      mark.setAttribute("transform", `translate(${x} ${y})`);
      const name = mark.querySelector("text");
      const isLeft = name !== null && x + RING_PX + name.getComputedTextLength() > this.#view.width;
      name?.setAttribute("text-anchor", isLeft ? "end" : "start");
      name?.setAttribute("x", String((isLeft ? -1 : 1) * (RING_PX - 2)));
      mark.toggleAttribute("data-locked", reason !== "");
      mark.toggleAttribute("data-chosen", id === this.#chosen);
      mark.toggleAttribute("hidden", !this.#view.version || level !== this.#view.level);
    });
  }

  /** @param {PointerEvent} event */
  #met(event) {
    const point = this.#view.pointAt(event);
    if (!point || PHONE.matches) return null;
    const here = this.#view.at(point.x, point.y);
    const met = this.#places
      .filter(({ level, reason }) => !reason && level === this.#view.level)
      .map(({ id, pose }) => ({ id, away: distance(here, this.#view.at(pose[0], pose[1])) }))
      .sort((one, other) => one.away - other.away)[0];
    return met && met.away <= NEAR_PX ? met.id : null;
  }
}

export class Goal {
  /** @type {HTMLElement} */
  #map;
  /** @type {MapView} */
  #view;
  #mark;
  /** @type {number[] | null} */
  #pose = null; // what is chosen
  #level = ""; // and on which level
  /** @type {number[] | null} */
  #touched = null; // what a finger sets just now
  #radius = 0;

  /** @param {HTMLElement} map @param {MapView} view */
  constructor(map, view) {
    this.#map = map;
    this.#view = view;
    this.#mark = layer(map, "map-goal");
    this.#mark.append(
      svgElement("circle", { r: RING_PX }),
      svgElement("path", { d: `M0 0H${ARROW_PX}m-12-10 12 10-12 10` }),
      svgElement("path", { class: "map-cross", d: "M-4000 0H-24M24 0H4000M0-4000V-24M0 24V4000" }),
    );
    view.onDraw(() => this.#draw());
  }

  // How much floor must be free, in metres.
  /** @param {number} radius */
  surround(radius) {
    this.#radius = radius;
  }

  // The level that is shown.
  get level() {
    return this.#view.level;
  }

  // `isFree`: it would be sent; else the server has a reason against it, or has not answered yet.
  /** @param {number[] | null} pose @param {boolean} isFree @param {string} level */
  show(pose, isFree, level) {
    [this.#pose, this.#level] = [pose, level];
    this.#mark.toggleAttribute("data-refused", !isFree);
    this.#draw();
  }

  // A finger, or the main button of a mouse: `chosen` gets the value of the input, and the pose. The numbers are those
  // that the server reads, whatever the language.
  // `texts` has what is said of a pose that keys set.
  /** @param {(value: string, pose: number[]) => void} chosen @param {HTMLElement} texts */
  onTouch(chosen, texts) {
    this.#map.dataset.goals = "";
    /** @param {number[]} pose @param {string} version */
    const choose = (pose, version) => {
      const [x, y, yaw] = pose.map((part) => part.toFixed(2));
      chosen(`x=${x} y=${y} yaw=${yaw} map=${version}`, [Number(x), Number(y), Number(yaw)]);
    };
    this.#byKeys((pose) => choose(pose, this.#view.version), texts);
    this.#view.onPointer((event) => {
      const start = event.button === 0 && !PHONE.matches ? this.#view.pointAt(event) : null;
      if (!start) return null;
      const { version } = this.#view;
      const direction = (/** @type {PointerEvent} */ moved) => this.#direction(start, moved);
      this.#touch([start.x, start.y, direction(event)]);
      follow(this.#map, event, {
        move: (moved) => this.#touch([start.x, start.y, direction(moved)]),
        end: (moved) => {
          const pose = [start.x, start.y, direction(moved)];
          this.#touch(null);
          choose(pose, version);
        },
        cancel: () => this.#touch(null),
      });
      return () => {
        follow(this.#map, event, null);
        this.#touch(null);
      };
    });
  }

  /** @param {(pose: number[]) => void} set @param {HTMLElement} texts */
  async #byKeys(set, texts) {
    const { Crosshair } = await import("./map-crosshair.js");
    new Crosshair(this.#map, this.#view, { show: (pose) => this.#touch(pose), set, texts });
  }

  // Where the finger was dragged; without a drag straight on from the robot, else to the east.
  /** @param {Point} start @param {PointerEvent} event */
  #direction(start, event) {
    const end = this.#view.pointAt(event) ?? start;
    const moved = distance(this.#view.at(start.x, start.y), this.#view.at(end.x, end.y));
    if (moved >= TURN_PX) return Math.atan2(end.y - start.y, end.x - start.x);
    const robot = this.#view.pose;
    return robot ? Math.atan2(start.y - robot[1], start.x - robot[0]) : 0;
  }

  /** @param {number[] | null} pose */
  #touch(pose) {
    this.#touched = pose;
    this.#draw();
  }

  #draw() {
    const pose = this.#touched ?? this.#pose;
    const isThere = this.#touched !== null || this.#level === this.#view.level;
    this.#mark.toggleAttribute("hidden", !pose || !isThere || !this.#view.version);
    this.#mark.toggleAttribute("data-touched", this.#touched !== null);
    if (!pose) return;
    const { x, y } = this.#view.at(pose[0], pose[1]);
    const radius = this.#view.at(pose[0] + this.#radius, pose[1]).x - x;
    this.#mark.children[0].setAttribute("r", String(Math.max(radius, RING_PX)));
    const turn = (-pose[2] * 180) / Math.PI;
    this.#mark.setAttribute("transform", `translate(${x} ${y}) rotate(${turn})`);
    this.#mark.children[2].setAttribute("transform", `rotate(${-turn})`);
  }
}

/** @param {Point} first @param {Point} second */
const distance = (first, second) => Math.hypot(first.x - second.x, first.y - second.y);

/** @typedef {{ move?: (event: PointerEvent) => void, end: (event: PointerEvent) => void, cancel?: () => void }} Calls */
/** @type {WeakMap<HTMLElement, AbortController>} */
const followed = new WeakMap();

// The further events of a finger on a map, until it is lifted; null: no more of them.
/** @param {HTMLElement} map @param {PointerEvent} first @param {Calls | null} calls */
export function follow(map, first, calls) {
  followed.get(map)?.abort();
  if (!calls) return;
  const until = new AbortController();
  followed.set(map, until);
  const view = map.querySelector(".map-view");
  /** @param {"pointermove" | "pointerup" | "pointercancel"} name @param {(event: PointerEvent) => void} call */
  const on = (name, call) =>
    view?.addEventListener(name, (event) => event.pointerId === first.pointerId && call(event), {
      signal: until.signal,
    });
  on("pointermove", (event) => calls.move?.(event));
  on("pointerup", (event) => {
    until.abort();
    calls.end(event);
  });
  on("pointercancel", () => {
    until.abort();
    calls.cancel?.();
  });
}
