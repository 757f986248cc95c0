// The inputs of numbers: text fields in the notation of the page's language, and sliders.
import { isLess, isOnStep, stepped } from "./decimals.js";
import { elementsOf, listText, numberText, readNumber, readNumbers, readPlain } from "./number-text.js";

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
  input.value = input.type === "range" ? plain : numberText(plain);
}

// What a press sends: a number, or the text as it is, which the server refuses; of a list its numbers.
/** @param {HTMLInputElement} input @returns {number | string | (number | string)[]} */
export function sentNumber(input) {
  if (input.matches("[data-list]")) return readNumbers(input.value, limitsOf(input).isWhole);
  return input.type === "range"
    ? Number(input.value)
    : (readNumber(input.value, limitsOf(input).isWhole) ?? input.value.trim());
}

// A typed number as plain text, null if it is none, and what is wrong with it.
/** @param {string} text @param {Limits} limits @returns {Judgement} */
export function judged(text, { min, max, step, isWhole }) {
  if (/^\s*[−-]?\s*$/.test(text)) return { plain: null, problem: "empty" };
  const plain = readPlain(text, isWhole);
  if (plain === null) return { plain, problem: isWhole ? "noWhole" : "noNumber" };
  if (min && isLess(plain, min)) return { plain, problem: "tooLow" };
  if (max && isLess(max, plain)) return { plain, problem: "tooHigh" };
  const isOff = step && plain !== max && !isOnStep(plain, min || "0", step, isWhole);
  return { plain, problem: isOff ? "offStep" : null };
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
const isPermitted = (plain, limits) => typeof plain === "string" && judged(numberText(plain), limits).problem === null;

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
  input.toggleAttribute("data-unread", isWrong && problem.startsWith("no"));
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
