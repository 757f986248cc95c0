// The question before a press: a sheet beside its button, with the action and its values. Its "yes" is the press. The
// frame around the page stays live behind it: a stop button is never covered, and never waits for an answer.
import { entries, isCheckbox } from "./entries.js";
import { entryText } from "./number-inputs.js";
import { TAP_AGAIN_MS } from "./press.js";
import { closest, find, setText } from "./show.js";

const NOT_NOW_MS = 15_000; // without an answer the question goes
const GAP_PX = 12;

let closing = 0;

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
    // The second tap of an answer is no press of the button below.
    closing = setTimeout(() => delete document.body.dataset.asks, TAP_AGAIN_MS);
  });
  clearTimeout(closing);
  document.body.dataset.asks = "";
  root.toggleAttribute("data-asked", true);
  dialog.showPopover();
  placeBeside(dialog, root.getBoundingClientRect());
  find(dialog, ".no").focus();
}

// Above the button, else below or beside it, within the page.
/** @param {HTMLElement} sheet @param {DOMRect} button */
function placeBeside(sheet, button) {
  const page = find(document, "main").getBoundingClientRect();
  const { width, height } = sheet.getBoundingClientRect();
  /** @param {number} start @param {number} least @param {number} most */
  const within = (start, least, most) => Math.max(least, Math.min(start, most));
  const isInFrame = button.right <= page.left || button.left >= page.right;
  let left = within((button.left + button.right - width) / 2, page.left + GAP_PX, page.right - GAP_PX - width);
  let top = button.top - GAP_PX - height;
  if (isInFrame || top < page.top) {
    const isRight = page.right - button.right >= width + 2 * GAP_PX;
    const isBelow = !isInFrame && page.bottom - button.bottom >= height + 2 * GAP_PX;
    if (isBelow) top = button.bottom + GAP_PX;
    else {
      left = isRight ? Math.max(button.right, page.left) + GAP_PX : button.left - GAP_PX - width;
      left = within(left, page.left + GAP_PX, page.right - GAP_PX - width);
      const middle = (button.top + button.bottom - height) / 2;
      top = within(middle, page.top + GAP_PX, page.bottom - GAP_PX - height);
    }
  }
  Object.assign(sheet.style, { left: `${left}px`, top: `${top}px` });
}

// The value as the page shows it.
/** @param {string | null} name */
function shownText(name) {
  const input = entries.find((entry) => entry.name === name);
  if (!input || input.value === "") return "";
  if (isCheckbox(input)) return input.parentElement?.querySelector(input.checked ? ".on" : ".off")?.textContent;
  return input instanceof HTMLSelectElement ? input.selectedOptions[0].textContent : entryText(input);
}
