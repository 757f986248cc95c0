// A number while it is entered: its characters, as the reader's language writes them. None is left out.
import { DECIMAL, MINUS } from "../number-text.js";

const TOO_LONG = 41; // characters: no number has so many

export class Draft {
  /** @type {string} */
  text;
  #fresh = true; // the first character replaces the value that was there

  /** @param {string} text */
  constructor(text) {
    this.text = text;
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
