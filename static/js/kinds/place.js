// An input for places on a map: a list of keys, symbols on the map and, with `data-touch`, a finger on the map. All of
// them only choose. The card is the server's; a value is entered when its card is there, so a press sends what it shows.
import { closest, copyOf, find, isGood, setText, showGroupOf } from "../show.js";
import { viewOf } from "./map.js";
import { Goal, Places } from "./map-goal.js";

/** @typedef {{ id: string, label: string, icon: string, pose: number[], level: string, distance: string, reason: string }} Place */
/** @typedef {{ value: string, name: string, rows: { name: string, text: string }[], pose: number[], level: string, reason: string }} Card */

const AGAIN_MS = 1000; // between two cards of the same choice
const LATE_MS = 3000; // without a card nothing is chosen
/** @type {Record<string, number>} */
const STEPS = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 };

/** @type {WeakMap<HTMLElement, PlaceInput>} */
const inputs = new WeakMap();

/** @param {HTMLElement} root */
export const equip = (root) => inputs.set(root, new PlaceInput(root));

/** @type {Record<string, Show>} */
export const show = {
  places: (root, places) => inputs.get(root)?.showPlaces(places),
  note: (root, note) => inputs.get(root)?.showNote(note),
  commands: (root, commands) => inputs.get(root)?.follow(commands),
};

class PlaceInput {
  /** @type {HTMLElement} */
  #root;
  /** @type {HTMLSelectElement} */
  #select;
  /** @type {HTMLElement} */
  #list;
  /** @type {HTMLElement} */
  #card;
  /** @type {Card | null} */
  #chosen = null; // what the card shows, and the select has
  #asked = 0; // counts the cards that were asked for: an answer to an earlier one is dropped
  #again = 0;
  /** @type {Place[]} */
  #places = [];
  /** @type {string[]} */
  #commands = []; // the ids of the commands that send it
  /** @type {Goal | null} */
  #goal = null; // what is drawn on the map
  /** @type {Places | null} */
  #symbols = null;

  /** @param {HTMLElement} root */
  constructor(root) {
    this.#root = root;
    this.#select = find(root, "select");
    this.#list = find(root, ".places");
    this.#card = find(root, ".place-card");
    this.#list.addEventListener("click", ({ target }) => this.#tap(closest(target, "button")));
    this.#list.addEventListener("keydown", (event) => this.#key(event));
    find(root, ".unchoose").addEventListener("click", () => this.unchoose(true));
    // What was chosen before is entered again, see kept-entries.js.
    this.#select.addEventListener("input", () => {
      if (this.#select.value !== (this.#chosen?.value ?? "")) this.choose(this.#select.value);
    });
    document.addEventListener("receipt", (event) => this.#receive(event));
    root.dataset.equipped = "";
    if (this.#select.value) this.choose(this.#select.value);
  }

  /** @param {Place[]} places */
  showPlaces(places) {
    this.#places = places;
    this.#draw();
    const keys = new Map([...this.#list.querySelectorAll("button")].map((key) => [key.dataset.place, key]));
    places.forEach((place, number) => {
      const key = keys.get(place.id) ?? this.#made(place);
      keys.delete(place.id);
      if (this.#list.children[number] !== key) this.#list.insertBefore(key, this.#list.children[number] ?? null);
      setText(find(key, ".name"), place.label);
      setText(find(key, ".distance"), place.distance);
      setText(find(key, ".reason"), place.reason);
      if (place.reason) key.setAttribute("aria-disabled", "true");
      else key.removeAttribute("aria-disabled");
    });
    for (const key of keys.values()) key.remove();
    this.#symbols?.show(places, this.#chosen?.value ?? "");
    this.#refresh();
  }

  /** @param {string} note */
  showNote(note) {
    setText(find(this.#root, ".note"), note);
    this.#refresh();
  }

  /** @param {string[]} commands */
  follow(commands) {
    this.#commands = commands;
  }

  // Nothing is entered until the card is there.
  /** @param {string} value @param {number[]} [pose] */
  choose(value, pose) {
    this.#enter(null);
    if (!value) return;
    if (pose) this.#goal?.show(pose, false, this.#goal.level);
    this.#ask(value).then(
      (card) => {
        if (!card) return;
        this.#enter(card);
        showGroupOf(this.#root); // what was touched on the map may be in another group
        this.#card.focus({ preventScroll: true });
      },
      () => {
        this.#enter(null);
        setText(find(this.#root, ".no-answer"), find(this.#root, "template.no-answer-text").content.textContent ?? "");
      },
    );
  }

  // `isAsked`: by the operator, who goes on in the list.
  /** @param {boolean} [isAsked] */
  unchoose(isAsked) {
    const before = this.#chosen?.value;
    this.#enter(null);
    const key =
      this.#list.querySelector(`[data-place="${CSS.escape(before ?? "")}"]`) ?? this.#list.querySelector("button");
    if (isAsked) key?.focus();
  }

  // The card of a value; null if another was asked for since.
  /** @param {string} value @returns {Promise<Card | null>} */
  async #ask(value) {
    this.#asked += 1;
    const asked = this.#asked;
    const request = new AbortController();
    setTimeout(() => request.abort(), LATE_MS);
    const path = `${pageGuard.page.base}/widgets/${this.#root.dataset.widget}/place`;
    try {
      const answer = await fetch(`${path}?value=${encodeURIComponent(value)}`, { signal: request.signal });
      if (!answer.ok) throw new Error(String(answer.status));
      const card = await answer.json();
      return asked === this.#asked ? card : null;
    } catch (error) {
      if (asked !== this.#asked) return null;
      throw error;
    }
  }

  /** @param {Card | null} card */
  #enter(card) {
    this.#asked += 1;
    this.#chosen = card;
    const select = this.#select;
    const before = select.value;
    select.querySelector("option[data-touched]")?.remove();
    if (card && ![...select.options].some((option) => option.value === card.value)) {
      const option = new Option(card.name, card.value);
      option.dataset.touched = "";
      select.append(option);
    }
    select.value = card?.value ?? "";
    if (select.value !== before) select.dispatchEvent(new InputEvent("input", { bubbles: true }));
    setText(find(this.#root, ".no-answer"), "");
    this.#showCard();
  }

  #showCard() {
    const card = this.#chosen;
    this.#card.hidden = !card;
    this.#root.toggleAttribute("data-chosen", card !== null);
    if (card) {
      const template = find(this.#root, "template.row-template");
      const rows = card.rows.map(({ name, text }) => {
        const row = copyOf(/** @type {HTMLTemplateElement} */ (template));
        setText(find(row, "dt"), name);
        setText(find(row, "dd"), text);
        return row;
      });
      find(this.#card, "dl").replaceChildren(...rows);
    }
    setText(find(this.#card, ".refusal"), card?.reason ?? "");
    this.#offerSave(card);
    this.#draw();
    this.#goal?.show(card?.pose ?? null, card !== null && !card.reason, card?.level ?? "");
    this.#symbols?.show(this.#places, card?.value ?? "");
  }

  // A touched pose may be saved as a place, on a page of its own.
  /** @param {Card | null} card */
  #offerSave(card) {
    const link = /** @type {HTMLAnchorElement | null} */ (this.#card.querySelector(".save-touched"));
    if (!link) return;
    const isPlace = this.#places.some((place) => place.id === card?.value);
    link.hidden = !card || isPlace || card.reason !== "";
    const path = `${pageGuard.page.base}/places/${this.#root.dataset.widget}`;
    if (card) link.href = `${path}?mode=save&value=${encodeURIComponent(card.value)}`;
  }

  // The robot drives, and the map may change: the card says it. What is entered stays as it is.
  #refresh() {
    const value = this.#chosen?.value;
    if (!value || this.#again) return;
    this.#again = setTimeout(async () => {
      this.#again = 0;
      if (this.#chosen?.value !== value) return;
      const card = await this.#ask(value).catch(() => null);
      if (!card || this.#chosen?.value !== value) return;
      this.#chosen = card;
      this.#showCard();
    }, AGAIN_MS);
  }

  /** @param {HTMLElement | null} key */
  #tap(key) {
    if (key && key.getAttribute("aria-disabled") !== "true") this.choose(key.dataset.place ?? "");
  }

  // Arrows go from key to key.
  /** @param {KeyboardEvent} event */
  #key(event) {
    const step = STEPS[event.key];
    const keys = [...this.#list.querySelectorAll("button")];
    const at = keys.indexOf(/** @type {HTMLButtonElement} */ (document.activeElement));
    if (!step || at < 0) return;
    event.preventDefault();
    keys[(at + step + keys.length) % keys.length].focus();
  }

  /** @param {Place} place */
  #made(place) {
    const key = copyOf(/** @type {HTMLTemplateElement} */ (find(this.#root, "template.key-template")));
    key.dataset.place = place.id;
    return key;
  }

  // The map is equipped before the first event: its script is loaded with this one.
  #draw() {
    if (this.#goal) return;
    const map = document.querySelector(`[data-kind="map"][data-widget="${this.#root.dataset.map}"]`);
    const view = map && viewOf(map);
    if (!map || !view) return;
    this.#symbols = new Places(map, view, (id) => this.#choosePlace(id));
    this.#goal = new Goal(map, view);
    this.#goal.surround(Number(this.#root.dataset.radius));
    if ("touch" in this.#root.dataset) this.#goal.onTouch((value, pose) => this.choose(value, pose), this.#root);
  }

  /** @param {string} id */
  #choosePlace(id) {
    if (this.#places.some((place) => place.id === id && !place.reason)) this.choose(id);
  }

  // A goal is sent once: then it is no longer chosen. What was refused stays, with the reason at the button.
  /** @param {Event} event */
  #receive(event) {
    const { outcome } = /** @type {CustomEvent} */ (event).detail;
    const root = closest(event.target, "[data-widget]");
    if (!this.#commands.includes(root?.dataset.widget ?? "")) return;
    if (isGood(outcome) || outcome === "unknown" || outcome === "timed_out") this.unchoose();
  }
}
