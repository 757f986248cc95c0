// The full text of a key in a popover: its face shows two lines. A touch on a locked key opens it, or one on the "…"
// that the face has where text is cut, which a keyboard reaches too. An open popover follows its key. A touch on the
// bar of control shows its text in full.
import { closest, copyOf, find, setText } from "./show.js";

const TEXTS = ".reasons, .why, .goal, .holding, .receipt, .result";
const popover = find(document, "#whole");
/** @type {HTMLElement | null} */
let shown = null; // the key whose text the popover shows

/** @param {HTMLElement} key */
function visibleTexts(key) {
  const locked = key.querySelector("button")?.disabled;
  const reasons = key.querySelector(".reasons")?.textContent;
  const shown = [...key.querySelectorAll(TEXTS)].filter((text) => {
    if (text.matches(".why")) return locked && !reasons;
    return !text.matches(".reasons") || locked;
  });
  return shown.map((text) => text.textContent.trim()).filter(Boolean);
}

function fillPopover() {
  const texts = shown ? visibleTexts(shown) : [];
  if (texts.length) setText(find(popover, "p"), texts.join("\n"));
  return texts.length > 0;
}

/** @param {HTMLElement} key */
function showFullText(key) {
  shown = key;
  setText(find(popover, "h2"), find(key, ".name").textContent);
  if (fillPopover()) popover.showPopover();
}

/** @param {HTMLElement} text */
function isCut(text) {
  return text.scrollHeight > text.clientHeight + 1;
}

/** @param {HTMLElement} key @param {boolean} cut */
function showCut(key, cut) {
  const isComplete = !cut && !key.querySelector('[data-text="more"]')?.textContent;
  find(key, ".more").toggleAttribute("hidden", isComplete);
  if (key === shown && popover.matches(":popover-open") && !fillPopover()) popover.hidePopover();
}

/** @type {Set<HTMLElement>} */
const changed = new Set(); // keys whose face or size is another since the last frame

/** @param {HTMLElement} key */
function mark(key) {
  if (!changed.size) requestAnimationFrame(markAll);
  changed.add(key);
}

// All are measured before the first is changed: the page is laid out once.
function markAll() {
  const keys = [...changed].map((key) => ({ key, cut: [...key.querySelectorAll(".face > p")].some(isCut) }));
  changed.clear();
  for (const { key, cut } of keys) showCut(key, cut);
}

/** @param {HTMLElement} key */
function equip(key) {
  const face = find(key, ".face");
  const button = find(key, "button");
  face.append(copyOf(find(document, "template#more")));
  const observer = new MutationObserver(() => mark(key));
  observer.observe(face, { childList: true, characterData: true, subtree: true });
  observer.observe(button, { attributeFilter: ["disabled"] });
  new ResizeObserver(() => mark(key)).observe(key);
  key.addEventListener("click", ({ target }) => {
    const locked = button.disabled && !closest(target, "button");
    if (locked || closest(target, ".more")) showFullText(key);
  });
}

for (const key of document.querySelectorAll(".key")) equip(key);

const control = document.querySelector("#control");
control?.querySelector("div")?.addEventListener("click", () => {
  shown = null;
  setText(find(popover, "h2"), control.getAttribute("aria-label") ?? "");
  const texts = [...control.querySelectorAll("p")].map((text) => text.textContent).filter(Boolean);
  setText(find(popover, "p"), texts.join("\n"));
  popover.showPopover();
});
