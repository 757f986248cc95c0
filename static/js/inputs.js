// Number fields that are read as the server reads them, sliders with their values, and step buttons for gloves.
// Without this script the same inputs are text fields.
import { enter, entryText, limitsOf, mark, step } from "./number-inputs.js";
import { numberText, plainText, readPlain } from "./number-text.js";

// The step of a slider and its buttons where the input has none: 1, 2 or 5 of a decimal place, and a hundredth
// of the range at most.
/** @param {{ min: string, max: string }} limits */
function stepSize({ min, max }) {
  const most = (Number(max) - Number(min)) / 100;
  const place = 10 ** Math.floor(Math.log10(most));
  return Number((place * ([5, 2].find((times) => times * place <= most) ?? 1)).toPrecision(12));
}

// The nearest step of a finger on a slider, or the nearer limit.
/** @param {HTMLInputElement} input */
function nearestStep(input) {
  const size = stepSize(input);
  const rounded = Number((Math.round(input.valueAsNumber / size) * size).toPrecision(12));
  return plainText(Math.min(Math.max(rounded, Number(input.min)), Number(input.max)));
}

// Makes the output as wide as its longest value, so that nothing moves under a finger.
/** @param {HTMLOutputElement} output @param {Limits} limits */
function setWidth(output, { min, max, step }) {
  const grain = Number(step) || stepSize({ min, max });
  const places = Math.max(0, -Math.floor(Math.log10(grain)));
  const longest = Math.max(...[min, max].map((limit) => Number(limit).toFixed(places).length), output.value.length);
  output.style.minWidth = `max(3.2em, ${longest}ch)`;
}

/** @param {HTMLInputElement} input @param {HTMLOutputElement} output */
function slide(input, output) {
  const { min, max, step: size, isWhole } = limitsOf(input);
  const plain = readPlain(input.value, isWhole) ?? min;
  Object.assign(input, { type: "range", min, max, step: size || "any", value: plain });
  const show = () => (output.value = entryText(input));
  input.addEventListener("input", (event) => {
    // A value of the keypad is exact; a finger on a slider is not.
    if (!size && !(event instanceof InputEvent && event.inputType)) input.value = nearestStep(input);
    show();
  });
  show();
  setWidth(output, limitsOf(input));
}

// A number that was read is shown as the panel writes it: what is seen is what is sent.
/** @param {HTMLInputElement} input */
function settle(input) {
  const plain = readPlain(input.value, limitsOf(input).isWhole);
  if (plain !== null && numberText(plain) !== input.value) enter(input, plain);
}

/** @param {HTMLInputElement} input */
function buttonStep(input) {
  const { min, max, step: size } = limitsOf(input);
  return size || (min && max ? plainText(stepSize({ min, max })) : "");
}

/** @param {HTMLInputElement} input */
function equip(input) {
  const root = input.closest("[data-widget]");
  if (!root) return;
  const output = root.querySelector("output");
  if (output) slide(input, output);
  else {
    input.addEventListener("input", () => mark(input));
    input.addEventListener("change", () => settle(input));
    mark(input);
  }
  for (const button of root.querySelectorAll("[data-step]")) {
    button.addEventListener("click", () => {
      const size = buttonStep(input);
      if (size) step(input, Number(button.dataset.step), size);
      input.dispatchEvent(new InputEvent("input", { bubbles: true, inputType: "insertReplacementText" }));
    });
  }
}

for (const input of document.querySelectorAll("input[data-number]")) equip(input);
for (const input of document.querySelectorAll("input[data-list]")) input.addEventListener("input", () => mark(input));
document.documentElement.dataset.inputs = ""; // steps and the marks of numbers are in force
