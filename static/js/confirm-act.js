// The page on which a person confirms an act on an alarm: the pad types into the field of the PIN without a new page.
import { find } from "./show.js";

const MOST_DIGITS = 12;
const form = find(document, "form[data-confirm-act]");

form.addEventListener("submit", (event) => {
  const digit = event.submitter instanceof HTMLButtonElement ? event.submitter.value : "enter";
  if (digit === "enter") return;
  event.preventDefault();
  const input = find(form, "input[name=_pin]");
  const edited = { clear: "", delete: input.value.slice(0, -1) };
  input.value = digit === "clear" || digit === "delete" ? edited[digit] : (input.value + digit).slice(0, MOST_DIGITS);
});
