// The keypad: a number is entered beside its field and goes there with Set, if the limits permit.
import { isTouched, releaseEntry } from "../entries.js";
import { Draft } from "./draft.js";
import { markScale } from "./scale.js";
import { Sheet, nameOf } from "./sheet.js";
import { widgetOf } from "./place.js";
import { numberText } from "../number-text.js";
import { enter, entryText, judged, limitsOf } from "../number-inputs.js";
import { closest, find, setText } from "../show.js";

const SHAPES = ["tall", "wide", "narrow"];
const SCANNED_MS = 50; // a bar code reader types faster: its Enter confirms nothing
const SHORT = 9; // characters that fit in large digits
const OF_INPUT_METHOD = 229;
/** @type {Record<string, string>} */
const KEYS = { Backspace: "delete", Delete: "clear" };

export class Entry {
  input;
  #sheet;
  #draft;
  /** @type {() => void} */
  #closed;
  #before;
  #wasTouched;
  #isPasted = false;
  #lastKeyAt = -Infinity;
  #changed = () => this.#pasted();
  /** @type {(event: KeyboardEvent) => void} */
  #typed = (event) => this.#key(event);

  /** @param {HTMLInputElement} input @param {() => void} closed */
  constructor(input, closed) {
    this.input = input;
    this.#closed = closed;
    this.#before = input.value;
    this.#wasTouched = isTouched(input);
    this.#draft = new Draft(entryText(input));
    this.#sheet = new Sheet("keypad", SHAPES, input, () => this.cancel());
    this.#label();
    this.#sheet.root.addEventListener("click", ({ target }) => this.#clicked(closest(target, "button")));
    addEventListener("keydown", this.#typed, true);
    // What is pasted, and what an input method writes, is in the field itself.
    if (input.type !== "range") input.addEventListener("input", this.#changed);
    this.#sheet.open(nameOf(input));
    this.#show();
  }

  cancel() {
    if (this.#isPasted) this.#put(this.#before);
    if (this.#isPasted && !this.#wasTouched) releaseEntry(widgetOf(this.input));
    this.#close();
  }

  #close() {
    removeEventListener("keydown", this.#typed, true);
    this.input.removeEventListener("input", this.#changed);
    this.#sheet.close();
    this.#closed();
  }

  /** @template {string} S @param {S} selector */
  #find(selector) {
    return find(this.#sheet.root, selector);
  }

  #label() {
    const { min, max, isWhole } = limitsOf(this.input);
    setText(this.#find("h2"), nameOf(this.input));
    setText(this.#find(".sheet-head b"), entryText(this.input));
    setText(this.#find("small"), this.input.dataset.unit ?? "");
    for (const [name, limit, end] of [
      ["min", min, ".low"],
      ["max", max, ".high"],
    ]) {
      const key = this.#find(`button[data-key=${name}]`);
      key.disabled = limit === "";
      for (const place of [find(key, "b"), this.#find(end)]) setText(place, numberText(limit));
    }
    // A parameter is set by the page's own key of that name.
    if (this.input.matches("[data-entry]"))
      for (const label of [".name", ".label"]) setText(this.#find(`.finish ${label}`), this.#sheet.root.dataset.enter);
    this.#find("button[data-key=sign]").disabled = min !== "" && Number(min) >= 0;
    this.#find('button[data-key="."]').disabled = isWhole;
    this.#find(".scale").hidden = min === "" || max === "";
  }

  /** @param {HTMLButtonElement | null} button */
  #clicked(button) {
    if (!button || button.disabled) return;
    if (button.matches(".cancel-entry")) this.cancel();
    else if (button.matches(".set-entry")) this.#set();
    else this.#press(button.dataset.key ?? "");
  }

  /** @param {string} key */
  #press(key) {
    const limit = key === "min" || key === "max" ? limitsOf(this.input)[key] : null;
    this.#type(() => (limit === null ? this.#draft.press(key) : this.#draft.replace(numberText(limit))));
  }

  /** @param {() => void} change */
  #type(change) {
    change();
    this.#show();
  }

  #pasted() {
    this.#isPasted = true;
    this.#type(() => this.#draft.replace(this.input.value));
  }

  // A real keyboard enters here too, except where a key of the page has the focus.
  /** @param {KeyboardEvent} event */
  #key(event) {
    const { target, key, isComposing, keyCode } = event;
    if (isComposing || keyCode === OF_INPUT_METHOD) return;
    const isOurs = target === this.input || target === document.body;
    const scanned = event.timeStamp - this.#lastKeyAt < SCANNED_MS;
    if (key !== "Shift") this.#lastKeyAt = event.timeStamp;
    if (!isOurs || event.ctrlKey || event.altKey || event.metaKey || key === "Tab") return;
    event.preventDefault();
    if (key === "Escape") this.cancel();
    else if (key === "Enter") scanned || this.#set();
    else if (KEYS[key]) this.#press(KEYS[key]);
    else if (key.length === 1) this.#type(() => this.#draft.write(key));
  }

  #show() {
    const { dataset } = this.#sheet.root;
    const { plain, problem } = judged(this.#draft.text, limitsOf(this.input));
    const isOut = problem !== null && problem !== "empty";
    setText(this.#find("output"), this.#draft.text);
    this.#find("output").toggleAttribute("data-long", this.#draft.text.length > SHORT);
    this.#find(".entered p").hidden = !isOut;
    setText(this.#find(".entered p b"), isOut ? dataset[problem] : "");
    setText(this.#find(".entered p span"), isOut ? this.#limits() : "");
    this.#find("button.set-entry").disabled = problem !== null;
    const isOff = problem === "tooLow" || problem === "tooHigh";
    setText(this.#find("[data-text=reason]"), problem ? dataset[isOff ? "outside" : problem] : "");
    markScale(this.#find(".scale"), plain, limitsOf(this.input));
  }

  // As the page says them: a node may change those of its parameter.
  #limits() {
    return find(widgetOf(this.input), "[data-text=limits]").textContent;
  }

  #set() {
    const { plain, problem } = judged(this.#draft.text, limitsOf(this.input));
    if (problem || plain === null) return;
    enter(this.input, plain);
    this.#put(this.input.value);
    this.#close();
  }

  /** @param {string} text */
  #put(text) {
    this.input.removeEventListener("input", this.#changed);
    this.input.value = text;
    this.input.dispatchEvent(new InputEvent("input", { bubbles: true, inputType: "insertReplacementText" }));
    this.input.dispatchEvent(new Event("change", { bubbles: true }));
  }
}
