// A bar code reader is a keyboard that types fast and ends with Enter. What it types while no input has the focus
// goes into the page's input that asks for it, and its Enter presses nothing.
import { closest, find } from "../show.js";

const APART_MS = 50;
const SHORTEST = 3; // characters: two keys of a hand may be as near
const EDITABLE = "input:not([type=checkbox], [type=range]), select, textarea";

const field = find(document, "input[data-scan]");
const message = find(document, `#${field.getAttribute("aria-describedby")}`);
let burst = "";
let lastAt = -Infinity;

/** @param {string} text */
function deliver(text) {
  const isTooLong = [...text].length > field.maxLength;
  message.textContent = (isTooLong && message.dataset.tooLong) || "";
  if (isTooLong) return;
  field.value = text;
  for (const name of ["input", "change"]) field.dispatchEvent(new Event(name, { bubbles: true }));
}

/** @param {Event} event */
function swallow(event) {
  event.preventDefault();
  event.stopImmediatePropagation();
}

/** @param {KeyboardEvent} event */
function typed(event) {
  const { key, target, timeStamp, ctrlKey, altKey, metaKey } = event;
  if (key === "Shift" || ctrlKey || altKey || metaKey) return;
  const follows = timeStamp - lastAt < APART_MS;
  lastAt = timeStamp;
  const isElsewhere = target !== field && target instanceof Element && target.matches(EDITABLE);
  if (key.length === 1) {
    burst = follows ? burst + key : key;
    if (follows && target !== field && !isElsewhere) swallow(event); // a space on a key is no press
    return;
  }
  const isCode = key === "Enter" && follows && burst.length >= SHORTEST;
  // Slow readers too: Enter on a key is never a press where codes are read. Space is.
  if (key === "Enter" && (isCode || closest(target, "button"))) swallow(event);
  if (isCode && !isElsewhere) deliver(burst);
  burst = "";
}

addEventListener("keydown", typed, true);
// The press of a space comes when it goes up.
addEventListener(
  "keyup",
  (event) => event.key === " " && burst.length > 1 && event.target instanceof HTMLButtonElement && swallow(event),
  true,
);
document.documentElement.dataset.scans = ""; // codes are read from now on
