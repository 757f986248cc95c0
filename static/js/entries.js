// The values entered on the page, and the inputs of parameters.
import { mark, sentNumber, setLimits } from "./number-inputs.js";
import { readNumbers } from "./number-text.js";

const NUMBERS = "[data-number], [data-list]";

// The value with its type. What is not a number is sent as text: the server says what is wrong.
function valueOf(input) {
  if (input.type === "checkbox") return input.checked;
  if (input.matches("[data-number]")) return sentNumber(input);
  return input.matches("[data-list]") ? readNumbers(input.value, input.matches("[data-whole]")) : input.value;
}

// Inputs stay in place: none is added or removed while the page is open.
export const entries = [...document.querySelectorAll("[data-widget] :is(input:not([type=hidden]), select)[name]")];

// All values on the page, by the names of the inputs.
export function enteredValues() {
  return Object.fromEntries(entries.map((input) => [input.name, valueOf(input)]));
}

// The input of a parameter shows the robot's value until it is touched. Then it keeps what was entered
// until that is set.
const touched = new WeakSet();
// Whether what was entered is kept; else the input follows the robot's value.
export function isTouched(input) {
  return !input.matches("[data-entry]") || touched.has(input);
}

const robotValues = new WeakMap(); // the robot's values since the last press

function entryOf(root) {
  return root.querySelector("[data-entry]");
}

export function showEntry(root, value) {
  const input = entryOf(root);
  robotValues.set(input, value);
  if (touched.has(input)) return;
  if (input.type === "checkbox") input.checked = value === true;
  else if (input.value !== value) {
    input.value = value;
    if (input.matches(NUMBERS)) mark(input);
  }
}

export function showBounds(root, bounds) {
  const input = entryOf(root);
  if (input.matches(NUMBERS)) setLimits(input, bounds);
}

// The value was set: the input shows the robot's value again.
export function releaseEntry(root) {
  const input = entryOf(root);
  if (input) touched.delete(input);
  if (robotValues.has(input)) showEntry(root, robotValues.get(input));
}

// A press begins: only values from now on count as its result.
export function forgetRobotValue(root) {
  robotValues.delete(entryOf(root));
}

addEventListener("input", ({ target }) => target.matches?.("[data-entry]") && touched.add(target));

import("./kept-entries.js").catch(() => {}); // without it a page begins with the panel's values
