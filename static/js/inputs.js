// Sliders with their values, and step buttons for gloves. Without this script the same inputs are number
// fields.
import { DECIMAL, numberText } from "./number-text.js";

// A browser in another language would leave out the comma, and take 1,5 for 15.
const isOwnComma = new Intl.NumberFormat(navigator.language).format(0.5).includes(",");
if (DECIMAL === "," && !isOwnComma) {
  addEventListener("beforeinput", (event) => {
    if (event.data !== "," || event.target.type !== "number") return;
    event.preventDefault();
    document.execCommand("insertText", false, ".");
  });
}

// The step of a slider and its buttons where the input has none: 1, 2 or 5 of a decimal place, and a hundredth
// of the range at most.
function stepSize(input) {
  const most = (input.max - input.min) / 100;
  const place = 10 ** Math.floor(Math.log10(most));
  return place * ([5, 2].find((times) => times * place <= most) ?? 1);
}

// The nearest step, or the nearer limit.
function nearestStep(input, value) {
  const size = stepSize(input);
  const rounded = Number((Math.round(value / size) * size).toPrecision(12));
  return Math.min(Math.max(rounded, input.min), input.max);
}

// Makes the output as wide as its longest value, so that nothing moves under a finger.
function setWidth(output, input) {
  const grain = input.step === "any" ? stepSize(input) : Number(input.step);
  const places = Math.max(0, -Math.floor(Math.log10(grain)));
  const longest = Math.max(...[input.min, input.max].map((limit) => Number(limit).toFixed(places).length));
  output.style.minWidth = `max(3.2em, ${Math.max(longest, input.value.length)}ch)`;
}

function step(input, times) {
  if (input.value === "") input.value = input.min;
  else if (input.step !== "any") input.stepUp(times);
  else if (input.min && input.max) input.value = nearestStep(input, Number(input.value) + times * stepSize(input));
}

function equip(input) {
  const root = input.closest("[data-widget]");
  const output = root.querySelector("output");
  const show = () => output && (output.value = numberText(input.value));
  if (output) {
    input.type = "range";
    setWidth(output, input);
    input.addEventListener("input", (event) => {
      // A value of the keypad is exact; a finger on a slider is not.
      if (input.step === "any" && !event.inputType) input.value = nearestStep(input, Number(input.value));
      show();
    });
  }
  for (const button of root.querySelectorAll("[data-step]")) {
    button.addEventListener("click", () => {
      step(input, Number(button.dataset.step));
      input.dispatchEvent(new Event("input", { bubbles: true }));
      show();
    });
  }
  show();
}

for (const input of document.querySelectorAll("input[type=number]")) equip(input);
document.documentElement.dataset.inputs = ""; // steps and commas are in force
