// The keypad on the screen, with the number that is being entered and the bar that shows it between its limits.
import { releaseEntry } from "../entries.js";
import { nameOf, Sheet, widgetOf } from "./sheet.js";
import { enter, entryText, judged, limitsOf } from "../number-inputs.js";
import { DECIMAL, MINUS, numberText } from "../number-text.js";
import { closest, find, setText } from "../show.js";

// A number while it is entered: its characters, as the reader's language writes them. None is left out.

const TOO_LONG = 41; // characters: no number has so many

class Draft {
  /** @type {string} */
  text;
  #fresh; // the first character replaces the value that was there

  /** @param {string} text @param {boolean} fresh */
  constructor(text, fresh) {
    this.text = text;
    this.#fresh = fresh;
  }

  // A key of the keypad.
  /** @param {string} key */
  press(key) {
    if (key === "delete") this.text = this.#fresh ? "" : this.text.slice(0, -1);
    else if (key === "clear") this.text = "";
    else if (key === "sign") this.text = /^[-−]/.test(this.text) ? this.text.slice(1) : `${MINUS}${this.text}`;
    else if (key === ".") this.write(/\d/.test(this.#before) ? DECIMAL : `0${DECIMAL}`);
    else this.#digit(key);
    this.#fresh = false;
  }

  // Characters of a keyboard.
  /** @param {string} characters */
  write(characters) {
    if (this.#before.length < TOO_LONG) this.text = this.#before + characters;
    this.#fresh = false;
  }

  // Another value in place of this one; the next character begins a new one.
  /** @param {string} text */
  replace(text) {
    this.text = text;
    this.#fresh = true;
  }

  get #before() {
    return this.#fresh ? "" : this.text;
  }

  // A digit after a single zero replaces it.
  /** @param {string} key */
  #digit(key) {
    if (/^[-−]?0$/.test(this.#before)) this.text = this.text.slice(0, -1);
    this.write(key);
  }
}

// The bar of the keypad: where a number is between its limits, which are at 12.5 and 87.5 %.

/** @param {HTMLElement} scale @param {string | null} plain @param {Limits} limits */
function markScale(scale, plain, { min, max }) {
  const at = 12.5 + (75 * (Number(plain) - Number(min))) / (Number(max) - Number(min));
  scale.style.setProperty("--at", `${Math.min(Math.max(at, 0), 100)}%`);
  scale.classList.toggle("none", plain === null);
  setText(find(scale, "b"), plain !== null && at > 26 && at < 74 ? numberText(plain) : ""); // else it would lie on a limit
}

// The keypad: a number is entered beside its field and goes there with Set, if the limits permit.

const SHAPES = ["tall", "wide", "narrow"];
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
  #isPasted; // or typed before the keypad was there
  #changed = () => this.#pasted();
  // The first characters of a code came as from a hand.
  #scanned = () => this.#type(() => this.#draft.replace(entryText(this.input)));
  /** @type {(event: KeyboardEvent) => void} */
  #typed = (event) => this.#key(event);

  /** @param {HTMLInputElement} input @param {import("./touch-entry.js").Before} before @param {() => void} closed */
  constructor(input, before, closed) {
    this.input = input;
    this.#closed = closed;
    this.#before = before.text;
    this.#wasTouched = before.isTouched;
    this.#isPasted = before.isTyped;
    this.#draft = new Draft(entryText(input), !this.#isPasted);
    this.#sheet = new Sheet("keypad", SHAPES, input, () => this.cancel());
    this.#label();
    this.#sheet.root.addEventListener("click", ({ target }) => this.#clicked(closest(target, "button")));
    addEventListener("keydown", this.#typed, true);
    document.addEventListener("scanned", this.#scanned);
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
    document.removeEventListener("scanned", this.#scanned);
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
    if (!isOurs || event.ctrlKey || event.altKey || event.metaKey || key === "Tab") return;
    event.preventDefault();
    if (key === "Escape") this.cancel();
    else if (key === "Enter") this.#set();
    else if (KEYS[key]) this.#press(KEYS[key]);
    else if (key.length === 1) this.#type(() => this.#draft.write(key));
  }

  #show() {
    const { dataset } = this.#sheet.root;
    const { plain, problem } = this.#judged();
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

  // What could be read in two ways is shown on the page as it was read, before anything is pressed there.
  #judged() {
    const { plain, problem } = judged(this.#draft.text, limitsOf(this.input));
    return { plain, problem: problem === "unclear" ? null : problem };
  }

  // As the page says them: a node may change those of its parameter.
  #limits() {
    return find(widgetOf(this.input), "[data-text=limits]").textContent;
  }

  #set() {
    const { plain, problem } = this.#judged();
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
