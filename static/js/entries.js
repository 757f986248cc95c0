// The values entered on the page, and the inputs of parameters.

// The value with its type. An empty number field, or an integer that is not exact here, is sent as text:
// the server says what is wrong.
function valueOf(input) {
  if (input.type === "checkbox") return input.checked;
  const isNumber = input.type === "number" || input.type === "range";
  if (!isNumber || input.value === "") return input.value;
  const value = Number(input.value);
  return Number.isInteger(value) && !Number.isSafeInteger(value) ? input.value : value;
}

// Inputs stay in place: none is added or removed while the page is open.
const entries = [...document.querySelectorAll("[data-widget] :is(input:not([type=hidden]), select)[name]")];

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
  else if (input.value !== value) input.value = value;
}

export function showBounds(root, bounds) {
  const input = entryOf(root);
  if (input.type === "number") Object.assign(input, bounds);
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
