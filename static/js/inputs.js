// Sliders with their values, and buttons for what gloves can't type. Without this file the same
// inputs are number fields.

// How far a slider and its buttons go where any number may be entered: 1, 2 or 5 of a decimal place, and
// a hundredth of the range at most.
function fine(input) {
  const most = (input.max - input.min) / 100;
  const place = 10 ** Math.floor(Math.log10(most));
  return place * ([5, 2].find((times) => times * place <= most) ?? 1);
}

// The nearest of its fine steps, or the limit that is nearer.
function near(input, value) {
  const step = fine(input);
  const rounded = Number((Math.round(value / step) * step).toPrecision(12));
  return Math.min(Math.max(rounded, input.min), input.max);
}

// As wide as its longest value: nothing moves under a finger.
function widen(output, input) {
  const grain = input.step === "any" ? fine(input) : Number(input.step);
  const places = Math.max(0, -Math.floor(Math.log10(grain)));
  const longest = Math.max(...[input.min, input.max].map((limit) => Number(limit).toFixed(places).length));
  output.style.minWidth = `max(3.2em, ${Math.max(longest, input.value.length)}ch)`;
}

function step(input, times) {
  if (input.value === "") input.value = input.min;
  else if (input.step !== "any") input.stepUp(times);
  else if (input.min && input.max) input.value = near(input, Number(input.value) + times * fine(input));
}

function equip(input) {
  const root = input.closest("[data-widget]");
  const output = root.querySelector("output");
  const show = () => output && (output.value = input.value);
  if (output) {
    input.type = "range";
    output.hidden = false;
    widen(output, input);
    input.addEventListener("input", () => {
      if (input.step === "any") input.value = near(input, Number(input.value));
      show();
    });
  }
  for (const button of root.querySelectorAll("[data-step]")) {
    button.hidden = false;
    button.addEventListener("click", () => {
      step(input, Number(button.dataset.step));
      input.dispatchEvent(new Event("input", { bubbles: true }));
      show();
    });
  }
  show();
}

for (const input of document.querySelectorAll("input[type=number]")) equip(input);
