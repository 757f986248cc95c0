// A number while it is entered: its characters, and what is wrong with it.
const MAX_CHARACTERS = 17;

export class Draft {
  text;
  #fresh = true; // the first digit replaces the value that was there

  constructor(text) {
    this.text = text;
  }

  type(key) {
    if (key === "delete") this.text = this.#fresh ? "" : this.text.slice(0, -1);
    else if (key === "clear") this.text = "";
    else if (key === "sign") this.text = this.text.startsWith("-") ? this.text.slice(1) : `-${this.text}`;
    else this.#add(key);
    this.#fresh = false;
  }

  // Another value in place of this one; the next digit begins a new one.
  replace(text) {
    this.text = text;
    this.#fresh = true;
  }

  #add(key) {
    const before = this.#fresh ? "" : this.text;
    if (key === "." && before.includes(".")) return;
    if (before.length >= MAX_CHARACTERS) return;
    this.text = key === "." && !/\d/.test(before) ? `${before}0.` : before === "0" && key !== "." ? key : before + key;
  }
}

// A number as an input of the page takes it, "" for none, and what its limits say of it.
export function judged(text, { min, max, step }) {
  const probe = Object.assign(document.createElement("input"), { type: "number", min, max, step });
  probe.value = text.endsWith(".") ? text.slice(0, -1) : text;
  const { rangeUnderflow, rangeOverflow, stepMismatch } = probe.validity;
  const found = [
    [text === "" || text === "-", "empty"],
    [probe.value === "", "noNumber"],
    [rangeUnderflow, "tooLow"],
    [rangeOverflow, "tooHigh"],
    [stepMismatch, "offStep"],
  ].find(([is]) => is);
  return { value: probe.value, problem: found?.[1] ?? null };
}

export function isWhole({ min, step }) {
  return step !== "any" && Number.isInteger(Number(step || 1)) && Number.isInteger(Number(min));
}
