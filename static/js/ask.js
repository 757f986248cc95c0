// The question before a press: a sheet beside its button, with the action and its values. Its "yes" is the press.
import { openAsking } from "./beside.js";
import { entries, isCheckbox, isNumber, numbers } from "./entries.js";
import { closest, find, setText } from "./show.js";

const NOT_NOW_MS = 15_000; // without an answer the question goes

/** @param {HTMLElement} root @param {(event: Event) => void} onYes */
export function confirm(root, onYes) {
  const dialog = find(root, "dialog.ask");
  if (dialog.matches(":popover-open")) return; // a second tap of a button in the frame, which stays live
  fillValues(dialog);
  const button = find(dialog, "button.yes");
  button.disabled = true;
  const asking = openAsking(root, dialog, NOT_NOW_MS, () => (button.disabled = false));
  asking.on("click", (event) => {
    if (event.defaultPrevented) return; // it was not open when the finger went down
    if (closest(event.target, ".yes")) onYes(event);
    if (closest(event.target, "button")) asking.close();
  });
  find(dialog, ".no").focus();
}

// Shows the values that the press will have.
/** @param {HTMLElement} dialog */
export function fillValues(dialog) {
  for (const place of dialog.querySelectorAll("[data-value-of]"))
    setText(place, shownText(place.getAttribute("data-value-of")) || find(document, "dialog.ask").dataset.empty);
}

// The value as the page shows it.
/** @param {string | null} name */
function shownText(name) {
  const input = entries.find((entry) => entry.name === name);
  if (!input || input.value === "") return "";
  if (isCheckbox(input)) return input.parentElement?.querySelector(input.checked ? ".on" : ".off")?.textContent;
  if (input instanceof HTMLSelectElement) return input.selectedOptions[0].textContent;
  return isNumber(input) ? numbers?.entryText(input) : input.value;
}
