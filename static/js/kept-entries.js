// What is entered on a page is there again when the operator comes back to it in this tab: kept in the tab's storage,
// for one start of the server and one panel file. It only fills inputs; nothing is pressed again.
import { changed, entries, isCheckbox, isNumber, isTouched, keptName, numbers } from "./entries.js";

// Sliders are there after it.
if (document.querySelector("[data-step]")) (await import("./number-inputs.js")).equipInputs();

const { revision, seen } = pageGuard.page;
const STAMP = `${revision} ${seen.slice(0, seen.lastIndexOf("-"))}`; // the server's files and its start

// null for what must not be restored.
/** @param {Entry} input */
function keptValue(input) {
  if (isCheckbox(input)) return input.checked;
  return isNumber(input) ? numbers?.portable(input) : input.value;
}

// The storage is no part of the panel, whose limits may have changed too.
/** @param {Entry} input @param {string} value */
function fits(input, value) {
  if (input instanceof HTMLSelectElement)
    return [...input.options].some((option) => !option.hidden && option.value === value);
  return input.maxLength < 0 || [...value].length <= input.maxLength;
}

/** @param {Entry} input @param {unknown} value */
function fill(input, value) {
  if (isNumber(input)) return numbers?.enterPortable(input, value);
  if (isCheckbox(input)) {
    if (typeof value !== "boolean") return false;
    input.checked = value;
  } else {
    if (typeof value !== "string" || !fits(input, value)) return false;
    input.value = value;
  }
  return true;
}

// Each page has an item of its own: one that closes late overwrites no other's. It is written at each input, since the
// next page may be there before this one is hidden.
function keep() {
  const typed = entries.filter((input) => changed.has(input) && isTouched(input));
  const values = typed.map((input) => [input.name, keptValue(input)]).filter(([, value]) => value !== null);
  sessionStorage.setItem(keptName(), JSON.stringify({ stamp: STAMP, values: Object.fromEntries(values) }));
}

const { stamp, values = {} } = JSON.parse(sessionStorage.getItem(keptName()) ?? "{}");
for (const [name, value] of stamp === STAMP ? Object.entries(values) : []) {
  const input = entries.find((one) => one.name === name);
  if (!input || changed.has(input) || input.closest("[inert]") || !fill(input, value)) continue;
  input.dispatchEvent(new InputEvent("input", { bubbles: true, inputType: "insertReplacementText" }));
}
for (const event of ["input", "change", "pagehide"]) addEventListener(event, keep);
document.documentElement.dataset.kept = ""; // what was entered before is there
