// The keyboard on the screen, and its letters in each language.
import { releaseEntry } from "../entries.js";
import { nameOf, Sheet, widgetOf } from "./sheet.js";
import { closest, find } from "../show.js";

// The keyboard's letters, in a table for each language; a language without one has the English.
const DIGITS = "1234567890";

/** @type {Record<string, string[]>} */
const LAYOUTS = {
  en: [DIGITS, "qwertyuiop", "asdfghjkl", "zxcvbnm,.-"],
  de: [`${DIGITS}ß`, "qwertzuiopü", "asdfghjklöä", "yxcvbnm,.-"],
};

const SIGNS = [DIGITS, '!"#$%&/()=', "+*'~^@€°<>", "?:;_|\\[]{}"];

// Capitals that are no capital letter of the same key.
/** @type {Record<string, string>} */
const CAPITALS = { ß: "ẞ", ",": ";", ".": ":", "-": "_" };

/** @param {string} letter */
function capital(letter) {
  return CAPITALS[letter] ?? letter.toUpperCase();
}

/** @param {string} language */
function layoutOf(language) {
  return LAYOUTS[language] ?? LAYOUTS[language.split("-")[0]] ?? LAYOUTS.en;
}

// The keyboard: types into its text field, in which the caret is seen. Cancel gives back what was there.

const SHAPES = ["keys"];
const SHIFTS = ["off", "once", "lock"];

export class Entry {
  input;
  #sheet;
  /** @type {() => void} */
  #closed;
  #before;
  #wasTouched;
  #shift = "off";
  #signs = false;
  /** @type {(event: KeyboardEvent) => void} */
  #typed = (event) => this.#key(event);
  #changed = () => this.#limit();

  /** @param {HTMLInputElement} input @param {import("./touch-entry.js").Before} before @param {() => void} closed */
  constructor(input, before, closed) {
    this.input = input;
    this.#closed = closed;
    this.#before = before.text;
    this.#wasTouched = before.isTouched;
    this.#sheet = new Sheet("keyboard", SHAPES, input, () => this.cancel());
    this.#draw();
    this.#sheet.root.addEventListener("click", ({ target }) => this.#clicked(closest(target, "button")));
    addEventListener("keydown", this.#typed, true);
    input.addEventListener("input", this.#changed);
    document.addEventListener("selectionchange", this.#changed);
    this.#sheet.open(nameOf(input));
    input.focus();
  }

  cancel() {
    if (this.input.value !== this.#before) {
      this.input.value = this.#before;
      this.#dispatch("input");
    }
    if (!this.#wasTouched) releaseEntry(widgetOf(this.input));
    this.#close();
  }

  #done() {
    if (this.input.value !== this.#before) this.#dispatch("change");
    this.#close();
  }

  #close() {
    removeEventListener("keydown", this.#typed, true);
    this.input.removeEventListener("input", this.#changed);
    document.removeEventListener("selectionchange", this.#changed);
    this.#sheet.close();
    this.#closed();
  }

  // A real keyboard types into the field by itself. Its Enter is Done: it presses nothing. Enter and Escape
  // of an input method's conversion are its own.
  /** @param {KeyboardEvent} event */
  #key(event) {
    if (event.target !== this.input || event.isComposing || !["Enter", "Escape"].includes(event.key)) return;
    event.preventDefault();
    if (event.key === "Enter") this.#done();
    else this.cancel();
  }

  /** @param {HTMLButtonElement | null} button */
  #clicked(button) {
    if (!button || button.disabled) return;
    const { key = "" } = button.dataset;
    if (button.matches(".cancel-entry")) this.cancel();
    else if (button.matches(".set-entry")) this.#done();
    else if (key === "shift") this.#setMode({ shift: SHIFTS[(SHIFTS.indexOf(this.#shift) + 1) % SHIFTS.length] });
    else if (key === "signs") this.#setMode({ signs: !this.#signs });
    else this.#edit(key);
  }

  /** @param {string} key */
  #edit(key) {
    const { value } = this.input;
    const start = this.input.selectionStart ?? value.length;
    const end = this.input.selectionEnd ?? start;
    if (key === "left" || key === "right") {
      const to = key === "left" ? Math.max(0, start - 1) : Math.min(value.length, end + 1);
      return this.input.setSelectionRange(to, to);
    }
    const from = key === "delete" && start === end ? Math.max(0, start - 1) : start;
    this.input.setRangeText(key === "delete" ? "" : key, from, end, "end");
    this.#dispatch("input");
    if (this.#shift === "once" && key !== "delete") this.#setMode({ shift: "off" });
  }

  /** @param {string} name */
  #dispatch(name) {
    this.input.dispatchEvent(new Event(name, { bubbles: true }));
  }

  /** @param {{ shift?: string, signs?: boolean }} mode */
  #setMode({ shift = this.#shift, signs = this.#signs }) {
    this.#shift = shift;
    this.#signs = signs;
    this.#draw();
  }

  #draw() {
    const { root } = this.#sheet;
    const [shift, erase] = ["shift", "delete"].map((key) => find(root, `button[data-key=${key}]`));
    shift.setAttribute("aria-pressed", String(this.#shift !== "off"));
    shift.dataset.shift = this.#shift;
    shift.disabled = this.#signs;
    find(root, "[data-key=signs]").setAttribute("aria-pressed", String(this.#signs));
    const letters = this.#signs ? SIGNS : layoutOf(document.documentElement.lang);
    const rows = letters.map((row) =>
      [...row].map((one) => keyOf(this.#shift === "off" || this.#signs ? one : capital(one))),
    );
    rows[0].push(erase);
    rows[rows.length - 1].unshift(shift);
    find(root, ".rows").replaceChildren(...rows.map(rowOf));
    this.#limit();
  }

  // A text of the greatest length takes no more.
  #limit() {
    const { value, maxLength, selectionStart, selectionEnd } = this.input;
    const isFull = maxLength >= 0 && value.length >= maxLength && selectionStart === selectionEnd;
    for (const key of this.#sheet.root.querySelectorAll("button[data-key]:not(.fn)")) key.disabled = isFull;
  }
}

/** @param {string} letter */
function keyOf(letter) {
  const key = Object.assign(document.createElement("button"), { type: "button", textContent: letter });
  key.dataset.key = letter;
  return key;
}

/** @param {HTMLElement[]} keys */
function rowOf(keys) {
  const row = document.createElement("div");
  row.className = "row";
  row.append(...keys);
  return row;
}
