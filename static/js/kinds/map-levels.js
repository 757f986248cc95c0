// The levels of a building on one map. It shows that of the robot, or another one that the operator chooses: the robot is
// not drawn there, and the map says where it is. The choice is this page's; it ends when the operator gives it back.
import { find, setText } from "../show.js";
import { openList } from "./map-list.js";
import { showZones } from "./map-zones.js";

/** @typedef {import("./map.js").Grid} Grid */
/** @typedef {import("./map-zones.js").Zone} Zone */
/** @typedef {{ id: string, label: string, grid: Grid | null, zones: Zone[], about: string, note: string }} Level */

/** @type {WeakMap<HTMLElement, Levels>} */
const known = new WeakMap();

/** @param {HTMLElement} root @param {import("./map.js").MapView} view */
export function levelsOf(root, view) {
  const levels = known.get(root) ?? new Levels(root, view);
  known.set(root, levels);
  return levels;
}

class Levels {
  /** @type {HTMLElement} */
  #root;
  /** @type {import("./map.js").MapView} */
  #view;
  /** @type {Level[]} */
  #levels = [];
  /** @type {Zone[]} */
  #zones = []; // of the robot's level
  #note = ""; // where the robot is
  #chosen = ""; // by hand: the id of a level

  /** @param {HTMLElement} root @param {import("./map.js").MapView} view */
  constructor(root, view) {
    [this.#root, this.#view] = [root, view];
    const list = find(root, "div.map-level-list");
    const close = openList(root, "levels", list);
    list.addEventListener("click", ({ target }) => {
      const row = /** @type {HTMLElement} */ (target).closest("button");
      if (!row) return;
      this.#chosen = row.dataset.showLevel ?? "";
      close();
      this.#draw();
    });
    find(root, "button.map-level").disabled = false;
    new MutationObserver(() => this.#draw()).observe(root, { attributeFilter: ["data-level"] });
  }

  /** @param {Level[]} levels */
  show(levels) {
    this.#levels = levels;
    this.#draw();
  }

  /** @param {string} note */
  tell(note) {
    this.#note = note;
    this.#draw();
  }

  /** @param {Zone[]} zones */
  showZones(zones) {
    this.#zones = zones;
    this.#draw();
  }

  // A level that is chosen by hand stays chosen when the robot comes there, and when it leaves.
  #draw() {
    const root = this.#root;
    const here = root.dataset.level ?? "";
    const shown = this.#levels.find(({ id }) => id === (this.#chosen || here));
    const isElsewhere = shown !== undefined && shown.id !== here;
    this.#view.showLevel(isElsewhere ? shown : null);
    showZones(root, this.#view, isElsewhere ? shown.zones : this.#zones);
    const byHand = find(root, "template.by-hand").content.textContent ?? "";
    setText(find(root, ".map-level b"), shown?.label ?? "\u2013");
    setText(find(root, ".map-level small"), this.#chosen ? byHand : "");
    root.toggleAttribute("data-by-hand", this.#chosen !== "");
    setText(find(root, ".map-level-note"), isElsewhere ? [this.#note, shown.note].filter(Boolean).join(" ") : "");
    for (const row of find(root, ".map-level-list").querySelectorAll("button")) {
      const id = row.dataset.showLevel ?? "";
      row.setAttribute("aria-pressed", String(id === this.#chosen));
      row.toggleAttribute("data-here", id !== "" && id === here);
      const level = this.#levels.find((each) => each.id === id);
      if (level) setText(row.querySelector("small"), level.note || level.about);
    }
  }
}
