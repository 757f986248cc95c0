// Sliders with their values, and buttons for what gloves can't type. Without this file the same
// inputs are number fields.
function equip(input) {
  const root = input.closest("[data-widget]");
  const output = root.querySelector("output");
  const show = () => output && (output.value = input.value);
  if (output) {
    input.type = "range";
    output.hidden = false;
    input.addEventListener("input", show);
  }
  for (const button of root.querySelectorAll("[data-step]")) {
    button.hidden = false;
    button.addEventListener("click", () => {
      if (input.value === "") input.value = input.min;
      else if (input.step !== "any") input.stepUp(Number(button.dataset.step));
      input.dispatchEvent(new Event("input", { bubbles: true }));
      show();
    });
  }
  show();
}

for (const input of document.querySelectorAll("input[type=number]")) equip(input);
