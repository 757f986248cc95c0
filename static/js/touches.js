// What touches the page: fingers, each with its own pointer, and readers of codes, which type.
import { closest, find, isStop, reportOnPage, STOPS } from "./show.js";

const CLICK_AFTER_MS = 500; // a browser's own click, after the touch that it is made of

// Touches of buttons: felt at once. A stop button is pressed by its own pointer, whatever else touches the glass.

/** @param {HTMLElement} button @param {{ clientX: number, clientY: number }} event */
const isOver = (button, { clientX: x, clientY: y }) => {
  const { left, right, top, bottom } = button.getBoundingClientRect();
  return x >= left && x <= right && y >= top && y <= bottom;
};

const ROLL_MM = 8; // so far a finger in a glove rolls while it presses

// Whether a pointer that went down on a button at `from` has slid off.
/** @param {HTMLElement} button @param {{ clientX: number, clientY: number }} from @param {PointerEvent} event */
function hasSlidOff(button, from, event) {
  const mm = Number.parseFloat(getComputedStyle(button).getPropertyValue("--mm"));
  const far = Math.hypot(event.clientX - from.clientX, event.clientY - from.clientY);
  return far > ROLL_MM * mm && !isOver(button, event);
}

// Chromium gives a click to the first finger only, but each finger has its own pointer.
export class StopKeys {
  /** @type {Map<number, { button: HTMLButtonElement, clientX: number, clientY: number }>} */
  #down = new Map(); // pointer → the stop button that it went down on, and where
  /** @type {(button: HTMLButtonElement, event: PointerEvent) => void} */
  #press;
  /** @type {WeakMap<HTMLButtonElement, number>} */
  #pressedAt = new WeakMap(); // when a pointer pressed it: the click that follows is the same press

  /** @param {(button: HTMLButtonElement, event: PointerEvent) => void} press */
  constructor(press) {
    this.#press = press;
    addEventListener("pointerdown", (event) => this.#began(event), true);
    addEventListener("pointermove", (event) => this.#moved(event), true);
    // Where another finger scrolls the page, the browser takes the pointers of all fingers away.
    for (const name of /** @type {const} */ (["pointerup", "pointercancel"]))
      addEventListener(name, (event) => this.#ended(event), true);
  }

  // Whether a click is that of a press by a pointer.
  /** @param {Event} click @param {HTMLButtonElement} button */
  isPressed(click, button) {
    return click.timeStamp - (this.#pressedAt.get(button) ?? Number.NEGATIVE_INFINITY) < CLICK_AFTER_MS;
  }

  /** @param {PointerEvent} event */
  #began(event) {
    const button = closest(event.target, STOPS);
    const { pointerId, clientX, clientY } = event;
    if (button && event.button === 0 && !button.disabled) this.#down.set(pointerId, { button, clientX, clientY });
  }

  // A finger that slides off takes its press back; one that rolls does not.
  /** @param {PointerEvent} event */
  #moved(event) {
    const down = this.#down.get(event.pointerId);
    if (down && hasSlidOff(down.button, down, event)) this.#down.delete(event.pointerId);
  }

  /** @param {PointerEvent} event */
  #ended(event) {
    const down = this.#down.get(event.pointerId);
    this.#down.delete(event.pointerId);
    if (!down || (event.type === "pointerup" && hasSlidOff(down.button, down, event))) return;
    this.#pressedAt.set(down.button, event.timeStamp);
    this.#press(down.button, event);
  }
}

// A button looks pressed while a pointer is down on it: from the first moment on, and not once it has slid off.
export function feelTouches() {
  /** @type {Map<number, { button: HTMLElement, clientX: number, clientY: number }>} */
  const touched = new Map();
  addEventListener("pointerdown", ({ target, pointerId, clientX, clientY }) => {
    const button = closest(target, "form.page button:enabled");
    if (!button) return;
    touched.set(pointerId, { button, clientX, clientY });
    button.toggleAttribute("data-down", true);
  });
  /** @param {HTMLElement} button @param {{ clientX: number, clientY: number }} from @param {PointerEvent} event */
  const isOff = (button, from, event) => (isStop(button) ? hasSlidOff(button, from, event) : !isOver(button, event));
  /** @param {PointerEvent} event */
  const released = (event) => {
    const down = touched.get(event.pointerId);
    if (!down || (event.type === "pointermove" && !isOff(down.button, down, event))) return;
    touched.delete(event.pointerId);
    if (![...touched.values()].some(({ button }) => button === down.button))
      down.button.toggleAttribute("data-down", false);
  };
  for (const name of /** @type {const} */ (["pointermove", "pointerup", "pointercancel"]))
    addEventListener(name, released, true);
}

// A drag that an element makes of its own, sideways only or every way. Else Chromium takes a quick one for a throw, and the next
// tap, on a button, only for the end of it.
/** @param {HTMLElement} element @param {"every" | "sideways"} way */
export function keepDrags(element, way) {
  let [x, y] = [0, 0];
  element.addEventListener("touchstart", ({ touches: [first] }) => ([x, y] = [first.clientX, first.clientY]), {
    passive: true,
  });
  /** @param {TouchEvent} event */
  const keep = (event) => {
    const [first] = event.touches;
    const isSideways = Math.abs(first.clientX - x) > Math.abs(first.clientY - y);
    if ((way === "every" || isSideways) && event.cancelable) event.preventDefault();
  };
  element.addEventListener("touchmove", keep, { passive: false });
}

// A bar code or badge reader is a keyboard that types faster than a hand. Its keys press, hold and choose nothing; its code
// goes to the field that asks for one, or is said to be not asked for. What a key presses waits until it is known that
// it came alone.

export const APART_MS = 50; // between two keys of a reader, at most
export const SHORTEST = 3; // characters of a code: two keys of a hand may be as near
const OF_INPUT_METHOD = 229;
const MODIFIERS = ["Shift", "Control", "Alt", "AltGraph", "Meta", "CapsLock", "NumLock"];
const ENDS = ["Enter", "Tab"];
const TEXTS = "input:not([type=checkbox], [type=radio], [type=range], [data-number]), textarea";
const VALUES = "input[data-number], input[type=range], select";
const CHOSEN = "input:is([type=checkbox], [type=radio], [type=range])";
const PRESSED = "button, summary, a[href], input[type=checkbox], input[type=radio], select, option";

let code = ""; // the characters of this run of keys, each as near to the one before as a reader's
let isCodeOver = false; // the run had its end: what else is as near belongs to it
let lastAt = -Infinity;
/** @type {{ field: HTMLInputElement | HTMLSelectElement, value: string } | null} */
let before = null; // what the field had before the run
/** @type {{ target: HTMLElement, key: string, timer: number } | null} */
let waiting = null; // a key that is not known yet to have come alone
let silence = 0;
let isByKeyboard = true; // whether the last act was one of a keyboard

export const isKeyboardUsed = () => isByKeyboard;

/** @param {Event} event */
function swallow(event) {
  event.preventDefault();
  event.stopImmediatePropagation();
}

// The character of a key; "" for a key without one. A reader knows nothing of Caps Lock.
/** @param {KeyboardEvent} event */
function characterOf(event) {
  const { key } = event;
  if (key === "Dead") return event.code.slice(-1); // of a layout that composes letters
  if (key.length !== 1) return "";
  if (!event.getModifierState("CapsLock")) return key;
  return key === key.toLowerCase() ? key.toUpperCase() : key.toLowerCase();
}

// The field for a badge: that of the sheet that is open, else of the page of sign-in.
function badgeField() {
  return document.querySelector("dialog#person:popover-open input[name=_badge], main.sign-in input#badge");
}

// Whether a code may stand in a field that has the focus.
/** @param {EventTarget | null} target */
function takesCodes(target) {
  const text = closest(target, TEXTS);
  const badge = badgeField();
  return text !== null && (badge === null || text === badge);
}

/** @param {KeyboardEvent} event */
function typed(event) {
  if (!event.isTrusted || event.repeat || event.isComposing || event.keyCode === OF_INPUT_METHOD) return;
  if (MODIFIERS.includes(event.key)) return;
  isByKeyboard = true;
  const follows = event.timeStamp - lastAt < APART_MS;
  lastAt = event.timeStamp;
  if (!follows) begin(event.target);
  const isCommand = (event.ctrlKey || event.altKey || event.metaKey) && !event.getModifierState("AltGraph");
  const character = isCommand ? "" : characterOf(event);
  if (character && isCodeOver) begin(event.target); // the next code
  if (character) write(event, character);
  else if (isCodeOver || (follows && isRun(event.target))) end(event);
  else if (!isCommand) hold(event);
}

// A hand's Enter may be as near to the last characters that it types: in a text it ends the entry.
/** @param {EventTarget | null} target */
function isRun(target) {
  const isText = closest(target, TEXTS) !== null;
  const isPressable = closest(target, PRESSED) !== null;
  return code.length >= (isText ? SHORTEST : isPressable ? 1 : 2);
}

/** @param {EventTarget | null} target */
function begin(target) {
  code = "";
  isCodeOver = false;
  const field = closest(target, `${TEXTS}, ${VALUES}`);
  before =
    field instanceof HTMLInputElement || field instanceof HTMLSelectElement ? { field, value: field.value } : null;
}

/** @param {KeyboardEvent} event @param {string} character */
function write(event, character) {
  code += character;
  if (waiting) clearTimeout(waiting.timer); // it did not come alone
  waiting = null;
  clearTimeout(silence);
  const field = closest(event.target, `${TEXTS}, ${VALUES}`);
  if (!field) {
    if (code.length === 1) hold(event);
    else swallow(event);
    if (code.length >= SHORTEST) silence = setTimeout(finish, 2 * APART_MS);
  } else if (field.matches("select, input[type=range]")) {
    if (code.length > 1) swallow(event);
    if (code.length === 2) restore();
    if (code.length >= SHORTEST) silence = setTimeout(finish, 2 * APART_MS);
  } else if (!takesCodes(field) && code.length >= SHORTEST && badgeField()) {
    swallow(event);
    silence = setTimeout(finish, 2 * APART_MS);
  }
}

// Its last key, and what follows it: a second one, or the signs of a line's end.
/** @param {KeyboardEvent} event */
function end(event) {
  swallow(event);
  if (ENDS.includes(event.key) || event.ctrlKey) finish();
}

function finish() {
  clearTimeout(silence);
  if (!isCodeOver && code.length >= SHORTEST) deliver();
  isCodeOver = true;
}

// What a key presses, holds or moves: only where it came alone. On a page where codes are read Enter presses no button,
// for slow readers too.
/** @param {KeyboardEvent} event */
function hold(event) {
  const { key } = event;
  const target = closest(event.target, PRESSED);
  if (key === "Enter" && closest(event.target, CHOSEN)) event.preventDefault(); // browsers press the form's first button
  if (!target || !isPressing(target, key)) return;
  swallow(event);
  if (key === "Enter" && target.matches("button") && document.querySelector("input[data-scan]")) return;
  waiting = { target, key, timer: setTimeout(press, APART_MS) };
}

/** @param {HTMLElement} target @param {string} key */
function isPressing(target, key) {
  if (target.matches("button.hold") && key.startsWith("Arrow")) return true;
  if (target.matches("a")) return key === "Enter";
  return key === " " || (key === "Enter" && !target.matches("input"));
}

function press() {
  if (!waiting) return;
  const { target, key } = waiting;
  waiting = null;
  if (document.activeElement !== target) return;
  const again = new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true });
  if (!target.dispatchEvent(again)) return;
  if (target instanceof HTMLSelectElement) target.showPicker();
  else target.click();
}

function restore() {
  if (!before || before.field.value === before.value) return;
  before.field.value = before.value;
  for (const name of ["input", "change"]) before.field.dispatchEvent(new Event(name, { bubbles: true }));
}

function deliver() {
  if (document.querySelector("#cleaning:popover-open")) return;
  const badge = badgeField();
  const asking = document.querySelector("input[data-scan]");
  const focused = document.activeElement;
  if (badge) {
    restore();
    if (!(badge instanceof HTMLInputElement)) return;
    badge.value = code;
    badge.form?.requestSubmit();
  } else if (focused !== asking && takesCodes(focused)) return;
  else {
    restore();
    document.dispatchEvent(new Event("scanned")); // a keypad forgets what it has of it
    if (asking instanceof HTMLInputElement) enter(asking);
    else reportOnPage("notAsked");
  }
  code = "";
}

/** @param {HTMLInputElement} field */
function enter(field) {
  const message = find(document, `#${field.getAttribute("aria-describedby")}`);
  const isTooLong = [...code].length > field.maxLength;
  message.textContent = (isTooLong && message.dataset.tooLong) || "";
  if (isTooLong) return;
  field.value = code;
  for (const name of ["input", "change"]) field.dispatchEvent(new Event(name, { bubbles: true }));
}

/** @param {KeyboardEvent} event */
function released(event) {
  if (!event.isTrusted) return;
  if (event.key === waiting?.key && waiting.target.matches(".hold")) {
    clearTimeout(waiting.timer);
    waiting = null;
  }
  if (event.key === " " && closest(event.target, PRESSED)) event.preventDefault(); // its press is `press`
}

addEventListener("keydown", typed, true);
addEventListener("keyup", released, true);
addEventListener("pointerdown", () => (isByKeyboard = false), true);
// A button that was touched does not keep the focus for Enter and Space.
addEventListener("click", ({ detail }) => {
  const { activeElement } = document;
  if (detail > 0 && activeElement instanceof HTMLElement && activeElement.matches(PRESSED)) activeElement.blur();
});
if (document.querySelector("input[data-scan]")) document.documentElement.dataset.scans = ""; // codes are read from now on

// Each finger presses what it touches. A browser gives a click to the first finger only, and to none of several that are on
// the glass at once: what such a finger has pressed is clicked here.

const TOUCHED = `:is(${PRESSED}, label, input, textarea):not(:disabled, .hold)`;
/** @type {Map<number, { target: HTMLElement | null, isAlone: boolean }>} */
const fingers = new Map(); // pointer → what it went down on, and whether no other was on the glass since
/** @type {WeakMap<Element, number>} */
const clickedAt = new WeakMap(); // when a finger beside others clicked it: a browser's own click is the same

/** @param {PointerEvent} event */
function began({ pointerType, pointerId, target }) {
  if (pointerType !== "touch") return;
  const isAlone = fingers.size === 0;
  if (!isAlone) for (const finger of fingers.values()) finger.isAlone = false;
  fingers.set(pointerId, { target: isStop(target) ? null : closest(target, TOUCHED), isAlone });
}

/** @param {PointerEvent} event */
function ended(event) {
  const finger = fingers.get(event.pointerId);
  fingers.delete(event.pointerId);
  if (!finger?.target || finger.isAlone) return;
  const { target } = finger;
  if (event.type === "pointercancel") return reportOnPage("otherFinger");
  if (!isOver(target, event) || !target.matches(TOUCHED)) return;
  clickedAt.set(target, event.timeStamp);
  if (target.matches("input, textarea, select")) target.focus();
  target.click();
}

/** @param {MouseEvent} event */
function clicked(event) {
  const target = closest(event.target, TOUCHED);
  if (!event.isTrusted || !target) return;
  if (event.timeStamp - (clickedAt.get(target) ?? Number.NEGATIVE_INFINITY) > CLICK_AFTER_MS) return;
  event.preventDefault();
  event.stopImmediatePropagation();
}

addEventListener("pointerdown", began, true);
for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) addEventListener(name, ended, true);
addEventListener("click", clicked, true);

// None of a browser's own gestures on a kiosk.
const ZOOM_KEYS = ["+", "-", "=", "0"];
const coarse = matchMedia("(pointer: coarse)");

// Where a finger is the main pointer: a developer's browser keeps its own. The rest is in floor.css.
function isKiosk() {
  return "kiosk" in document.documentElement.dataset && coarse.matches;
}

/** @template {keyof WindowEventMap} K @param {K} name @param {(event: WindowEventMap[K]) => boolean} isGesture */
function refuse(name, isGesture = () => true) {
  /** @param {WindowEventMap[K]} event */
  const listener = (event) => isKiosk() && isGesture(event) && event.preventDefault();
  addEventListener(name, listener, { capture: true, passive: false });
}

export function refuseGestures() {
  refuse("contextmenu");
  refuse("dragstart");
  refuse("gesturestart"); // a pinch in WebKit
  refuse("wheel", ({ ctrlKey }) => ctrlKey);
  refuse("keydown", ({ key, ctrlKey, metaKey }) => (ctrlKey || metaKey) && ZOOM_KEYS.includes(key));
}
