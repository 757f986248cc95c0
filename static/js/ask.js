// The question before a press: a sheet beside its button, with the action and its values. Its "yes" is the press. The
// frame around the page stays live behind it: a stop button is never covered, and never waits for an answer.
import { coverPage, placeBeside, uncoverPage } from "./beside.js";
import { entries, isCheckbox, isNumber, numbers } from "./entries.js";
import { TAP_AGAIN_MS } from "./press.js";
import { closest, find, setText } from "./show.js";

const NOT_NOW_MS = 15_000; // without an answer the question goes

/** @param {HTMLElement} root @param {(event: Event) => void} onYes */
export function confirm(root, onYes) {
  const dialog = find(root, "dialog.ask");
  if (dialog.matches(":popover-open")) return; // a second tap of a button in the frame, which stays live
  for (const place of dialog.querySelectorAll("[data-value-of]")) {
    setText(place, shownText(place.getAttribute("data-value-of")) || dialog.dataset.empty);
  }
  const button = find(dialog, "button.yes");
  const answers = new AbortController();
  /** @template {keyof WindowEventMap} K @param {K} name @param {(event: WindowEventMap[K]) => void} listener @param {EventTarget} [target] */
  const on = (name, listener, target = dialog) =>
    target.addEventListener(name, listener, { signal: answers.signal, capture: target !== dialog });

  const close = () => dialog.matches(":popover-open") && dialog.hidePopover();
  on("click", (event) => {
    if (event.defaultPrevented) return; // it was not open when the finger went down
    if (closest(event.target, ".yes")) onYes(event);
    if (closest(event.target, "button")) close();
  });
  // A touch of anything else is "not now".
  on("pointerdown", ({ target }) => closest(target, ".ask") || isSecondTap || close(), window);
  on("keydown", (event) => event.key === "Escape" && close(), window);
  on("focusout", ({ relatedTarget: next }) => next && !closest(next, ".ask") && close());
  on("resize", () => placeBeside(dialog, root.getBoundingClientRect()), window);
  // The second tap of the press that opens the question is no answer.
  let isSecondTap = true;
  button.disabled = true;
  const opening = setTimeout(() => (button.disabled = isSecondTap = false), TAP_AGAIN_MS);
  const notNow = setTimeout(close, NOT_NOW_MS);
  on("beforetoggle", ({ newState }) => {
    if (newState === "open") return;
    answers.abort();
    clearTimeout(opening);
    clearTimeout(notNow);
    root.toggleAttribute("data-asked", false);
    if (dialog.contains(document.activeElement)) find(root, "button").focus();
    uncoverPage();
  });
  coverPage();
  root.toggleAttribute("data-asked", true);
  dialog.showPopover();
  placeBeside(dialog, root.getBoundingClientRect());
  find(dialog, ".no").focus();
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
