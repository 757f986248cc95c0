// A sheet beside a button: where it stands, and what may be touched meanwhile. It never covers the frame.
import { find } from "./show.js";

const GAP_PX = 12;
const TAP_AGAIN_MS = 700; // a second tap within this time is the same one

let uncovering = 0;

// Nothing of the page can be pressed but its stop buttons.
export function coverPage() {
  clearTimeout(uncovering);
  document.body.dataset.asks = "";
}

// The second tap on what has gone is no press of the button below.
export function uncoverPage() {
  coverPage();
  uncovering = setTimeout(() => delete document.body.dataset.asks, TAP_AGAIN_MS);
}

// Above the button, else below, right or left of it, within the page; where nothing has room, over a part of it.
/** @param {HTMLElement} sheet @param {DOMRect} button */
export function placeBeside(sheet, button) {
  const page = find(document, "main").getBoundingClientRect();
  const { width, height } = sheet.getBoundingClientRect();
  /** @param {number} start @param {number} size @param {number} from @param {number} to */
  const within = (start, size, from, to) => Math.max(from + GAP_PX, Math.min(start, to - GAP_PX - size));
  const isInFrame = button.right <= page.left || button.left >= page.right;
  let left = within((button.left + button.right - width) / 2, width, page.left, page.right);
  let top = button.top - GAP_PX - height;
  if (isInFrame || top < page.top) {
    const isRight = page.right - button.right >= width + 2 * GAP_PX;
    const isBelow = !isInFrame && page.bottom - button.bottom >= height + 2 * GAP_PX;
    if (isBelow) top = button.bottom + GAP_PX;
    else {
      left = isRight ? Math.max(button.right, page.left) + GAP_PX : button.left - GAP_PX - width;
      left = within(left, width, page.left, page.right);
      const hasRoom = left >= button.right || left + width <= button.left;
      const isUpper = button.top - page.top > page.bottom - button.bottom;
      const beside = (button.top + button.bottom - height) / 2;
      top = within(hasRoom ? beside : isUpper ? page.top : page.bottom, height, page.top, page.bottom);
    }
  }
  Object.assign(sheet.style, { left: `${left}px`, top: `${top}px` });
}
