// A sheet that asks before a press, beside its button: how it opens and goes. The frame around the page stays live
// behind it: a stop button is never covered, and never waits for an answer.
import { coverPage, placeBeside, uncoverPage } from "./beside.js";
import { TAP_AGAIN_MS } from "./press.js";
import { closest, find } from "./show.js";

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
    if (dialog.contains(document.activeElement)) find(root, "button").focus();
    uncoverPage();
  });
  coverPage();
  root.toggleAttribute("data-asked", true);
  dialog.showPopover();
  place();
  return { on, close, place, stay };
}
