// A sheet over the page in which something is entered, and where it lies.
import { TAP_AGAIN_MS } from "../press.js";
import { copyOf, find, lockHolds, unlockHolds } from "../show.js";

// Its place: beside its field, never over it, the header or the rail with Stop.

/** @typedef {{ left: number, right: number, top: number, bottom: number }} Area @typedef {{ left: number, top: number, lift: number, side: string, point: number }} Spot */
const GAP_PX = 8;

// Of an input that is none of a widget: what is around it.
/** @param {HTMLElement} input @returns {HTMLElement} */
export function widgetOf(input) {
  const root = /** @type {HTMLElement | null} */ (input.closest("[data-widget], [data-typed]"));
  if (!root) throw new Error("an input outside of a widget");
  return root;
}

// What is kept free: the field with its name, a slider with its value; where there is less room, the field alone.
/** @param {HTMLElement} input */
function fieldsOf(input) {
  const field = input.closest(".entry") ?? input;
  const whole = input.matches("[data-entry]") ? field : widgetOf(input);
  return [whole, field].map((one) => one.getBoundingClientRect());
}

// The page, beside the rail.
/** @returns {Area} */
function area() {
  const { left, right, top, bottom } = find(document, "main").getBoundingClientRect();
  return { left, right, top, bottom };
}

/** @param {HTMLElement} sheet @param {string} shape @param {Area} area */
function measure(sheet, shape, area) {
  sheet.dataset.shape = shape;
  sheet.style.setProperty("--most", `${area.right - area.left - 2 * GAP_PX}px`);
  const { width, height } = sheet.getBoundingClientRect();
  return { width, height };
}

// Beside the field, as high as the page: null without room.
/** @param {HTMLElement} sheet @param {DOMRect} field @param {Area} area @returns {Spot | null} */
function aside(sheet, field, area) {
  const { width, height } = measure(sheet, "tall", area);
  const room = area.bottom - area.top - 2 * GAP_PX;
  if (height > room) return null;
  const right = area.right - field.right >= width + 2 * GAP_PX;
  if (!right && field.left - area.left < width + 2 * GAP_PX) return null;
  const left = right ? field.right + 2 * GAP_PX : field.left - 2 * GAP_PX - width;
  const middle = (field.top + field.bottom - height) / 2;
  const top = Math.max(area.top + GAP_PX, Math.min(middle, area.bottom - GAP_PX - height));
  return { left, top, lift: 0, side: right ? "left" : "right", point: (field.top + field.bottom) / 2 - top };
}

// Below or above the field over the width of the page; without room there the page is lifted.
/** @param {HTMLElement} sheet @param {DOMRect} field @param {Area} area @param {string} shape @returns {Spot | null} */
function across(sheet, field, area, shape) {
  const { width, height } = measure(sheet, shape, area);
  if (width > area.right - area.left) return null;
  const middle = (field.left + field.right - width) / 2;
  const left = Math.max(area.left + GAP_PX, Math.min(middle, area.right - GAP_PX - width));
  const bottom = area.bottom - GAP_PX - height;
  const point = (field.left + field.right) / 2 - left;
  const hidden = field.top < area.top;
  if (!hidden && field.bottom + GAP_PX <= bottom) return { left, top: bottom, lift: 0, side: "top", point };
  const above = area.top + GAP_PX;
  const seen = field.bottom <= area.bottom;
  if (seen && above + height + GAP_PX <= field.top) return { left, top: above, lift: 0, side: "bottom", point };
  const free = bottom - area.top - GAP_PX;
  if (free < field.bottom - field.top) return null;
  const target = hidden ? area.top + GAP_PX - field.top : bottom - GAP_PX - field.bottom;
  return { left, top: bottom, lift: target, side: "top", point };
}

// Places the sheet for an input; returns by how many pixels the page is lifted.
/** @param {HTMLElement} sheet @param {HTMLElement} input @param {string[]} shapes */
function place(sheet, input, shapes) {
  const main = find(document, "main");
  main.toggleAttribute("data-lifted", false);
  const spot = spotOf(sheet, fieldsOf(input), shapes);
  sheet.dataset.side = spot.side;
  const { left, top, point } = spot;
  for (const [name, px] of Object.entries({ left, top, point }))
    sheet.style.setProperty(`--${name}`, `${Math.round(px)}px`);
  main.style.setProperty("--lift", `${Math.round(spot.lift)}px`);
  main.toggleAttribute("data-lifted", spot.lift !== 0);
  return spot.lift;
}

/** @param {HTMLElement} sheet @param {DOMRect[]} fields @param {string[]} shapes @returns {Spot} */
function spotOf(sheet, fields, shapes) {
  const page = area();
  for (const field of fields) {
    for (const shape of shapes) {
      const spot = shape === "tall" ? aside(sheet, field, page) : across(sheet, field, page, shape);
      if (spot) return spot;
    }
  }
  return lowest(sheet, fields[fields.length - 1], page);
}

// A screen that is too low for both: the end of the field is seen, and the sheet in its last shape.
/** @param {HTMLElement} sheet @param {DOMRect} field @param {Area} area @returns {Spot} */
function lowest(sheet, field, area) {
  const { height } = sheet.getBoundingClientRect();
  const top = Math.max(area.top, area.bottom - height);
  return {
    left: area.left,
    top,
    lift: top - GAP_PX - field.bottom,
    side: "top",
    point: (field.left + field.right) / 2 - area.left,
  };
}

// One at a time, and hold-to-run keys are locked.

// The styles of sheets come with the first one.
await new Promise((resolve, reject) => {
  const link = Object.assign(document.createElement("link"), { rel: "stylesheet", onload: resolve, onerror: reject });
  link.href = new URL("../keypad.css", import.meta.url).href;
  document.head.append(link);
});

// What lies below a sheet that moves or closes is not pressed by a second tap.
let settling = 0;
function settle() {
  clearTimeout(settling);
  document.body.dataset.settling = "";
  settling = setTimeout(() => delete document.body.dataset.settling, TAP_AGAIN_MS);
}

// What an input is called on the page.
/** @param {HTMLInputElement} input */
export function nameOf(input) {
  const named = input.labels?.[0] ?? document.getElementById(input.getAttribute("aria-labelledby") ?? "");
  return named?.textContent ?? "";
}

export class Sheet {
  /** @type {HTMLElement} */
  root;
  /** @type {HTMLElement} */
  #input;
  /** @type {string[]} */
  #shapes;
  /** @type {() => void} */
  #gone; // called when the input is not there any more
  #watch = new ResizeObserver(() => (this.#input.getClientRects().length ? this.#place() : this.#gone()));
  #placed = () => this.#place();

  // `shapes`: how it may look, the best one first.
  /** @param {string} id @param {string[]} shapes @param {HTMLElement} input @param {() => void} gone */
  constructor(id, shapes, input, gone) {
    this.root = copyOf(find(document, `template#${id}`));
    this.#input = input;
    this.#shapes = shapes;
    this.#gone = gone;
    // The input keeps the focus, and so its caret.
    this.root.addEventListener("mousedown", (event) => event.preventDefault());
  }

  /** @param {string} label */
  open(label) {
    this.root.setAttribute("aria-label", label);
    document.body.append(this.root);
    widgetOf(this.#input).dataset.entering = "";
    lockHolds(this.root.dataset.locks);
    if (this.#place()) settle();
    addEventListener("resize", this.#placed);
    this.#watch.observe(this.#input);
  }

  close() {
    settle();
    removeEventListener("resize", this.#placed);
    this.#watch.disconnect();
    this.root.remove();
    find(document, "main").toggleAttribute("data-lifted", false);
    delete widgetOf(this.#input).dataset.entering;
    unlockHolds();
  }

  #place() {
    return place(this.root, this.#input, this.#shapes);
  }
}
