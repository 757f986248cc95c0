// A press that asks first: what will be done, with which values. Its "yes" is the press.
export function asked(root, form, yes) {
  const dialog = root.querySelector("dialog.ask");
  for (const place of dialog.querySelectorAll("[data-value-of]")) {
    place.textContent = shown(form.elements[place.dataset.valueOf]) || dialog.dataset.empty;
  }
  const answer = (event) => {
    if (event.target.closest(".yes")) yes(event);
    if (event.target.closest("button")) dialog.close();
  };
  dialog.addEventListener("click", answer);
  dialog.addEventListener("close", () => dialog.removeEventListener("click", answer), { once: true });
  dialog.showModal();
}

// As the operator reads it on the page.
function shown(input) {
  const entry = input instanceof RadioNodeList ? [...input].find((one) => one.type !== "hidden") : input;
  if (entry.type === "checkbox") {
    return entry.parentElement.querySelector(entry.checked ? ".on" : ".off").textContent;
  }
  return entry.selectedOptions ? entry.selectedOptions[0].textContent : entry.value;
}
