// Texts of keys that are cut. A touch on a locked key opens a sheet with why it is locked and what to do, and so does the
// "…" of the key, which a keyboard reaches. A touch on the bar of control shows its text in full. The sheet's script comes
// when the page is at rest, or at the first touch: without a server a lock still says why.
import { sayOnce } from "./group-locks.js";
import { closest, copyOf, find } from "./show.js";

export const TEXTS = ".reasons, .why, .goal, .holding, .receipt, .result";
/** @type {typeof import("./whole-text.js") | null} */
let sheet = null; // when it was needed

const AT_REST_MS = 4000;
/** @type {(error: unknown) => void} */
const noop = () => {};
const load = () => import("./whole-text.js").then((script) => (sheet = script));
setTimeout(() => load().catch(noop), AT_REST_MS);

/** @param {HTMLElement} key */
export function isLocked(key) {
  return key.dataset.enabled ? key.dataset.enabled === "false" : key.querySelector("button")?.disabled === true;
}

/** @param {HTMLElement} text */
function isCut(text) {
  return text.scrollHeight > text.clientHeight + 1 || text.scrollWidth > text.clientWidth + 1;
}

// A locked key has it always: the button itself has no focus.
/** @param {HTMLElement} key @param {boolean} cut */
function showMore(key, cut) {
  const more = find(key, ".more");
  const isComplete = !cut && !isLocked(key) && !key.querySelector('[data-text="more"]')?.textContent;
  more.toggleAttribute("hidden", isComplete && document.activeElement !== more);
  more.toggleAttribute("data-clipped", cut);
  const focused = document.activeElement;
  if (isLocked(key) && focused?.matches("button:disabled") && key.contains(focused)) more.focus();
  sheet?.follow(key);
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
  const keys = [...changed].map((key) => ({
    key,
    cut: [...key.querySelectorAll(":is(.face, .told) > p")].some(isCut),
  }));
  changed.clear();
  for (const { key, cut } of keys) showMore(key, cut);
  const roots = keys.map(({ key }) => key);
  sayOnce(roots, isLocked);
}

// A key, or a step or a switch, whose two keys have one text.
/** @param {HTMLElement} key */
function equip(key) {
  const face = find(key, ".face, .reported, .told");
  const more = copyOf(find(document, "template#more"));
  more.setAttribute("aria-describedby", find(key, "button").getAttribute("aria-describedby") ?? "");
  more.addEventListener("blur", () => mark(key));
  face.append(more);
  const observer = new MutationObserver(() => mark(key));
  const texts = { childList: true, characterData: true, subtree: true };
  for (const text of face.querySelectorAll(TEXTS)) observer.observe(text, texts);
  for (const button of key.querySelectorAll("button")) observer.observe(button, { attributeFilter: ["disabled"] });
  new ResizeObserver(() => mark(key)).observe(key);
  key.addEventListener("click", (event) => {
    if (closest(event.target, ".more") || (isLocked(key) && !closest(event.target, "button")))
      load().then(({ open }) => open(key, event.detail === 0), noop);
  });
}

for (const key of document.querySelectorAll('.key, [data-kind="step"], [data-kind="switch"]')) equip(key);

const control = document.querySelector("#control");
control?.querySelector("div")?.addEventListener("click", () => {
  load().then(({ openControl }) => openControl(control), noop);
});
