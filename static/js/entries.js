// The values entered on the page, and the inputs of parameters.

const NUMBERS = "input[data-number], input[data-list]";
// What pages without numbers do not need.
export const numbers = document.querySelector(NUMBERS) ? await import("./number-inputs.js") : null;

/** @param {Entry} input @returns {input is Checkbox} */
export const isCheckbox = (input) => input.type === "checkbox";
/** @param {Entry} input @returns {input is NumberInput} */
export const isNumber = (input) => input.matches(NUMBERS);

// The value with its type. What is not a number is sent as text: the server says what is wrong.
/** @param {Entry} input */
function sentValue(input) {
  if (isCheckbox(input)) return input.checked;
  return isNumber(input) ? numbers?.sentNumber(input) : input.value;
}

// Inputs stay in place: none is added or removed while the page is open.
export const entries = [
  ...document.querySelectorAll("[data-widget] input[name]:not([type=hidden]), [data-widget] select[name]"),
];

// All values on the page, by the names of the inputs.
export function enteredValues() {
  return Object.fromEntries(entries.map((input) => [input.name, sentValue(input)]));
}

// The input of a parameter shows the robot's value until it is touched. Then it keeps what was entered
// until that is set.
/** @type {WeakSet<Element>} */
const touched = new WeakSet();
// Whether what was entered is kept; else the input follows the robot's value.
/** @param {Entry} input */
export function isTouched(input) {
  return !input.matches("[data-entry]") || touched.has(input);
}

/** @type {WeakMap<Entry, string | boolean>} */
const robotValues = new WeakMap(); // the robot's values since the last press

/** @param {HTMLElement} root */
function entryOf(root) {
  return root.querySelector("input[data-entry], select[data-entry]");
}

/** @param {HTMLElement} root @param {string | boolean} value */
export function showEntry(root, value) {
  const input = entryOf(root);
  if (!input) return;
  robotValues.set(input, value);
  if (touched.has(input)) return;
  if (isCheckbox(input)) input.checked = value === true;
  else if (input.value !== value) {
    input.value = String(value);
    if (isNumber(input)) numbers?.mark(input);
  }
}

/** @param {HTMLElement} root @param {Limits} bounds */
export function showBounds(root, bounds) {
  const input = entryOf(root);
  if (input && isNumber(input)) numbers?.setLimits(input, bounds);
}

// The value was set: the input shows the robot's value again.
/** @param {HTMLElement} root */
export function releaseEntry(root) {
  const input = entryOf(root);
  if (!input) return;
  touched.delete(input);
  const value = robotValues.get(input);
  if (value !== undefined) showEntry(root, value);
}

// A press begins: only values from now on count as its result.
/** @param {HTMLElement} root */
export function forgetRobotValue(root) {
  const input = entryOf(root);
  if (input) robotValues.delete(input);
}

// The inputs that were changed here, by hand or by a script.
/** @type {Set<EventTarget | null>} */
export const changed = new Set();

// What was entered here before is entered again, and what is entered now is kept: by a script that a page without
// entries does not need. Where the browser keeps nothing, a page begins with the panel's values.
export function keptName() {
  const { base, page } = pageGuard.page;
  return `operator-panel.entries ${base}/${page}`;
}

function hasKept() {
  try {
    return sessionStorage.getItem(keptName()) !== null;
  } catch {
    return false;
  }
}

// The page starts. `keep` is called once there is something to keep, or to enter again.
/** @param {() => void} keep */
export function followEntries(keep) {
  /** @param {EventTarget | null} target */
  const follow = (target) => {
    changed.add(target);
    if (target instanceof Element && target.matches("[data-entry]")) touched.add(target);
  };
  pageGuard.changed.forEach(follow); // while the modules were on their way
  addEventListener("input", ({ target }) => follow(target));
  if (document.querySelector("[data-recipes]")) return; // these values are those of a recipe
  if (hasKept() || changed.size) keep();
  else addEventListener("input", keep, { once: true });
}
