// Opens the keypad or the keyboard on the screen at a touch in an input. With panel key `keyboard = "auto"` only
// where a finger is the main pointer.
import { isTouched } from "../entries.js";
import { closest } from "../show.js";

const coarse = matchMedia("(pointer: coarse)");
const always = pageGuard.page.keyboard === "on";
const TOUCHED = ":is([data-widget], [data-typed]) :is(input[type=text], input[type=password], output)";
/** @typedef {{ text: string, isTouched: boolean, isTyped: boolean }} Before  What the input had at the touch, and whether something was typed since. */
/** @type {Record<"keypad" | "keyboard", () => Promise<{ Entry: new (input: HTMLInputElement, before: Before, closed: () => void) => { input: HTMLElement, cancel(): void } }>>} */
const KINDS = { keypad: () => import("./keypad.js"), keyboard: () => import("./keyboard.js") };

/** @type {{ input: HTMLElement, cancel(): void } | null} */
let open = null; // what is open now
let touches = 0; // counts them: a module that arrives after the next touch opens nothing

// Without a system keyboard, where there is one of the page's own.
function prepare() {
  const active = always || coarse.matches;
  for (const input of document.querySelectorAll(
    ":is([data-widget], [data-typed]) :is(input[type=text], input[type=password])",
  )) {
    input.dataset.inputmode ??= input.inputMode;
    input.inputMode = active ? "none" : input.dataset.inputmode;
  }
  document.body.toggleAttribute("data-touch-entry", active);
}

/** @param {HTMLElement} place */
async function openFor(place) {
  const input = place instanceof HTMLInputElement ? place : place.parentElement?.querySelector("input");
  if (!input || open?.input === input) return;
  open?.cancel();
  const touch = ++touches;
  const { value } = input;
  const wasTouched = isTouched(input);
  try {
    const module = await KINDS[input.matches("[data-number]") ? "keypad" : "keyboard"]();
    if (touch !== touches) return;
    const isTyped = isTouched(input) && input.value !== value; // else the robot's value may have changed
    const before = { text: isTyped ? value : input.value, isTouched: wasTouched, isTyped };
    open = new module.Entry(input, before, () => (open = null));
  } catch {
    input.inputMode = input.dataset.inputmode ?? ""; // the next touch has the browser's own
  }
}

document.addEventListener("click", ({ target }) => {
  const place = closest(target, TOUCHED);
  if (place && (always || coarse.matches)) openFor(place);
});
coarse.addEventListener("change", prepare);
prepare();
