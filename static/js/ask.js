import { TAP_AGAIN_MS } from "./press.js";

let closing = 0;

// A press that asks first: what will be done, with which values. Its "yes" is the press.
export function asked(root, form, yes) {
  const dialog = root.querySelector("dialog.ask");
  for (const place of dialog.querySelectorAll("[data-value-of]")) {
    place.textContent = shown(form.elements[place.dataset.valueOf]) || dialog.dataset.empty;
  }
  const button = dialog.querySelector(".yes");
  const answer = (event) => {
    if (event.defaultPrevented) return; // it was not open when the finger came down
    if (event.target.closest(".yes")) yes(event);
    if (event.target.closest("button")) dialog.close();
  };
  // The second tap of the press that asks is no answer.
  button.disabled = true;
  const opening = setTimeout(() => (button.disabled = false), TAP_AGAIN_MS);
  dialog.addEventListener("click", answer);
  const over = () => {
    clearTimeout(opening);
    dialog.removeEventListener("click", answer);
    // The second tap of an answer is no press of what is below.
    closing = setTimeout(() => delete document.body.dataset.asks, TAP_AGAIN_MS);
  };
  clearTimeout(closing);
  document.body.dataset.asks = "";
  dialog.addEventListener("close", over, { once: true });
  dialog.showModal();
}

// As the operator reads it on the page.
function shown(input) {
  const entry = input instanceof RadioNodeList ? [...input].find((one) => one.type !== "hidden") : input;
  if (entry.type === "checkbox") {
    return entry.parentElement.querySelector(entry.checked ? ".on" : ".off").textContent;
  }
  if (entry.value === "") return "";
  return entry.selectedOptions ? entry.selectedOptions[0].textContent : entry.value;
}
