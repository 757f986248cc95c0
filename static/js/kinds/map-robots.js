// The other robots on a map of several, with their names: what is old is dashed and says its age. A finger on a robot, or
// its row in the list, opens the robot's page.
import { find, setText, svgElement } from "../show.js";
import { follow } from "./map-goal.js";
import { openList } from "./map-list.js";

/** @typedef {import("./map.js").MapView} MapView */
/** @typedef {{ robot: string, name: string, label: string, state: string, note: string, level: string, pose: number[] | null }} Robot */

const NEAR_PX = 26; // around a robot that a finger meets
const LEAST_PX = 11; // its radius, however small the map
const NAME_PX = 6; // between a robot and its name

/** @type {WeakMap<HTMLElement, Robots>} */
const known = new WeakMap();

/** @param {HTMLElement} root @param {MapView} view @param {Robot[]} robots */
export function showRobots(root, view, robots) {
  const shown = known.get(root) ?? new Robots(root, view);
  known.set(root, shown);
  shown.show(robots);
}

class Robots {
  /** @type {HTMLElement} */
  #root;
  /** @type {MapView} */
  #view;
  /** @type {Robot[]} */
  #robots = [];
  #marks = svgElement("g", { class: "map-others" });

  /** @param {HTMLElement} root @param {MapView} view */
  constructor(root, view) {
    this.#root = root;
    this.#view = view;
    find(root, ".map-robot").before(this.#marks);
    openList(root, "robots", this.#list);
    view.onDraw(() => this.#draw());
    view.onPointer((event) => this.#take(event), true);
  }

  get #list() {
    return find(this.#root, "div.map-robot-list");
  }

  /** @param {Robot[]} robots */
  show(robots) {
    this.#robots = robots;
    for (const { robot, state, note } of robots) {
      const row = this.#row(robot);
      if (!row) continue;
      row.dataset.state = state;
      setText(row.querySelector("small"), note);
    }
    while (this.#marks.children.length > robots.length) this.#marks.lastChild?.remove();
    while (this.#marks.children.length < robots.length) {
      const sign = svgElement(
        "g",
        {},
        svgElement("circle", { r: "1" }),
        svgElement("path", { d: "M.75 0-.5.55-.2 0-.5-.55z" }),
      );
      const unsure = svgElement("text", { "text-anchor": "middle", dy: ".36em" });
      unsure.textContent = "?";
      this.#marks.append(svgElement("g", {}, sign, unsure, svgElement("text", { class: "map-name", dy: ".36em" })));
    }
    this.#view.draw();
  }

  /** @param {string} robot */
  #row(robot) {
    return /** @type {HTMLAnchorElement | null} */ (this.#list.querySelector(`a[data-on-map="${robot}"]`));
  }

  #draw() {
    const radius = Math.max(Number(this.#root.dataset.radius) * this.#view.perMetre, LEAST_PX);
    this.#robots.forEach(({ label, state, level, pose }, number) => {
      const mark = this.#marks.children[number];
      mark.toggleAttribute("hidden", !pose || !this.#view.version || level !== this.#view.level);
      mark.setAttribute("data-state", state);
      if (!pose) return;
      const { x, y } = this.#view.at(pose[0], pose[1]);
      const [sign, , name] = mark.children;
      mark.setAttribute("transform", `translate(${x} ${y})`);
      sign.setAttribute("transform", `rotate(${(-pose[2] * 180) / Math.PI}) scale(${radius})`);
      if (name.textContent !== label) name.textContent = label;
      const beside = radius + NAME_PX;
      const isLeft = x + beside + /** @type {SVGTextElement} */ (name).getComputedTextLength() > this.#view.width;
      name.setAttribute("text-anchor", isLeft ? "end" : "start");
      name.setAttribute("x", String(isLeft ? -beside : beside));
    });
  }

  // A finger on another robot, unless the map's own is nearer.
  /** @param {PointerEvent} event */
  #take(event) {
    const robot = event.button === 0 ? this.#met(event) : "";
    if (!robot) return null;
    const opens = (/** @type {PointerEvent} */ lifted) => {
      if (this.#met(lifted) === robot) this.#row(robot)?.click();
    };
    follow(this.#root, event, { end: opens });
    return () => follow(this.#root, event, null);
  }

  // The id of the robot under a finger, "" for none.
  /** @param {PointerEvent} event */
  #met(event) {
    const point = this.#view.pointAt(event);
    if (!point) return "";
    const finger = this.#view.at(point.x, point.y);
    const away = (/** @type {number[] | null} */ pose) => {
      if (!pose) return Number.POSITIVE_INFINITY;
      const { x, y } = this.#view.at(pose[0], pose[1]);
      return Math.hypot(x - finger.x, y - finger.y);
    };
    const drawn = this.#robots.filter(({ level }) => level === this.#view.level);
    const [nearest] = drawn.sort((first, second) => away(first.pose) - away(second.pose));
    const limit = Math.min(NEAR_PX, away(this.#view.pose));
    return nearest && away(nearest.pose) < limit ? nearest.robot : "";
  }
}
