// Sheets beside a button: where they stand, what may be touched meanwhile, and how one that asks opens and goes.
import { TAP_AGAIN_MS } from "./press.js";
import { closest, find } from "./show.js";
import { isKeyboardUsed } from "./touches.js";

// A sheet beside a button: where it stands, and what may be touched meanwhile. It never covers the frame.

const GAP_PX = 12;

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

// A sheet that asks before a press, beside its button: how it opens and goes. The frame around the page stays live
// behind it: a stop button is never covered, and never waits for an answer.

// Opens `dialog` for the widget `root`; `onReady` is called when the second tap of the press that opens it has passed,
// which is no answer. It goes without an answer after `notNowMs` since the last `stay`.
/** @param {HTMLElement} root @param {HTMLElement} dialog @param {number} notNowMs @param {() => void} onReady */
export function openAsking(root, dialog, notNowMs, onReady) {
  const answers = new AbortController();
  /** @template {keyof WindowEventMap} K @param {K} name @param {(event: WindowEventMap[K]) => void} listener @param {EventTarget} [target] */
  const on = (name, listener, target = dialog) =>
    target.addEventListener(name, listener, { signal: answers.signal, capture: target !== dialog });
  const close = () => dialog.matches(":popover-open") && dialog.hidePopover();
  const place = () => placeBeside(dialog, root.getBoundingClientRect());
  let isReady = false;
  let notNow = 0;
  const stay = () => {
    clearTimeout(notNow);
    notNow = setTimeout(close, notNowMs);
  };
  // A touch of anything else is "not now".
  on("pointerdown", ({ target }) => closest(target, ".ask") || !isReady || close(), window);
  on("keydown", (event) => event.key === "Escape" && close(), window);
  on("focusout", ({ relatedTarget: next }) => next && !closest(next, ".ask") && close());
  on("resize", place, window);
  const opening = setTimeout(() => {
    isReady = true;
    onReady();
  }, TAP_AGAIN_MS);
  stay();
  on("beforetoggle", ({ newState }) => {
    if (newState === "open") return;
    answers.abort();
    clearTimeout(opening);
    clearTimeout(notNow);
    root.toggleAttribute("data-asked", false);
    if (dialog.contains(document.activeElement) && isKeyboardUsed()) find(root, "button").focus();
    uncoverPage();
  });
  coverPage();
  root.toggleAttribute("data-asked", true);
  dialog.showPopover();
  place();
  return { on, close, place, stay };
}
