// What is entered on a page is there again when the operator comes back to it in this tab: kept in the tab's storage,
// for one start of the server and one panel file. It only fills inputs; nothing is pressed again.
import "./inputs.js"; // sliders are there after it
import { entries, isTouched } from "./entries.js";
import { enter, entered, judged, limitsOf } from "./number-inputs.js";
import { listText, numberText } from "./number-text.js";

const KEY = "operator-panel.entries";
const { base, page, revision, seen } = document.body.dataset;
const STAMP = `${revision} ${seen.slice(0, seen.lastIndexOf("-"))}`; // the server's files and its start
const PLACE = `${base}/${page}`;

const isNumber = (input) => input.matches("[data-number]");
const isList = (input) => input.matches("[data-list]");

// Independent of the language; null for what must not be restored.
function valueOf(input) {
  if (input.type === "checkbox") return input.checked;
  if (!isNumber(input) && !isList(input)) return input.value;
  const numbers = entered(input);
  if (numbers.some(({ problem }) => problem)) return null;
  return isList(input) ? numbers.map(({ plain }) => plain) : numbers[0].plain;
}

// The limits may have changed since, and the storage is no part of the panel.
function fits(input, value) {
  const isPermitted = (plain) => typeof plain === "string" && judged(numberText(plain), limitsOf(input)).problem === null;
  if (input.type === "checkbox") return typeof value === "boolean";
  if (isList(input)) return Array.isArray(value) && value.every(isPermitted);
  if (isNumber(input)) return isPermitted(value);
  if (input.options) return [...input.options].some((option) => !option.hidden && option.value === value);
  return typeof value === "string" && (input.maxLength < 0 || [...value].length <= input.maxLength);
}

function restore(input, value) {
  if (!fits(input, value) || input.closest("[inert]")) return;
  if (input.type === "checkbox") input.checked = value;
  else if (isNumber(input)) enter(input, value);
  else input.value = isList(input) ? listText(value) : value;
  input.dispatchEvent(new InputEvent("input", { bubbles: true, inputType: "insertReplacementText" }));
}

// The entries of each page, with the start of the server in which they were made.
const kept = () => JSON.parse(sessionStorage.getItem(KEY) ?? "{}");

const changed = new Set();
addEventListener("input", ({ target }) => changed.add(target));

function keep() {
  const typed = entries.filter((input) => changed.has(input) && isTouched(input));
  const values = typed.map((input) => [input.name, valueOf(input)]).filter(([, value]) => value !== null);
  sessionStorage.setItem(KEY, JSON.stringify({ ...kept(), [PLACE]: { stamp: STAMP, values: Object.fromEntries(values) } }));
}

const { stamp, values = {} } = kept()[PLACE] ?? {};
for (const [name, value] of stamp === STAMP ? Object.entries(values) : []) {
  const input = entries.find((one) => one.name === name);
  if (input && !changed.has(input)) restore(input, value);
}
addEventListener("pagehide", keep);
document.documentElement.dataset.kept = ""; // what was entered before is there
