// The pad of digits beside the field of a PIN.
import { closest, find } from "./show.js";

const MOST_DIGITS = 12;

// Types what a touched button of a pad stands for into the field beside it; false where no such button was touched.
/** @param {EventTarget | null} target @param {"input[name=pin]" | "input[name=_pin]"} field */
export function typeDigit(target, field) {
  const key = closest(target, ".pad button");
  const form = closest(target, "form");
  if (!key || !form) return false;
  const input = find(form, field);
  const edited = { clear: "", delete: input.value.slice(0, -1) };
  const digit = key.value;
  input.value = digit === "clear" || digit === "delete" ? edited[digit] : (input.value + digit).slice(0, MOST_DIGITS);
  return true;
}
