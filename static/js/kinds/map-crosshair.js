// A pose on a map by keys alone: Enter on the map begins with a crosshair in its middle, arrows move it by 20 mm of the
// screen (with Shift by 2), Page up and Page down turn the direction, Enter sets the pose, Escape ends it. What it says
// is read aloud when it rests.
import { find } from "../show.js";

/** @typedef {import("./map.js").MapView} MapView */
/** @typedef {{ show: (pose: number[] | null) => void, set: (pose: number[]) => void, texts: HTMLElement }} Calls */

const STEP_MM = 20;
const FINE_MM = 2;
const TURN_RAD = Math.PI / 12; // 15 degrees
const EDGE_PX = 48; // of the view, which moves the map: the arrow is within it
const REST_MS = 300;
/** @type {Record<string, [number, number]>} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
/** @type {Record<string, number>} */
const TURNS = { PageUp: 1, PageDown: -1 };

export class Crosshair {
  /** @type {HTMLElement} */
  #map;
  /** @type {MapView} */
  #view;
  /** @type {Calls} */
  #calls;
  /** @type {number[] | null} */
  #pose = null;
  #rest = 0;
  #line = Object.assign(document.createElement("p"), { className: "map-crosshair" });

  // `texts` has the templates of what is said; `show` draws the pose, `set` chooses it.
  /** @param {HTMLElement} map @param {MapView} view @param {Calls} calls */
  constructor(map, view, calls) {
    [this.#map, this.#view, this.#calls] = [map, view, calls];
    this.#line.setAttribute("role", "status");
    map.append(this.#line);
    const area = find(map, ".map-view");
    view.onDraw(() => this.#offer(area)); // with the first map: before, Enter begins nothing
    area.addEventListener("keydown", (event) => this.#key(event), { capture: true });
    area.addEventListener("blur", () => document.hasFocus() && this.#end()); // not by another window
    area.addEventListener("pointerdown", () => this.#end());
  }

  /** @param {HTMLElement} area */
  #offer(area) {
    if (area.hasAttribute("aria-description")) return;
    area.setAttribute("role", "application");
    area.setAttribute("aria-description", this.#text("begin"));
  }

  /** @param {"begin" | "at"} name */
  #text(name) {
    return find(this.#calls.texts, `template.crosshair-${name}`).content.textContent ?? "";
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const { key, shiftKey } = event;
    const isOn = this.#pose !== null;
    if (key === "Enter" && this.#view.version) {
      if (isOn) this.#set();
      else this.#begin();
    } else if (!isOn) return;
    else if (key === "Escape") this.#end();
    else if (ARROWS[key]) this.#move(ARROWS[key], shiftKey ? FINE_MM : STEP_MM);
    else if (TURNS[key]) this.#turn(TURNS[key] * TURN_RAD);
    else return;
    event.preventDefault();
    event.stopImmediatePropagation();
  }

  // In the middle of what is shown; it looks on from the robot, as a touched pose does.
  #begin() {
    const { x, y } = this.#view.middle;
    const robot = this.#view.pose;
    this.#show([x, y, robot ? Math.atan2(y - robot[1], x - robot[0]) : 0]);
  }

  /** @param {[number, number]} direction @param {number} mm */
  #move([right, down], mm) {
    if (!this.#pose) return;
    const [x, y, yaw] = this.#pose;
    const px = mm * Number.parseFloat(getComputedStyle(this.#map).getPropertyValue("--mm"));
    const metres = px / this.#view.perMetre;
    this.#show([x + right * metres, y - down * metres, yaw]);
    this.#bring();
  }

  // Into the view, below what is said.
  #bring() {
    if (!this.#pose) return;
    const said = this.#line.textContent ? this.#line.offsetTop + this.#line.offsetHeight : 0;
    this.#view.bring(this.#pose[0], this.#pose[1], EDGE_PX, said - find(this.#map, ".map-view").offsetTop);
  }

  /** @param {number} angle */
  #turn(angle) {
    if (!this.#pose) return;
    const [x, y, yaw] = this.#pose;
    this.#show([x, y, yaw + angle]);
  }

  /** @param {number[]} pose */
  #show(pose) {
    this.#pose = pose;
    this.#map.toggleAttribute("data-crosshair", true);
    this.#calls.show(pose);
    clearTimeout(this.#rest);
    this.#rest = setTimeout(() => this.#say(), REST_MS);
  }

  #say() {
    if (!this.#pose) return;
    const [x, y, yaw] = this.#pose;
    /** @param {number} number @param {number} decimals */
    const text = (number, decimals) =>
      number.toLocaleString(document.documentElement.lang, {
        minimumFractionDigits: decimals,
        maximumFractionDigits: decimals,
      });
    const degrees = (Math.round((yaw * 180) / Math.PI) + 360) % 360;
    /** @type {Record<string, string>} */
    const parts = { "{x}": text(x, 2), "{y}": text(y, 2), "{degrees}": text(degrees, 0) };
    this.#line.textContent = this.#text("at").replace(/\{\w+\}/g, (name) => parts[name] ?? name);
    this.#bring();
  }

  #set() {
    const pose = this.#pose;
    this.#end();
    if (pose) this.#calls.set(pose);
  }

  #end() {
    if (!this.#pose) return;
    this.#pose = null;
    clearTimeout(this.#rest);
    this.#map.toggleAttribute("data-crosshair", false);
    this.#line.textContent = "";
    this.#calls.show(null);
  }
}
