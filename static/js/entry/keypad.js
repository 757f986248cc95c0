// The keypad: a number is entered beside its field and goes there with Set, if the limits permit.
import { Draft, isWhole, judged } from "./draft.js";
import { Sheet } from "./sheet.js";
import { numberText } from "../number-text.js";
import { setText } from "../show.js";

const SHAPES = ["tall", "wide", "narrow"];
const SCANNED_MS = 50; // a bar code reader types faster: its Enter confirms nothing
const KEYS = { ",": ".", "-": "sign", Backspace: "delete", Delete: "clear" };

export class Entry {
  input;
  #sheet = new Sheet("keypad", SHAPES, () => this.cancel());
  #draft;
  #closed;
  #lastKeyAt = -Infinity;
  #typed = (event) => this.#key(event);

  constructor(input, closed) {
    this.input = input;
    this.#closed = closed;
    this.#draft = new Draft(input.value);
    this.#label();
    this.#sheet.root.addEventListener("click", ({ target }) => this.#clicked(target.closest("button")));
    addEventListener("keydown", this.#typed, true);
    this.#sheet.open(input, this.#find("h2").textContent);
    this.#show();
  }

  cancel() {
    removeEventListener("keydown", this.#typed, true);
    this.#sheet.close();
    this.#closed();
  }

  #find(selector) {
    return this.#sheet.root.querySelector(selector);
  }

  #label() {
    const { min, max, value, dataset } = this.input;
    const named = this.input.labels[0] ?? document.getElementById(this.input.getAttribute("aria-labelledby"));
    setText(this.#find("h2"), named.textContent);
    setText(this.#find(".sheet-head b"), numberText(value));
    setText(this.#find("small"), dataset.unit ?? "");
    for (const [name, limit] of [["min", min], ["max", max]]) {
      const key = this.#find(`[data-key=${name}]`);
      key.disabled = limit === "";
      setText(key.querySelector("b"), numberText(limit));
    }
    // A parameter is set by the page's own key of that name.
    if (this.input.matches("[data-entry]")) for (const label of [".name", ".label"]) setText(this.#find(`.finish ${label}`), this.#sheet.root.dataset.enter);
    this.#find("[data-key=sign]").disabled = min !== "" && min >= 0;
    this.#find('[data-key="."]').disabled = isWhole(this.input);
    const isRange = min !== "" && max !== "";
    this.#find(".scale").hidden = !isRange;
    setText(this.#find(".low"), numberText(min));
    setText(this.#find(".high"), numberText(max));
  }

  #clicked(button) {
    if (!button || button.disabled) return;
    if (button.matches(".cancel-entry")) this.cancel();
    else if (button.matches(".set-entry")) this.#set();
    else this.#type(button.dataset.key);
  }

  #type(key) {
    if (key === "min" || key === "max") this.#draft.replace(this.input[key]);
    else this.#draft.type(key);
    this.#show();
  }

  // A real keyboard enters here too, except where a key of the page has the focus.
  #key(event) {
    const { target, key } = event;
    const isOurs = target === this.input || target === document.body;
    const scanned = event.timeStamp - this.#lastKeyAt < SCANNED_MS;
    if (key !== "Shift") this.#lastKeyAt = event.timeStamp;
    if (!isOurs || event.ctrlKey || event.altKey || event.metaKey || key === "Tab") return;
    event.preventDefault();
    if (key === "Escape") this.cancel();
    else if (key === "Enter") scanned || this.#set();
    else this.#typeReal(KEYS[key] ?? key);
  }

  #typeReal(key) {
    const button = /^(\d|\.|sign|delete|clear)$/.test(key) && this.#find(`[data-key="${key}"]`);
    if (button && !button.disabled) this.#type(key);
  }

  #show() {
    const { dataset } = this.#sheet.root;
    const { value, problem } = judged(this.#draft.text, this.input);
    const isOut = problem !== null && problem !== "empty";
    setText(this.#find("output"), numberText(this.#draft.text));
    this.#find(".entered p").hidden = !isOut;
    setText(this.#find(".entered p b"), isOut ? dataset[problem] : "");
    setText(this.#find(".entered p span"), isOut ? this.#limits() : "");
    this.#find(".set-entry").disabled = problem !== null;
    const isOff = problem === "tooLow" || problem === "tooHigh";
    setText(this.#find("[data-text=reason]"), problem ? dataset[isOff ? "outside" : problem] : "");
    this.#mark(Number(value), value !== "");
  }

  // As the page says them: a node may change those of its parameter.
  #limits() {
    return this.input.closest("[data-widget]").querySelector("[data-text=limits]").textContent;
  }

  // Where the number is on the scale: the limits are at 12.5 and 87.5 %.
  #mark(value, isNumber) {
    const { min, max } = this.input;
    const at = 12.5 + (75 * (value - min)) / (max - min);
    const scale = this.#find(".scale");
    scale.style.setProperty("--at", `${Math.min(Math.max(at, 0), 100)}%`);
    scale.classList.toggle("none", !isNumber);
    setText(scale.querySelector("b"), at > 26 && at < 74 ? numberText(String(value)) : ""); // else it would lie on a limit
  }

  #set() {
    const { value, problem } = judged(this.#draft.text, this.input);
    if (problem) return;
    this.input.value = value;
    this.input.dispatchEvent(new InputEvent("input", { bubbles: true, inputType: "insertReplacementText" }));
    this.input.dispatchEvent(new Event("change", { bubbles: true }));
    this.cancel();
  }
}
