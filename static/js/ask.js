// The dialog that confirms a press: the action and its values. Its "yes" is the press.
import { entryText } from "./number-inputs.js";
import { TAP_AGAIN_MS } from "./press.js";

let closing = 0;

/** @param {HTMLElement} root @param {HTMLFormElement} form @param {(event: Event) => void} onYes */
export function confirm(root, form, onYes) {
  const dialog = root.querySelector("dialog.ask");
  for (const place of dialog.querySelectorAll("[data-value-of]")) {
    place.textContent = shownText(form.elements[place.dataset.valueOf]) || dialog.dataset.empty;
  }
  const button = dialog.querySelector(".yes");
  const clicked = (event) => {
    if (event.defaultPrevented) return; // it was not open when the finger went down
    if (event.target.closest(".yes")) onYes(event);
    if (event.target.closest("button")) dialog.close();
  };
  // The second tap of the press that opens the dialog is no answer.
  button.disabled = true;
  const opening = setTimeout(() => (button.disabled = false), TAP_AGAIN_MS);
  dialog.addEventListener("click", clicked);
  const closed = () => {
    clearTimeout(opening);
    dialog.removeEventListener("click", clicked);
    // The second tap of an answer is no press of the button below.
    closing = setTimeout(() => delete document.body.dataset.asks, TAP_AGAIN_MS);
  };
  clearTimeout(closing);
  document.body.dataset.asks = "";
  dialog.addEventListener("close", closed, { once: true });
  dialog.showModal();
}

// The value as the page shows it.
/** @param {Entry | RadioNodeList} input @returns {string | null} */
function shownText(input) {
  const entry = input instanceof RadioNodeList ? [...input].find((one) => one.type !== "hidden") : input;
  if (entry.type === "checkbox") {
    return entry.parentElement.querySelector(entry.checked ? ".on" : ".off").textContent;
  }
  if (entry.value === "") return "";
  if (entry.selectedOptions) return entry.selectedOptions[0].textContent;
  return entryText(entry);
}
