// The inputs of numbers: text fields in the notation of the page's language, and sliders, with their step buttons.
import {
  clearText,
  elementsOf,
  isLess,
  isOnStep,
  listText,
  loneGroup,
  numberText,
  plainText,
  readNumber,
  readNumbers,
  readPlain,
  stepped,
} from "./number-text.js";

// Its limits as plain text, "" without one.
/** @param {HTMLElement} input @returns {Limits} */
export function limitsOf({ dataset: { min = "", max = "", stepSize = "", whole } }) {
  return { min, max, step: stepSize === "any" ? "" : stepSize, isWhole: whole !== undefined };
}

/** @param {HTMLInputElement} input @param {Limits} limits */
export function setLimits(input, { min, max, step }) {
  Object.assign(input.dataset, { min, max, stepSize: step });
  mark(input);
}

// The entered number as the page shows it, or what was typed in its place.
/** @param {HTMLInputElement} input */
export function entryText(input) {
  return input.type === "range" ? numberText(input.value) : input.value;
}

/** @param {HTMLInputElement} input @param {string} plain */
export function enter(input, plain) {
  input.value = input.type === "range" ? plain : clearText(plain);
}

// What a press sends: a number, or the text as it is, which the server refuses; of a list its numbers.
/** @param {HTMLInputElement} input @returns {number | string | (number | string)[]} */
export function sentNumber(input) {
  const limits = limitsOf(input);
  /** @param {string} text */
  const read = (text) => (judged(text, limits).problem === "unclear" ? null : readNumber(text, limits.isWhole));
  if (input.matches("[data-list]")) return readNumbers(input.value, read);
  return input.type === "range" ? Number(input.value) : (read(input.value) ?? input.value.trim());
}

// What is wrong with a number as plain text.
/** @param {string} plain @param {Limits} limits @returns {Judgement["problem"]} */
function beyond(plain, { min, max, step, isWhole }) {
  if (min && isLess(plain, min)) return "tooLow";
  if (max && isLess(max, plain)) return "tooHigh";
  return step && plain !== max && !isOnStep(plain, min || "0", step, isWhole) ? "offStep" : null;
}

// A typed number as plain text, null if it is none, and what is wrong with it.
/** @param {string} text @param {Limits} limits @returns {Judgement} */
export function judged(text, limits) {
  if (/^\s*[−-]?\s*$/.test(text)) return { plain: null, problem: "empty" };
  const plain = readPlain(text, limits.isWhole);
  if (plain === null) return { plain, problem: limits.isWhole ? "noWhole" : "noNumber" };
  const isPermittedAsBoth = loneGroup(text)?.every(
    (other) => !(limits.isWhole && other.includes(".")) && beyond(other, limits) === null,
  );
  return { plain, problem: isPermittedAsBoth ? "unclear" : beyond(plain, limits) };
}

// The entered number, or those of a list, judged.
/** @param {HTMLInputElement} input @returns {Judgement[]} */
export function entered(input) {
  const limits = limitsOf(input);
  const texts = input.matches("[data-list]") ? elementsOf(input.value) : [entryText(input)];
  return (
    texts?.map((text) => judged(text, limits)) ?? [{ plain: null, problem: limits.isWhole ? "noWhole" : "noNumber" }]
  );
}

// Independent of the language: plain text, or that of each number of a list; null if it can't be sent as it is.
/** @param {HTMLInputElement} input */
export function portable(input) {
  const numbers = entered(input);
  if (numbers.some(({ problem }) => problem)) return null;
  return input.matches("[data-list]") ? numbers.map(({ plain }) => plain) : numbers[0].plain;
}

/** @param {unknown} plain @param {Limits} limits @returns {plain is string} */
const isPermitted = (plain, limits) => typeof plain === "string" && judged(clearText(plain), limits).problem === null;

// Enters what was portable, if the limits permit it.
/** @param {HTMLInputElement} input @param {unknown} value */
export function enterPortable(input, value) {
  const limits = limitsOf(input);
  if (input.matches("[data-list]")) {
    if (!Array.isArray(value) || !value.every((plain) => isPermitted(plain, limits))) return false;
    input.value = listText(value);
  } else {
    if (!isPermitted(value, limits)) return false;
    enter(input, value);
  }
  return true;
}

// Marks what can't be sent as it is; nothing yet is no mistake.
/** @param {HTMLInputElement} input */
export function mark(input) {
  const problem = entered(input).find((number) => number.problem)?.problem ?? null;
  const isWrong = problem !== null && input.value.trim() !== "";
  input.setCustomValidity(isWrong ? problem : "");
  if (isWrong && /^no|^unclear$/.test(problem)) input.dataset.unread = problem === "unclear" ? problem : "";
  else delete input.dataset.unread;
}

// One step up or down, and never beyond a limit. An input without a step has those of its buttons, from 0 on.
/** @param {HTMLInputElement} input @param {number} times @param {string} size */
export function step(input, times, size) {
  const { min, max, step: own, isWhole } = limitsOf(input);
  const plain = input.type === "range" ? input.value : readPlain(input.value, isWhole);
  if (plain === null) return input.value.trim() ? undefined : enter(input, min || "0");
  const next = stepped(plain, times, (own && min) || "0", size, isWhole);
  enter(input, min && isLess(next, min) ? min : max && isLess(max, next) ? max : next);
}

// Number fields that are read as the server reads them, sliders with their values, and step buttons for gloves.
// Without this script the same inputs are text fields.

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

// A number that was read is shown as the panel writes it: what is seen is what is sent. What is unclear stays as it is.
/** @param {HTMLInputElement} input */
function settle(input) {
  const { plain, problem } = judged(input.value, limitsOf(input));
  if (plain !== null && problem !== "unclear" && clearText(plain) !== input.value) enter(input, plain);
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

// Once, for all inputs of the page.
export function equipInputs() {
  if ("inputs" in document.documentElement.dataset) return;
  for (const input of document.querySelectorAll("input[data-number]")) equip(input);
  for (const input of document.querySelectorAll("input[data-list]")) input.addEventListener("input", () => mark(input));
  document.documentElement.dataset.inputs = ""; // steps and the marks of numbers are in force
}
